"""A fingerprint of the rows that a recording was read from, which all that is done to it later keeps.

Interpolation, another sample time, filters and zeros change every sample, so that two recordings no
longer show that some of their rows are the same. The rows as they stand in the files do. Of every
channel, hashes of stretches in which it moved are kept with their times: those that are the lowest
numbers, so that two files, or two parts of one, choose the same of what they share (a bottom-k sketch;
Broder, "On the resemblance and containment of documents", 1997).
"""

from __future__ import annotations

import base64
import binascii
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Array
from mckibben.recording import AT, ROWS, Recording

Hashes = NDArray[np.uint64]

STRETCH = 32
"""Movements of a channel in a row that are hashed, with the rows that it rested between them: the
noise of a sensor lets no two runs agree so long."""

FEWEST, MOST, SHARE = 256, 2048, 200
"""Hashes that are kept of a channel: one of so many stretches, within limits."""

TELLING, ALIKE = 8, 0.7
"""Stretches from which on samples there have to correlate by so much, whatever was filtered."""

DROPPED = np.uint64(36)
"""Low bits of a number that do not count: it is told to five significant digits."""

_ODD = np.uint64(0x9E3779B97F4A7C15)
_INVERSE = np.uint64(pow(int(_ODD), -1, 2**64))
_ENTRY = np.dtype([("hash", "<u8"), ("time", "<f8")])


@dataclass(frozen=True)
class SharedRows:
    """Rows that two recordings were both read from.

    Parameters
    ----------
    start, stop : float
        Times at which the first and the last shared stretch begin in the second recording [s]; rows
        without time.
    begins : float
        Where the first of them begins in the first.
    share : float
        Stretches that they share, over those of the one that has fewer.
    """

    start: float
    stop: float
    begins: float
    share: float


def fingerprint(channels: Mapping[str, Array], time: Array) -> dict[str, str]:
    """Return the hashes of the rows of a file, as text, for every channel that moves enough.

    A recording keeps them in ``meta`` with where it begins among them, whatever its own time is later.

    Parameters
    ----------
    channels : mapping of str to Array, shape (n,)
        As they stand in the file, in the units of the package; NaN where a value is missing.
    time : Array, shape (n,)
        In the time of the recording [s], or rows.
    """
    found = {}
    for name, samples in channels.items():
        whole = np.flatnonzero(np.isfinite(samples))
        finite = samples[whole]
        moved = np.flatnonzero(finite[1:] != finite[:-1]) + 1
        n = moved.size - STRETCH + 1
        if n < 1:
            continue
        told = np.ascontiguousarray(finite[moved] + 0.0).view(np.uint64)  # -0 is 0
        told = (told + (np.uint64(1) << (DROPPED - np.uint64(1)))) >> DROPPED
        rested = np.diff(moved, prepend=moved[0]).astype(np.uint64)
        powers = np.multiply.accumulate(np.full(moved.size, _ODD))
        sums = np.concatenate([[np.uint64(0)], np.cumsum(mixed(mixed(told) + rested) * powers)])
        # powers count from where a stretch begins
        hashes = mixed(
            (sums[STRETCH:] - sums[:-STRETCH]) * np.multiply.accumulate(np.full(n, _INVERSE))
        )
        most = min(max(n // SHARE, FEWEST), MOST)
        lowest = np.argpartition(hashes, min(4 * most, n) - 1)[: 4 * most]  # some may repeat
        _, first = np.unique(hashes[lowest], return_index=True)
        chosen = lowest[first[:most]]
        entries = np.empty(chosen.size, dtype=_ENTRY)
        entries["hash"], entries["time"] = hashes[chosen], time[whole[moved[chosen]]]
        found[name] = base64.b64encode(entries.tobytes()).decode()
    return found


def pairs_of_one_row(
    recordings: Sequence[Recording], channels: Sequence[str]
) -> list[tuple[int, int]]:
    """Return the places of recordings that have a stretch of some channel in common, in order.

    Parameters
    ----------
    recordings : sequence of Recording
    channels : sequence of str
        Such as the outputs.
    """
    found = set()
    for name in channels:
        owners: dict[int, set[int]] = {}
        for place, recording in enumerate(recordings):
            for code in _entries(recording, name)["hash"].tolist():
                owners.setdefault(code, set()).add(place)
        shared = {tuple(sorted(some)) for some in owners.values() if len(some) > 1}
        found |= {pair for some in shared for pair in combinations(some, 2)}
    return sorted(found)


def shared_rows(
    first: Recording, second: Recording, inputs: Sequence[str], outputs: Sequence[str]
) -> SharedRows | None:
    """Return what two recordings were both read from, where some outputs moved, or None.

    A coarse sensor may give the same in two runs. Where the inputs have noise of their own, it does not.

    Parameters
    ----------
    first, second : Recording
        Parts of what was read, or the whole; recordings that were not read have no rows.
    inputs, outputs : sequence of str
        Channels.
    """
    given = [_shared(first, second, name) for name in inputs]
    told = [rows for rows, known in given if known]
    if told and not any(told):
        return None
    found = [rows for rows, _ in (_shared(first, second, name) for name in outputs) if rows]
    return max(found, key=lambda rows: rows.share, default=None)


def _shared(first: Recording, second: Recording, name: str) -> tuple[SharedRows | None, bool]:
    """Return what is shared by one channel, and whether both have rows of it."""
    one, other = _entries(first, name), _entries(second, name)
    if not (one.size and other.size):
        return None, False
    last = min(one["hash"].max(), other["hash"].max())  # below it, both kept all that they have
    one, other = (each[each["hash"] <= last] for each in (one, other))
    _, mine, yours = np.intersect1d(one["hash"], other["hash"], return_indices=True)
    if mine.size == 0 or not _agree(
        _at(first, name, one["time"][mine]), _at(second, name, other["time"][yours])
    ):
        return None, True
    begins, times = one["time"][mine], other["time"][yours]
    start, share = int(times.argmin()), mine.size / min(one.size, other.size)
    return SharedRows(float(times[start]), float(times.max()), float(begins[start]), share), True


def _at(recording: Recording, name: str, time: Array) -> Array:
    return np.interp(time, recording.time, recording[name])


def _agree(some: Array, others: Array) -> bool:
    """Tell whether samples are those that were read still, and not put under what is known of them."""
    if some.size < TELLING or min(np.ptp(some), np.ptp(others)) == 0:
        return True
    return bool(abs(np.corrcoef(some, others)[0, 1]) > ALIKE)


def _entries(recording: Recording, channel: str) -> NDArray[np.void]:
    """Return the hashes of stretches that begin within a recording; none of what is damaged.

    Their times are the recording's own.
    """
    kept = recording.meta.get(ROWS)
    text, at = (kept.get(channel), kept.get(AT)) if isinstance(kept, Mapping) else (None, None)
    try:
        entries = np.frombuffer(base64.b64decode(str(text or ""), validate=True), dtype=_ENTRY)
    except (ValueError, binascii.Error):
        entries = np.empty(0, dtype=_ENTRY)
    entries = entries.copy()
    entries["time"] += recording.start_time - (at if isinstance(at, int | float) else np.nan)
    half = 0.5 * (recording.sample_time or 1.0)
    time = entries["time"]
    begun = (time >= recording.start_time - half) & (time < float(recording.time[-1]) + half)
    within: NDArray[np.void] = entries[begun]
    return within


def mixed(code: Hashes) -> Hashes:
    """Return codes scrambled, each to another one (the finalizer of splitmix64)."""
    code = code + _ODD
    code = (code ^ (code >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    code = (code ^ (code >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return code ^ (code >> np.uint64(31))
