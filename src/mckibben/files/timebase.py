"""Uniform time grid from recorded times."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Array
from mckibben.errors import DataError
from mckibben.files.headers import snake_case
from mckibben.files.notices import listed
from mckibben.files.quality import wraps
from mckibben.files.request import Source

Spans = NDArray[np.intp]
"""First samples, and those after the last, shape (m, 2)."""

GAP = 3.0
"""Steps longer than this many median steps are gaps; shorter ones are jitter."""

RATES = ("fs", "Fs", "sample_rate", "sampling_frequency")
"""Names of samples per second [Hz]."""

STEPS = ("Ts", "dt", "sample_time")
"""Names of seconds per sample."""


_SINCE_1970 = {"ms": (1e12, 4.2e12), "us": (1e15, 4.2e15), "ns": (1e18, 4.2e18)}
"""Unit -> counts of it since 1970 in the years 2001 to 2103."""


class Step(NamedTuple):
    """A time step, and the deviation of recorded steps from it, in the unit of the times.

    ``jitter`` is the root mean square and the largest deviation of a step; None where every time is on
    the grid within the digits that were recorded, and none is lost.
    """

    size: float
    jitter: tuple[float, float] | None


def checked(time: Array, source: Source) -> Array:
    """Return increasing times: wrapping counters are unwrapped; raise an error for others.

    Raises
    ------
    DataError
        If a time is missing, repeated or goes back, with the row.
    """
    missing = np.flatnonzero(~np.isfinite(time))
    if missing.size:
        problem = f"the time is missing in {missing.size} row(s)"
        remedy = "fill it in or delete the row; or delete the column and give `rate`"
        raise source.error(problem, remedy, "time", int(missing[0]))
    wrapped = wraps(time)
    if wrapped is not None:
        size, upwards = wrapped
        row = source.table.row(int(np.flatnonzero(upwards)[0]) + 1)
        source.warn(f"the time wraps at {size:.0f}, first in row {row}, and was unwrapped")
        time = time + size * np.cumsum([0.0, *upwards])
    steps = np.diff(time)
    wrong = np.flatnonzero(steps <= 0)
    if not wrong.size:
        return time
    at = int(wrong[0])
    problem = f"the time goes back from {time[at]:.10g} to {time[at + 1]:.10g}"
    remedy = "split the file there, or sort its rows by time"
    if steps[at] == 0:
        problem = f"the time {time[at]:.10g} is repeated"
        remedy = "delete the repeated row; or, where times were rounded when saved, give `rate`"
    raise source.error(problem, remedy, "time", at + 1)


def stated_step(source: Source) -> float | None:
    """Return the sample time [s] from scalars in the file such as ``fs = 50``, with a note.

    Raises
    ------
    DataError
        If one is no positive finite number, or two contradict each other.
    """
    rates = source.table.rates
    if not rates:
        return None
    stated = listed([f"{place} = {value:g}" for place, value in rates.items()])
    with np.errstate(all="ignore"):
        given = np.array(list(rates.values()), dtype=float)
        steps = np.where([_last(place) in STEPS for place in rates], given, 1.0 / given)
    if not (steps.min() >= 1e-12 and steps.max() < 1e11 and np.ptp(steps) <= 1e-3 * steps.min()):
        problem = f"{stated}: no rate or sample time, or not one alone"
        remedy = "give the samples per second with `rate`, or correct them in the file"
        raise source.error(problem, remedy, "time")
    source.warn(
        f"there are no times, so {stated} is read as {steps[0]:g} s between samples; "
        "use `rate` where that is wrong"
    )
    return float(steps[0])


def is_rate(name: str) -> bool:
    """Return whether a scalar's name is that of a rate or a sample time.

    >>> is_rate("Fs"), is_rate("SampleTime"), is_rate("FS")
    (True, True, False)
    """
    return _last(name) in RATES + STEPS


def _last(place: str) -> str:
    name = place.replace("/", ".").rpartition(".")[2]
    return name if len(name) == 2 else snake_case(name)


def unit_by_size(time: Array, source: Source) -> str | None:
    """Return the unit of times without one if their size determines it, with a note, or None.

    Raises
    ------
    DataError
        If they may be days or counts as well as seconds.
    """
    time = time[np.isfinite(time)]
    if time.size < 2:
        return None
    low, high = float(time.min()), float(time.max())
    steps = np.diff(time)
    # days since 1900, of spreadsheets, and since year 0, of MATLAB, in the years 1941 to 2119 or so
    days = ((15_000.0, 80_000.0), (693_000.0, 800_000.0))
    short = (
        0 < np.median(np.abs(steps)) < 0.999e-3
    )  # a minute of a day; seconds are rarely so short
    if short and any(first <= low and high <= last for first, last in days):
        problem = (
            f"the times have no unit; {time[0]:.12g} and the short steps may be days, as "
            "spreadsheets count them, or seconds"
        )
        raise source.error(problem, "use `units[time]=day` or `units[time]=s`", "time", 0)
    for unit, (first, last) in _SINCE_1970.items():
        if first <= low and high < last:
            source.warn(
                f"the times have no unit; by their size they are counted in {unit} since 1970; "
                "use `units[time]=UNIT` where that is wrong"
            )
            return unit
    step = float(np.median(steps))
    if step >= 1 and np.array_equal(time, np.rint(time)):
        raise doubtful_unit("it has no unit and counts in whole numbers", step, source)
    return None


def doubtful_unit(problem: str, step: float, source: Source) -> DataError:
    """Return the error for times of uncertain unit, with units that make steps of 0.1 ms to 5 s."""
    shares = {"ms": 1e-3, "us": 1e-6, "ns": 1e-9}
    fitting = [unit for unit, share in shares.items() if 1e-4 <= share * step <= 5.0] or ["ms"]
    options = " or ".join(f"`units[time]={unit}`" for unit in fitting)
    remedy = f"name its unit, as in {options}, or `units[time]=s` where that is right"
    return source.error(f"{problem}: is it in {' or '.join(fitting)}?", remedy, "time", 0)


def resolution(time: Array) -> float:
    """Return the last recorded digit of the times.

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


