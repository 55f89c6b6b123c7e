"""A controller that is told the load by an estimate, where nothing measures it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.control.controller import Controller
from mckibben.errors import ModelError


@dataclass
class EstimatedLoad(Controller):
    """A controller whose scheduling input is estimated from pressure and displacement.

    Parameters
    ----------
    controller : Controller
        What is told the load, as its only scheduling input.
    estimate : Block
        From what is measured (by channel name) to the load.
    filter_time : float
        Of the estimate [s]; without it, estimate and controller excite one another.
    """

    controller: Controller
    estimate: Block
    filter_time: float = 0.3

    def __post_init__(self) -> None:
        if not self.filter_time > 0:
            raise ModelError(
                f"filter_time is {self.filter_time}. Remedy: give a positive time in seconds."
            )
        self._names = [channel.name for channel in self.estimate.inputs]

    @property
    def preview(self) -> float:
        """The controller's."""
        return self.controller.preview

    @property
    def n_clipped(self) -> int:
        """Those of the controller's compensator."""
        return self.controller.n_clipped

    def foresees(self, reference: Array, scheduled: Array) -> None:
        """Pass on the reference; the load to come is taken to be that of now."""
        del scheduled
        self.controller.foresees(reference, self._load)

    def reset(self, sample_time: float) -> None:
        self.controller.reset(sample_time)
        self._stream = self.estimate.stream(sample_time)
        self._share = 1.0 - np.exp(-sample_time / self.filter_time)
        self._load = np.zeros(1)

    def reads(self, readings: Mapping[str, float]) -> None:
        """Estimate the load from what was measured.

        Raises
        ------
        ModelError
            If something is not measured that the estimate needs.
        """
        self.controller.reads(readings)
        absent = [name for name in self._names if name not in readings]
        if absent:
            raise ModelError(
                f"the estimate of the load needs {absent[0]!r}, which the plant does not measure. "
                "Remedy: fit it to channels that are measured."
            )
        found = self._stream.step([readings[name] for name in self._names])
        self._load = self._load + self._share * (found - self._load)

    def step(self, reference: Array, displacement: Array, scheduled: Array) -> Array:
        del scheduled
        return self.controller.step(reference, displacement, self._load)

    def applied(self, pressures: Array) -> None:
        self.controller.applied(pressures)
