"""Stretches of motion that two recordings have in common: copies, slices, one file given twice.

Two runs of one experiment never agree sample by sample: noise, creep and the start see to that. Where
all channels agree to rounding over a hundred movements of the output, it is one measurement in two
places, whatever the files' formats, names, offsets in time, or every how many-th sample was written. A
simulation without noise that is run twice gives the same samples, and is the same data likewise: a test
on it tells nothing that training did not. Repeats within one recording are no matter of this module.

Holds, saturated stretches and slow rests do not count, since all recordings of one muscle agree there.
What was interpolated, resampled, filtered or given a zero is looked up by the rows that were read.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Array
from mckibben.errors import DataError
from mckibben.files.fingerprint import Hashes, mixed, pairs_of_one_row, shared_rows
from mckibben.files.quality import runs
from mckibben.recording import Recording

Indices = NDArray[np.int64]

ENOUGH = 100
"""Movements of the output in a row that make a shared stretch; of short recordings, half of theirs."""

FEWEST = 8
"""Movements of the output below which nothing can be told."""

GRAVE = 0.05
"""Share of the shorter recording's movements from which a comparison is refused."""

ROUNDING = 1e-4
"""Differences up to this share of a channel's range are rounding: of text, float32, another unit."""

DIGITS = 5e-6
"""The same as a share of the largest value: six significant digits."""

COARSE = 10
"""Bins that candidates are looked for in are so many times wider than rounding, to survive it."""

WINDOW = 8
"""Changes of bin in a row that make a candidate."""

MOST_WINDOWS = 2_000_000
"""Of more, those are taken whose hash says so: the same ones of a copy."""

MOST_SHIFTS = 16
"""Offsets in time that are tried between two recordings, those with the most candidates first."""

MOST_STRIDE = 10
"""Longest sample time, as a multiple of another's, at which every so many-th sample is looked at."""

TESTED = "tested on data it was fitted to, so that the figures say nothing of other data"
"""What every result says where that is so."""


@dataclass(frozen=True)
class Shared:
    """Stretches that a recording has in common with one before it in a list.

    Parameters
    ----------
    first, second : int
        Places of the two in the list; ``first`` is the lower.
    start, stop : float
        Where the longest stretch begins and ends in the second [s], or samples without time.
    begins : float
        Where it begins in the first.
    share : float
        Movements of the output that they share, over those of the one that has fewer.
    """

    first: int
    second: int
    start: float
    stop: float
    begins: float
    share: float


@dataclass(frozen=True)
class _View:
    """Every so many-th sample of a recording, channels as rows."""

    place: int
    stride: int
    phase: int


def shared_stretches(
    recordings: Sequence[Recording], inputs: Sequence[str], outputs: Sequence[str]
) -> list[Shared]:
    """Return what recordings have in common with ones before them, in time linear in their length.

    Parameters
    ----------
    recordings : sequence of Recording
        All have the channels.
    inputs, outputs : sequence of str
        All of these agree where a stretch is shared; how much it moves is told by the outputs.
    """
    names = [*inputs, *outputs]
    if len(recordings) < 2:
        return []
    found = []
    votes: dict[tuple[int, int], list[tuple[_View, _View, Indices]]] = {}
    for one, other, shifts in _candidates(recordings, names):
        votes.setdefault((one.place, other.place), []).append((one, other, shifts))
    for (first, second), ways in sorted(votes.items()):
        pair = (recordings[first], recordings[second])
        rounding = {name: _rounding(pair, name) for name in names}
        compared = [
            _compared(pair, (one, other), shifts, rounding, outputs) for one, other, shifts in ways
        ]
        known = [item for item in compared if item is not None]
        if known:
            start, stop, begins, share = max(known, key=lambda item: item[3])
            found.append(Shared(first, second, start, stop, begins, share))
    seen = {(one.first, one.second) for one in found}
    for first, second in pairs_of_one_row(recordings, outputs):
        rows = None
        if (first, second) not in seen:
            rows = shared_rows(recordings[first], recordings[second], inputs, outputs)
        if rows is not None:
            found.append(Shared(first, second, rows.start, rows.stop, rows.begins, rows.share))
    return sorted(found, key=lambda one: (one.first, one.second))


