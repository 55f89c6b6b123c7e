"""Estimators of one input and one output."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np

from mckibben.blocks.base import Block
from mckibben.blocks.compose import Series
from mckibben.blocks.fields import Channel
from mckibben.blocks.memoryless.negative import Negative
from mckibben.estimators.core.checking import training_data
from mckibben.estimators.core.data import Mask, TrainingData
from mckibben.estimators.core.estimator import Estimator, resting
from mckibben.estimators.optimisers.tracker import Tracker
from mckibben.recording import Recording, listed

MADE_OF_DISPLACEMENT = {
    "length": ", and a length is the rest length less the displacement: read that column as length, "
    "with gain -1 and the rest length as offset",
    "contraction": ", and a contraction is the displacement over the rest length: read that column as "
    "contraction, with a gain of 1 over the rest length",
}
"""What of a recording's displacement is asked for."""


@dataclass(kw_only=True, repr=False, eq=False)
class SingleEstimator(Estimator):
    """Settings common to all estimators of one input and one output.

    Parameters
    ----------
    input, output : str
        Channels to learn from.
    initial : {"first_sample", "virgin", "fitted"}
        Memory before the first sample of every recording: as if the input had only risen; as if
        nothing had ever happened; or fitted with the rest, of which a model with hysteresis has one
        number a recording, the input from which it came down, and a linear one its whole state.
    """

    input: str = "pressure"
    output: str = "displacement"
    initial: Literal["first_sample", "virgin", "fitted"] = "first_sample"

    made_for: ClassVar[tuple[str, str] | None] = None
    """Kinds of channel, input and output, that the model is about; None for any."""

    rises: ClassVar[bool] = True
    """Whether the block's output rises with its input, so that falling data are turned over."""

    told: ClassVar[tuple[str, ...]] = ()
    """Settings that name channels which the model is given beside the input; of the block, too."""

    @property
    def scheduling(self) -> tuple[str, ...]:
        """Channels that the model is given beside the input."""
        return tuple(getattr(self, name) for name in self.told)

    @classmethod
    def objection(
        cls,
        recordings: Sequence[Recording],
        inputs: Sequence[str],
        outputs: Sequence[str],
        scheduling: Sequence[str] | None = None,
    ) -> str | None:
        if len(inputs) != 1 or len(outputs) != 1:
            return "it is of one input and one output"
        if scheduling is not None:
            return "it is not told the load"
        (given,), (wanted,) = inputs, outputs
        kinds = (given.partition("_")[0], wanted.partition("_")[0])
        if cls.made_for is not None and kinds != cls.made_for:
            nearly = kinds == ("displacement", cls.made_for[1])
            made = MADE_OF_DISPLACEMENT.get(cls.made_for[0], "") if nearly else ""
            return f"it maps {cls.made_for[0]} to {cls.made_for[1]}{made}"
        needed = cls(input=given, output=wanted).scheduling
        absent = [name for name in needed if any(name not in r for r in recordings)]
        if absent:
            return f"it needs the channel {absent[0]!r} too"
        return None if cls.told else resting(recordings, inputs)

    @classmethod
    def channel_settings(
        cls,
        inputs: Sequence[str],
        outputs: Sequence[str],
        scheduling: Sequence[str] | None = None,
    ) -> dict[str, Any]:
        return {"input": inputs[0], "output": outputs[0]}

    def data(
        self, recordings: Recording | Sequence[Recording], rows: Sequence[Mask] | None = None
    ) -> TrainingData:
        # models of several muscles begin anew after rows left out, and so are fitted to bridges too
        measured = [~one.bridged for one in listed(recordings)]
        counted = measured if rows is None else map(np.logical_and, rows, measured)
        return training_data(recordings, self.input, self.output, list(counted), self.scheduling)

    def find(self, data: TrainingData, tracker: Tracker) -> tuple[Block, TrainingData]:
        """Return the block found on data that rise, turned over where they fall."""
        if not (self.rises and data.falls):
            return self.identify(data, tracker)
        rising, used = self.identify(data.negated(), tracker)
        channel = self.channels(data)["output"]
        block = Series((rising, Negative(channel, channel)))
        return block, data.with_peaks([run.peak for run in used.runs])

    @abstractmethod
    def identify(self, data: TrainingData, tracker: Tracker) -> tuple[Block, TrainingData]:
        """Return the block found, and the data with the memories at the start that belong to it.

        The output of the data rises with the input; `fit` changes its sign where it does not.
        """

    def channels(self, data: TrainingData) -> dict[str, Channel]:
        """Return the channels of the block to build, as keyword arguments."""
        beside = zip(self.told, data.scheduled, strict=True)
        return {"input": data.inputs[0], "output": data.outputs[0], **dict(beside)}

    @property
    def starting_rule(self) -> Literal["first_sample", "virgin"]:
        """The named rule behind `initial`."""
        return "virgin" if self.initial == "virgin" else "first_sample"
