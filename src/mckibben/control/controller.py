"""What a controller is: references and measurements in, pressures out, sample by sample."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.feedback import MEASURED, FeedforwardFeedback
from mckibben.blocks.running import Stream
from mckibben.control.preview import dead_time_undone


class Controller(ABC):
    """Asked once a control step for the pressures of n muscles."""

    @abstractmethod
    def reset(self, sample_time: float) -> None:
        """Forget the past, and get ready for steps of so many seconds."""

    @abstractmethod
    def step(self, reference: Array, displacement: Array, scheduled: Array) -> Array:
        """Return the pressures to apply until the next step [bar], shape (n,).

        Parameters
        ----------
        reference : array, shape (n,)
            Where the muscles should be at the next step [mm].
        displacement : array, shape (n,)
            Where they were just measured to be [mm].
        scheduled : array, shape (s,)
            What schedules the model: an extensor's pressure, a load.
        """

    @property
    def preview(self) -> float:
        """How far ahead its compensator wants the reference, to make up for dead time [s]."""
        return 0.0

    @property
    def forward_model(self) -> Block | None:
        """The model that its compensator undoes, if it has one."""
        return None

    @property
    def samples_ahead(self) -> int:
        """How many samples further ahead it wants the reference, to plan with."""
        return 0

    @property
    def n_clipped(self) -> int:
        """How many samples its compensator has clipped by itself since the start."""
        return 0

    def foresees(self, reference: Array, scheduled: Array) -> None:
        """Learn reference and schedule as they will be then, before `step`, where they are known.

        The compensator goes by these, feedback by those of `step`.
        """
        del reference, scheduled

    def reads(self, readings: Mapping[str, float]) -> None:
        """Learn all that was just measured, by channel, before `step`."""
        del readings

    def applied(self, pressures: Array) -> None:
        """Learn what was applied in the end, after limits."""
        del pressures


@dataclass
class BlockController(Controller):
    """A block in a loop: a compensator alone, feedback, or both, as it is saved and exported.

    Parameters
    ----------
    block : Block
        From references, what is measured of them (inputs named ``..._measured``) if it asks for that,
        and what schedules it, to pressures. What it does not ask for is passed over.
    """

    block: Block

    @property
    def preview(self) -> float:
        """The dead time of what the block undoes."""
        return dead_time_undone(self.block)

    @property
    def forward_model(self) -> Block | None:
        """What the block undoes."""
        return self.block.forward_model

    @property
    def samples_ahead(self) -> int:
        """Those of the horizon of a compensator that looks ahead."""
        return self.block.samples_ahead

    @property
    def n_clipped(self) -> int:
        """Those of the compensator."""
        return self._stream.block.n_clipped(self._stream.state)

    def reset(self, sample_time: float) -> None:
        whole = self.block
        self._ahead: Array | None = None
        self._feedback: Stream | None = None
        if isinstance(whole, FeedforwardFeedback):  # which may be given references of two times
            self._feedback = whole.feedback.stream(sample_time)
            whole = whole.compensator
        self._stream = whole.stream(sample_time)
        felt = [channel.name.endswith(MEASURED) for channel in whole.inputs]
        self._sample, self._feels = np.empty(len(felt)), np.array(felt)

    def foresees(self, reference: Array, scheduled: Array) -> None:
        self._ahead = np.concatenate([reference, scheduled])

    def step(self, reference: Array, displacement: Array, scheduled: Array) -> Array:
        given = np.concatenate([reference, scheduled])
        if self._ahead is not None and (self.preview > 0.0 or not self._feels.any()):
            # what is measured answers the reference of the last step, or before by a dead time that the
            # block knows; a plan takes what schedules as it is now
            known = len(reference) if self.samples_ahead else len(given)
            given[:known] = self._ahead[:known]
        if self._feels.any():
            self._sample[self._feels] = displacement
        self._sample[~self._feels] = given[: np.count_nonzero(~self._feels)]
        found = self._stream.step(self._sample)
        if self._feedback is not None:
            found = self._feedback.step(np.concatenate([reference, displacement, found]))
        return found.copy()
