"""Conversion of table columns to the package's units: calibration, units and plausibility."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mckibben.arrays import Array, Rows
from mckibben.errors import DataError
from mckibben.files import clocks, instants, quality, timebase, wrapping
from mckibben.files.channels import NAME, Channel, Time
from mckibben.files.choosing import assign
from mckibben.files.clocks import DRIVES
from mckibben.files.headers import is_time, parse, snake_case, time_unit, unit_of, unknown_ending
from mckibben.files.notices import listed
from mckibben.files.request import GAPS_BRIDGED, Source
from mckibben.files.table import Column
from mckibben.files.timebase import Times
from mckibben.files.units import COUNTS, Unit, convert, find, weight
from mckibben.recording import REST_LENGTH, base_name, conversion, standard_unit

ASSUMED = "no unit is given, so these are assumed: "
"""Beginning of a note on assumed units."""


@dataclass(frozen=True)
class Signal:
    """One channel: its samples, and the processing of its column, in the unit ``read_in``.

    ``assumed`` is whether no unit is stated; ``calibration`` has gain and offset, or the
    constant that the folder describes.
    """

    samples: Array
    unit: str
    read_in: Unit
    assumed: bool
    calibration: Mapping[str, Any]


def in_package_units(source: Source) -> tuple[dict[str, Signal], Times | None, dict[str, Any]]:
    """Return the channels of a table in the package's units, its times, and other contents.

    Raises
    ------
    DataError
        If a channel asked for is missing, two columns are one channel, a cell is no number, a unit is
        unknown, contradicted or of the wrong dimension, or a value is impossible.
    """
    request, source = source.request, _with_clocks(source)
    columns, left_out = assign(source)
    times = _clock(columns, left_out, source)
    columns = _apart(columns, times, source)
    sampled = clocks.rates(columns)
    if any(column.times is not None for column in columns.values()):
        columns, dropped = clocks.on_one(columns, source)
        left_out |= dict.fromkeys(dropped, "it does not cover the times of the others")
        grid = np.asarray(columns.pop("time").values)
        times = Times(grid, began=None if times is None else times.began)
        source = replace(source, table=replace(source.table, lines=None))
    signals: dict[str, Signal] = {}
    flawed: DataError | None = None
    derived = source.derived(columns)
    drives = [c.values for n, c in columns.items() if base_name(n) in DRIVES]
    jumps = wrapping.jumps_of(values for values in drives if values is not None)
    for name, column in columns.items():
        try:
            signals[name] = _signal(name, column, jumps, source)
        except DataError as error:
            if name in derived.values() or (
                request.needs(name) and (unit_of(name) is not None or request.asks_for(name))
            ):
                raise
            left_out[column.header], flawed = error.problem, flawed or error
    if not signals:
        raise flawed or source.error(
            "there is no column of numbers", "give one with samples in columns"
        )
    items = signals.items()
    references = {name: s.read_in.reference for name, s in items if s.read_in.reference}
    meta = {
        "ignored_columns": list(left_out),
        "converted_units": [
            f"{name} from {s.read_in.name} to {s.unit}"
            for name, s in items
            if s.read_in.name != s.unit
        ],
        "pressure_reference": references,
        "calibration": {name: s.calibration for name, s in items if s.calibration},
        "assumed_units": [name for name, s in items if s.assumed and s.unit],
        "sampled": sampled,
        "began": None if times is None else times.began,
    }
    assumed = ["time in s"] if times is not None and times.assumed else []
    assumed += [f"{name} in {s.unit}" for name, s in items if s.assumed and s.unit]
    if assumed:
        text = f"{ASSUMED}{listed(assumed)}; use `units[CHANNEL]=UNIT` where that is wrong"
        source.warn(text, quiet=source.in_memory)  # names in a program are its author's
    absolute = [name for name, kind in references.items() if kind == "absolute"]
    if absolute:
        source.warn(f"absolute pressure, not gauge: {listed(absolute)}; no offset was removed")
    if left_out and not source.table.own:
        reasons = [f"{header} ({why})" for header, why in left_out.items()]
        source.warn(f"not read: {listed(reasons)}")
    signals |= {name: _derived(name, of, signals[of], source) for name, of in derived.items()}
    return signals, times, {name: value for name, value in meta.items() if value}


def _derived(channel: str, of: str, signal: Signal, source: Source) -> Signal:
    """Return a channel derived from another and the rest length."""
    line = conversion(channel, of, source.rest_length)
    assert line is not None
    samples = line[0] * signal.samples + line[1]
    largest = np.nanmax(np.abs(samples), initial=0.0)
    if channel.startswith("contraction") and largest >= 1.0:
        raise source.error(
            f"{of} and a rest length of {source.rest_length:g} mm make it {largest:g}",
            "give the rest length in millimetres: a contraction is below 1",
            channel,
        )
    return replace(signal, samples=samples, unit=standard_unit(channel) or "", calibration={})


def _with_clocks(source: Source) -> Source:
    """Return a table with a clock per column, if it has several clocks."""
    table = source.table
    if table.own or table.has_clocks or "time" in source.request.columns:
        return source
    clocks: list[Column] = []
    groups: list[list[Column]] = [[]]
    for column in table.columns:
        if is_time(column.label):
            clocks.append(column)
            groups.append([])
        elif column.values is not None:
            groups[-1].append(column)
    if sum(map(bool, groups[1:])) < 2:
        return source
    groups[:2] = [groups[0] + groups[1]]  # what is before the first clock has that one
    columns, times = [], [times_of(clock, source) for clock in clocks]
    for one, start, group in zip(times, starts_of(times, source), groups, strict=True):
        seconds = start + convert(one.values, one.unit, "s")
        is_finite = np.isfinite(seconds)
        for column in group:
            values = None if column.values is None else column.values[is_finite]
            columns.append(replace(column, values=values, times=seconds[is_finite]))
    return replace(source, table=replace(table, columns=tuple(columns), lines=None))


def starts_of(times: Sequence[Times], source: Source) -> list[float]:
    """Return when clocks begin, from the first of them [s]; with a note where that is not known."""
    starts = timebase.begun([instants.moment(each.began) if each.began else None for each in times])
    if starts is None:
        source.warn(timebase.AT_ONE_MOMENT)
    return starts or [0.0] * len(times)


def _clock(columns: dict[str, Column], left_out: dict[str, str], source: Source) -> Times | None:
    """Return the times, taken out of the columns; with a rate, dates need not be readable."""
    clock = columns.pop("time", None)
    if clock is None:
        return None
    try:
        return times_of(clock, source)
    except DataError:
        if clock.values is not None or source.request.step is None:
            raise
    left_out[clock.header] = "the rate is given"
    return None


def _apart(columns: dict[str, Column], times: Times | None, source: Source) -> dict[str, Column]:
    """Return columns with times of their own where not all were sampled in every row."""
    table, request = source.table, source.request
    if request.raw or table.own or table.has_clocks or (times is None and request.step is None):
        return columns
    if times is None:
        times = Times((request.step or 1.0) * np.arange(table.n_samples, dtype=np.float64))
    seconds = convert(times.values, times.unit, "s")
    if not np.all(np.diff(seconds) >= 0):
        return columns
    on_clocks, renewed = clocks.apart(columns, seconds)
    for name, rows in renewed.items():
        source.warn(
            f"channel {name!r} is renewed every {rows:.3g} rows, so it is read at these; "
            "use `raw` where that is wrong"
        )
    return on_clocks


def times_of(column: Column, source: Source) -> Times:
    """Return the times in a column of numbers or dates."""
    line = _calibration("time", column, source)
    gain, offset = line.get("gain", 1.0), line.get("offset", 0.0)
    if column.values is None:
        since, began = instants.seconds(column.texts, source)
        return Times(gain * since + offset, began=began)
    values = gain * _numbers("time", column, source) + offset
    unit, assumed = _unit("time", column, values, source)
    name = unit.name
    stated = _is_stated("time", column, source)
    if not stated:
        seconds = convert(values, name, "s")
        quality.question_size("time", column, seconds, name, source, assumed=assumed)
    times = Times(values, name, stated or name != "s", assumed)
    return times if source.table.own else timebase.since_first(times)


def _signal(channel: str, column: Column, jumps: Rows, source: Source) -> Signal:
    """Return a channel in the package's unit, NaN for missing samples; drives have ``jumps``."""
    raw = _numbers(channel, column, source)
    calibration = _calibration(channel, column, source)
    is_own, standard = source.table.own, unit_of(channel)
    cleaned = not is_own and not source.request.raw
    if cleaned and base_name(channel) not in DRIVES:  # a sawtooth can be commanded
        raw = wrapping.unwrapped(channel, raw, jumps, source)
    values = raw
    if "gain" in calibration:
        with np.errstate(over="ignore"):
            values = calibration["gain"] * raw + calibration["offset"]
    read_in, assumed = _unit(channel, column, values, source)
    unit = standard if is_own or standard is not None else read_in.target
    unit = read_in.name if unit is None else unit
    samples = convert(values, read_in.name, unit)
    if cleaned:
        samples = quality.without_codes(channel, samples, raw, source)
    if not is_own and not _is_stated(channel, column, source):
        quality.question_size(channel, column, samples, read_in.name, source, assumed=assumed)
    return Signal(samples, unit, read_in, assumed, calibration)


