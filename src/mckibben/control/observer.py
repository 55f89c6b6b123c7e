"""Disturbance observer: estimates the model error, and corrects the reference by it.

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
from mckibben.control.connecting import Offer
from mckibben.control.controller import Ahead, Controller
from mckibben.errors import require


@dataclass
class DisturbanceObserver(Controller):
    """A compensator and its model in parallel with the plant.

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
        require(self.filter_time > 0, "filter_time", self.filter_time, "a positive time [s]")
        self._model = self.compensator.inverse()
        self.forward_model = self._model
        self.preview = self._model.dead_time

    def connect(self, offer: Offer) -> None:
        block, model = self.compensator, self._model
        references = block.inputs[: block.n_driven]
        self._inputs, self._commands = offer.inputs(block), offer.commands(block)
        given = (*offer.driven, *offer.scheduled)
        self._measured = offer.selected(references, offer.measured, block.title, offer.plant)
        self._taken = offer.selected(model.inputs, given, model.title, f"a loop on {offer.plant}")
        self._modelled = offer.selected(references, model.outputs, block.title, model.title)

    def reset(self, sample_time: float) -> None:
        self.stream = self.compensator.stream(sample_time)
        self._model_stream = self._model.stream(sample_time)
        self._share = 1.0 - np.exp(-sample_time / self.filter_time)
        self._disturbance = np.zeros(self.compensator.n_driven)
        self._expected: Array | None = None
        self._scheduled = np.empty(0)

    def step(self, reference: Array, measured: Array, scheduled: Array, ahead: Ahead) -> Array:
        """Return the compensator's commands for the reference without the disturbance."""
        if self._expected is not None:
            residual = self._measured(measured) - self._expected
            self._disturbance += self._share * (residual - self._disturbance)
        self._scheduled = scheduled
        wanted = self._inputs(np.concatenate((*ahead, measured)))
        wanted[: self._disturbance.size] -= self._disturbance
        assert self.stream is not None
        return self._commands(self.stream.step(wanted))

    def applied(self, pressures: Array) -> None:
        """Advance the model by the applied commands."""
        taken = self._taken(np.concatenate((pressures, self._scheduled)))
        self._expected = self._modelled(self._model_stream.step(taken))
