"""Other inputs, such as loads and lengths: segments in which they are constant, and their effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mckibben.arrays import Array
from mckibben.diagnosis.tracks import FEWEST, Range
from mckibben.estimators.coupled.base import schedules
from mckibben.recording import Recording
from mckibben.signals.holds import STILL, holds, moves
from mckibben.statistics import correlation_length, dependence, hats

ALIKE, COVERS = 0.02, 0.5
"""Share of another input's range within which its levels are equal, and share of the input range
that a segment must cover.
"""

FOLLOWS = 0.9
"""R² of an input's regression on the others above which their effects are not separable."""

MOST, KNOTS = 2000, 12
"""Largest number of samples per recording for effects, and number of knots of the input's curve."""


@dataclass(frozen=True)
class Effect:
    """Effect of another input, from ``low`` to ``high``, on the output at equal input.

    By straight lines: the ``change`` of the output and that of its slope, ``gain_change``, each with its
    95 % interval; None where recordings do not tell the latter.
    """

    channel: str
    low: float
    high: float
    unit: str
    change: float
    limits: Range
    gain_change: float | None
    gain_limits: Range | None


def others_of(
    recordings: Sequence[Recording], given: str, wanted: str, asked: Sequence[str]
) -> list[str]:
    """Return other inputs that vary within or between recordings.

    Those asked for, other channels of the input's quantity, what schedules models, and channels that
    every recording holds.
    """
    quantity = given.rstrip("0123456789")
    seen = [name for name in recordings[0].channels if all(name in one for one in recordings)]
    candidates = [
        *asked,
        *(n for n in seen if given != quantity and n.rstrip("0123456789") == quantity),
        *(n for n in schedules(recordings) if n in seen),
        *(n for n in seen if all(np.ptp(one[n]) == 0 for one in recordings)),
    ]
    named = [n for n in dict.fromkeys(candidates) if n not in (given, wanted)]
    return [n for n in named if moves([one[n] for one in recordings])]


Group = tuple[tuple[float, ...], list[tuple[int, Recording]]]
"""Levels at which the other inputs are constant, with the recordings and segments in which they
are.
"""


def standing(recordings: Sequence[Recording], given: str, others: Sequence[str]) -> list[Group]:
    """Return segments in which all other inputs are constant and the input moves, by level."""
    span = max(float(np.ptp(one[given])) for one in recordings)
    ranges = np.ptp(np.concatenate([one.matrix(others) for one in recordings]), axis=0)
    found: list[tuple[Array, int, Recording]] = []
    for place, one in enumerate(recordings):
        columns = one.matrix(others)
        whole = bool(np.all(np.ptp(columns, axis=0) <= STILL * ranges))
        for hold in [slice(0, len(one))] if whole else holds(columns, ranges.tolist(), FEWEST):
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


def effects(
    recordings: Sequence[Recording], given: str, wanted: str, others: Sequence[str]
) -> tuple[Effect, ...]:
    """Return the effects of other inputs at equal input; none if they are collinear.

    By least squares beside a curve of the input, each with a straight line, and that times the input.
    """
    from scipy.special import stdtrit

    parts = [one.matrix((given, wanted, *others))[:: -(-len(one) // MOST)] for one in recordings]
    seen = np.concatenate(parts)
    x, y = seen[:, 0], seen[:, 1]
    lows, highs = seen[:, 2:].min(axis=0), seen[:, 2:].max(axis=0)
    shares = (seen[:, 2:] - lows) / (highs - lows) - 0.5
    k, middle = len(others), 0.5 * (x.min() + x.max())
    if _together(parts, hats(x, KNOTS), k):
        return ()
    columns = np.column_stack([shares, shares * (x - middle)[:, np.newaxis], hats(x, KNOTS)])
    # changes of slope are not always told
    for terms in (columns, np.delete(columns, slice(k, 2 * k), axis=1)):
        found, _, rank, _ = np.linalg.lstsq(terms, y, rcond=None)
        if rank == terms.shape[1]:
            break
    else:
        return ()
    left = y - terms @ found
    pieces = np.split(left, np.cumsum([len(part) for part in parts])[:-1])
    memory = correlation_length(pieces)
    # as many samples are independent, less those that the terms take
    freedom = max(len(y) / memory - terms.shape[1], 1.0)
    variance = float(left @ left) / freedom * np.diag(np.linalg.inv(terms.T @ terms))
    half = float(stdtrit(freedom, 0.975)) * np.sqrt(variance)
    limits = list(zip((found - half).tolist(), (found + half).tolist(), strict=True))
    return tuple(
        Effect(
            channel=name,
            low=float(lows[j]),
            high=float(highs[j]),
            unit=recordings[0].units[name],
            change=float(found[j]),
            limits=limits[j],
            gain_change=float(found[j + k]) if terms is columns else None,
            gain_limits=limits[j + k] if terms is columns else None,
        )
        for j, name in enumerate(others)
    )


def _together(parts: Sequence[Array], hats: Array, k: int) -> bool:
    """Return whether another input is determined by the remaining inputs within recordings.

    What moves only between recordings is separate.
    """
    seen = np.concatenate([part - part.mean(axis=0) for part in parts])[:, 2:]
    curves = np.split(hats, np.cumsum([len(part) for part in parts])[:-1])
    curve = np.concatenate([one - one.mean(axis=0) for one in curves])
    return bool((dependence(np.column_stack([curve, seen]))[-k:] > FOLLOWS).any())


def without(
    recordings: Sequence[Recording], given: str, wanted: str, moved: Sequence[Effect]
) -> list[Recording]:
    """Return recordings with the outputs corrected to mid-range of the other inputs."""
    ends = [float(end(one[given])) for one in recordings for end in (np.min, np.max)]
    middle, found = 0.5 * (min(ends) + max(ends)), []
    for one in recordings:
        output = one[wanted]
        for effect in moved:
            share = (one[effect.channel] - effect.low) / (effect.high - effect.low) - 0.5
            output = output - share * (
                effect.change + (effect.gain_change or 0.0) * (one[given] - middle)
            )
        found.append(one.with_channels({wanted: one.units[wanted]}, **{wanted: output}))
    return found
