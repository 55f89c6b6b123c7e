"""Counters that wrap: they jump by nearly a power of two of the column's steps, and go on from there.

A sawtooth, a released staircase and a square wave jump too. A counter is told by the size of its jumps,
and by what is left where they are undone: steps as just before and after, but for noise and a change of
speed.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from mckibben.arrays import Array, Rows
from mckibben.files.request import Source

SOON = 5
"""Rows after a jump of a drive in which an output may follow."""

FEWEST, MOST = 2.0**8, 2.0**32
"""Ranges of counters [steps]."""


def jumps_of(columns: Iterable[Array]) -> Rows:
    """Return the rows in which any column changes by more than half of its range."""
    result = []
    with np.errstate(over="ignore", invalid="ignore"):
        for values in columns:
            steps, width = np.abs(np.diff(values)), np.ptp(values) if values.size else 0.0
            result.append(np.flatnonzero(steps > 0.5 * width) + 1)
    return np.unique(np.concatenate([np.zeros(0, np.intp), *result]))


def unwrapped(channel: str, recorded: Array, jumps: Rows, source: Source) -> Array:
    """Return samples of which a counter that wraps goes on, with a note; others as they are.

    None that jumps with what drives it, in the rows ``jumps``, is a counter.
    """
    finite = np.flatnonzero(np.isfinite(recorded))
    corrections = wraps(recorded[finite])
    if corrections is None:
        return recorded
    size, upwards = corrections
    wrapped = finite[np.flatnonzero(upwards) + 1]
    after = wrapped[:, np.newaxis] - jumps
    if np.mean(np.any((after >= 0) & (after <= SOON), axis=1)) > 0.5:
        return recorded
    row = source.table.row(int(wrapped[0]))
    source.warn(
        f"channel {channel!r} jumps by almost {size:.6g}, first in row {row}, as a counter that wraps: "
        "it was made to go on; use `raw` where that was measured"
    )
    result = recorded.copy()
    result[finite] += size * np.cumsum([0.0, *upwards])
    return result


def wraps(values: Array) -> tuple[float, Array] | None:
    """Return the range of a counter that wraps, and its upward wraps at each of n - 1 steps.

    None where the n values, all finite, are not multiples of one step, also scaled and shifted, or do
    not wrap. Samples that repeat the one before, as of a slow counter, do not matter.
    """
    every = np.diff(values)
    moving = np.flatnonzero(every)
    steps = every[moving]
    sizes = np.abs(steps)
    largest, spread = float(sizes.max(initial=0.0)), float(np.ptp(values)) if values.size else 0.0
    usual = float(sizes[sizes <= largest / 2].max(initial=0.0))
    if not (0 < 5 * usual <= largest and spread < 2 * largest):
        return None
    for unit in quanta(values):
        size = unit * float(2.0 ** np.ceil(np.log2(largest / unit + 0.5)))
        jumps = sizes > size / 2
        upwards = -np.sign(steps) * jumps
        if (
            FEWEST <= np.rint(size / unit) <= MOST
            and spread < size - unit / 2
            and sizes[~jumps].max() <= 0.1 * size
            and _goes_on(steps + size * upwards, upwards, unit)
        ):
            at_each = np.zeros(every.size)
            at_each[moving] = upwards
            return size, at_each
    return None


def _goes_on(travel: Array, upwards: Array, unit: float) -> bool:
    """Return whether the steps of what was unwrapped are at its wraps as around them."""
    if np.ptp(np.cumsum(travel)) < 4 * np.abs(travel).max():
        return False  # a square wave
    wrapped = upwards != 0
    around = np.pad(travel, 1, mode="edge")
    before, after = around[:-2], around[2:]
    bends = travel - (before + after) / 2
    is_isolated = np.convolve(wrapped, np.ones(3), "same") < 0.5
    if not is_isolated.any():
        return False
    # small ones are noise even of what mostly moves, or stands and steps
    small = [np.quantile(np.abs(each[is_isolated]), 0.2) for each in (bends, 1.6 * travel)]
    rounding = 0.65 * unit
    noise = max(rounding, 4 * min(small))
    allowed = 1.5 * noise + 0.3 * np.abs(after - before) + 0.05 * np.abs(after + before)
    off, allowed = (bends * upwards)[wrapped], allowed[wrapped]
    weights = allowed**-2
    # the sample that crosses the end in noise is an extreme one, where it crosses back and forth too
    biased = 1.5 if np.ptp(upwards[wrapped]) else 0.3
    bias = unit / 2 + biased * (noise - rounding) + weights.sum() ** -0.5
    return bool(
        np.all(np.abs(off) <= 2 * allowed) and abs(np.average(off, weights=weights)) <= bias
    )


def quanta(values: Array) -> Iterator[float]:
    """Yield the steps of which the distances between values are multiples: of decimals, and rounded.

    >>> [round(step, 12) for step in quanta(np.array([0.0125, 0.05, 0.0375, 0.0875]))]
    [0.0125, 0.0125]
    """
    places = np.unique(values)
    floor = 16 * float(np.spacing(np.abs(places).max()))
    for decimals in range(10):
        counts = np.rint(places * 10.0**decimals)
        if np.abs(counts / 10.0**decimals - places).max() <= floor:
            if 0 < np.ptp(counts) < 2.0**62:
                yield float(np.gcd.reduce((counts - counts[0]).astype(np.int64))) / 10.0**decimals
            break
    distances = np.unique(np.concatenate([np.diff(places), places[1:] - places[0]]))
    rounded = _divisor(distances[distances > floor], floor)
    if rounded is not None:
        yield rounded


def _divisor(distances: Array, floor: float) -> float | None:
    """Return the step of which distances are multiples, but for a hundredth of it or so."""
    unit = divisor = least = float(distances[0]) if distances.size else 0.0
    reach = 4.0
    while unit > floor:
        # from small multiples, of which there is no doubt, to large ones, which make the step exact
        some = distances[distances <= reach * max(unit, least)]
        counts = np.rint(some / unit)
        misfits = some[np.abs(some - unit * counts) > 0.1 * unit][:8]
        if misfits.size:  # as Euclid's algorithm
            rests = np.abs(misfits - divisor * np.rint(misfits / divisor))
            remainders = rests[rests > 0.1 * divisor]
            unit = divisor = float(remainders.min() if remainders.size else rests.max())
            reach = 4.0
            continue
        unit = float(some @ counts / (counts @ counts))
        if some.size == distances.size:
            return unit
        reach *= 4.0
    return None