def common_step(time: Array, spans: Spans) -> Step:
    """Return the common step of all spans: the shortest decimal that fits them.

    Rounding of recorded times is distinguished from jitter by the spread of the times about the grid.
    """
    spans = spans[spans[:, 1] - spans[:, 0] > 1]
    if not spans.size:
        return Step(float(f"{np.median(np.diff(time)):.6g}"), (0.0, 0.0))
    lengths = spans[:, 1] - spans[:, 0]
    starts = np.cumsum(lengths) - lengths
    t = np.concatenate([time[first:after] - time[first] for first, after in spans])
    digit = resolution(time)
    noise = 8 * float(np.spacing(np.max(np.abs(time))))
    within = np.delete(np.arange(1, t.size), starts[1:] - 1)
    steps = t[within] - t[within - 1]
    size, off_grid = _fitted(t, np.arange(t.size, dtype=float), starts, digit, noise)
    if not off_grid:
        return Step(size, None)
    usual = np.mean(steps[steps <= 1.5 * np.median(steps) + digit])
    counts = np.zeros(t.size)
    counts[within] = np.maximum(1, np.rint(steps / usual))  # 2 where one sample is lost
    counted, off_counted = _fitted(t, np.cumsum(counts), starts, digit, noise)
    if off_counted < off_grid:  # else long steps are followed by short ones
        size = counted
    off = np.abs(steps - size)
    return Step(size, (float(np.sqrt(np.mean(off**2))), float(off.max())))


def _fitted(
    t: Array, count: Array, starts: NDArray[np.intp], digit: float, noise: float
) -> tuple[float, float]:
    """Return the step for samples of these counts, and the rms deviation of times from its grid."""
    lengths = np.diff(starts, append=t.size)
    k = count - np.repeat(count[starts], lengths)
    t_mid, k_mid = (
        each - np.repeat(np.add.reduceat(each, starts) / lengths, lengths) for each in (t, k)
    )
    slope = float(np.sum(k_mid * t_mid) / np.sum(k_mid**2))
    # Times printed more coarsely than half a step could hide a lost sample: they count as jitter.
    rounding = 0.75 * digit if digit <= 0.5 * slope else 0.0
    tolerance = rounding + noise + 1e-6 * slope
    for size in _shortest_first(slope):
        off = t - size * k
        spread = np.maximum.reduceat(off, starts) - np.minimum.reduceat(off, starts)
        if np.all(spread <= 2 * tolerance):
            return size, 0.0
    return float(f"{slope:.6g}"), float(np.sqrt(np.mean((t_mid - slope * k_mid) ** 2)))


def _shortest_first(step: float) -> Iterator[float]:
    """Yield decimals of increasing accuracy for a step, and steps with such a decimal rate."""
    for digits in range(1, 17):
        yield float(f"{step:.{digits}g}")
        yield 1.0 / float(f"{1.0 / step:.{digits}g}")
    yield step


def agrees(time: Array, step: float) -> bool:
    """Return whether times have a stated step, within the recorded digits."""
    off = np.abs(time - time[0] - step * np.arange(time.size))
    return bool(np.all(off <= max(resolution(time), 1e-3 * step)))
