"""Uniform time grid from recorded times."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Array, Rows
from mckibben.errors import DataError
from mckibben.files.headers import snake_case
from mckibben.files.instants import instant
from mckibben.files.notices import listed
from mckibben.files.request import Source
from mckibben.files.units import convert
from mckibben.files.wrapping import wraps

Spans = NDArray[np.intp]
"""Start and stop of each span of samples, stop excluded, shape (m, 2)."""

GAP = 3.0
"""Steps longer than this many median steps are gaps; shorter ones are jitter."""

RATES = ("fs", "Fs", "sample_rate", "sampling_rate", "sample_frequency", "sampling_frequency")
"""Names of scalars that are sampling rates [Hz]."""

STEPS = (
    *("Ts", "dt", "sample_time", "sample_interval", "sample_period"),
    *("sampling_time", "sampling_interval", "sampling_period"),
)
"""Names of scalars that are sample times [s]."""

_PER_SECOND = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}
"""Units of times that are counted, and how many are a second."""

MOST_WITHOUT_TIME = 0.05
"""Largest share of rows without a time that are left out."""

YEARS_2001_TO_2049 = (1e9, 2.5e9)
"""Seconds since 1970."""

DAY = 86_400.0
"""Seconds."""

AT_ONE_MOMENT = "clocks are taken to begin at one moment, as not all of them have dates"


@dataclass(frozen=True)
class Times:
    """Times in their original unit, with the recorded digits.

    The unit is ``certain`` where it was requested or is not the second. ``began`` is the first instant
    of dates, from which the others are counted.
    """

    values: Array
    unit: str = "s"
    certain: bool = True
    assumed: bool = False
    began: str | None = None

    def seconds(self, duration: float) -> float:
        """Return a time or duration in this unit in seconds."""
        return float(convert(np.array([duration]), self.unit, "s")[0])


def since_first(times: Times) -> Times:
    """Return times since the first where they are counted since 1970, else as they are."""
    finite = times.values[np.isfinite(times.values)]
    first = float(finite[0]) if finite.size else 0.0
    low, high = YEARS_2001_TO_2049
    if not low < times.seconds(first) < high:
        return times
    digits = -math.ceil(math.log10(2.0 * np.spacing(first)))  # what a number of that size can hold
    values = np.round(times.values - first, digits)
    return replace(times, values=values, began=instant(times.seconds(first)))


def begun(moments: Sequence[float | None]) -> list[float] | None:
    """Return when clocks begin, from the first of them [s].

    Moments are seconds since 1970, or since midnight where there is no date: such a clock begins on the
    day that is nearest to a dated one. None is an unknown moment: then so are all starts, unless all are
    unknown, and the clocks begin together.

    >>> begun([1_769_860_800.0, 43_200.5]), begun([5.0, 7.0]), begun([5.0, None]), begun([None])
    ([0.0, 0.5], [0.0, 2.0], None, [0.0])
    """
    dates = [moment for moment in moments if moment is not None]
    if len(dates) < len(moments):
        return None if dates else [0.0] * len(moments)
    dated = next((date for date in dates if date > YEARS_2001_TO_2049[0]), None)
    if dated is not None:
        late = [
            0.0 if date > YEARS_2001_TO_2049[0] else round((dated - date) / DAY) for date in dates
        ]
        dates = [date + DAY * days for date, days in zip(dates, late, strict=True)]
    return [date - min(dates) for date in dates]


class Step(NamedTuple):
    """A time step, and the deviations of recorded steps from it, in the unit of the times.

    ``jitter`` is the root mean square and the maximum of the deviations; None if all times are on the
    grid within their recorded digits and no sample is lost.
    """

    size: float
    jitter: tuple[float, float] | None


def usable(times: Times, channels: Mapping[str, Array], source: Source) -> Rows:
    """Return the rows with a time, and a sample that no row before has at that time; with notes.

    Many without a time are an error later. None is a repeat where times increase, or begin anew as
    counters do, or are rounded so that other rows have equal times.
    """
    time = times.values
    finite = np.flatnonzero(np.isfinite(time))
    if finite.size < time.size:
        if finite.size < (1 - MOST_WITHOUT_TIME) * time.size:
            return np.arange(time.size)
        row = source.table.row(int(np.argmin(np.isfinite(time))))
        n = time.size - finite.size
        source.warn(f"{n} row(s) have no time and were left out, the first in row {row}")
    time, channels = time[finite], {name: x[finite] for name, x in channels.items()}
    return finite[_without_repeats(time, channels, finite, source)]


def _without_repeats(
    time: Array, channels: Mapping[str, Array], rows: Rows, source: Source
) -> Rows:
    indices = np.arange(time.size)
    if np.all(np.diff(time) > 0) or wraps(time) is not None:
        return indices
    table = np.column_stack([time, *channels.values()])
    _, first = np.unique(table, axis=0, return_index=True, equal_nan=True)
    repeats = np.setdiff1d(indices, first)
    first_rows = np.sort(first)
    if not repeats.size or np.any(np.diff(time[first_rows]) <= 0):  # of a coarse clock at rest
        return indices
    row = source.table.row(int(rows[repeats[0]]))
    source.warn(
        f"{repeats.size} row(s) are exact repeats and were left out, the first in row {row}"
    )
    return first_rows


def increasing(times: Times, source: Source) -> Times:
    """Return strictly increasing times; counters that wrap are unwrapped, with a note.

    Raises
    ------
    DataError
        If a time is missing, is repeated or decreases; names the row.
    """
    time = times.values
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
        return replace(times, values=time)
    first = int(wrong[0])
    problem = f"the time goes back from {time[first]:.10g} to {time[first + 1]:.10g}"
    remedy, options = "split the file there, or sort its rows by time", []
    if steps[first] == 0:
        problem = f"the time {time[first]:.10g} is repeated"
        remedy = "delete the repeated row; or, if times were rounded when saved, give `rate`"
        options = [{"sample_time": step} for step in _of_rounded(times)]
    raise source.error(problem, remedy, "time", first + 1, options)


def _of_rounded(times: Times) -> Iterator[float]:
    """Yield the sample time [s] of times that were rounded when they were saved."""
    time = times.values
    mean, steps = (time[-1] - time[0]) / (time.size - 1), np.diff(time)
    coarse = mean > 0 and 0.9 * steps[steps > 0].min() > mean
    for digits in (1, 2) if coarse else ():  # rates and steps that are set have few
        for size in (float(f"{mean:.{digits}g}"), 1.0 / float(f"{1.0 / mean:.{digits}g}")):
            if agrees(time, size):
                yield times.seconds(size)
                return


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
    stated = listed([f"{path} = {value:g}" for path, value in rates.items()])
    with np.errstate(all="ignore"):
        values = np.array(list(rates.values()), dtype=float)
        steps = np.where([_last(path) in STEPS for path in rates], values, 1.0 / values)
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


def _last(path: str) -> str:
    name = path.replace("/", ".").rpartition(".")[2]
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
        raise source.error(problem, "", "time", 0, _time_units("day", "s"))
    first, last = YEARS_2001_TO_2049
    for unit, per_second in _PER_SECOND.items():
        within = first <= low / per_second and high / per_second < last
        if within and unit in plausible_units(time):
            source.warn(
                f"the times have no unit; by their size they are counted in {unit} since 1970; "
                "use `units[time]=UNIT` where that is wrong"
            )
            return unit
    moving = steps[steps > 0]
    if moving.size and np.median(moving) >= 1 and np.array_equal(time, np.rint(time)):
        raise doubtful_unit("it has no unit and counts in whole numbers", time, source)
    return None


def doubtful_unit(problem: str, time: Array, source: Source) -> DataError:
    """Return the error for times of uncertain unit, or of none."""
    plausible = plausible_units(time)
    text = f"{problem}: is it in {' or '.join(plausible)}?"
    return source.error(text, "", "time", 0, _time_units(*dict.fromkeys([*plausible, "s"])))


def plausible_units(time: Array) -> list[str]:
    """Return units in which steps are from 0.1 ms to 5 s; first those in which it all is 2 s to a day.

    >>> plausible_units(np.arange(600.0)), plausible_units(20 * np.arange(600.0))
    (['s', 'ms'], ['ms'])
    """
    steps, duration = np.diff(time), float(time[-1] - time[0])
    step = float(np.median(steps[steps > 0])) if np.any(steps > 0) else 0.0
    units = [unit for unit, size in _PER_SECOND.items() if 1e-4 <= step / size <= 5.0]
    usual = {unit: 2.0 <= duration / _PER_SECOND[unit] <= 86_400.0 for unit in units}
    return sorted(units, key=lambda unit: not usual[unit]) or ["ms"]


def _time_units(*units: str) -> list[dict[str, dict[str, str]]]:
    return [{"units": {"time": unit}} for unit in units]


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
    t: Array, count: Array, starts: Rows, digit: float, noise: float
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
    """Return whether times have a given step, within their rounding and half a step.

    Times that are repeated were rounded to the smallest step between them.
    """
    steps = np.diff(time)
    grain = steps[steps > 0].min() if np.any(steps == 0) else resolution(time)
    deviation = np.abs(time - time[0] - step * np.arange(time.size))
    return bool(np.all(deviation <= grain + 0.5 * step))
