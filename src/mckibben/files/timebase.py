"""From the times of the samples, as recorded, to one uniform time grid."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Array
from mckibben.files.headers import snake_case
from mckibben.files.notices import listed
from mckibben.files.request import Source

Span = tuple[int, int]
"""Samples from the first to, not including, the second."""

GAP = 3.0
"""Steps longer than this many median steps are gaps; shorter ones are jitter."""

WRAPS = (2.0**8, 2.0**16, 2.0**32)
"""Counts after which integer counters begin anew."""

RATES = ("fs", "Fs", "sample_rate", "sampling_frequency")
"""Names of samples per second [Hz]."""

STEPS = ("Ts", "dt", "sample_time")
"""Names of seconds per sample."""

_SINCE_1970 = {"ms": (1e12, 4.2e12), "us": (1e15, 4.2e15), "ns": (1e18, 4.2e18)}
"""Unit -> counts of it since 1970 in the years 2001 to 2103."""

_DAYS = ((15_000.0, 80_000.0), (693_000.0, 800_000.0))
"""Days since 1900, of spreadsheets, and since year 0, of MATLAB, in the years 1941 to 2119 or so."""

_SHORT = 0.999e-3
"""Steps of numbers as large as such days that may be days; longer ones are hardly of a muscle."""


@dataclass(frozen=True)
class Step:
    """A time step, and how far the recorded steps are from it.

    Parameters
    ----------
    size : float
        In the unit of the times.
    jitter : (float, float) or None
        Root mean square and largest deviation of a step; None where every time is on the grid
        within the digits that were recorded.
    """

    size: float
    jitter: tuple[float, float] | None


def checked(time: Array, source: Source) -> Array:
    """Return times that rise: counters that wrap go on, and other times that do not rise are refused.

    Raises
    ------
    DataError
        If a time is missing, repeated or goes back, with the row.
    """
    missing = np.flatnonzero(~np.isfinite(time))
    if missing.size:
        problem = f"the time is missing in {missing.size} row(s)"
        remedy = "fill it in or delete the row; or delete the column and give --rate"
        raise source.error(problem, remedy, "time", int(missing[0]))
    time = _unwrapped(time, source)
    steps = np.diff(time)
    wrong = np.flatnonzero(steps <= 0)
    if not wrong.size:
        return time
    at = int(wrong[0])
    if steps[at] == 0:
        problem = (
            f"the time {time[at]:.10g} is repeated ({np.sum(steps == 0)} repetition(s) in all)"
        )
        remedy = "delete the repeated row; or, where times were rounded when saved, give --rate"
    else:
        problem = f"the time goes back from {time[at]:.10g} to {time[at + 1]:.10g}"
        remedy = "split the file there, or sort its rows by time"
    raise source.error(problem, remedy, "time", at + 1)


def _unwrapped(time: Array, source: Source) -> Array:
    """Return times of an integer counter that goes on where it wrapped, with a note."""
    steps = np.diff(time)
    back = steps < 0
    if not back.any() or not np.array_equal(time, np.rint(time)):
        return time
    usual = float(np.median(steps[~back])) if not back.all() else 0.0
    for size in WRAPS:
        on = steps[back] + size
        if time.min() >= 0 and time.max() < size and np.all((on > 0) & (on <= GAP * usual)):
            row = source.table.row(int(np.argmax(back)) + 1)
            source.warn(f"the time wraps at {size:.0f}, first in row {row}, and was unwrapped")
            found: Array = time + size * np.concatenate([[0], np.cumsum(back)])
            return found
    return time


def stated_step(source: Source) -> float | None:
    """Return the sample time [s] by scalars beside the samples such as ``fs = 50``, with a note.

    Raises
    ------
    DataError
        If one is no positive finite number, or two contradict each other.
    """
    rates = source.table.rates
    if not rates:
        return None
    said = listed([f"{place} = {value:g}" for place, value in rates.items()])
    with np.errstate(all="ignore"):
        steps = [
            float(value if _last(place) in STEPS else np.float64(1.0) / value)
            for place, value in rates.items()
        ]
    possible = all(1e-12 <= step < 1e11 for step in steps)
    if not possible or max(steps) - min(steps) > 1e-3 * min(steps):
        problem = "contradict each other" if possible else "cannot be a rate or a sample time"
        remedy = "give the samples per second with --rate, or correct them in the file"
        raise source.error(f"{said}: {problem}", remedy, "time")
    source.warn(
        f"there are no times, so {said} is read as {steps[0]:g} s between samples; "
        "use --rate where that is wrong"
    )
    return steps[0]


def is_rate(name: str) -> bool:
    """Tell whether a scalar of this name is a rate or a sample time.

    >>> is_rate("Fs"), is_rate("SampleTime"), is_rate("FS")
    (True, True, False)
    """
    return _last(name) in RATES + STEPS


def _last(place: str) -> str:
    name = place.replace("/", ".").rpartition(".")[2]
    return name if len(name) == 2 else snake_case(name)


def unit_by_size(time: Array, source: Source) -> str | None:
    """Return the unit of times without one where their size shows it, or None.

    Raises
    ------
    DataError
        If they may be days as well as seconds.
    """
    if time.size < 2 or not np.all(np.isfinite(time)):
        return None
    low, high = float(time.min()), float(time.max())
    if any(first <= low and high <= last for first, last in _DAYS):
        steps = np.abs(np.diff(time))
        if 0 < float(np.median(steps)) < _SHORT:
            problem = (
                f"the times have no unit; {time[0]:.12g} and the short steps may be days, as "
                "spreadsheets count them, or seconds"
            )
            raise source.error(problem, "say --unit time=day or --unit time=s", "time", 0)
    for unit, (first, last) in _SINCE_1970.items():
        if first <= low and high < last:
            return unit
    return None


def counts(time: Array) -> bool:
    """Tell whether times are whole numbers that step by one or more, as counters do."""
    finite = time[np.isfinite(time)]
    whole = finite.size > 1 and np.array_equal(finite, np.rint(finite))
    return bool(whole and np.median(np.diff(finite)) >= 1)


def gaps(time: Array) -> NDArray[np.intp]:
    """Return the samples, from 0, that come after a gap."""
    steps = np.diff(time)
    return np.flatnonzero(steps > GAP * np.median(steps)) + 1


def resolution(time: Array) -> float:
    """Return the last digit that the times were recorded with.

    >>> resolution(np.array([0.0, 0.083, 0.167])), resolution(np.array([0.0, 4.0, 8.0]))
    (0.001, 1.0)
    """
    largest = float(np.max(np.abs(time)))
    noise = 4 * float(np.spacing(largest))
    for decimals in range(10):
        digit = float(f"1e-{decimals}")
        if digit < 100 * noise:
            break
        if np.all(np.abs(time - np.round(time, decimals)) <= noise):
            return digit
    single = np.float32(largest)
    return float(np.spacing(single)) if np.all(time == time.astype(np.float32)) else noise


def common_step(time: Array, spans: list[Span]) -> Step:
    """Return the step that all spans have in common: the shortest decimal that fits them.

    Rounding of recorded times is told from jitter by the spread of the times about the grid.
    """
    spans = [span for span in spans if span[1] - span[0] > 1]
    if not spans:
        return Step(float(f"{np.median(np.diff(time)):.6g}"), (0.0, 0.0))
    lengths = np.array([stop - start for start, stop in spans])
    starts = np.cumsum(lengths) - lengths
    t = np.concatenate([time[start:stop] - time[start] for start, stop in spans])
    k = np.concatenate([np.arange(length, dtype=float) for length in lengths])
    t_mid = t - np.repeat(np.add.reduceat(t, starts) / lengths, lengths)
    k_mid = k - np.repeat(np.add.reduceat(k, starts) / lengths, lengths)
    slope = float(np.sum(k_mid * t_mid) / np.sum(k_mid**2))
    digit = resolution(time)
    # Times printed more coarsely than half a step could hide a lost sample: they count as jitter.
    rounding = 0.75 * digit if digit <= 0.5 * slope else 0.0
    tolerance = rounding + 8 * float(np.spacing(np.max(np.abs(time)))) + 1e-6 * slope
    for size in _shortest_first(slope):
        off = t - size * k
        spread = np.maximum.reduceat(off, starts) - np.minimum.reduceat(off, starts)
        if np.all(spread <= 2 * tolerance):
            return Step(size, None)
    within = np.delete(np.diff(t), starts[1:] - 1)
    size = float(f"{slope:.6g}")
    off = np.abs(within - size)
    return Step(size, (float(np.sqrt(np.mean(off**2))), float(off.max())))


def agrees(time: Array, step: float) -> bool:
    """Tell whether times are those of a stated step, within the digits recorded."""
    off = np.abs(time - time[0] - step * np.arange(time.size))
    return bool(np.all(off <= max(resolution(time), 1e-3 * step)))


def rises_evenly(values: Array) -> bool:
    """Tell whether values are as times are: each by as much above the last, or nearly."""
    steps = np.diff(values)
    return bool(
        np.all(steps > 0) and np.all(np.abs(steps - np.median(steps)) < 0.5 * np.median(steps))
    )


def grid(time: Array, step: float) -> Array:
    """Return the grid of this step from the first time to the last."""
    n = int((time[-1] - time[0]) / step + 1e-6) + 1
    found: Array = time[0] + step * np.arange(n)
    return found


def _shortest_first(step: float) -> Iterator[float]:
    """Yield decimals ever closer to a step, and steps whose rate is such a decimal."""
    for digits in range(1, 17):
        yield float(f"{step:.{digits}g}")
        yield 1.0 / float(f"{1.0 / step:.{digits}g}")
    yield step
