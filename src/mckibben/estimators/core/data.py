"""Training data: inputs, outputs, scheduling inputs and sample masks of recordings."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, TypeVar

import numpy as np

from mckibben.arrays import Array, Mask
from mckibben.blocks.base import Block, run_many
from mckibben.blocks.fields import Channel
from mckibben.blocks.runs import Run, run_of
from mckibben.errors import DataError
from mckibben.recording import FEWEST_SAMPLES, Recording, check_sample_times, listed, sample_time_of

Made = TypeVar("Made")

MOVES_AT_ALL = 0.02
"""Share of its known range below which an output counts as constant."""

SLOWEST = 1 / 3
"""Largest time constant of a linear model, relative to the longest recording: in a slower one the gain
and the time constant are not determined separately.
"""


@dataclass(frozen=True, eq=False)
class TrainingData:
    """All runs for identification, and their common channels.

    ``spans`` are ranges of the outputs that are known otherwise, for where they do not move;
    ``n_recordings`` the number of recordings, also of those of which no run is left.
    """

    runs: tuple[Run, ...]
    inputs: tuple[Channel, ...]
    outputs: tuple[Channel, ...]
    scheduled: tuple[Channel, ...] = ()
    spans: tuple[float, ...] | None = None
    n_recordings: int = 0
    _latest: dict[Hashable, tuple[Array, Any]] = field(default_factory=dict, init=False, repr=False)

    def latest(self, key: Hashable, theta: Array, compute: Callable[[], Made]) -> Made:
        """Return the result of ``compute``, cached by key for the last ``theta``.

        For what all runs share at a point of a search.
        """
        cached = self._latest.get(key)
        if cached is None or not np.array_equal(cached[0], theta):
            cached = self._latest[key] = (theta.copy(), compute())
        value: Made = cached[1]
        return value

    @cached_property
    def lowest(self) -> Array:
        """Lowest value of every input over all runs."""
        return np.asarray(np.min([run.driven.min(axis=0) for run in self.runs], axis=0))

    @cached_property
    def highest(self) -> Array:
        """Highest value of every input over all runs."""
        return np.asarray(np.max([run.driven.max(axis=0) for run in self.runs], axis=0))

    @cached_property
    def travel(self) -> Array:
        """Range of every output over all runs."""
        found = np.ptp(self.stacked("outputs"), axis=0)
        if self.spans is None:
            return found
        spans = np.array(self.spans)
        return np.where(found > MOVES_AT_ALL * spans, found, spans)

    @property
    def input_span(self) -> float:
        """Range of the first input over all runs."""
        return float(self.highest[0] - self.lowest[0])

    @property
    def output_span(self) -> float:
        """Range of the scored outputs."""
        return float(np.ptp(self.target))

    @property
    def input_range(self) -> tuple[float, float]:
        """Lowest and highest value of the first input over all runs."""
        return float(self.lowest[0]), float(self.highest[0])

    @property
    def output_range(self) -> tuple[float, float]:
        """Lowest and highest output of the scored samples."""
        y = self.target
        return float(y.min()), float(y.max())

    @cached_property
    def target(self) -> Array:
        """Scored outputs of all runs, sample by sample, shape (samples that count × m,)."""
        return self.scored(lambda run: run.outputs).ravel()

    @property
    def spread(self) -> Array:
        """Standard deviation of every output at scored samples; of its known range where it is held."""
        y = self.target.reshape(-1, len(self.outputs))
        if self.spans is None:
            return y.std(axis=0)
        spans = np.array(self.spans)
        return np.where(np.ptp(y, axis=0) > MOVES_AT_ALL * spans, y.std(axis=0), spans / 12**0.5)

    @property
    def slowest(self) -> float:
        """Largest time constant of a linear model [samples]."""
        return max(SLOWEST * max(run.u.size for run in self.runs), FEWEST_SAMPLES)

    @property
    def sample_time(self) -> float | None:
        """Sample time of all runs, or None if one has none."""
        return self.runs[0].sample_time

    def timed(self) -> float:
        """Return the sample time of all runs; raise a `DataError` where the recordings have no time."""
        return sample_time_of(self.runs[0].source, "be fitted by a model that depends on rate")

    @property
    def falls(self) -> bool:
        """Whether the output decreases with the input, as a muscle's length does."""
        inputs = self.scored(lambda run: run.u)
        return float(np.dot(inputs - inputs.mean(), self.target)) < 0

    def changed(self, change: Callable[[Run], Run]) -> TrainingData:
        """Return the same data with every run changed."""
        return replace(self, runs=tuple(map(change, self.runs)))

    def stretches(self, shortest: int) -> TrainingData:
        """Return the same data as runs of scored samples; see `Run.stretches`."""
        parts = [part for run in self.runs for part in run.stretches(shortest)]
        runs = tuple(replace(run, place=k) for k, run in enumerate(parts))
        return replace(self, runs=runs)

    def stacked(self, what: str) -> Array:
        """Return a field of all runs, concatenated."""
        return np.concatenate([getattr(run, what) for run in self.runs])

    def scored(self, of_run: Callable[[Run], Array]) -> Array:
        """Return a quantity of every run, (n, ...), at the scored samples of all runs."""
        return np.concatenate([of_run(run)[run.counts] for run in self.runs])

    def simulated(self, blocks: Sequence[Block]) -> Array:
        """Return outputs of blocks, from rest, at the scored samples, shape (blocks, as `target`)."""
        outputs = []
        for run in self.runs:
            many = run_many(blocks, run.inputs, sample_time=run.sample_time)
            outputs.append(many[:, run.counts].reshape(len(many), -1))
        return np.concatenate(outputs, axis=1)

    def thinned(self, most: int) -> TrainingData:
        """Return the same runs with fewer scored samples, evenly spread; inputs are unchanged."""
        total = sum(int(run.counts.sum()) for run in self.runs)
        if total <= most:
            return self

        def thinner(run: Run) -> Run:
            counting = np.flatnonzero(run.counts)
            share = max(round(most * counting.size / total), min(2, counting.size))
            kept = counting[np.linspace(0, counting.size - 1, share).round().astype(int)]
            return replace(run, counts=np.isin(np.arange(run.counts.size), kept))

        return self.changed(thinner)


