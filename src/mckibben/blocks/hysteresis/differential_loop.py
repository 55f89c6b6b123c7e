"""What differential models of a loop share: a memory, the previous input, and z beside a polynomial."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Start
from mckibben.blocks.fields import StoredInitial
from mckibben.blocks.inverse import Invertible, check_input_range
from mckibben.blocks.kernels import kernel
from mckibben.errors import ModelError


@kernel
def bouc_wen_start(coefficients: Array, state: Array, inputs: Array, virgin: bool) -> None:
    """Start with z = 1, as after a long rise, or z = 0."""
    state[0] = 0.0 if virgin else 1.0
    state[1] = inputs[0]


class Loop(Invertible):
    """A block whose state is one memory and the previous input."""

    solved: ClassVar[bool] = True
    inverse_remembers = "input"

    @property
    def n_states(self) -> int:
        """The memory, and the previous input."""
        return 2

    def peaks(self) -> Array:
        """Return peaks spread over the input range."""
        return np.linspace(*self.input_limits, 33)


class BoucWenLoop(Loop):
    """A loop of z beside a reversible polynomial of the input."""

    start_kernel: ClassVar[Start] = bouc_wen_start

    polynomial: tuple[float, ...]
    input_range: tuple[float, float] | None
    initial: StoredInitial

    def __post_init__(self) -> None:
        check_input_range(self.kind, self.input_range)
        if not self.polynomial:
            raise ModelError(
                f"{self.kind!r} has no polynomial. Remedy: give one coefficient or more."
            )
