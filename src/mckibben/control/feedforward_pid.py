"""A compensator with PID feedback on top."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mckibben.blocks.base import Block
from mckibben.blocks.feedforward_feedback import FeedforwardFeedback
from mckibben.blocks.fields import Channel
from mckibben.control.controller import Controller
from mckibben.control.pid import PID

Array = NDArray[np.float64]


@dataclass
class FeedforwardPID(Controller):
    """Pressures of a compensator, corrected by what is measured.

    The reference is where the muscles should be at the next step, the measurement is of now: feedback
    compares the measurement with the reference of one step before.

    Parameters
    ----------
    compensator : Block
        From displacements, and what schedules it, to pressures.
    pid : PID
        Feedback, and the limits of pressure.
    """

    compensator: Block
    pid: PID

    def reset(self, sample_time: float) -> None:
        """Start both afresh."""
        self._taken = len(self.compensator.scheduling)
        self._stream = self.block().stream(sample_time)

    def step(self, reference: Array, displacement: Array, scheduled: Array) -> Array:
        """Return the compensator's pressures with the correction."""
        given = np.concatenate([reference, displacement, scheduled[: self._taken]])
        return self._stream.step(given).copy()

    def block(self, compensator: Block | None = None) -> FeedforwardFeedback:
        """Return compensator and feedback as one block."""
        ahead = compensator or self.compensator
        n = len(ahead.inputs) - len(ahead.scheduling)
        bases = tuple(Channel(f"{c.name}_base", c.unit) for c in ahead.outputs)
        feedback = self.pid.feedback(ahead.inputs[:n], ahead.outputs, bases=bases)
        return FeedforwardFeedback(ahead, feedback)
