"""Other inputs, such as loads and lengths: segments in which they are constant."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mckibben.arrays import Array
from mckibben.channels import by_name, channels_of
from mckibben.numerics.statistics import hats
from mckibben.recording import FEWEST_SAMPLES, Recording
from mckibben.signals.holds import STILL, holds, moves

ALIKE, COVERS = 0.02, 0.5
"""Share of another input's range within which its levels are equal, and share of the input range
that a segment must cover.
"""

MOST, KNOTS = 2000, 12
"""Largest number of samples per recording for offsets, and number of knots of the input's curve."""


def others_of(
    recordings: Sequence[Recording], given: str, wanted: str, asked: Sequence[str]
) -> list[str]:
    """Return other inputs that vary within or between recordings.

    Those asked for, what drives beside the input, what schedules models, and channels that every
    recording holds.
    """
    seen = [name for name in recordings[0].channels if all(name in one for one in recordings)]
    driving = by_name(recordings)[0]
    further = channels_of(recordings, given, wanted).further
    candidates = [
        *asked,
        *(n for n in driving if given in driving and n in seen),
        *(n for n in further if n in seen),
        *(n for n in seen if all(np.ptp(one[n]) == 0 for one in recordings)),
    ]
    named = [n for n in dict.fromkeys(candidates) if n not in (given, wanted)]
    return [n for n in named if moves([one[n] for one in recordings])]


Group = tuple[tuple[float, ...], list[tuple[int, Recording]]]
"""Levels at which the other inputs are constant, with the recordings and segments in which they
are.
"""


def constant_segments(
    recordings: Sequence[Recording], given: str, others: Sequence[str]
) -> list[Group]:
    """Return segments in which all other inputs are constant and the input moves, by level."""
    span = max(float(np.ptp(one[given])) for one in recordings)
    ranges = np.ptp(np.concatenate([one.matrix(others) for one in recordings]), axis=0)
    found: list[tuple[Array, int, Recording]] = []
    for place, one in enumerate(recordings):
        columns = one.matrix(others)
        whole = bool(np.all(np.ptp(columns, axis=0) <= STILL * ranges))
        for hold in (
            [slice(0, len(one))] if whole else holds(columns, ranges.tolist(), FEWEST_SAMPLES)
        ):
            part = one.slice(hold.start, hold.stop)
            if np.ptp(part[given]) > COVERS * span:
                found.append((columns[hold].mean(axis=0), place, part))
    groups: list[Group] = []
    for level, place, part in sorted(found, key=lambda each: tuple(each[0])):
        for at, parts in groups:
            if np.all(np.abs(level - at) <= ALIKE * ranges):
                parts.append((place, part))
                break
        else:
            groups.append((tuple(level.tolist()), [(place, part)]))
    return groups


def levelled(recordings: Sequence[Recording], given: str, wanted: str) -> list[Recording]:
    """Return recordings whose outputs are shifted onto one curve of the input."""
    seen = [one.matrix((given, wanted))[:: -(-len(one) // MOST)] for one in recordings]
    own = np.repeat(np.eye(len(seen)), [len(part) for part in seen], axis=0)
    x, y = np.concatenate(seen).T
    offsets = np.linalg.lstsq(np.column_stack([own, hats(x, KNOTS)]), y, rcond=None)[0][: len(seen)]
    offsets -= offsets @ own.mean(axis=0)
    return [
        one.with_channels({wanted: one.units[wanted]}, **{wanted: one[wanted] - offset})
        for one, offset in zip(recordings, offsets.tolist(), strict=True)
    ]
