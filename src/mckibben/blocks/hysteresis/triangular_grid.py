"""The triangular grid of Preisach-type models: increasing levels, and a weight for every cell."""

from __future__ import annotations

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.inverse import Invertible, check_input_range
from mckibben.errors import ModelError


class TriangularGrid(Invertible):
    """A block of L + 1 levels and L (L + 1) / 2 weights, its input between the first and last level."""

    increasing = ("levels",)

    levels: tuple[float, ...]
    weights: tuple[float, ...]

    def __post_init__(self) -> None:
        n = len(self.levels) - 1
        if n < 1 or np.any(np.diff(self.levels) <= 0):
            raise ModelError(
                f"the levels of {self.kind!r} do not increase. Remedy: give two or more, in order."
            )
        check_input_range(self.kind, self.input_range)
        if len(self.weights) != n * (n + 1) // 2:
            raise ModelError(
                f"{self.kind!r} with {n + 1} levels has {len(self.weights)} weights. "
                f"Remedy: give {n * (n + 1) // 2}."
            )

    @property
    def input_range(self) -> tuple[float, float]:
        """The first and last level."""
        return self.levels[0], self.levels[-1]

    @property
    def diagonal(self) -> Array:
        """Weights of the cells on the diagonal, shape (L,), which act where the input turns."""
        return np.array(self.weights)[np.cumsum(np.arange(1, len(self.levels))) - 1]

    def peaks(self) -> Array:
        """Return the levels."""
        return np.array(self.levels)