def _is_stated(channel: str, column: Column, source: Source) -> bool:
    """Return whether the user states a unit or a calibration of a channel, here or in the folder."""
    request = source.request
    settings = (
        request.described.time if channel == "time" else request.described.channels.get(channel)
    )
    described = settings is not None and settings.unit is not None and _describes(settings, column)
    calibrated = channel != "time" and bool(_calibration(channel, column, source))
    return channel in request.units or described or calibrated


def _numbers(channel: str, column: Column, source: Source) -> Array:
    """Return the samples of a column; raise a `DataError` for text or flaws."""
    if column.values is None:
        remedy = f"name a column of numbers with `columns[{channel}]=COLUMN`"
        raise source.error(f"column {column.header!r} holds text", remedy, channel, 0)
    if (flaw := column.flaw) is None:
        return column.values
    if channel == "time" and flaw.bridgeable:  # rows without a time are left out
        return column.values
    if not flaw.bridgeable or source.request.gaps == "error":
        options = GAPS_BRIDGED if flaw.bridgeable else ()
        raise source.error(flaw.problem, flaw.remedy, channel, flaw.sample, options)
    row = source.table.row(flaw.sample)
    source.warn(f"channel {channel!r}, row {row}: {flaw.problem}, so it is a missing sample")
    return column.values


