"""What is not the muscle's own: other inputs that move meanwhile, and zeros that differ."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mckibben.characterization.evidence import KNOTS, hats
from mckibben.characterization.results import Effect
from mckibben.characterization.time_effects import held_within, holds
from mckibben.characterization.tracks import FEWEST, prepare
from mckibben.errors import DataError
from mckibben.recording import Recording
from mckibben.signals.zeroing import apart

MOST = 2000
"""Samples of a recording that are looked at for its level."""


def alone(
    recordings: Sequence[Recording], given: str, beside: Sequence[str]
) -> tuple[list[Recording], str]:
    """Return the stretches of recordings in which all other inputs rest, and a sentence on them.

    Raises
    ------
    DataError
        If an input is missing, or none moves alone.
    """
    resting = [np.ones(len(one), dtype=bool) for one in recordings]
    for name in beside:
        for rests, held in zip(resting, _held(recordings, name), strict=True):
            rests &= held
    found = [
        one.slice(start, stop)
        for one, rests in zip(recordings, resting, strict=True)
        for start, stop in _stretches(rests)
        if stop - start >= FEWEST
    ]
    others, verb = " and ".join(beside), "rests" if len(beside) == 1 else "rest"
    if not found or max(float(np.ptp(one[given])) for one in found) == 0:
        raise DataError(
            f"it never moves while {others} {verb}, so that what it does alone cannot be told",
            file=recordings[0].source,
            channel=given,
            remedy="record one in which it moves alone; models of several inputs need no such recording",
        )
    share = sum(map(len, found)) / sum(map(len, recordings))
    return found, f"Told where {others} {verb}, {100 * share:.0f} % of the samples."


def moves(recordings: Sequence[Recording], name: str) -> bool:
    """Tell whether a channel moves, in or between recordings, by more than white noise does."""
    seen = [one[name] for one in recordings]
    steps = np.concatenate([np.diff(one) for one in seen])
    return float(np.mean(steps**2)) < float(np.concatenate(seen).var())  # of noise it is twice that


def effects(
    recordings: Sequence[Recording], given: str, wanted: str, beside: Sequence[str]
) -> tuple[Effect, ...]:
    """Return how far other inputs move an output at equal input, each by one straight line.

    There are none where some move together.
    """
    seen = [one.matrix((given, wanted, *beside)) for one in recordings]
    every = np.concatenate([one[:: -(-len(one) // MOST)] for one in seen])
    lows, highs = every[:, 2:].min(axis=0).tolist(), every[:, 2:].max(axis=0).tolist()
    columns = np.column_stack([hats(every[:, 0], KNOTS), every[:, 2:]])
    slopes, _, rank, _ = np.linalg.lstsq(columns, every[:, 1], rcond=None)
    if rank < columns.shape[1]:
        return ()
    found = []
    others = slopes[columns.shape[1] - len(beside) :].tolist()
    for name, slope, low, high in zip(beside, others, lows, highs, strict=True):
        found.append(Effect(name, low, high, recordings[0].units[name], slope * (high - low)))
    return tuple(found)


def without(
    recordings: Sequence[Recording], wanted: str, moved: Sequence[Effect]
) -> list[Recording]:
    """Return recordings whose output is what it would be with other inputs amid their ranges."""
    found = []
    for one in recordings:
        output = one[wanted]
        for effect in moved:
            middle = (effect.low + effect.high) / 2
            output = output - effect.change * (one[effect.channel] - middle) / (
                effect.high - effect.low
            )
        found.append(one.with_channels({wanted: one.units[wanted]}, **{wanted: output}))
    return found


def levelled(recordings: Sequence[Recording], given: str, wanted: str) -> list[Recording]:
    """Return recordings whose outputs are one curve of the input as nearly as offsets make them."""
    u, y, owner = [], [], []
    for place, one in enumerate(recordings):
        every = -(-len(one) // MOST)
        u.append(one[given][::every])
        y.append(one[wanted][::every])
        owner.append(np.full(u[-1].size, place))
    x, places = np.concatenate(u), np.concatenate(owner)
    own = np.equal.outer(places, np.arange(len(recordings))).astype(np.float64)
    columns = np.column_stack([own, hats(x, KNOTS)])
    offsets = np.linalg.lstsq(columns, np.concatenate(y), rcond=None)[0][: len(recordings)]
    offsets -= offsets @ own.mean(axis=0)
    return [
        one.with_channels({wanted: one.units[wanted]}, **{wanted: one[wanted] - offset})
        for one, offset in zip(recordings, offsets.tolist(), strict=True)
    ]


def of_one_zero(
    recordings: Sequence[Recording], given: str, wanted: str
) -> tuple[list[Recording], str]:
    """Return recordings of one zero, and a sentence on zeros that differ; empty where they do not."""
    if not all(given in one and wanted in one for one in recordings):
        return list(recordings), ""
    found = apart(recordings, wanted, given)
    if found is None:
        return list(recordings), ""
    unit = recordings[0].units[wanted]
    return levelled(recordings, given, wanted), (
        f"The recordings rest at different {wanted}, from {found[0]:.3g} to {found[1]:.3g} {unit} where "
        f"{given} is lowest: each is counted from a zero of its own here, and models need it so, too "
        "(mckibben.signals.zeroed, --zero)."
    )


def _held(recordings: Sequence[Recording], name: str) -> list[NDArray[np.bool_]]:
    scale, tracks = prepare(recordings, name, name)
    found = []
    for track in tracks:
        held = np.zeros(track.u.size, dtype=bool)
        if np.ptp(track.u) <= held_within(track, scale):
            held[:] = True
        for start, stop in holds(track, scale):
            held[start:stop] = True
        found.append(held)
    return found


def _stretches(rests: NDArray[np.bool_]) -> list[tuple[int, int]]:
    steps = np.diff(np.concatenate([[0], rests.astype(np.int8), [0]]))
    return list(
        zip(np.flatnonzero(steps == 1).tolist(), np.flatnonzero(steps == -1).tolist(), strict=True)
    )
