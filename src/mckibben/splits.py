"""Splits of data into fit and test, and parts of the training data that are left out in turn."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from mckibben.arrays import Array, Mask
from mckibben.channels import Channels
from mckibben.errors import DataError
from mckibben.numerals import counted
from mckibben.recording import FEWEST_SAMPLES, Recording
from mckibben.signals.reversals import reversals

HELD_OUT = 0.25
"""Share of the input's travel that is held out by default."""

EVERY = 3
"""Every how many runs one is held out, for several muscles or varying loads."""

HARDLY = 0.2
"""Standard deviation of an output in a part, relative to the whole, below which the part counts as
at rest.
"""

N_PARTS = 8
"""Number of parts; a few more where recordings are cut equally."""

Part = tuple[Mask, ...]
"""For every recording, the samples that a part has."""


@dataclass(frozen=True)
class Split:
    """Training and test data.

    Parameters
    ----------
    train : tuple of Recording
        Used to fit and to choose.
    test : tuple of Recording
        Each runs free from its own first sample.
    test_rows : tuple of array of bool
        For every test recording, the samples that are scored.
    described : str
        The split in words.
    """

    train: tuple[Recording, ...]
    test: tuple[Recording, ...]
    test_rows: tuple[Mask, ...]
    described: str


@dataclass(frozen=True)
class Span:
    """Samples of one recording that belong to a part: from and to, in a unit (none: sample numbers)."""

    recording: str
    start: float
    stop: float
    unit: str


def given_split(train: Sequence[Recording], test: Sequence[Recording]) -> Split:
    """Return the user's split."""
    rows = tuple(~recording.bridged for recording in test)
    described = f"{counted(len(train), 'recording')} to fit, {len(test)} to test"
    return Split(tuple(train), tuple(test), rows, described)


def split_of(train: Sequence[Recording], test: Sequence[Recording], channels: Channels) -> Split:
    """Return the user's split, or else one that holds out part of the training recordings."""
    return given_split(train, test) if test else held_out(train, channels)


def tested_from(rows: Mask) -> int | None:
    """Return the first test sample of a recording whose beginning was fitted; else None."""
    return int(rows.argmax()) or None


def held_out(recordings: Sequence[Recording], channels: Channels) -> Split:
    """Return the default split of recordings without test data.

    Of one muscle, the last part; where every run holds the input, such as a length, the last runs at
    its levels, or levels within. Of several muscles, or under loads, every third level of what
    schedules, ends excepted; without several levels, every third run; of fewer, the last part as well.
    """
    if channels.single and len(recordings) > 1:
        groups = _repeats(recordings, channels.inputs[0], EVERY)
        if len(groups) > 1:
            tested = [k in groups[-1] for k in range(len(recordings))]
            return _parted(recordings, tested, f"the last run at each {channels.inputs[0]}")
    levelled = channels.inputs if channels.single else channels.scheduling
    for name in channels.held if len(recordings) > 1 else ():
        means = [float(f"{recording[name].mean():.3g}") for recording in recordings]
        unseen = sorted(set(means))[1:-1][::EVERY]
        if unseen and name in levelled:
            levels = f"{', '.join(f'{level:g}' for level in unseen)} {recordings[0].units[name]}"
            return _parted(
                recordings, [mean in unseen for mean in means], f"runs at {name} {levels}"
            )
    if len(recordings) >= EVERY and not channels.single:
        tested = [k % EVERY == EVERY - 1 for k in range(len(recordings))]
        return _parted(recordings, tested, "every third run")
    return held_out_part(recordings, channels, HELD_OUT)


def _parted(recordings: Sequence[Recording], tested: Sequence[bool], kind: str) -> Split:
    train = [run for run, is_test in zip(recordings, tested, strict=True) if not is_test]
    test = [run for run, is_test in zip(recordings, tested, strict=True) if is_test]
    split = given_split(train, test)
    return replace(split, described=f"{split.described}: {kind} held out")


def held_out_part(recordings: Sequence[Recording], channels: Channels, share: float) -> Split:
    """Hold out the last part of the recordings in which an output moves.

    Whole recordings from the end, then the tail of one, which is run through from its start, so that
    its memory is right, and scored on the tail only. Where outputs hardly move there, the part before
    it is held out instead, if one moves there.

    Parameters
    ----------
    channels : Channels
        The travel of the first input is divided: a rest at the end of a recording tests nothing.
    share : float
        Of that travel over all recordings to hold out, between 0 and 1.

    Raises
    ------
    DataError
        If nothing would be left to fit, or to test.
    """
    channel, names = channels.inputs[0], channels.outputs
    travel = share * sum(float(_travel(recording[channel])[-1]) for recording in recordings)
    deviation = np.concatenate([recording.matrix(names) for recording in recordings]).std(axis=0)

    def moves(split: Split) -> bool:
        runs = zip(split.test, split.test_rows, strict=True)
        scored = np.concatenate([recording.matrix(names)[rows] for recording, rows in runs])
        return bool((scored.std(axis=0) >= HARDLY * deviation).any())

    split = last = _tail(recordings, channel, travel, "all before")
    for k in range(1, int(1 / share)):
        if moves(split):
            return split
        before, partly, after = _cut(recordings, channel, k * travel)
        if partly is not None:
            run, start = partly
            before, after = [*before, run.slice(0, start)], [run.slice(start, len(run)), *after]
        with suppress(DataError):  # too little is left to fit
            split = _tail(before, channel, travel, "the rest")
            split = replace(split, train=(*split.train, *after))
    return split if moves(split) else last