def _calibration(channel: str, column: Column, source: Source) -> dict[str, Any]:
    """Return gain and offset, requested or described, or the described constant, or nothing."""
    settings = source.request.described.channels.get(channel)
    if settings is not None and settings.value is not None and column.header == channel:
        return {"value": settings.value, "unit": settings.unit}
    if channel in source.request.lines:
        gain, offset = source.request.lines[channel]
    elif settings is not None and settings.is_calibrated and _describes(settings, column):
        gain, offset = 1.0 if settings.gain is None else settings.gain, settings.offset or 0.0
    else:
        return {}
    return {"column": column.header, "gain": gain, "offset": offset}


def _describes(settings: Channel | Time, column: Column) -> bool:
    """Return whether a folder's settings of a channel refer to this column."""
    name = snake_case(settings.column or column.header)
    return name in (snake_case(column.header), snake_case(parse(column.header).name))


def _unit(channel: str, column: Column, values: Array, source: Source) -> tuple[Unit, bool]:
    """Return the unit of a column, requested, stated or assumed, and whether it is assumed."""
    expected = unit_of(channel)
    requested = source.request.units.get(channel)
    text = _stated(channel, column, source) if requested is None else requested
    if text is None:
        by_size = timebase.unit_by_size(values, source) if channel == "time" else None
        if by_size:
            return Unit(by_size, "s"), False
        return _assumed(channel, column, values, source), expected is not None
    if source.table.own and requested is None and expected in (None, text):
        return Unit(text, expected), False
    unit = find(text)
    if unit is None and requested is None and expected is None:
        return Unit(text, None), False
    if unit is None:
        raise _unknown(channel, f"the unit {text[:40]!r} is unknown", column, values, source)
    if expected is None or unit.target == expected:
        return unit, False
    options: list[dict[str, Any]] = []
    remedy = f"name its unit with `units[{channel}]=UNIT`, or name another column"
    if unit.target in ("V", "A") or text.casefold() in COUNTS:
        remedy = _to_calibrate(channel, column, expected)
    elif expected == "" and unit.target == "mm":
        options = [quality.in_mm(channel, column, source)]
        remedy = f"name it displacement or length, and state {REST_LENGTH} besides"
    elif weight(text) != text:  # of a mass
        options = [{"units": {channel: weight(text)}}]
    problem = f"in {text!r}, which does not convert to" if text else "without a unit: it is in"
    problem = f"it cannot be {problem} {expected or 'a pure number'}"
    raise source.error(problem, remedy, channel, options=options)