def told(
    roles: Mapping[str, Sequence[Recording]],
    inputs: Sequence[str],
    outputs: Sequence[str],
    *,
    allow: bool = False,
) -> tuple[str, ...]:
    """Return in words what recordings of a comparison have in common, or refuse them.

    Parameters
    ----------
    roles : mapping of str to sequence of Recording
        What each is for: "fit", "validate", "test", in this order.
    inputs, outputs : sequence of str
        Channels.
    allow : bool
        Whether to say only, and not to refuse.

    Raises
    ------
    DataError
        If what is tested on was fitted to, or what is fitted to is given twice, and that is not allowed.
    """
    listed = [(role, recording) for role, some in roles.items() for recording in some]
    said = []
    for shared in shared_stretches([recording for _, recording in listed], inputs, outputs):
        sentence = _sentence(shared, listed)
        if shared.share >= GRAVE and not allow:
            raise DataError(
                sentence,
                file=listed[shared.second][1].source,
                remedy="drop the copy, or cut the stretch out of one of them; to go on all the same "
                "(runs of a sensor with few levels may agree and be two), give --allow-shared "
                "(allow_shared=True, or the tick beside Fit), and every result will say so",
            )
        said.append(f"{sentence}.")
    return tuple(said)


def refuse_copies(
    to: str, recordings: Sequence[Recording], inputs: Sequence[str], outputs: Sequence[str]
) -> None:
    """Refuse recordings some of whose samples would count twice.

    Parameters
    ----------
    to : str
        What they are for, as a verb.

    Raises
    ------
    DataError
        If two share more than a little.
    """
    for shared in shared_stretches(recordings, inputs, outputs):
        if shared.share >= GRAVE:
            raise DataError(
                _sentence(shared, [(to, recording) for recording in recordings]),
                file=recordings[shared.second].source,
                remedy="drop the copy, or cut the stretch out of one of them",
            )


def without_copies(
    recordings: Sequence[Recording], inputs: Sequence[str], outputs: Sequence[str]
) -> list[Recording]:
    """Return recordings without those that are, but for a little, in one before them."""
    copies = {
        shared.second
        for shared in shared_stretches(recordings, inputs, outputs)
        if shared.share > 1 - GRAVE
    }
    return [one for place, one in enumerate(recordings) if place not in copies]


def _sentence(shared: Shared, listed: Sequence[tuple[str, Recording]]) -> str:
    (role, one), (other_role, other) = listed[shared.first], listed[shared.second]
    unit = "samples" if other.sample_time is None else "s"
    start, stop = shared.start - other.start_time, shared.stop - other.start_time
    where = (
        f"{start:.6g} to {stop:.6g} {unit} after the start of {_called(other, one)} are those of "
        f"{_called(one, other)} from {shared.begins - one.start_time:.6g} {unit} on, "
        f"{100 * shared.share:.0f} % of the shorter one's motion"
    )
    if role == other_role:
        return f"the same samples would count twice to {role}: {where}"
    if "fit" not in (role, other_role):
        return f"the choice would be made on what is tested on: {where}"
    doing = TESTED if other_role == "test" else TESTED.replace("tested", "validated")
    return f"{doing}: {where}"


def _called(recording: Recording, other: Recording) -> str:
    """Return a recording's name, with its file where that is the other's name too."""
    alike = recording.name == other.name and recording.source not in (None, other.source)
    return f"{recording.name} ({recording.source})" if alike else recording.name