def _tail(recordings: Sequence[Recording], channel: str, travel: float, kind: str) -> Split:
    """Hold out the last part of the input's travel."""
    train, partly, test_whole = _cut(recordings, channel, travel)
    described, tests, rows = [], [], []
    if partly is not None:
        run, start = partly
        train.append(run.slice(0, start))
        tests.append(run)
        rows.append((np.arange(len(run)) >= start) & ~run.bridged)
        described.append(f"last {len(run) - start} samples of {run.name}")
    elif not test_whole:
        raise DataError(
            f"{len(recordings[-1])} samples are too few to hold out a part for it",
            file=recordings[-1].source,
            parameter="test",
            remedy="give a longer recording, or a separate test recording with `test`",
        )
    if test_whole:
        split = given_split(train, test_whole)
        tests, rows = [*tests, *split.test], [*rows, *split.test_rows]
        described.append(f"the last {counted(len(test_whole), 'recording')}")
    words = f"{' and '.join(described)} to test, {kind} to fit"
    return Split(tuple(train), tuple(tests), tuple(rows), words)


def _cut(
    recordings: Sequence[Recording], channel: str, travel: float
) -> tuple[list[Recording], tuple[Recording, int] | None, list[Recording]]:
    """Cut off the last part of the input's travel: the part before, the index, and the part after."""
    before, after = list(recordings), list[Recording]()
    travels = [_travel(recording[channel]) for recording in before]
    while len(before) > 1 and travels[-1][-1] <= travel:
        travel -= float(travels.pop()[-1])
        after.insert(0, before.pop())
    run, travelled = before[-1], travels[-1]
    start = int(np.searchsorted(travelled, travelled[-1] - travel))
    if start < FEWEST_SAMPLES and len(before) > 1:  # nearly all, as of recordings equally long
        return before[:-1], None, [run, *after]
    if min(start, len(run) - start) < FEWEST_SAMPLES:
        return before, None, after
    return before[:-1], (run, start), after


def _travel(u: Array) -> Array:
    """Return the cumulative travel of the input at every sample, without noise."""
    turns = reversals(u)
    path = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(u[turns])))])
    branch = np.clip(np.searchsorted(turns, np.arange(u.size), side="right") - 1, 0, turns.size - 2)
    branch_travel = np.abs(u - u[turns[branch]])
    return np.minimum(path[branch] + branch_travel, path[branch + 1])


def _repeats(train: Sequence[Recording], channel: str, n: int) -> list[list[int]]:
    """Return repetitions of the levels of a common input: all first runs, all second ...; or none."""
    if any(np.ptp(recording[channel]) > 0 for recording in train):
        return []
    levels = [float(recording[channel][0]) for recording in train]
    repeat = [levels[:index].count(level) for index, level in enumerate(levels)]
    groups = [
        [index for index, k in enumerate(repeat) if k % n == remainder] for remainder in range(n)
    ]
    return [group for group in groups if group] if min(map(levels.count, levels)) > 1 else []


# -- parts of the training data that are left out in turn, to choose a model -------------------


def parts_of(recordings: Sequence[Recording], channels: Channels) -> tuple[Part, ...]:
    """Return the parts: blocks of time of fewer than `N_PARTS` recordings, else whole recordings.

    These are dealt to the parts in the order of what is held in each of them, such as a load or a
    length, so that every part has several levels, and repeats are in different parts. Samples bridged in
    reading belong to none. There are none of too little data.
    """
    each = -(-N_PARTS // len(recordings))
    pieces = [
        (index, piece)
        for index in _by_level(recordings, channels)
        for piece in np.array_split(
            np.arange(len(recordings[index])),
            np.clip(len(recordings[index]) // FEWEST_SAMPLES, 1, each),
        )
    ]
    count = len(pieces) if each > 1 else N_PARTS
    measured = [~recording.bridged for recording in recordings]
    parts = []
    for first in range(count if count > 1 else 0):
        rows = [np.zeros(len(recording), dtype=bool) for recording in recordings]
        for index, piece in pieces[first::count]:
            rows[index][piece] = measured[index][piece]
        if any(mask.any() for mask in rows):
            parts.append(tuple(rows))
    return tuple(parts)


def spans_of(part: Part, recordings: Sequence[Recording]) -> tuple[Span, ...]:
    """Return what a part has of each recording."""
    spans = []
    for recording, rows in zip(recordings, part, strict=True):
        times, unit = recording.time[rows], "" if recording.sample_time is None else "s"
        if times.size:
            spans.append(Span(recording.name, float(times[0]), float(times[-1]), unit))
    return tuple(spans)


def _by_level(recordings: Sequence[Recording], channels: Channels) -> list[int]:
    """Return the indices of recordings, in the order of the channels that each of them holds."""
    levels = [tuple(float(f"{r[name].mean():.3g}") for name in channels.held) for r in recordings]
    return sorted(range(len(recordings)), key=lambda k: levels[k])
