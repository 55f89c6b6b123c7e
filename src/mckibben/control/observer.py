"""Disturbance observer: what the model does not explain is estimated, and the reference shifted by it.

The forward model runs on the applied pressures beside the plant; the low-passed difference between
measurement and model is an output disturbance (a load, a drift, an error of the model), and the
compensator is asked for the reference without it. With an exact inverse this is internal model control
(Morari and Zafiriou, "Robust Process Control"): no gain to tune but the filter's time.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.control.controller import Controller
from mckibben.errors import ModelError


@dataclass
class DisturbanceObserver(Controller):
    """A compensator and its model, side by side with the plant.

    Parameters
    ----------
    compensator : Block
        From displacements, and what schedules it, to pressures; its inverse is the model.
    filter_time : float
        Time constant of the estimate [s], positive: longer is more robust, shorter more accurate.
    """

    compensator: Block
    filter_time: float = 0.3

    def __post_init__(self) -> None:
        if not self.filter_time > 0:
            raise ModelError(
                f"filter_time is {self.filter_time}. Remedy: give a positive time in seconds."
            )
        self._model = self.compensator.inverse()

    @property
    def preview(self) -> float:
        """The dead time of the model."""
        return self._model.dead_time

    @property
    def forward_model(self) -> Block | None:
        """The model."""
        return self._model

    @property
    def n_clipped(self) -> int:
        """Those of the compensator."""
        return self.compensator.n_clipped(self._ahead.state)

    def reset(self, sample_time: float) -> None:
        self._coming: tuple[Array, Array] | None = None
        self._ahead = self.compensator.stream(sample_time)
        self._beside = self._model.stream(sample_time)
        self._share = 1.0 - np.exp(-sample_time / self.filter_time)
        self._disturbance: Array | None = None
        self._expected: Array | None = None
        self._n_ahead, self._n_beside = len(self.compensator.inputs), len(self._model.inputs)
        self._scheduled = np.empty(0)

    def foresees(self, reference: Array, scheduled: Array) -> None:
        self._coming = (reference, scheduled)

    def step(self, reference: Array, displacement: Array, scheduled: Array) -> Array:
        """Return the compensator's pressures for the reference without the disturbance."""
        if self._disturbance is None:
            self._disturbance = np.zeros_like(reference)
        if self._expected is not None:
            surprise = displacement - self._expected
            self._disturbance += self._share * (surprise - self._disturbance)
        self._scheduled = scheduled
        if self._coming is not None:
            reference, scheduled = self._coming
        wanted = np.concatenate([reference - self._disturbance, scheduled])
        return self._ahead.step(wanted[: self._n_ahead]).copy()

    def applied(self, pressures: Array) -> None:
        """Let the model take the step that the plant takes."""
        taken = np.concatenate([pressures, self._scheduled])[: self._n_beside]
        self._expected = self._beside.step(taken).copy()
