"""Controllers: from references and measurements to pressures, sample by sample.

Commands act after the dead time of the air. With a planned motion, the compensator can be given the
reference that much ahead: offline, `previewed` shifts the reference; sample by sample, `Stream.step`
gets the reference of `preview_time` later; `mckibben.control.track` does so by default.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block, Stream
from mckibben.blocks.feedback import BASE, FeedforwardFeedback
from mckibben.blocks.fields import Channel
from mckibben.control.connecting import Offer
from mckibben.errors import require
from mckibben.recording import MEASURED, Recording, sample_time_of

MOST_PREVIEW = 1e4
"""Longest preview [s]."""


def preview_time(compensator: Block) -> float:
    """Return the dead time of the inverted model [s], which is the preview needed.

    With feedback, that of the compensator; 0 if the inverted model is unknown.

    Examples
    --------
    >>> from mckibben.blocks.dynamics.air import Air
    >>> preview_time(Air.example().inverse())
    0.02
    """
    model = compensator.forward_model
    return 0.0 if model is None else model.dead_time


def samples_ahead(preview: float, sample_time: float) -> int:
    """Return a preview in whole samples; raise an error if it is out of range."""
    require(0 <= preview <= MOST_PREVIEW, "preview", preview, f"0 to {MOST_PREVIEW:g} s")
    return round(preview / sample_time)


def previewed(reference: Recording, preview: float) -> Recording:
    """Return a reference shifted by the preview.

    Parameters
    ----------
    reference : Recording
        With time.
    preview : float
        How much later [s], not negative, in whole samples; see `preview_time`. The end is held.

    Raises
    ------
    DataError
        Where the reference has no time.
    ModelError
        Where the preview is out of range.
    """
    ahead = samples_ahead(preview, sample_time_of(reference, "be a reference"))
    n = len(reference)
    places = np.minimum(np.arange(n) + ahead, n - 1)
    return reference.with_channels(**{name: reference[name][places] for name in reference.channels})


Ahead = tuple[Array, Array]
"""Reference and schedule of a later step, for compensators with a dead time or a horizon."""


class Controller(ABC):
    """Computes the commands of n muscles in every control step."""

    preview: float = 0.0
    """Preview of the reference for the compensator, to make up for dead time [s]."""

    forward_model: Block | None = None
    """The model that the compensator inverts, if there is one."""

    stream: Stream | None = None
    """Its running compensator, if that is a block."""

    samples_ahead: int = 0
    """Further preview of the reference for prediction [samples]."""

    def connect(self, offer: Offer) -> None:
        """Connect to the signals of a loop, before `reset`; raise an error if they do not match."""
        del offer

    @abstractmethod
    def reset(self, sample_time: float) -> None:
        """Reset the state, for a given sample time [s]."""

    @abstractmethod
    def step(self, reference: Array, measured: Array, scheduled: Array, ahead: Ahead) -> Array:
        """Return the commands to apply until the next step [bar or V], shape (n,).

        Parameters
        ----------
        reference : array
            Reference of `Offer.followed` at the next step [mm, rad or N].
        measured : array
            Latest measurements, `Offer.measured`.
        scheduled : array
            Scheduling inputs, `Offer.scheduled`, such as an extensor's pressure or a load.
        ahead : (array, array)
            Reference and schedule, `preview` and `samples_ahead` later, for compensators.
        """

    def applied(self, pressures: Array) -> None:
        """Receive the commands applied after limits."""
        del pressures


@dataclass
class BlockController(Controller):
    """A block in a loop: compensator, feedback, or both, as saved and exported.

    Parameters
    ----------
    block : Block
        From references, measurements (inputs named ``..._measured``) and scheduling inputs to
        pressures. Other signals of the loop are ignored.
    """

    block: Block

    def __post_init__(self) -> None:
        self.preview, self.forward_model = preview_time(self.block), self.block.forward_model
        self.samples_ahead = self.block.samples_ahead

    def connect(self, offer: Offer) -> None:
        block = self.block
        self._compensator, self._pid = block, None
        if isinstance(block, FeedforwardFeedback):
            # both parts may take references of different times
            self._compensator, self._pid = block.compensator, block.feedback
        self._inputs = offer.inputs(self._compensator)
        self._commands = offer.commands(block)
        if self._pid is not None:
            bases = tuple(Channel(f"{c.name}{BASE}", c.unit) for c in self._compensator.outputs)
            self._pid_inputs = offer.inputs(self._pid, bases)

    def reset(self, sample_time: float) -> None:
        self.stream = self._compensator.stream(sample_time)
        self._feedback = None if self._pid is None else self._pid.stream(sample_time)
        measures = any(channel.name.endswith(MEASURED) for channel in self._compensator.inputs)
        # measurements belong to the reference of the last step, or a dead time before it; predictive
        # compensators take the current scheduling inputs
        self._uses_preview = self.preview > 0.0 or not measures
        self._predicts = self.samples_ahead > 0

    def step(self, reference: Array, measured: Array, scheduled: Array, ahead: Ahead) -> Array:
        reference_ahead, schedule = ahead if self._uses_preview else (reference, scheduled)
        schedule = scheduled if self._predicts else schedule
        assert self.stream is not None
        outputs = self.stream.step(
            self._inputs(np.concatenate((reference_ahead, schedule, measured)))
        )
        if self._feedback is not None:
            signals = np.concatenate((reference, scheduled, measured, outputs))
            outputs = self._feedback.step(self._pid_inputs(signals))
        return self._commands(outputs)


@dataclass
class DisturbanceObserver(Controller):
    """A compensator and its model in parallel with the plant, which correct the reference.

    The forward model runs on the applied pressures; the low-passed difference between measurement and
    model is an output disturbance (a load, a drift, an error of the model), and the compensator is asked
    for the reference without it. With an exact inverse this is internal model control (Morari and
    Zafiriou, "Robust Process Control"): no gain to tune but the filter's time.

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
        signals = (*offer.driven, *offer.scheduled)
        self._measured = offer.selected(references, offer.measured, block.title, offer.plant)
        self._taken = offer.selected(model.inputs, signals, model.title, f"a loop on {offer.plant}")
        self._modelled = offer.selected(references, model.outputs, block.title, model.title)

    def reset(self, sample_time: float) -> None:
        self.stream = self.compensator.stream(sample_time)
        self._model_stream = self._model.stream(sample_time)
        self._filter_gain = 1.0 - np.exp(-sample_time / self.filter_time)
        self._disturbance = np.zeros(self.compensator.n_driven)
        self._expected: Array | None = None
        self._scheduled = np.empty(0)

    def step(self, reference: Array, measured: Array, scheduled: Array, ahead: Ahead) -> Array:
        """Return the compensator's commands for the reference without the disturbance."""
        if self._expected is not None:
            residual = self._measured(measured) - self._expected
            self._disturbance += self._filter_gain * (residual - self._disturbance)
        self._scheduled = scheduled
        inputs = self._inputs(np.concatenate((*ahead, measured)))
        inputs[: self._disturbance.size] -= self._disturbance
        assert self.stream is not None
        return self._commands(self.stream.step(inputs))

    def applied(self, pressures: Array) -> None:
        """Advance the model by the applied commands."""
        inputs = self._taken(np.concatenate((pressures, self._scheduled)))
        self._expected = self._modelled(self._model_stream.step(inputs))


@dataclass
class EstimatedLoad(Controller):
    """A controller whose scheduling input is estimated, for plants without a load sensor.

    Parameters
    ----------
    controller : Controller
        Controller scheduled by the load.
    estimate : Block
        From measurements, pressure and displacement, to the load.
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
        self._filter_gain = 1.0 - np.exp(-sample_time / self.filter_time)
        self._load = np.zeros(len(self.estimate.outputs))

    def step(self, reference: Array, measured: Array, scheduled: Array, ahead: Ahead) -> Array:
        """Return the controller's commands, with the current load estimate for the next step."""
        outputs = self._estimate.step(self._inputs(measured))
        self._load = self._load + self._filter_gain * (outputs - self._load)
        now, later = (np.concatenate((self._load, further)) for further in (scheduled, ahead[1]))
        return self.controller.step(reference, measured, now, (ahead[0], later))

    def applied(self, pressures: Array) -> None:
        self.controller.applied(pressures)
