"""A controller with an estimated load, for plants without a load sensor."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.control.connecting import Offer
from mckibben.control.controller import Ahead, Controller
from mckibben.errors import require


@dataclass
class EstimatedLoad(Controller):
    """A controller whose scheduling input is estimated from pressure and displacement.

    Parameters
    ----------
    controller : Controller
        Controller scheduled by the load.
    estimate : Block
        From measurements to the load.
    filter_time : float
        Time constant of the estimate [s], which avoids oscillation of the loop.
    """

    controller: Controller
    estimate: Block
    filter_time: float = 0.3

    def __post_init__(self) -> None:
        require(self.filter_time > 0, "filter_time", self.filter_time, "a positive time [s]")
        inner = self.controller
        self.preview, self.forward_model = inner.preview, inner.forward_model
        self.samples_ahead = inner.samples_ahead

    def connect(self, offer: Offer) -> None:
        title, loads = self.estimate.title, self.estimate.outputs
        self._inputs = offer.selected(self.estimate.inputs, offer.measured, title, offer.plant)
        self.controller.connect(replace(offer, scheduled=(*loads, *offer.scheduled)))

    def reset(self, sample_time: float) -> None:
        self.controller.reset(sample_time)
        self.stream = self.controller.stream
        self._estimate = self.estimate.stream(sample_time)
        self._share = 1.0 - np.exp(-sample_time / self.filter_time)
        self._load = np.zeros(len(self.estimate.outputs))

    def step(self, reference: Array, measured: Array, scheduled: Array, ahead: Ahead) -> Array:
        """Return the controller's commands, with the current load estimate for the next step."""
        found = self._estimate.step(self._inputs(measured))
        self._load = self._load + self._share * (found - self._load)
        now, then = (np.concatenate((self._load, others)) for others in (scheduled, ahead[1]))
        return self.controller.step(reference, measured, now, (ahead[0], then))

    def applied(self, pressures: Array) -> None:
        self.controller.applied(pressures)
