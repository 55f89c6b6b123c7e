"""PID feedback, one loop a muscle, in a closed loop; the law is `mckibben.blocks.pid`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mckibben.blocks.base import Block
from mckibben.blocks.fields import Channel
from mckibben.blocks.pid import PIDFeedback
from mckibben.control.controller import Controller
from mckibben.errors import ModelError

Array = NDArray[np.float64]


@dataclass
class PID(Controller):
    """Independent loops.

    Parameters
    ----------
    kp : sequence of float
        Proportional gain of every muscle [bar/mm].
    ki : sequence of float
        Integral gain [bar/(mm s)].
    kd : sequence of float
        Derivative gain [bar s/mm].
    limits : (float, float)
        Of pressure [bar].
    filter_time : float
        Of the derivative [s].
    """

    kp: tuple[float, ...]
    ki: tuple[float, ...]
    kd: tuple[float, ...] = ()
    limits: tuple[float, float] = (0.0, 6.0)
    filter_time: float = 0.1

    def __post_init__(self) -> None:
        self.kd = self.kd or (0.0,) * len(self.kp)
        if not len(self.kp) == len(self.ki) == len(self.kd):
            raise ModelError("kp, ki and kd differ in length. Remedy: give one a muscle of each.")
        if not self.limits[0] < self.limits[1]:
            raise ModelError(f"limits are {self.limits}. Remedy: give lowest, then highest.")

    def reset(self, sample_time: float) -> None:
        """Empty the integral and the filter."""
        self._stream = self.block().stream(sample_time)

    def step(self, reference: Array, displacement: Array, scheduled: Array) -> Array:
        """Return pressures within the limits."""
        del scheduled
        return self._stream.step(np.concatenate([reference, displacement])).copy()

    def block(self, compensator: Block | None = None) -> PIDFeedback:
        """Return these loops as a block; channels are a compensator's, or by number."""
        n = len(self.kp)
        references, pressures = _channels(compensator, n)
        return self.feedback(references, pressures)

    def feedback(
        self,
        references: tuple[Channel, ...],
        pressures: tuple[Channel, ...],
        *,
        bases: tuple[Channel, ...] = (),
    ) -> PIDFeedback:
        """Return these loops as a block of given channels; with bases, behind a compensator."""
        measured = tuple(Channel(f"{c.name}_measured", c.unit) for c in references)
        return PIDFeedback(
            self.kp,
            self.ki,
            self.kd,
            self.limits,
            self.filter_time,
            references,
            (*measured, *bases),
            pressures,
            late=bool(bases),
        )


def _channels(compensator: Block | None, n: int) -> tuple[tuple[Channel, ...], tuple[Channel, ...]]:
    if compensator is not None:
        return compensator.inputs[:n], compensator.outputs
    numbers = range(1, n + 1)
    return (
        tuple(Channel(f"displacement_{k}", "mm") for k in numbers),
        tuple(Channel(f"pressure_{k}", "bar") for k in numbers),
    )
