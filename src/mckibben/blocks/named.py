"""Blocks whose parameters are some of their fields, in order."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mckibben.blocks.base import Block
from mckibben.blocks.refusals import parameter_vector

Array = NDArray[np.float64]


class NamedParameters(Block):
    """A block whose parameter vector is made of fields: numbers, and vectors of fixed length."""

    parameters: ClassVar[tuple[str, ...]]
    """Names of the fields, in the order of the vector."""

    @property
    def n_parameters(self) -> int:
        """All numbers in the fields that are parameters."""
        return sum(np.size(getattr(self, name)) for name in self.parameters)

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the fields, those of vectors numbered."""
        names: list[str] = []
        for name in self.parameters:
            value, said = getattr(self, name), name.replace("_", " ")
            names += [f"{said} {k + 1}" for k in range(len(value))] if np.ndim(value) else [said]
        return tuple(names)

    def pack(self) -> Array:
        """Return the fields one after another."""
        return np.concatenate([np.atleast_1d(getattr(self, name)) for name in self.parameters])

    def unpack(self, parameters: ArrayLike) -> Self:
        """Return a block of the same structure with other parameters."""
        values = parameter_vector(self, parameters).tolist()
        fields: dict[str, float | tuple[float, ...]] = {}
        for name in self.parameters:
            own = getattr(self, name)
            if isinstance(own, tuple):
                fields[name], values = tuple(values[: len(own)]), values[len(own) :]
            else:
                fields[name], values = values[0], values[1:]
        return replace(self, **fields)  # type: ignore[type-var]
