"""What is wrong with samples: codes for missing ones, wraps, outliers, impossible values."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Array
from mckibben.files.headers import unit_of
from mckibben.files.notices import listed
from mckibben.files.request import Source
from mckibben.files.units import SPELLINGS, convert

Mask = NDArray[np.bool_]


class Plausible(NamedTuple):
    """Values of a standard channel or of time; others are in another unit.

    ``typical`` is a common size, by which another unit is proposed; a channel without a unit that
    reaches less than ``least`` or more than ``most`` may well be in another.
    """

    low: float
    high: float
    typical: float = 1.0
    least: float = 0.0
    most: float = math.inf


PLAUSIBLE = {
    "bar": Plausible(-1.1, 60.0, 5.0, 0.6, 12.0),
    "mm": Plausible(-2e4, 2e4, 30.0, 0.5, 3e3),
    "N": Plausible(-1e6, 1e6, 300.0),
    "s": Plausible(-1e11, 1e11, 1.7e9),  # since 1970
    "rad": Plausible(-1e4, 1e4, 1.0, 0.0, 7.0),
    "V": Plausible(-1e3, 1e3, 5.0),
    "mm/s": Plausible(-1e5, 1e5, 100.0),
    "degC": Plausible(-100.0, 1e3),
    "": Plausible(-1e4, 1e4, 0.2, 0.0, 1.5),
}
"""By the package's unit."""

SMALLEST_BAR, ZERO_BAR = 1e-7, 1e-12
"""A pressure whose largest value lies between these [bar] is in another unit, not the rounding of 0."""

CODES = (0.0, *(10.0**k - 1 for k in range(3, 8)), 2.0**15 - 1, 2.0**16 - 1)
"""Sizes that instruments write for a missing sample; 0 only where the other samples exclude it."""

FEWEST = 10
"""Fewest other samples by which a code can be distinguished from a measurement."""

JUMP = 5.0
"""Steps to and from a code, over the largest step between other samples."""

SHARE = 0.25
"""Largest share of samples that can be zeros, or ends of a range, for missing ones."""

HUGE = 1e30
"""Size beyond which a number is a code, whatever the channel."""

WRAPS = (2.0**8, 2.0**16)
"""Range of integer counters, which begin anew beyond it."""

LONE, FAR = 3, 1.0
"""Longest run of samples that is an outlier, and its distance from the others over their range."""


def runs(mask: Mask) -> NDArray[np.intp]:
    """Return the first of each run of true values and the first after it, shape (m, 2)."""
    return np.flatnonzero(np.diff(mask.astype(np.int8), prepend=0, append=0)).reshape(-1, 2)


def refuse_wraps(channel: str, recorded: Array, source: Source) -> None:
    """Refuse samples, as in the file, of an integer counter that wraps."""
    finite = np.isfinite(recorded)
    known = recorded[finite]
    steps = np.diff(known)
    largest = float(np.abs(steps).max()) if steps.size else 0.0
    for size in WRAPS:
        if not 0.9 * size < largest < size or np.ptp(known) >= size:
            continue
        jumps = np.abs(steps) > 0.9 * size
        others = steps[~jumps]
        unwrapped = steps[jumps] - np.sign(steps[jumps]) * size
        if (
            np.count_nonzero(others) > FEWEST
            and np.array_equal(known, np.rint(known))
            and np.abs(unwrapped).max() <= 2 * np.abs(others).max() < 0.2 * size
        ):
            raise source.error(
                f"it jumps by almost {size:.0f} there: an integer counter that wraps",
                f"add {size:.0f} after each wrap, or name another column with --column "
                f"{channel}=COLUMN",
                channel,
                int(np.flatnonzero(finite)[np.argmax(jumps) + 1]),
            )


def without_codes(channel: str, values: Array, recorded: Array, source: Source) -> Array:
    """Return samples, NaN where the file has a code for a missing one, with a note.

    Codes are round numbers as ``recorded`` in the file, not in the package's unit.
    """
    known = recorded[np.isfinite(recorded)]
    signed = {sign * size for size in CODES for sign in (1.0, -1.0)}
    coded = np.isin(recorded, [code for code in signed if _is_code(code, known)])
    zero = coded & (recorded == 0)
    if zero.any() and _moves_with(zero, source):
        coded &= ~zero
    huge = (np.abs(recorded) > HUGE) & np.isfinite(recorded)
    if np.count_nonzero(~huge) >= FEWEST:  # SCPI's for not a number, and for beyond the range
        coded |= huge
    if not coded.any():
        return values
    found = listed([f"{value:g}" for value in np.unique(recorded[coded])], most=5)
    source.warn(
        f"channel {channel!r}: {coded.sum()} sample(s) are {found}, a code for missing ones "
        f"(first in row {source.table.row(int(np.argmax(coded)))})"
    )
    return np.where(coded, np.nan, values)


