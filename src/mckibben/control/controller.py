"""Controllers: from references and measurements to pressures, sample by sample."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block, Stream
from mckibben.blocks.feedback import BASE, FeedforwardFeedback
from mckibben.blocks.fields import Channel
from mckibben.control.connecting import Offer
from mckibben.control.preview import preview_time
from mckibben.recording import MEASURED

Ahead = tuple[Array, Array]


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
        whole = self.block
        self._compensator, self._pid = whole, None
        if isinstance(whole, FeedforwardFeedback):
            # both parts may take references of different times
            self._compensator, self._pid = whole.compensator, whole.feedback
        self._inputs = offer.inputs(self._compensator)
        self._commands = offer.commands(whole)
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
        found = self.stream.step(
            self._inputs(np.concatenate((reference_ahead, schedule, measured)))
        )
        if self._feedback is not None:
            given = np.concatenate((reference, scheduled, measured, found))
            found = self._feedback.step(self._pid_inputs(given))
        return self._commands(found)