def _candidates(
    recordings: Sequence[Recording], names: Sequence[str]
) -> Iterator[tuple[_View, _View, Indices]]:
    """Yield pairs of views whose bins change alike somewhere, and the offsets at which they do."""
    widths = {name: COARSE * _rounding(recordings, name) for name in names}
    moving = [name for name in names if widths[name] > 0]
    lows = {name: min(float(r[name].min()) for r in recordings) for name in moving}
    steps = {r.sample_time for r in recordings if r.sample_time is not None}
    views, hashes, starts = [], [], []
    for place, recording in enumerate(recordings):
        for stride in _strides(recording.sample_time, steps):
            for phase in range(stride):
                bins = [
                    np.floor((recording[name][phase::stride] - lows[name]) / widths[name])
                    for name in moving
                ]
                own_starts, own = _windows(bins)
                views.append(_View(place, stride, phase))
                starts.append(own_starts)
                hashes.append(own)
    sizes = [own.size for own in hashes]
    if sum(sizes) == 0:
        return
    every, start = np.concatenate(hashes), np.concatenate(starts)
    view = np.repeat(np.arange(len(views)), sizes)
    sparse = -(-every.size // MOST_WINDOWS)
    if sparse > 1:
        kept = every % np.uint64(sparse) == 0
        every, start, view = every[kept], start[kept], view[kept]
    order = np.argsort(every, kind="stable")
    new = np.concatenate([[True], np.diff(every[order]) != 0])
    leader = order[np.flatnonzero(new)[np.cumsum(new) - 1]]
    places = np.array([v.place for v in views])
    differ = places[view[leader]] != places[view[order]]
    one, other = leader[differ], order[differ]
    pairs = view[one] * len(views) + view[other]
    by_pair = np.argsort(pairs, kind="stable")
    for group in np.split(by_pair, np.flatnonzero(np.diff(pairs[by_pair])) + 1):
        if group.size:
            shifts, count = np.unique(start[one[group]] - start[other[group]], return_counts=True)
            likely = np.lexsort((np.abs(shifts), -count))[:MOST_SHIFTS]
            yield views[view[one[group[0]]]], views[view[other[group[0]]]], shifts[likely]


def _strides(step: float | None, steps: set[float]) -> list[int]:
    """Return every how many-th samples of a recording stand where another one's may."""
    if step is None:
        return [1]
    ratios = {round(other / step) for other in steps if abs(other / step % 1 - 0.5) > 0.499}
    return sorted({1} | {ratio for ratio in ratios if 1 < ratio <= MOST_STRIDE})


def _windows(bins: Sequence[Array]) -> tuple[Indices, Hashes]:
    """Return where windows of changes begin, and their hashes.

    Only samples at which some channel enters another bin count: a hold is one of them, however long.
    """
    code = np.zeros(bins[0].size if bins else 0, dtype=np.uint64)
    for one in bins:
        code = mixed(code + one.astype(np.int64).astype(np.uint64))
    changes = np.flatnonzero(np.diff(code)) + 1
    n = changes.size - WINDOW + 1
    if n < 1:
        return np.empty(0, dtype=np.int64), np.empty(0, dtype=np.uint64)
    values = code[changes]
    hashes = np.zeros(n, dtype=np.uint64)
    for k in range(WINDOW):
        hashes = mixed(hashes + values[k : k + n])
    return changes[:n].astype(np.int64), hashes


def _compared(
    pair: tuple[Recording, Recording],
    views: tuple[_View, _View],
    shifts: Indices,
    rounding: Mapping[str, float],
    outputs: Sequence[str],
) -> tuple[float, float, float, float] | None:
    """Return start, stop, where it begins in the first, and share of what two views have in common."""
    one, other = (
        {name: r[name][v.phase :: v.stride] for name in rounding}
        for r, v in zip(pair, views, strict=True)
    )
    moves = [_moves(samples, rounding, outputs) for samples in (one, other)]
    fewer = int(min(moves[0][-1], moves[1][-1]))
    if fewer < FEWEST:
        return None
    enough = max(FEWEST, min(ENOUGH, fewer // 2))
    n, m = moves[0].size, moves[1].size
    same = np.zeros(m, dtype=bool)
    longest, place = (0, 0), 0
    for shift in shifts.tolist():
        begin, end = max(0, -shift), min(m, n - shift)
        if end - begin < 2:
            continue
        alike = np.ones(end - begin, dtype=bool)
        for name, tolerance in rounding.items():
            alike &= (
                np.abs(one[name][begin + shift : end + shift] - other[name][begin:end]) <= tolerance
            )
        starts, stops = runs(alike).T + begin
        travelled = moves[1][stops - 1] - moves[1][starts]
        for k in np.flatnonzero(travelled >= enough).tolist():
            start, stop = int(starts[k]), int(stops[k])
            same[start:stop] = True
            if stop - start > longest[1] - longest[0]:
                longest, place = (start, stop), start + shift
        if same.all():
            break
    if not same.any():
        return None
    share = float(np.diff(moves[1], prepend=0)[same].sum()) / fewer
    return (
        _when(pair[1], views[1], longest[0]),
        _when(pair[1], views[1], longest[1] - 1),
        _when(pair[0], views[0], place),
        min(share, 1.0),
    )


def _moves(
    samples: Mapping[str, Array], rounding: Mapping[str, float], outputs: Sequence[str]
) -> Indices:
    """Return how often the output has moved by more than rounding until every sample."""
    n = next(iter(samples.values())).size
    moved = np.zeros(n, dtype=bool)
    for name in outputs:
        if rounding[name] > 0:
            moved[1:] |= np.diff(np.round(samples[name] / rounding[name])) != 0
    return np.cumsum(moved, dtype=np.int64)


def _rounding(recordings: Sequence[Recording], name: str) -> float:
    """Return the difference up to which values of a channel are the same; 0 where it never changes."""
    low = min(float(recording[name].min()) for recording in recordings)
    high = max(float(recording[name].max()) for recording in recordings)
    return max(ROUNDING * (high - low), DIGITS * max(abs(low), abs(high))) if high > low else 0.0


def _when(recording: Recording, view: _View, index: int) -> float:
    step = 1.0 if recording.sample_time is None else recording.sample_time
    return float(recording.start_time + step * (view.phase + view.stride * index))
