"""Estimators of coupled muscles, or of a muscle and its load."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from mckibben.arrays import Array, Mask
from mckibben.blocks.base import Block
from mckibben.channels import loads_among, numbered, one, schedules
from mckibben.errors import DataError
from mckibben.estimators.core.data import Run, TrainingData, training_data
from mckibben.estimators.core.estimator import Estimator, resting
from mckibben.estimators.optimisers.tracker import Tracker
from mckibben.recording import Recording, listed

MOVES = 0.1
"""Share of its range over all runs that an input must cover to move in a run."""

RESTS = 0.03
"""Share of that range above the lowest value below which an input is at rest."""

FEWEST_IN_A_ROW = 50
"""Smallest number of successive samples for several muscles."""


@dataclass(kw_only=True, repr=False, eq=False)
class CoupledEstimator(Estimator):
    """Settings common to all estimators of several inputs and outputs.

    Parameters
    ----------
    input, output : str or sequence of str, optional
        Channels; default ``pressure_1`` and so on and ``displacement_1`` and so on, as many as there
        are; or, of a single muscle, ``voltage`` or else ``pressure``, and ``displacement``.
    scheduling : sequence of str, optional
        Channels that schedule the model: an extensor's pressure, a load, a temperature. Default
        ``pressure_extensor`` and ``force``, where there are any.
    """

    purpose = "several"
    errors_known: ClassVar[bool] = False

    input: str | tuple[str, ...] | None = None
    output: str | tuple[str, ...] | None = None
    scheduling: tuple[str, ...] | None = None

    paired: ClassVar[bool] = True
    """Whether every input must have an output."""

    fewer_outputs: ClassVar[bool] = False
    """Whether there may still be fewer outputs than inputs."""

    alone: ClassVar[bool] = False
    """Whether it also models one muscle without a measured load."""

    unmeasured: ClassVar[bool] = False
    """Whether recordings may lack a scheduling channel that others have."""

    through: ClassVar[bool] = False
    """Whether ignored samples are simulated too, so that the memory after them is right; otherwise
    each segment starts with its own memory.
    """

    each_alone: ClassVar[bool] = False
    """Whether every muscle must move alone in some run."""

    fewest_inputs: ClassVar[int] = 1
    most_inputs: ClassVar[float] = np.inf
    """Maximum number of muscles."""

    @classmethod
    def objection(
        cls,
        recordings: Sequence[Recording],
        inputs: Sequence[str],
        outputs: Sequence[str],
        scheduling: Sequence[str] | None = None,
    ) -> str | None:
        if len(inputs) < cls.fewest_inputs:
            return "it is of several muscles"
        if len(inputs) > cls.most_inputs:
            return "it is of one muscle under a load"
        scheduled = scheduling
        if scheduled is None:
            scheduled = schedules(recordings, (*inputs, *outputs))
        for name in scheduled:
            lacking = [recording.name for recording in recordings if name not in recording]
            if lacking and not cls.unmeasured:
                return f"it takes {name} as an input, which {lacking[0]} lacks: add it, or leave it out"
        if (
            not cls.alone
            and len(inputs) == len(outputs) == 1
            and not any(
                np.ptp(np.concatenate([recording[name] for recording in recordings]))
                for name in scheduled
            )
        ):
            return "it is of several muscles, or of one under a measured load that changes"
        if not cls.fits(len(inputs), len(outputs)):
            return "it needs an output to every input"
        return resting(recordings, inputs) or (
            _never_alone(recordings, inputs) if cls.each_alone else None
        )

    @classmethod
    def fits(cls, n_inputs: int, n_outputs: int) -> bool:
        """Return whether the numbers of inputs and outputs are allowed."""
        fewer = cls.fewer_outputs and n_outputs < n_inputs
        return fewer or not cls.paired or n_inputs == n_outputs

    @classmethod
    def channel_settings(
        cls,
        inputs: Sequence[str],
        outputs: Sequence[str],
        scheduling: Sequence[str] | None = None,
    ) -> dict[str, Any]:
        named = None if scheduling is None else tuple(scheduling)
        return {"input": tuple(inputs), "output": tuple(outputs), "scheduling": named}

    def data(
        self, recordings: Recording | Sequence[Recording], rows: Sequence[Mask] | None = None
    ) -> TrainingData:
        """Return the training data, with channels found by name if not given."""
        every = listed(recordings)
        if not every:
            raise DataError("there are no recordings", remedy="give at least one")
        first = every[0]
        inputs, outputs = (
            (given,) if isinstance(given, str) else given for given in (self.input, self.output)
        )
        inputs = inputs or in_any(every, driving)
        outputs = outputs or in_any(every, moved)
        for what, names in (("pressure", inputs), ("displacement", outputs)):
            if not names:
                raise DataError(
                    f"there is no channel {what}_1, nor {what}",
                    file=first.source,
                    remedy=f"name the columns {what}_1, {what}_2 ..., or use `columns[CHANNEL]=COLUMN`",
                )
        loads = loads_among(every, inputs)
        inputs = tuple(name for name in inputs if name not in loads)
        scheduling = self.scheduling
        if scheduling is None:
            scheduling = schedules(every, (*inputs, *outputs))
        scheduling = tuple(dict.fromkeys((*scheduling, *loads)))
        for recording in every:
            for name in (*inputs, *outputs, *scheduling):
                if name not in recording:
                    raise DataError(
                        "the model needs it, and the recording has no such channel",
                        file=recording.source,
                        channel=name,
                        remedy="give all recordings the same channels, or name others",
                    )
        longest = max(map(len, every))
        if longest < FEWEST_IN_A_ROW:  # shorter ones beside a longer one are passed over below
            raise DataError(
                f"{longest} samples are too few for this model",
                file=first.source,
                remedy=f"give recordings of at least {FEWEST_IN_A_ROW} samples",
            )
        if self.pairs and not self.fits(len(inputs), len(outputs)):
            raise DataError(
                f"there are {len(inputs)} inputs and {len(outputs)} outputs",
                file=first.source,
                remedy="record as many of both, or fit coupled-memory or tsfnn",
            )
        found = training_data(
            every, inputs, outputs, rows, scheduling, one_rate=False, spans=self.spans
        )
        kept = bridged(found) if self.through else found.stretches(FEWEST_IN_A_ROW - 1)
        if sum(int(run.counts.sum()) for run in kept.runs) < FEWEST_IN_A_ROW:
            raise DataError(
                f"no {FEWEST_IN_A_ROW} samples in a row count", remedy="give longer recordings"
            )
        return kept

    @property
    def pairs(self) -> bool:
        """Whether these settings need one output per input."""
        return self.paired

    @property
    def spans(self) -> tuple[float, ...] | None:
        """Ranges of the outputs, if known in advance."""
        return None

    def find(self, data: TrainingData, tracker: Tracker) -> tuple[Block, TrainingData]:
        """Return the identified block, and the data without unused channels."""
        block = self.identify(data, tracker)
        return block, of_channels(data, block.scheduling)

    @abstractmethod
    def identify(self, data: TrainingData, tracker: Tracker) -> Block:
        """Return the identified block."""


def of_channels(data: TrainingData, names: Sequence[str]) -> TrainingData:
    """Return data with some of the scheduling channels, in that order."""
    known = [channel.name for channel in data.scheduled]
    places = [known.index(name) for name in names]
    runs = tuple(replace(run, scheduled=run.scheduled[:, places]) for run in data.runs)
    return replace(data, runs=runs, scheduled=tuple(data.scheduled[place] for place in places))


def bridged(data: TrainingData) -> TrainingData:
    """Return the runs up to their last scored output, with unscored outputs interpolated.

    These go straight with the inputs, as those that count do, and meet them on either side.
    """
    known = [run for run in data.runs if run.counts.any()]
    runs = [run.cut(0, int(np.flatnonzero(run.counts)[-1]) + 1) for run in known]
    columns = [np.column_stack([run.driven, run.scheduled, np.ones(len(run.u))]) for run in runs]
    counting = [columns[i][run.counts] for i, run in enumerate(runs)]
    targets = np.concatenate([run.outputs[run.counts] for run in runs])
    by = np.linalg.lstsq(np.concatenate(counting), targets, rcond=None)[0]
    found = []
    for place, (run, given) in enumerate(zip(runs, columns, strict=True)):
        time, at = np.arange(len(run.u)), np.flatnonzero(run.counts)
        left = (run.outputs - given @ by)[at]
        meeting = np.column_stack([np.interp(time, at, column) for column in left.T])
        outputs = np.where(run.counts[:, np.newaxis], run.outputs, given @ by + meeting)
        found.append(replace(run, outputs=outputs, place=place))
    return replace(data, runs=tuple(found))


def alone(data: TrainingData, place: int) -> list[Run]:
    """Return the runs in which one input moves and all others rest."""
    ends = data.lowest, data.highest
    return [run for run in data.runs if moves_alone(run.driven, place, *ends)]


def moves_alone(driven: Array, place: int, lowest: Array, highest: Array) -> bool:
    """Return whether one input moves and all others rest.

    Parameters
    ----------
    driven : array, shape (n, m)
        Of a run.
    place : int
    lowest, highest : arrays, shape (m,)
        Of all runs.
    """
    span, above = highest - lowest, driven.max(axis=0) - lowest
    others = np.delete(above <= RESTS * span, place)
    return bool(np.ptp(driven[:, place]) > MOVES * span[place] and others.all())


def _never_alone(recordings: Sequence[Recording], inputs: Sequence[str]) -> str | None:
    """Return a muscle that never moves alone, or None."""
    driven = [recording.matrix(inputs) for recording in recordings]
    lowest = np.min([run.min(axis=0) for run in driven], axis=0)
    highest = np.max([run.max(axis=0) for run in driven], axis=0)
    for place, name in enumerate(inputs):
        if not any(moves_alone(run, place, lowest, highest) for run in driven):
            return (
                f"{name} moves alone in no run, so hysteresis and coupling cannot be distinguished: add "
                "a run in which the other inputs rest"
            )
    return None


def driving(recording: Recording) -> tuple[str, ...]:
    """Return the driving channels of a recording, by name, pressure first."""
    several = numbered(recording, "pressure") or numbered(recording, "voltage")
    return several or one(recording, "pressure", "voltage")


def moved(recording: Recording) -> tuple[str, ...]:
    """Return the displacements of a recording, or its angles, by their names."""
    several = numbered(recording, "displacement") or numbered(recording, "angle")
    return several or one(recording, "displacement", "angle")


def in_any(
    recordings: Sequence[Recording], named: Callable[[Recording], tuple[str, ...]]
) -> tuple[str, ...]:
    """Return the channels of so many muscles that any recording has."""
    return max((named(recording) for recording in recordings), key=len)
