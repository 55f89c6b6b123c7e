"""Levels at which recordings hold other inputs, such as a length or a load; each has its own loop."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mckibben.characterization.beside import held
from mckibben.characterization.tracks import FEWEST
from mckibben.recording import Recording

ALIKE = 0.02
"""Share of all that another input does within which levels are one."""


def conditions(recordings: Sequence[Recording], but: Sequence[str]) -> list[str]:
    """Return the channels that every recording holds, and not all of them at one level."""
    return [
        name
        for name in (recordings[0].channels if recordings else ())
        if name not in but
        and all(name in one and np.ptp(one[name]) == 0 for one in recordings)
        and len({float(one[name][0]) for one in recordings}) > 1
    ]


def levels_of(
    recordings: Sequence[Recording], given: str, wanted: str, beside: Sequence[str]
) -> list[list[int]]:
    """Return which recordings hold all other inputs alike: none where any moves in any.

    Without other inputs these are all. Left out are levels at which input or output never move, such as
    a length at which a muscle is slack.
    """
    if not beside:
        return [list(range(len(recordings)))]
    if not all(np.all(rests) for name in beside for rests in held(recordings, name)):
        return []
    seen = np.array([[float(one[name].mean()) for name in beside] for one in recordings])
    places = np.column_stack([_places(column) for column in seen.T])
    found = [
        np.flatnonzero((places == level).all(axis=1)).tolist()
        for level in np.unique(places, axis=0)
    ]
    return [level for level in found if _tells([recordings[k] for k in level], given, wanted)]


def _places(values: np.ndarray) -> np.ndarray:
    """Return the number of the level that each value is of, from the lowest."""
    places = np.zeros(values.size, dtype=int)
    begun, place = values.min(), 0
    for k in np.argsort(values, kind="stable"):
        if values[k] - begun > ALIKE * np.ptp(values):
            begun, place = values[k], place + 1
        places[k] = place
    return places


def _tells(recordings: Sequence[Recording], given: str, wanted: str) -> bool:
    return sum(map(len, recordings)) >= FEWEST and all(
        np.ptp(np.concatenate([one[name] for one in recordings])) > 0 for name in (given, wanted)
    )
