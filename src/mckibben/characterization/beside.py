"""What is not the muscle's own: other inputs that move meanwhile, and zeros that differ."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mckibben.characterization.evidence import KNOTS, hats
from mckibben.characterization.results import Effect
from mckibben.characterization.time_effects import held_within, holds
from mckibben.characterization.tracks import FEWEST, prepare
from mckibben.recording import Recording
from mckibben.signals.zeroing import apart, zeroed

MOST = 2000
"""Samples of a recording that are looked at for its level."""


def alone(recordings: Sequence[Recording], given: str, beside: Sequence[str]) -> list[Recording]:
    """Return the stretches in which all other inputs rest; none if the input moves in none of them."""
    still = [np.ones(len(one), dtype=bool) for one in recordings]
    for name in beside:
        for rests, at in zip(still, held(recordings, name), strict=True):
            rests &= at
    found = [
        one.slice(start, stop)
        for one, rests in zip(recordings, still, strict=True)
        for start, stop in _stretches(rests)
        if stop - start >= FEWEST
    ]
    return found if any(np.ptp(one[given]) > 0 for one in found) else []


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
    recordings: Sequence[Recording], given: str, wanted: str, alike: Sequence[Sequence[int]]
) -> tuple[list[Recording], str]:
    """Return recordings of one zero, and a sentence on zeros that differ; empty where they do not.

    They differ where some that should be alike rest apart.
    """
    known = all(given in one and wanted in one for one in recordings)
    parts = [[recordings[k] for k in places] for places in alike if known]
    found = [ends for part in parts if (ends := apart(part, wanted, given)) is not None]
    if not found:
        return list(recordings), ""
    low, high = min(ends[0] for ends in found), max(ends[1] for ends in found)
    return [zeroed(one, [wanted], given) for one in recordings], (
        f"The recordings rest at different {wanted}, from {low:.3g} to {high:.3g} "
        f"{recordings[0].units[wanted]} where {given} is lowest: each is counted from a zero of its own "
        f"here, and models need it so, too: --zero {wanted} (mckibben.signals.zeroed)."
    )


def held(recordings: Sequence[Recording], name: str) -> list[NDArray[np.bool_]]:
    """Return where an input rests in every recording."""
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
