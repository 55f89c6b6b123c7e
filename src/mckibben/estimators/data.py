"""Recordings as identification sees them: inputs, outputs, and which samples count."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from mckibben.errors import DataError
from mckibben.recording import Recording

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Made = TypeVar("Made")

FEWEST_SAMPLES = 10
"""Fewer samples than this identify nothing."""


@dataclass(frozen=True)
class Run:
    """One recording: input u and output y, shape (n,), and the mask of samples that count.

    ``peak`` is the input from which the run is taken to have come before its first sample, where that
    is not below: it makes the memory at the start. ``scheduled`` are the scheduling inputs, (n, k).
    """

    u: Array
    y: Array
    counts: Mask
    sample_time: float | None
    scheduled: Array
    peak: float | None = None

    def condensed(self) -> Run:
        """Return the run without samples that neither count nor are turning points of the input.

        Play operators do not feel how the input went from one turning point to the next. Turns within
        the noise go too, so this is for searching, not for the final word.
        """
        from mckibben.signals import reversals

        kept = self.counts.copy()
        kept[reversals(self.u)] = True
        return replace(
            self,
            u=self.u[kept],
            y=self.y[kept],
            counts=self.counts[kept],
            scheduled=self.scheduled[kept],
        )

    @property
    def history(self) -> Array:
        """The input with the peak before the first sample in front, if there is one."""
        return self.u if self.peak is None else np.concatenate([[self.peak], self.u])

    @property
    def inputs(self) -> Array:
        """What a block is given: the history, then the scheduling inputs, shape (n, 1 + k)."""
        scheduled = self.scheduled
        if self.peak is not None:
            scheduled = np.concatenate([scheduled[:1], scheduled])
        return np.ascontiguousarray(np.column_stack([self.history, scheduled]))

    def trim(self, samples: Array) -> Array:
        """Drop what belongs to the peak from something computed over `history`."""
        return samples if self.peak is None else samples[1:]


@dataclass(frozen=True, eq=False)
class TrainingData:
    """All runs to identify from, with the ranges and units that they share."""

    runs: tuple[Run, ...]
    input: str
    output: str
    input_unit: str
    output_unit: str
    scheduling: tuple[str, ...] = ()
    scheduling_units: tuple[str, ...] = ()
    _memo: dict[Hashable, Array] = field(default_factory=dict, init=False, repr=False)
    _latest: dict[Hashable, tuple[Array, Any]] = field(default_factory=dict, init=False, repr=False)

    def once(self, key: Hashable, compute: Callable[[], Array]) -> Array:
        """Return what ``compute`` gives, computed at the first call with this key only."""
        if key not in self._memo:
            self._memo[key] = compute()
        return self._memo[key]

    def latest(self, key: Hashable, theta: Array, compute: Callable[[], Made]) -> Made:
        """Return what ``compute`` gives, anew only where ``theta`` is not that of the last call.

        For what all runs share at a point of a search.
        """
        known = self._latest.get(key)
        if known is None or not np.array_equal(known[0], theta):
            known = self._latest[key] = (theta.copy(), compute())
        found: Made = known[1]
        return found

    @property
    def input_range(self) -> tuple[float, float]:
        """Lowest and highest input of all runs."""
        low, high = self.once(
            "input range",
            lambda: np.array(
                [min(run.u.min() for run in self.runs), max(run.u.max() for run in self.runs)]
            ),
        ).tolist()
        return low, high

    @property
    def output_range(self) -> tuple[float, float]:
        """Lowest and highest output of the samples that count."""
        y = self.target
        return float(y.min()), float(y.max())

    @property
    def target(self) -> Array:
        """Outputs that count, of all runs, shape (number of counting samples,)."""
        return self.once("target", lambda: np.concatenate([run.y[run.counts] for run in self.runs]))

    @property
    def sample_time(self) -> float | None:
        """Sample time of all runs, or None where one has none."""
        return self.runs[0].sample_time

    @property
    def falls(self) -> bool:
        """Whether the output falls while the input rises, as a muscle's length does."""
        inputs = np.concatenate([run.u[run.counts] for run in self.runs])
        return float(np.dot(inputs - inputs.mean(), self.target)) < 0

    def negated(self) -> TrainingData:
        """Return the same data with the output's sign changed."""
        return replace(self, runs=tuple(replace(run, y=-run.y) for run in self.runs))

    def with_peaks(self, peaks: Sequence[float | None]) -> TrainingData:
        """Return the same data with other memories at the start."""
        runs = tuple(replace(run, peak=peak) for run, peak in zip(self.runs, peaks, strict=True))
        return replace(self, runs=runs)

    def unstarted(self) -> TrainingData:
        """Return the same data with no memory fitted to any start."""
        return self.with_peaks([None] * len(self.runs))

    def condensed(self) -> TrainingData:
        """Return the same data with every run condensed; see `Run.condensed`."""
        return replace(self, runs=tuple(run.condensed() for run in self.runs))

    def thinned(self, most: int) -> TrainingData:
        """Return the same runs with fewer samples that count, spread evenly; inputs stay whole."""
        total = sum(int(run.counts.sum()) for run in self.runs)
        if total <= most:
            return self
        runs = []
        for run in self.runs:
            counting = np.flatnonzero(run.counts)
            share = max(round(most * counting.size / total), min(2, counting.size))
            chosen = counting[np.linspace(0, counting.size - 1, share).round().astype(int)]
            counts = np.zeros_like(run.counts)
            counts[chosen] = True
            runs.append(replace(run, counts=counts))
        return replace(self, runs=tuple(runs))


