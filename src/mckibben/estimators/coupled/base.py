"""Estimators of coupled muscles, or of a muscle and its load."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np

from mckibben import registry
from mckibben.arrays import Array, Mask
from mckibben.blocks.base import Block
from mckibben.blocks.fields import Channel
from mckibben.blocks.runs import Run
from mckibben.channels import PRESSURE, Channels
from mckibben.errors import DataError
from mckibben.estimators.core.data import TrainingData, training_data
from mckibben.estimators.core.estimator import Estimator, Purpose, resting
from mckibben.numerics.tracker import Tracker
from mckibben.recording import Recording, listed

MOVES = 0.1
"""Share of its range over all runs that an input must cover to move in a run."""

RESTS = 0.03
"""Share of that range above the lowest value below which an input is at rest."""

FEWEST_IN_A_ROW = 50
"""Smallest number of successive samples for several muscles."""


class CoupledEstimator(Estimator):
    """Settings common to all estimators of several inputs and outputs.

    Parameters
    ----------
    input, output : str or sequence of str, optional
        Channels; default as many as `mckibben.channels.channels_of` finds.
    scheduling : sequence of str, optional
        Channels that schedule the model: an extensor's pressure, a load, a temperature. Default those
        that are found.
    """

    purpose: ClassVar[Purpose | None] = "several"
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

    held_too: ClassVar[bool] = False
    """Whether the input may be held, and a pressure schedules then: all inputs are treated alike."""

    each_alone: ClassVar[bool] = False
    """Whether every muscle must move alone in some run."""

    fewest_inputs: ClassVar[int] = 1
    most_inputs: ClassVar[float] = np.inf
    """Maximum number of muscles."""

    @classmethod
    def objection(cls, recordings: Sequence[Recording], channels: Channels) -> str | None:
        inputs, outputs = channels.inputs, channels.outputs
        if len(inputs) < cls.fewest_inputs:
            return "it is of several muscles"
        if len(inputs) > cls.most_inputs:
            return "it is of one muscle under a load"
        scheduled = cls.taken(channels)
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
        return resting(recordings, (*inputs, *scheduled) if cls.held_too else inputs) or (
            _never_alone(recordings, inputs) if cls.each_alone else None
        )

    @classmethod
    def fits(cls, n_inputs: int, n_outputs: int) -> bool:
        """Return whether the numbers of inputs and outputs are allowed."""
        fewer = cls.fewer_outputs and n_outputs < n_inputs
        return fewer or not cls.paired or n_inputs == n_outputs

    @classmethod
    def channel_settings(cls, channels: Channels) -> dict[str, Any]:
        inputs, outputs = channels.inputs, channels.outputs
        return {"input": inputs, "output": outputs, "scheduling": cls.taken(channels)}

    def data(
        self, recordings: Recording | Sequence[Recording], rows: Sequence[Mask] | None = None
    ) -> TrainingData:
        """Return the training data, of the channels that are named or found."""
        every = listed(recordings)
        if not every:
            raise DataError("there are none", parameter="recordings", remedy="give at least one")
        first = every[0]
        channels = self.resolved(every, self.input, self.output, self.scheduling)
        inputs, outputs, scheduling = channels.inputs, channels.outputs, self.taken(channels)
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

    @classmethod
    def taken(cls, channels: Channels) -> tuple[str, ...]:
        """Return the channels that schedule the model."""
        # an offered pressure is for laws of force
        return tuple(name for name in channels.further if cls.held_too or name != PRESSURE)

    @property
    def pairs(self) -> bool:
        """Whether these settings need one output per input."""
        return self.paired

    @property
    def spans(self) -> tuple[float, ...] | None:
        """Ranges of the outputs, if known in advance."""
        return None


def bridged(data: TrainingData) -> TrainingData:
    """Return the runs up to their last scored output, or of a whole period, with others interpolated.

    These go straight with the inputs, as those that count do, and meet them on either side.
    """
    known = [run for run in data.runs if run.counts.any()]
    ends = [
        None if run.source.periodic else int(np.flatnonzero(run.counts)[-1]) + 1 for run in known
    ]
    runs = [run.cut(0, end) for run, end in zip(known, ends, strict=True)]
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


def memory_of(
    model: str,
    settings: dict[str, Any],
    runs: Sequence[Run],
    place: int,
    data: TrainingData,
    output: Channel,
) -> Block:
    """Return the hysteresis of one muscle by a model of one, from runs in which it is alone.

    It begins at rest, as the model of all does; ``output`` is what it is to be called.
    """
    given = data.inputs[place]
    units = {given.name: given.unit, output.name: output.unit}
    recordings = [
        Recording(
            {given.name: run.driven[:, place], output.name: run.outputs[:, place]},
            run.sample_time,
            units,
        )
        for run in runs
    ]
    channels = {"input": given.name, "output": output.name}
    made = registry.load("estimators", model)(**settings | channels)
    found: Block = made.find(made.data(recordings, [run.counts for run in runs]), Tracker())
    return found


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