def _unknown(
    channel: str, problem: str, column: Column, values: Array, source: Source
) -> DataError:
    """Return the error for an unknown unit, with those that suit the size of the values."""
    expected = unit_of(channel)
    if expected is None:
        return source.error(problem, f"name it with `units[{channel}]=UNIT`", channel)
    if channel == "time":
        units = timebase.plausible_units(values[np.isfinite(values)])
    else:
        largest = np.abs(values[np.isfinite(values)]).max(initial=0.0)
        units = quality.fitting_units(largest, expected, expected)
    options = [{"units": {channel: unit or "1"}} for unit in units]
    return source.error(problem, _to_calibrate(channel, column, expected), channel, options=options)


def _to_calibrate(channel: str, column: Column, unit: str) -> str:
    """Return how to state gain and offset, from the unit of the column to that of a channel."""
    of = column.unit or parse(column.label).unit
    option = f"`calibration[{channel}]={column.header}:GAIN:OFFSET:{unit}`"
    return f"calibrate it with {option}, the gain in {unit or 1} per {of or 'unit of the column'}"


def _stated(channel: str, column: Column, source: Source) -> str | None:
    """Return the unit of the file and the folder; raise a `DataError` if they differ."""
    described = source.request.described
    settings = described.time if channel == "time" else described.channels.get(channel)
    in_header = None if source.table.own else parse(column.label).unit
    if channel == "time" and in_header is None:
        in_header = time_unit(column.label)
    stated = {"its header": in_header, "the file": column.unit}
    if settings is not None and settings.unit is not None and _describes(settings, column):
        if isinstance(settings, Channel) and settings.value is not None:
            stated = {NAME: column.unit}
        elif isinstance(settings, Channel) and settings.is_calibrated:
            stated = {NAME: settings.unit}  # the unit that the calibration results in
        else:
            stated[NAME] = settings.unit
    texts = {source_name: text for source_name, text in stated.items() if text is not None}
    units = {source_name: unit for source_name, text in texts.items() if (unit := find(text))}
    if units:
        texts = {source_name: texts[source_name] for source_name in units}
    if len({(unit.name, unit.reference) for unit in units.values()}) > 1:
        differing = ", ".join(f"{text!r} in {source_name}" for source_name, text in texts.items())
        options = [{"units": {channel: text}} for text in dict.fromkeys(reversed(texts.values()))]
        problem = f"its unit is contradicted: {differing}"
        raise source.error(problem, "correct the file", channel, options=options)
    return next(reversed(texts.values()), None)


def _assumed(channel: str, column: Column, values: Array, source: Source) -> Unit:
    """Return the package's unit; raise a `DataError` if the header may have another."""
    expected = unit_of(channel)
    if expected is None:
        return Unit("", "")
    if expected and (ending := unknown_ending(column.label)):
        problem = f"its unit is not certain: {column.label!r} has {ending!r}"
        volts = find(ending.upper()) if len(ending) == 1 else find(ending)
        if volts is not None and volts.target in ("V", "A"):
            raise source.error(problem, _to_calibrate(channel, column, expected), channel)
        raise _unknown(channel, problem, column, values, source)
    return Unit(expected, expected)
