"""Shared rows of recordings: copies, slices, or a file given twice.

Two runs of one experiment never agree, to rounding, over many movements of the output. Of rests only the
length counts. Copies that were resampled, filtered or zeroed hold other numbers, and are not found.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from mckibben.arrays import Array
from mckibben.errors import DataError
from mckibben.recording import Recording

WINDOW = 64
"""Number of consecutive output changes that must agree; half of that of short recordings."""

FEWEST_CHANGES = 8
"""Number of output changes below which recordings are not compared."""

ROUNDING = 2e-4
"""Rounding of values, relative to the largest magnitude of a channel over all recordings."""

GRAVE = 0.05
"""Share of equal windows, in the recording with fewer of them, above which two recordings share
data.
"""

COPY_SHARE = 1.0 - GRAVE
"""Shared part of the motion above which a recording counts as a copy of an earlier one."""

_WEIGHTS = np.random.default_rng(0).integers(2**64, size=1024, dtype=np.uint64)  # any will do


class Shared(NamedTuple):
    """Shared part of a recording and an earlier one in a list.

    Parameters
    ----------
    first, second : int
        Places of the two in the list; ``first`` is the lower.
    start, stop : float
        Times in the second between which the common rows lie [s]; samples without time.
    start_in_first : float
        Time of the first of these rows in the first.
    share : float
        Movements within windows that are in both, over those of the recording that has fewer.
    """

    first: int
    second: int
    start: float
    stop: float
    start_in_first: float
    share: float


def shared_rows(
    recordings: Sequence[Recording], inputs: Sequence[str], outputs: Sequence[str]
) -> list[Shared]:
    """Return recordings that share data: rows in which all channels agree while an output moves."""
    if len(recordings) < 2:
        return []
    moves = _movements(recordings, inputs, outputs)
    counts = np.array([codes.size for _, codes in moves], dtype=np.int64)
    lengths = np.where(counts < FEWEST_CHANGES, 0, np.clip(counts // 2, FEWEST_CHANGES, WINDOW))
    shared = []
    for length in np.unique(lengths[lengths > 0]):
        # a number for every window of so many output changes
        windows = [
            np.convolve(codes, _WEIGHTS[:length], "valid") if codes.size >= length else codes[:0]
            for _, codes in moves
        ]

        # the share of windows that each two recordings have in common
        owners = np.repeat(np.arange(len(windows)), [codes.size for codes in windows])
        distinct, indices = np.unique(np.concatenate(windows), return_inverse=True)
        shape = distinct.size, len(windows)
        present = csr_array((np.ones(owners.size), (indices, owners)), shape=shape)
        present.data[:] = 1.0  # however often a periodic motion repeats
        common = (present.T @ present).toarray()
        fewer = np.minimum.outer(common.diagonal(), common.diagonal())
        window_share = np.triu(common / np.maximum(fewer, 1.0), 1)
        window_share[np.minimum.outer(lengths, lengths) != length] = 0.0

        # where the common windows lie, and what share of the motion they cover
        for first, second in np.argwhere(window_share >= GRAVE).tolist():
            one, other = windows[first], windows[second]
            masks = [np.isin(one, other), np.isin(other, one)]
            covered = [np.mean(np.convolve(same, np.ones(length)) > 0.5) for same in masks]
            motion_share = float(max(covered))
            same = np.flatnonzero(masks[1])
            start, stop = moves[second][0][[same[0], same[-1] + length - 1]].tolist()
            start_in_first = float(moves[first][0][np.argmax(one == other[same[0]])])
            shared.append(Shared(first, second, start, stop, start_in_first, motion_share))
    return sorted(shared)


def check_shared(
    roles: Mapping[str, Sequence[Recording]],
    inputs: Sequence[str],
    outputs: Sequence[str],
    *,
    allow: bool | None = None,
) -> tuple[str, ...]:
    """Raise an error if recordings share data, or return statements about it.

    Parameters
    ----------
    roles : mapping of str to sequence of Recording
        What each is for: "fit", "validate", "calibrate", "test" in this order, or one other verb.
    allow : bool, optional
        Whether not to refuse; None where users have no such option.

    Raises
    ------
    DataError
        If they share data, and that is not allowed.
    """
    listed = [(role, recording) for role, some in roles.items() for recording in some]
    shares = shared_rows([recording for _, recording in listed], inputs, outputs)
    sentences = tuple(_sentence(shared, listed) for shared in shares)
    if shares and not allow:
        remedy = "drop the copy, or cut the stretch out of one of them"
        if allow is not None:
            remedy += (
                "; or, if the runs are distinct (a coarse sensor may read the same in both), give "
                "`allow_shared`: every result states it"
            )
        raise DataError(sentences[0], file=listed[shares[0].second][1].source, remedy=remedy)
    return tuple(f"{sentence}." for sentence in sentences)


def without_copies(
    recordings: Sequence[Recording], inputs: Sequence[str], outputs: Sequence[str]
) -> list[Recording]:
    """Return recordings without those that are nearly contained in an earlier one."""
    shares = shared_rows(recordings, inputs, outputs)
    copies = {shared.second for shared in shares if shared.share > COPY_SHARE}
    return [recording for k, recording in enumerate(recordings) if k not in copies]


def _sentence(shared: Shared, listed: Sequence[tuple[str, Recording]]) -> str:
    (role, one), (other_role, other) = listed[shared.first], listed[shared.second]
    names = [one.name, other.name]
    if one.name == other.name and one.source != other.source:
        names = [f"{each.name} ({each.source})" for each in (one, other)]
    unit = "samples" if other.sample_time is None else "s"
    start, stop = shared.start - other.start_time, shared.stop - other.start_time
    verb = {"validate": "validated", "calibrate": "calibrated"}.get(other_role, "tested")
    what = f"{verb} on data that it was {'fitted to' if role == 'fit' else 'chosen by'}"
    if role == other_role:
        what = f"the same samples would be used twice to {role}"
    start_in_first = shared.start_in_first - one.start_time
    return (
        f"{what}: {start:.6g} to {stop:.6g} {unit} after the start of {names[1]} are those of "
        f"{names[0]} from {start_in_first:.6g} {unit} on, {100 * shared.share:.0f} % of "
        "the shorter one's motion"
    )


def _movements(
    recordings: Sequence[Recording], inputs: Sequence[str], outputs: Sequence[str]
) -> list[tuple[Array, NDArray[np.uint64]]]:
    """Return the times of output changes in each, and hashes of the rows there and before."""
    columns = [recording.matrix([*outputs, *inputs]) for recording in recordings]
    largest = np.max(
        [abs(one).max(axis=0) for one in columns], axis=0, initial=np.finfo(float).tiny
    )
    result = []
    for recording, samples in zip(recordings, columns, strict=True):
        # the offset is irrational, so that round decimals are no ties
        rounded = np.floor(samples / largest / ROUNDING + 0.5**0.5).astype(np.int64)
        moves = (np.diff(rounded[:, : len(outputs)], axis=0) != 0).any(axis=1)
        rows = np.flatnonzero(moves) + 1
        hashed = np.column_stack([np.diff(rows), rounded[rows[1:]]]).astype(np.uint64)
        result.append((recording.time[rows[1:]], hashed @ _WEIGHTS[-hashed.shape[1] :]))
    return result
