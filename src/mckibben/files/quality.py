"""What is wrong with samples: codes for missing ones, wraps, outliers, impossible values."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Array
from mckibben.files.headers import unit_of
from mckibben.files.request import Source
from mckibben.files.units import SPELLINGS, convert

Mask = NDArray[np.bool_]

POSSIBLE: dict[str, tuple[float, float]] = {
    "bar": (-1.1, 60.0),
    "mm": (-2e4, 2e4),
    "N": (-1e6, 1e6),
    "s": (-1e11, 1e11),
    "rad": (-1e4, 1e4),
    "V": (-1e3, 1e3),
    "mm/s": (-1e5, 1e5),
    "degC": (-100.0, 1e3),
    "": (-1e4, 1e4),
}
"""Package unit -> lowest and highest value of a standard channel; others are in another unit."""

SMALLEST_BAR, ZERO_BAR = 1e-7, 1e-12
"""A pressure whose largest value lies between these [bar] is in another unit, not the rounding of 0."""

DOUBTFUL = {"bar": 0.6, "mm": 0.5}
"""Package unit -> size below which a channel without a unit may well be in another."""

TYPICAL = {"bar": 5.0, "mm": 30.0, "N": 300.0, "s": 1.7e9, "rad": 1.0, "V": 5.0, "mm/s": 100.0}
"""Package unit -> common size of measurements, by which another unit is proposed (times: since 1970)."""

CODES = (0.0, *(10.0**k - 1 for k in range(3, 8)), 2.0**15 - 1, 2.0**16 - 1, 9.91e37)
"""Sizes that instruments write for a missing sample; 0 only where the other samples exclude it."""

FEWEST = 10
"""Fewest other samples by which a code can be distinguished from a measurement."""

JUMP = 5.0
"""Steps to and from a code, over the largest step between other samples."""

SHARE = 0.25
"""Largest share of zeros that can be codes."""

WRAPS = (2.0**8, 2.0**16)
"""Range of integer counters, which begin anew beyond it."""

LONE, FAR = 3, 1.0
"""Longest run of samples that is an outlier, and its distance from the others over their range."""


def runs(mask: Mask) -> NDArray[np.intp]:
    """Return the first of each run of true values and the first after it, shape (m, 2)."""
    return np.flatnonzero(np.diff(mask.astype(np.int8), prepend=0, append=0)).reshape(-1, 2)


def without_codes(channel: str, values: Array, recorded: Array, source: Source) -> Array:
    """Return the samples of a channel, NaN where the file has a code for a missing one.

    Parameters
    ----------
    channel : str
    values : numpy.ndarray, shape (n,)
    recorded : numpy.ndarray, shape (n,)
        The same as in the file, where codes are round numbers.
    source : Source

    Raises
    ------
    DataError
        If an integer counter wraps.

    Warns
    -----
    DataWarning
        Of codes.
    """
    finite = np.isfinite(recorded)
    wrap = _wrap(recorded[finite])
    if wrap is not None:
        at, size = wrap
        raise source.error(
            f"it jumps by almost {size:.0f} there: an integer counter that wraps",
            f"add {size:.0f} after each wrap, or name another column with --column {channel}=COLUMN",
            channel,
            int(np.flatnonzero(finite)[at]),
        )
    coded = np.isin(recorded, list(_codes(recorded[finite])))
    if not coded.any():
        return values
    found = ", ".join(f"{value:g}" for value in np.unique(recorded[coded]))
    source.warn(
        f"channel {channel!r}: {coded.sum()} sample(s) are {found}, a code for missing ones "
        f"(first in row {source.table.row(int(np.argmax(coded)))})"
    )
    return np.where(coded, np.nan, values)


def note_outliers(channel: str, values: Array, source: Source) -> None:
    """Note samples in short runs far from all others, which may be measured."""
    outliers = _outliers(values)
    if outliers.size:
        first = int(outliers[0])
        source.warn(
            f"channel {channel!r}: {outliers.size} outlier(s), the first of {values[first]:.6g} in row "
            f"{source.table.row(first)}; correct or blank cells that were not measured"
        )


def refuse_impossible(channel: str, values: Array, read_in: str, source: Source) -> None:
    """Refuse values of a standard channel or of time that no rig has.

    Parameters
    ----------
    channel : str
    values : numpy.ndarray, shape (n,)
        In the package's unit; those that are not finite are passed over.
    read_in : str
        The unit that they were read in.
    source : Source

    Raises
    ------
    DataError
        With the value and the row, and the unit that fits in the remedy.
    """
    target = unit_of(channel)
    if target not in POSSIBLE or not values.size:
        return
    low, high = POSSIBLE[target]
    least, largest = float(values.min()), float(values.max())
    tiny = target == "bar" and max(-least, largest) < SMALLEST_BAR
    if low <= least and largest <= high and not tiny:
        return  # as nearly always, without a copy; NaN fails the comparison
    sizes = np.where(np.isfinite(values), values, 0.0)
    outside = np.maximum(sizes - high, low - sizes)
    at = int(np.argmax(outside if outside.max() > 0 else np.abs(sizes)))
    if outside[at] <= 0 and not (target == "bar" and ZERO_BAR < abs(sizes[at]) < SMALLEST_BAR):
        return
    fitting = fitting_units(values[at], read_in, target)
    options = " or ".join(f"--unit {channel}={unit}" for unit in fitting[:2])
    problem = f"{values[at]:.6g} {target} is impossible: is it in {fitting[0]}?"
    raise source.error(
        problem, f"name its unit, as in {options}, or correct that cell", channel, at
    )


def fitting_units(value: float, read_in: str, target: str) -> list[str]:
    """Return the units in which a value is of a common size, the nearest first."""
    read = convert(np.array([abs(value)]), target, read_in)
    sizes = {unit: float(convert(read, unit, target)[0]) for unit in SPELLINGS[target]}
    typical = math.log(TYPICAL.get(target, 1.0))
    off = {unit: abs(math.log(max(size, 1e-300)) - typical) for unit, size in sizes.items()}
    nearest, *others = sorted(off, key=lambda unit: off[unit])
    return [nearest, *(unit for unit in others if off[unit] < math.log(10.0))]


def _codes(known: Array) -> Iterator[float]:
    """Return the codes for missing samples among values as recorded."""
    if known.size <= FEWEST:
        return
    for code in {sign * size for size in CODES for sign in (1.0, -1.0)}:
        at = known == code
        others = known[~at]
        if not at.any() or others.size < FEWEST:
            continue
        low, high = float(others.min()), float(others.max())
        far = max(code - high, low - code) > high - low > 0  # of two levels, neither is a code
        if far if code else _excluded(at, known):
            yield code


def _excluded(at: Mask, known: Array) -> bool:
    """Tell whether zeros are far from what is measured just before and after each run of them."""
    if at[0] or at[-1] or at.mean() > SHARE:
        return False
    steps = np.abs(np.diff(known))
    edges = at[1:] != at[:-1]
    inside = steps[~at[1:] & ~at[:-1]]
    # a signal of levels moves by jumps alone; one that is measured, by steps of all sizes
    return bool(
        inside.size
        and np.count_nonzero(inside) > inside.size / 2
        and steps[edges].min() / JUMP > inside.max()
    )


def _wrap(known: Array) -> tuple[int, float] | None:
    """Return the first sample after a wrap of integers, and the size of their range."""
    steps = np.diff(known)
    largest = float(np.abs(steps).max()) if steps.size else 0.0
    for size in WRAPS:
        if not 0.9 * size < largest < size or np.ptp(known) >= size:
            continue
        jumps = np.abs(steps) > 0.9 * size
        others = steps[~jumps]
        unwrapped = steps[jumps] - np.sign(steps[jumps]) * size
        if (
            others.size > FEWEST
            and np.count_nonzero(others) > others.size / 2
            and np.array_equal(known, np.rint(known))
            and np.abs(unwrapped).max() <= 2 * np.abs(others).max() < 0.2 * size
        ):
            return int(np.argmax(jumps)) + 1, size
    return None


def _outliers(values: Array) -> NDArray[np.intp]:
    """Return the samples of short runs far from all others."""
    finite = np.flatnonzero(np.isfinite(values))
    if finite.size < 10 * FEWEST:
        return finite[:0]
    known = values[finite]
    low, high = np.quantile(known, (0.01, 0.99))
    beyond = np.maximum(known - high, low - known) > FAR * (high - low)
    if high == low or not beyond.any():
        return finite[:0]
    edges = runs(beyond)
    alone = (edges[:, 1] - edges[:, 0] <= LONE) & (edges[:, 0] > 0) & (edges[:, 1] < known.size)
    return finite[[k for start, stop in edges[alone] for k in range(start, stop)]]
