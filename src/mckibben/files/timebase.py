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
from mckibben.files.request import Source
from mckibben.files.wrapping import wraps

Spans = NDArray[np.intp]
"""Start and stop of each span of samples, stop excluded, shape (m, 2)."""

GAP = 3.0
"""Steps longer than this many median steps are gaps; shorter ones are jitter."""

RATES = ("fs", "Fs", "sample_rate", "sampling_frequency")
"""Names of scalars that are sampling rates [Hz]."""

STEPS = ("Ts", "dt", "sample_time")
"""Names of scalars that are sample times [s]."""

_SINCE_1970 = {"ms": (1e12, 4.2e12), "us": (1e15, 4.2e15), "ns": (1e18, 4.2e18)}
"""Unit -> range of times since 1970 in that unit, for the years 2001 to 2103."""


class Step(NamedTuple):
    """A time step, and the deviations of recorded steps from it, in the unit of the times.

    ``jitter`` is the root mean square and the maximum of the deviations; None if all times are on the
    grid within their recorded digits and no sample is lost.
    """

    size: float
    jitter: tuple[float, float] | None


def increasing(time: Array, source: Source) -> Array:
    """Return strictly increasing times; counters that wrap are unwrapped, with a note.

    Raises
    ------
    DataError
        If a time is missing, is repeated or decreases; names the row.
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
        source.warn(f"the time wraps at {size:.10g}, first in row {row}, and was unwrapped")
        time = time + size * np.cumsum([0.0, *upwards])
    steps = np.diff(time)
    wrong = np.flatnonzero(steps <= 0)
    if not wrong.size:
        return time
    first = int(wrong[0])
    problem = f"the time goes back from {time[first]:.10g} to {time[first + 1]:.10g}"
    remedy = "split the file there, or sort its rows by time"
    if steps[first] == 0:
        problem = f"the time {time[first]:.10g} is repeated"
        remedy = "delete the repeated row; or, if times were rounded when saved, give `rate`"
    raise source.error(problem, remedy, "time", first + 1)


def stated_step(source: Source) -> float | None:
    """Return the sample time [s] from scalars in the file such as ``fs = 50``, with a note.

    Raises
    ------
    DataError
        If one is not a positive finite number, or two contradict each other.
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
    """Return the unit of times without one if their size determines it, with a note; else None.

    Raises
    ------
    DataError
        If they may be days or counts instead of seconds.
    """
    time = time[np.isfinite(time)]
    if time.size < 2:
        return None
    low, high = float(time.min()), float(time.max())
    steps = np.diff(time)
    # days since 1900, of spreadsheets, and since year 0, of MATLAB, in the years 1941 to 2119 or so
    days = ((15_000.0, 80_000.0), (693_000.0, 800_000.0))
    # steps below 1.4 minutes as days, or below 1 ms as seconds, which are rare
    short = 0 < np.median(np.abs(steps)) < 0.999e-3
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
    """Return the error for times of uncertain unit; suggest units with steps of 0.1 ms to 5 s."""
    seconds = {"ms": 1e-3, "us": 1e-6, "ns": 1e-9}
    plausible = [unit for unit, scale in seconds.items() if 1e-4 <= scale * step <= 5.0] or ["ms"]
    options = " or ".join(f"`units[time]={unit}`" for unit in plausible)
    remedy = f"name its unit, as in {options}, or `units[time]=s` if that is right"
    return source.error(f"{problem}: is it in {' or '.join(plausible)}?", remedy, "time", 0)


def resolution(time: Array) -> float:
    """Return the value of the last recorded digit of the times.

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

    Deviations from the grid within the recorded digits are rounding; larger ones are jitter.
    """
    spans = spans[spans[:, 1] - spans[:, 0] > 1]
    if not spans.size:
        return Step(float(f"{np.median(np.diff(time)):.6g}"), (0.0, 0.0))
    lengths = spans[:, 1] - spans[:, 0]
    starts = np.cumsum(lengths) - lengths
    t = np.concatenate([time[start:stop] - time[start] for start, stop in spans])
    digit = resolution(time)
    noise = 8 * float(np.spacing(np.max(np.abs(time))))
    within = np.delete(np.arange(1, t.size), starts[1:] - 1)
    steps = t[within] - t[within - 1]
    size, rms = _fit_step(t, np.arange(t.size, dtype=float), starts, digit, noise)
    if rms == 0.0:
        return Step(size, None)
    typical = np.mean(steps[steps <= 1.5 * np.median(steps) + digit])
    counts = np.zeros(t.size)
    counts[within] = np.maximum(1, np.rint(steps / typical))  # 2 if one sample is lost
    size_with_lost, rms_with_lost = _fit_step(t, np.cumsum(counts), starts, digit, noise)
    if rms_with_lost < rms:  # otherwise short steps follow the long ones
        size = size_with_lost
    deviations = np.abs(steps - size)
    return Step(size, (float(np.sqrt(np.mean(deviations**2))), float(deviations.max())))


def _fit_step(
    t: Array, count: Array, starts: NDArray[np.intp], digit: float, noise: float
) -> tuple[float, float]:
    """Return the step of numbered samples, and the RMS deviation from its grid; 0 if rounding."""
    lengths = np.diff(starts, append=t.size)
    k = count - np.repeat(count[starts], lengths)
    t_mid, k_mid = (
        each - np.repeat(np.add.reduceat(each, starts) / lengths, lengths) for each in (t, k)
    )
    slope = float(np.sum(k_mid * t_mid) / np.sum(k_mid**2))
    # digits coarser than half a step could hide a lost sample: their rounding counts as jitter
    rounding = 0.75 * digit if digit <= 0.5 * slope else 0.0
    tolerance = rounding + noise + 1e-6 * slope
    for size in _shortest_first(slope):
        deviation = t - size * k
        spread = np.maximum.reduceat(deviation, starts) - np.minimum.reduceat(deviation, starts)
        if np.all(spread <= 2 * tolerance):
            return size, 0.0
    return float(f"{slope:.6g}"), float(np.sqrt(np.mean((t_mid - slope * k_mid) ** 2)))


def _shortest_first(step: float) -> Iterator[float]:
    """Yield approximations of a step with more and more digits, of itself or of its rate."""
    for digits in range(1, 17):
        yield float(f"{step:.{digits}g}")
        yield 1.0 / float(f"{1.0 / step:.{digits}g}")
    yield step


def agrees(time: Array, step: float) -> bool:
    """Return whether times have a given step, within the recorded digits."""
    deviation = np.abs(time - time[0] - step * np.arange(time.size))
    return bool(np.all(deviation <= max(resolution(time), 1e-3 * step)))
