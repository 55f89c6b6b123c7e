"""Training data: inputs, outputs, scheduling inputs and sample masks of recordings."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Array, true_runs
from mckibben.blocks.fields import Channel
from mckibben.errors import DataError
from mckibben.recording import FEWEST_SAMPLES, Recording, listed

Mask = NDArray[np.bool_]
Made = TypeVar("Made")

MOVES_AT_ALL = 0.02
"""Share of its known range below which an output counts as constant."""

SLOWEST = 1 / 3
"""Largest time constant of a linear model, relative to the longest recording: in a slower one the gain
and the time constant are not determined separately.
"""


def stretches(mask: Mask) -> list[tuple[int, int]]:
    """Return start and stop of segments of true values."""
    return [(start, stop) for start, stop in true_runs(mask).tolist()]


@dataclass(frozen=True)
class Run:
    """One recording: inputs (n, k), outputs (n, m), scheduling inputs (n, s), and scored samples."""

    name: str
    driven: Array
    outputs: Array
    scheduled: Array
    counts: Mask
    sample_time: float | None
    place: int = 0
    """Index among all runs."""

    recording: int = 0
    """Index of its recording."""

    unmeasured: tuple[str, ...] = ()
    """Scheduling channels that the recording lacks; their mean over the other recordings is used.
    """

    @property
    def u(self) -> Array:
        """The first input, shape (n,)."""
        return self.driven[:, 0]

    @property
    def y(self) -> Array:
        """The first output, shape (n,)."""
        return self.outputs[:, 0]

    def thinned(self, every: int) -> Run:
        """Return every n-th sample."""
        step = None if self.sample_time is None else every * self.sample_time
        return replace(self._at(slice(None, None, every)), sample_time=step)

    def cut(self, start: int, stop: int | None = None) -> Run:
        """Return a segment of the run."""
        return self._at(slice(start, stop))

    def stretches(self, shortest: int) -> list[Run]:
        """Return the segments of scored samples longer than a minimum, each as a run."""
        return [
            self.cut(start, stop)
            for start, stop in stretches(self.counts)
            if stop - start > shortest
        ]

    def condensed(self) -> Run:
        """Return the run reduced to scored samples and turning points of the input.

        Play operators do not depend on the path between turning points. Turns within
        the noise go too, so this is for searching, not for the final word.
        """
        from mckibben.signals import reversals

        kept = self.counts.copy()
        kept[reversals(self.u)] = True
        return self._at(kept)

    def _at(self, kept: slice | Mask) -> Run:
        """Return the remaining samples."""
        return replace(
            self,
            driven=self.driven[kept],
            outputs=self.outputs[kept],
            scheduled=self.scheduled[kept],
            counts=self.counts[kept],
        )

    @property
    def inputs(self) -> Array:
        """Inputs of a block, shape (n, k + s): driven and scheduling."""
        return np.ascontiguousarray(np.hstack([self.driven, self.scheduled]))


@dataclass(frozen=True, eq=False)
class TrainingData:
    """All runs for identification, and their common channels.

    ``spans`` are ranges of the outputs that are known otherwise, for where they do not move.
    """

    runs: tuple[Run, ...]
    inputs: tuple[Channel, ...]
    outputs: tuple[Channel, ...]
    scheduled: tuple[Channel, ...] = ()
    spans: tuple[float, ...] | None = None
    _memo: dict[Hashable, Array] = field(default_factory=dict, init=False, repr=False)
    _latest: dict[Hashable, tuple[Array, Any]] = field(default_factory=dict, init=False, repr=False)

    def once(self, key: Hashable, compute: Callable[[], Array]) -> Array:
        """Return the result of ``compute``, cached by key."""
        if key not in self._memo:
            self._memo[key] = compute()
        return self._memo[key]

    def latest(self, key: Hashable, theta: Array, compute: Callable[[], Made]) -> Made:
        """Return the result of ``compute``, cached for the last ``theta``.

        For what all runs share at a point of a search.
        """
        known = self._latest.get(key)
        if known is None or not np.array_equal(known[0], theta):
            known = self._latest[key] = (theta.copy(), compute())
        found: Made = known[1]
        return found

    @property
    def input(self) -> str:
        """Name of the first input."""
        return self.inputs[0].name

    @property
    def input_unit(self) -> str:
        """Its unit."""
        return self.inputs[0].unit

    @property
    def output(self) -> str:
        """Name of the first output."""
        return self.outputs[0].name

    @property
    def lowest(self) -> Array:
        """Lowest value of every input over all runs."""
        return self.once(
            "lowest", lambda: np.min([run.driven.min(axis=0) for run in self.runs], axis=0)
        )

    @property
    def highest(self) -> Array:
        """Highest value of every input over all runs."""
        return self.once(
            "highest", lambda: np.max([run.driven.max(axis=0) for run in self.runs], axis=0)
        )

    @property
    def travel(self) -> Array:
        """Range of every output over all runs."""
        found = self.once("travel", lambda: np.ptp(self.stacked("outputs"), axis=0))
        if self.spans is None:
            return found
        spans = np.array(self.spans)
        return np.where(found > MOVES_AT_ALL * spans, found, spans)

    @property
    def input_range(self) -> tuple[float, float]:
        """Lowest and highest value of the first input over all runs."""
        return float(self.lowest[0]), float(self.highest[0])

    @property
    def output_range(self) -> tuple[float, float]:
        """Lowest and highest output of the scored samples."""
        y = self.target
        return float(y.min()), float(y.max())

    @property
    def target(self) -> Array:
        """Scored outputs of all runs, sample by sample, shape (samples that count × m,)."""
        return self.once(
            "target", lambda: np.concatenate([run.outputs[run.counts].ravel() for run in self.runs])
        )

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

    def timed(self, why: str = "this model depends on rate", instead: str = "") -> float:
        """Return the sample time of all runs.

        Parameters
        ----------
        why : str
            What needs it.
        instead : str
            What could be done without.

        Raises
        ------
        DataError
            Where the recordings have no time.
        """
        if self.sample_time is None:
            raise DataError(
                f"the recordings have no time, and {why}",
                remedy="read them with a time column or `rate`" + instead,
            )
        return self.sample_time

    @property
    def falls(self) -> bool:
        """Whether the output decreases with the input, as a muscle's length does."""
        inputs = np.concatenate([run.u[run.counts] for run in self.runs])
        return float(np.dot(inputs - inputs.mean(), self.target)) < 0

    def _changed(self, change: Callable[[Run], Run]) -> TrainingData:
        return replace(self, runs=tuple(map(change, self.runs)))

    def negated(self) -> TrainingData:
        """Return the same data with the output's sign changed."""
        return self._changed(lambda run: replace(run, outputs=-run.outputs))

    def condensed(self) -> TrainingData:
        """Return the same data with reduced runs; see `Run.condensed`."""
        return self._changed(Run.condensed)

    def stretches(self, shortest: int) -> TrainingData:
        """Return the same data as runs of scored samples; see `Run.stretches`."""
        found = [part for run in self.runs for part in run.stretches(shortest)]
        runs = tuple(replace(run, place=place) for place, run in enumerate(found))
        return replace(self, runs=runs)

    def stacked(self, what: str) -> Array:
        """Return a field of all runs, concatenated."""
        return np.concatenate([getattr(run, what) for run in self.runs])

    def between(self, start: float, stop: float) -> TrainingData:
        """Return the same runs, scored only between two shares of their time."""

        def part(run: Run) -> Run:
            shares = np.arange(run.counts.size)
            inside = (shares >= round(start * shares.size)) & (shares < round(stop * shares.size))
            return replace(run, counts=run.counts & inside)

        return self._changed(part)

    def thinned(self, most: int) -> TrainingData:
        """Return the same runs with fewer scored samples, evenly spread; inputs are unchanged."""
        total = sum(int(run.counts.sum()) for run in self.runs)
        if total <= most:
            return self

        def thinner(run: Run) -> Run:
            counting = np.flatnonzero(run.counts)
            share = max(round(most * counting.size / total), min(2, counting.size))
            chosen = counting[np.linspace(0, counting.size - 1, share).round().astype(int)]
            return replace(run, counts=np.isin(np.arange(run.counts.size), chosen))

        return self._changed(thinner)


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
    driven, given = (
        (names,) if isinstance(names, str) else tuple(names) for names in (inputs, outputs)
    )
    every = [one.with_derived([*driven, *given, *scheduling]) for one in listed(recordings)]
    if not every:
        raise DataError("there are no recordings to fit", remedy="give at least one")
    if same := set(driven) & set(given):
        raise DataError(
            "input and output are the same channel",
            channel=min(same),
            remedy="choose two channels with `input` and `output`",
        )
    masks = [np.ones(len(r), dtype=bool) for r in every] if rows is None else list(rows)
    if len(masks) != len(every) or any(
        np.shape(mask) != (len(r),) for mask, r in zip(masks, every, strict=False)
    ):
        raise DataError(
            "rows do not match the recordings", remedy="give one mask a recording, one value a row"
        )
    first = every[0]
    for recording in every:
        _check(recording, first, (*driven, *given, *scheduling), one_rate)
    runs = tuple(
        Run(
            r.name,
            r.matrix(driven),
            r.matrix(given),
            r.matrix(scheduling) if scheduling else np.empty((len(r), 0)),
            np.asarray(mask, dtype=bool),
            r.sample_time,
            recording=place,
        )
        for place, (r, mask) in enumerate(zip(every, masks, strict=True))
    )

    def channels(names: Sequence[str]) -> tuple[Channel, ...]:
        return tuple(Channel(name, first.units[name]) for name in names)

    data = TrainingData(runs, channels(driven), channels(given), channels(scheduling), spans=spans)
    counting = np.concatenate([run.outputs[run.counts] for run in runs])
    if len(counting) < FEWEST_SAMPLES:
        raise DataError(
            f"{len(counting)} samples are too few to identify a model",
            file=first.source,
            remedy=f"give at least {FEWEST_SAMPLES}",
        )
    moving = () if spans else given
    for names, values in ((driven, data.stacked("driven")), (moving, counting[:, : len(moving)])):
        for name, column in zip(names, values.T, strict=True):
            if np.ptp(column) == 0:
                raise DataError(
                    f"the channel is constant at {column[0]:g}",
                    file=first.source,
                    channel=name,
                    remedy="record a run in which it moves, or name another channel",
                )
    return data


def _check(recording: Recording, first: Recording, names: Sequence[str], one_rate: bool) -> None:
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
    ours, theirs = recording.sample_time, first.sample_time
    if (ours is None) != (theirs is None):
        raise DataError(
            "some recordings have time and others have none",
            file=recording.source,
            remedy="give `rate` for those without, or fit them separately",
        )
    if one_rate and ours is not None and theirs is not None and abs(ours - theirs) > 1e-3 * theirs:
        raise DataError(
            f"the sample time is {ours:g} s here and {theirs:g} s in {first.name or first.source}",
            file=recording.source,
            remedy=f"give `resample={max(ours, theirs):.3g}`",
        )


def _is_absolute(recording: Recording, channel: str) -> bool:
    references = recording.meta.get("pressure_reference")
    return isinstance(references, Mapping) and references.get(channel) == "absolute"
