"""Blocks without memory."""

from __future__ import annotations

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.core.block import Block
from mckibben.blocks.core.fields import Initial
from mckibben.blocks.core.refusals import explicit_state


class Stateless(Block):
    """A block whose outputs are functions of its inputs at the same sample."""

    @property
    def n_states(self) -> int:
        """None."""
        return 0

    def initial_state(self, first: Array, initial: Initial | None = None) -> Array:
        """Return an empty state."""
        if initial is not None and not isinstance(initial, str):
            return explicit_state(self, initial)
        return np.empty(0)