def note_outliers(channel: str, values: Array, source: Source) -> None:
    """Note samples in short runs far from all others, which may be measured."""
    finite = np.flatnonzero(np.isfinite(values))
    if finite.size < 10 * FEWEST:
        return
    known = values[finite]
    low, high = np.quantile(known, (0.01, 0.99))
    first, after = runs(np.maximum(known - high, low - known) > FAR * (high - low)).T
    lone = (after - first <= LONE) & (first > 0) & (after < known.size)
    if high > low and lone.any():
        n, at = np.sum((after - first)[lone]), int(finite[first[lone][0]])
        source.warn(
            f"channel {channel!r}: {n} outlier(s), the first of {values[at]:.6g} in row "
            f"{source.table.row(at)}; correct or blank cells that were not measured"
        )


def refuse_impossible(channel: str, values: Array, read_in: str, source: Source) -> None:
    """Refuse values of a standard channel or of time that no rig has, and propose a unit.

    Parameters
    ----------
    values : numpy.ndarray, shape (n,)
        In the package's unit; those that are not finite are passed over.
    read_in : str
        The unit that they were read in.
    """
    target = unit_of(channel)
    if target not in PLAUSIBLE or not values.size:
        return
    low, high, *_ = PLAUSIBLE[target]
    least, largest = float(values.min()), float(values.max())
    smallest = SMALLEST_BAR if target == "bar" else 0.0
    if low <= least and largest <= high and max(-least, largest) >= smallest:
        return  # as nearly always, without a copy; NaN fails the comparison
    sizes = np.where(np.isfinite(values), values, 0.0)
    outside = np.maximum(sizes - high, low - sizes)
    at = int(np.argmax(outside if outside.max() > 0 else np.abs(sizes)))
    if outside[at] <= 0 and not ZERO_BAR < abs(sizes[at]) < smallest:
        return
    units = fitting_units(values[at], read_in, target)
    options = " or ".join(f"--unit {channel}={unit}" for unit in units[:2])
    problem = f"{values[at]:.6g} {target} is impossible: is it in {units[0]}?"
    remedy = f"name its unit, as in {options}, or correct that cell"
    raise source.error(problem, remedy, channel, at)


def fitting_units(value: float, read_in: str, target: str) -> list[str]:
    """Return the units in which a value is of a common size, the nearest first."""
    read = convert(np.array([abs(value)]), target, read_in)
    sizes = {unit: float(convert(read, unit, target)[0]) for unit in SPELLINGS[target]}
    typical = math.log(PLAUSIBLE[target].typical)
    off = {unit: abs(math.log(max(size, 1e-300)) - typical) for unit, size in sizes.items()}
    nearest, *others = sorted(off, key=lambda unit: off[unit])
    return [nearest, *(unit for unit in others if off[unit] < math.log(10.0))]


def _moves_with(at: Mask, source: Source) -> bool:
    """Return whether another column jumps where runs of samples begin and end: they were measured."""
    edges = at[1:] != at[:-1]
    for column in source.table.columns:
        if column.values is None or column.values.size != at.size or not column.values[at].any():
            continue
        steps = np.abs(np.diff(column.values))
        if np.median(steps[edges]) > JUMP * np.quantile(steps[~edges], 0.95):
            return True
    return False


def _is_code(code: float, known: Array) -> bool:
    """Return whether a number is a code for missing samples among those as recorded."""
    at = known == code
    others = known[~at]
    if not at.any() or others.size < FEWEST:
        return False
    steps = np.abs(np.diff(known))
    inside = steps[~at[1:] & ~at[:-1]]
    jump = float(steps[at[1:] != at[:-1]].min())
    low, high = float(others.min()), float(others.max())
    far = max(code - high, low - code) > high - low > 0  # of two levels, neither is a code
    # a signal of levels moves by jumps alone; one that is measured, by steps of all sizes
    smooth = bool(inside.size) and np.count_nonzero(inside) > inside.size / 2
    apart = smooth and at.mean() <= SHARE and jump / JUMP > inside.max()
    if code > 0:
        return far and apart
    if code < 0:
        return far or (apart and int(np.diff(runs(at)).max()) <= LONE)
    return apart and not (at[0] or at[-1])
