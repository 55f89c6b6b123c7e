"""Open loop: a compensator's pressures, whatever is measured."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mckibben.blocks.base import Block
from mckibben.control.controller import Controller

Array = NDArray[np.float64]


@dataclass
class Feedforward(Controller):
    """A compensator by itself.

    Parameters
    ----------
    compensator : Block
        From displacements, and what schedules it, to pressures.
    """

    compensator: Block

    def reset(self, sample_time: float) -> None:
        """Start the compensator afresh."""
        self._stream = self.compensator.stream(sample_time)
        self._taken = len(self.compensator.inputs)

    def step(self, reference: Array, displacement: Array, scheduled: Array) -> Array:
        """Return the compensator's pressures for the reference."""
        del displacement
        return self._stream.step(np.concatenate([reference, scheduled])[: self._taken]).copy()

    def block(self, compensator: Block | None = None) -> Block:
        """Return the compensator."""
        del compensator
        return self.compensator
