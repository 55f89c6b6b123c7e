"""What differential models of a loop share: a memory, the previous input, and z beside a polynomial."""

from __future__ import annotations

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.core.fields import Initial, StoredInitial
from mckibben.blocks.core.refusals import explicit_state
from mckibben.blocks.core.single_channel import check_input_range
from mckibben.blocks.core.solved_inverse import Solved
from mckibben.errors import ModelError


class Loop(Solved):
    """A block whose state is one memory and the previous input."""

    @property
    def n_states(self) -> int:
        """The memory, and the previous input."""
        return 2

    def peaks(self) -> Array:
        """Return peaks spread over the input range."""
        return np.linspace(*self.limits, 33)


class BoucWenLoop(Loop):
    """A loop of z beside a reversible polynomial of the input."""

    polynomial: tuple[float, ...]
    initial: StoredInitial

    def __post_init__(self) -> None:
        check_input_range(self.kind, self.input_range)
        if not self.polynomial:
            raise ModelError(
                f"{self.kind!r} has no polynomial. Remedy: give one coefficient or more."
            )

    def initial_state(self, first: Array, initial: Initial | None = None) -> Array:
        """Return [z, first input]."""
        start = self.initial if initial is None else initial
        if isinstance(start, str):
            return np.array([float(start == "first_sample"), first[0]])
        return explicit_state(self, start)