def training_data(
    recordings: Recording | Sequence[Recording],
    inputs: str | Sequence[str],
    outputs: str | Sequence[str],
    rows: Sequence[Mask] | None = None,
    scheduling: Sequence[str] = (),
    *,
    one_rate: bool = True,
    spans: tuple[float, ...] | None = None,
) -> TrainingData:
    """Check recordings and return them as training data.

    Parameters
    ----------
    recordings : Recording or sequence of Recording
        What to identify from.
    inputs, outputs : str or sequence of str
        Channels.
    rows : sequence of bool arrays, optional
        For every recording the samples that count; default all. Inputs are always used whole, since
        memory depends on them, while outputs elsewhere are never looked at.
    scheduling : sequence of str
        Further channels that the model is given.
    one_rate : bool
        Whether all must have the same sample time.
    spans : tuple of float, optional
        Ranges of the outputs, where these are known otherwise; then outputs may be constant.

    Raises
    ------
    DataError
        On no recordings, absent channels, too few samples, a constant input or output, or sample
        times that differ.
    """
    input_names, output_names = (
        (names,) if isinstance(names, str) else tuple(names) for names in (inputs, outputs)
    )
    recorded_runs = [
        one.with_derived([*input_names, *output_names, *scheduling]) for one in listed(recordings)
    ]
    if not recorded_runs:
        raise DataError("there are none to fit", parameter="recordings", remedy="give at least one")
    if same := set(input_names) & set(output_names):
        raise DataError(
            "input and output are the same channel",
            channel=min(same),
            remedy="choose two channels with `input` and `output`",
        )
    masks = [np.ones(len(r), dtype=bool) for r in recorded_runs] if rows is None else list(rows)
    if [np.shape(mask) for mask in masks] != [(len(r),) for r in recorded_runs]:
        raise DataError(
            "rows do not match the recordings", remedy="give one mask a recording, one value a row"
        )
    first = recorded_runs[0]
    for recording in recorded_runs:
        _check(recording, first, (*input_names, *output_names, *scheduling))
    check_sample_times(recorded_runs, equal=one_rate)
    runs = tuple(
        run_of(r, input_names, output_names, scheduling, np.asarray(mask, dtype=bool), index=index)
        for index, (r, mask) in enumerate(zip(recorded_runs, masks, strict=True))
    )

    def channels(names: Sequence[str]) -> tuple[Channel, ...]:
        return tuple(Channel(name, first.units[name]) for name in names)

    data = TrainingData(
        runs,
        channels(input_names),
        channels(output_names),
        channels(scheduling),
        spans=spans,
        n_recordings=len(runs),
    )
    counting = data.scored(lambda run: run.outputs)
    if len(counting) < FEWEST_SAMPLES:
        raise DataError(
            f"{len(counting)} samples are too few to identify a model",
            file=first.source,
            remedy=f"give at least {FEWEST_SAMPLES}",
        )
    moving = () if spans else output_names
    for names, values in (
        (input_names, data.stacked("driven")),
        (moving, counting[:, : len(moving)]),
    ):
        for name, column in zip(names, values.T, strict=True):
            if np.ptp(column) == 0:
                raise DataError(
                    f"the channel is constant at {column[0]:g}",
                    file=first.source,
                    channel=name,
                    remedy="record a run in which it moves, or name another channel",
                )
    return data


def _check(recording: Recording, first: Recording, names: Sequence[str]) -> None:
    for name in names:
        if recording[name].size and recording.units[name] != first.units[name]:
            raise DataError(
                f"the unit is {recording.units[name]!r} here and {first.units[name]!r} in "
                f"{first.name or first.source}",
                file=recording.source,
                channel=name,
                remedy="convert one of the recordings, or name its unit with `units[CHANNEL]=UNIT`",
            )
        absolute = [_is_absolute(one, name) for one in (recording, first)]
        if absolute[0] != absolute[1]:
            raise DataError(
                "it is absolute in one recording, and gauge in another",
                file=(recording if absolute[0] else first).source,
                channel=name,
                remedy="subtract the atmosphere, as in "
                f"`calibration[{name}]=COLUMN:GAIN:-1.01325:bar`, the gain 1 for bar, 0.01 for kPa",
            )


def _is_absolute(recording: Recording, channel: str) -> bool:
    references = recording.meta.get("pressure_reference")
    return isinstance(references, Mapping) and references.get(channel) == "absolute"