def training_data(
    recordings: Recording | Sequence[Recording],
    input_name: str,
    output_name: str,
    rows: Sequence[Mask] | None = None,
    scheduling: Sequence[str] = (),
) -> TrainingData:
    """Check recordings and return them as training data.

    Parameters
    ----------
    recordings : Recording or sequence of Recording
        What to identify from.
    input_name, output_name : str
        Channels.
    rows : sequence of bool arrays, optional
        For every recording the samples that count; default all. Inputs are always used whole, since
        memory depends on them, while outputs elsewhere are never looked at.
    scheduling : sequence of str
        Further channels that the model is given.

    Raises
    ------
    DataError
        On no recordings, absent channels, too few samples, a constant input or output, or sample
        times that differ.
    """
    listed = [recordings] if isinstance(recordings, Recording) else list(recordings)
    if not listed:
        raise DataError("there are no recordings to fit", remedy="give at least one")
    if input_name == output_name:
        raise DataError(
            "input and output are the same channel",
            channel=input_name,
            remedy="choose two channels with --input and --output",
        )
    masks = [np.ones(len(r), dtype=bool) for r in listed] if rows is None else list(rows)
    if len(masks) != len(listed) or any(
        np.shape(mask) != (len(r),) for mask, r in zip(masks, listed, strict=False)
    ):
        raise DataError(
            "rows do not match the recordings", remedy="give one mask a recording, one value a row"
        )
    first = listed[0]
    for recording in listed:
        _check(recording, first, (input_name, output_name, *scheduling))
    runs = tuple(
        Run(
            r[input_name],
            r[output_name],
            np.asarray(mask, dtype=bool),
            r.sample_time,
            r.matrix(scheduling) if scheduling else np.empty((len(r), 0)),
        )
        for r, mask in zip(listed, masks, strict=True)
    )
    data = TrainingData(
        runs,
        input_name,
        output_name,
        first.units[input_name],
        first.units[output_name],
        tuple(scheduling),
        tuple(first.units[name] for name in scheduling),
    )
    if data.target.size < FEWEST_SAMPLES:
        raise DataError(
            f"{data.target.size} samples are too few to identify a model",
            file=first.source,
            remedy=f"give at least {FEWEST_SAMPLES}",
        )
    for channel, values in (
        (input_name, np.concatenate([run.u for run in runs])),
        (output_name, data.target),
    ):
        if np.ptp(values) == 0:
            raise DataError(
                f"the channel is constant at {values[0]:g}",
                file=first.source,
                channel=channel,
                remedy="record a run in which it moves, or name another channel",
            )
    return data


def _check(recording: Recording, first: Recording, names: Sequence[str]) -> None:
    for name in names:
        if recording[name].size and recording.units[name] != first.units[name]:
            raise DataError(
                f"the unit is {recording.units[name]!r} here and {first.units[name]!r} in "
                f"{first.source or first.name}",
                file=recording.source,
                channel=name,
                remedy="convert one of the recordings, or name its unit with --unit",
            )
    ours, theirs = recording.sample_time, first.sample_time
    if (ours is None) != (theirs is None):
        raise DataError(
            "some recordings have time and others have none",
            file=recording.source,
            remedy="give --rate for those without, or fit them apart",
        )
    if ours is not None and theirs is not None and abs(ours - theirs) > 1e-3 * theirs:
        raise DataError(
            f"the sample time is {ours:g} s here and {theirs:g} s in {first.source or first.name}",
            file=recording.source,
            remedy="say --resample SECONDS, or use mckibben.signals.resample",
        )
