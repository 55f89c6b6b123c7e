"""Conversion of table columns to the package's units: calibration, units and plausibility."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mckibben.arrays import Array
from mckibben.errors import DataError
from mckibben.files import clocks, instants, quality, timebase, wrapping
from mckibben.files.channels import NAME, Channel, Time
from mckibben.files.choosing import assign
from mckibben.files.headers import is_clock, parse, snake_case, time_unit, unit_of, unknown_ending
from mckibben.files.notices import listed
from mckibben.files.request import Source
from mckibben.files.table import Column
from mckibben.files.units import COUNTS, Unit, convert, find, weight
from mckibben.recording import COMMAND, PLAUSIBLE, REST_LENGTH, conversion, standard_unit

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


@dataclass(frozen=True)
class Times:
    """Times in their original unit, with the recorded digits.

    The unit is ``certain`` where it was requested or is not the second.
    """

    values: Array
    unit: str = "s"
    certain: bool = True
    assumed: bool = False

    def seconds(self, duration: float) -> float:
        """Return a time or duration in this unit in seconds."""
        return float(convert(np.array([duration]), self.unit, "s")[0])


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
    columns, dropped = clocks.on_one(columns, source)
    left_out |= dict.fromkeys(dropped, "it does not cover the times of the others")
    clock = columns.pop("time", None)
    if clock is not None and clock.values is None and request.step is not None:
        left_out[clock.header], clock = "the rate is given", None
    times = None if clock is None else times_of(clock, source)
    signals: dict[str, Signal] = {}
    derived = source.derived(columns)
    for name, column in columns.items():
        try:
            signals[name] = _signal(name, column, source)
        except DataError as error:
            if name in derived.values() or (
                request.needs(name) and (unit_of(name) is not None or request.asks_for(name))
            ):
                raise
            left_out[column.header] = error.problem
    if not signals:
        problem = "there is no column of numbers"
        raise source.error(problem, "give a file with samples in columns")
    each = signals.items()
    references = {name: one.read_in.reference for name, one in each if one.read_in.reference}
    meta = {
        "ignored_columns": list(left_out),
        "converted_units": [
            f"{name} from {one.read_in.name} to {one.unit}"
            for name, one in each
            if one.read_in.name != one.unit
        ],
        "pressure_reference": references,
        "calibration": {name: one.calibration for name, one in each if one.calibration},
    }
    assumed = ["time in s"] if times is not None and times.assumed else []
    assumed += [f"{name} in {one.unit}" for name, one in each if one.assumed]
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
    return signals, times, {name: found for name, found in meta.items() if found}


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
        if is_clock(column.label):
            clocks.append(column)
            groups.append([])
        elif column.values is not None:
            groups[-1].append(column)
    if sum(map(bool, groups[1:])) < 2:
        return source
    groups[:2] = [groups[0] + groups[1]]  # what is before the first clock has that one
    columns = []
    for clock, group in zip(clocks, groups, strict=True):
        times = times_of(clock, source)
        seconds = convert(times.values, times.unit, "s")
        known = np.isfinite(seconds)
        for column in group:
            values = None if column.values is None else column.values[known]
            columns.append(replace(column, values=values, times=seconds[known]))
    return replace(source, table=replace(table, columns=tuple(columns), lines=None))


def times_of(column: Column, source: Source) -> Times:
    """Return the times in a column of numbers or dates."""
    if column.values is None:
        return Times(instants.seconds(column.texts, source))
    values = _numbers("time", column, source)
    found, assumed = _unit("time", column, values, source)
    unit = found.name
    quality.refuse_impossible("time", convert(values, unit, "s"), unit, source)
    asked = "time" in source.request.units or source.request.described.time.unit is not None
    return Times(values, unit, asked or unit != "s", assumed)


def _signal(channel: str, column: Column, source: Source) -> Signal:
    """Return a channel in the package's unit, NaN for missing samples."""
    raw = _numbers(channel, column, source)
    calibration = _calibration(channel, column, source)
    calibrated = "gain" in calibration
    values = raw
    if calibrated:
        with np.errstate(over="ignore"):
            values = calibration["gain"] * raw + calibration["offset"]
    read_in, assumed = _unit(channel, column, values, source)
    own, standard = source.table.own, unit_of(channel)
    unit = standard if own or standard is not None else read_in.target
    unit = read_in.name if unit is None else unit
    samples = convert(values, read_in.name, unit)
    if not own and not source.request.raw:
        if not channel.startswith(("voltage", COMMAND)):  # a sawtooth can be commanded
            wrapping.refuse_wraps(channel, raw, source)
        samples = quality.without_codes(channel, samples, raw, source)
    if not own or channel in source.request.units or calibrated:
        quality.refuse_impossible(channel, samples, read_in.name, source)
    return Signal(samples, unit, read_in, assumed, calibration)


def _numbers(channel: str, column: Column, source: Source) -> Array:
    """Return the samples of a column; raise a `DataError` for text or flaws."""
    if column.values is None:
        remedy = f"name a column of numbers with `columns[{channel}]=COLUMN`"
        raise source.error(f"column {column.header!r} holds text", remedy, channel, 0)
    if column.flaw is not None:
        flaw = column.flaw
        raise source.error(flaw.problem, flaw.remedy, channel, flaw.sample)
    return column.values


def _calibration(channel: str, column: Column, source: Source) -> dict[str, Any]:
    """Return gain and offset, requested or described, or the described constant, or nothing."""
    given = source.request.described.channels.get(channel)
    if given is not None and given.value is not None and column.header == channel:
        return {"value": given.value, "unit": given.unit}
    if channel in source.request.lines:
        gain, offset = source.request.lines[channel]
    elif given is not None and given.is_calibrated and _describes(given, column):
        gain, offset = 1.0 if given.gain is None else given.gain, given.offset or 0.0
    else:
        return {}
    return {"column": column.header, "gain": gain, "offset": offset}


def _describes(given: Channel | Time, column: Column) -> bool:
    """Return whether a folder's settings of a channel refer to this column."""
    named = snake_case(given.column or column.header)
    return named in (snake_case(column.header), snake_case(parse(column.header).name))


def _unit(channel: str, column: Column, values: Array, source: Source) -> tuple[Unit, bool]:
    """Return the unit of a column, requested, stated or assumed, and whether it is assumed."""
    expected = unit_of(channel)
    asked = source.request.units.get(channel)
    text = _stated(channel, column, source) if asked is None else asked
    if text is None:
        by_size = timebase.unit_by_size(values, source) if channel == "time" else None
        if by_size:
            return Unit(by_size, "s"), False
        return _assumed(channel, column, values, source), bool(expected)
    if source.table.own and asked is None and expected in (None, text):
        return Unit(text, expected), False
    unit = find(text)
    if unit is None and asked is None and expected is None:
        return Unit(text, None), False
    if unit is None:
        remedy = f"name it, as in `units[{channel}]={expected or 'UNIT'}`"
        raise source.error(f"the unit {text[:40]!r} is unknown", remedy, channel)
    if expected is None or unit.target == expected:
        return unit, False
    if unit.target in ("V", "A") or text.casefold() in COUNTS:
        remedy = f"calibrate it, as in {_option(channel, column, expected)}, or in {NAME}"
    elif expected == "" and unit.target == "mm":
        remedy = _in_mm(column)
    elif weight(text) != text:
        remedy = f"where it is the weight of that mass, use `units[{channel}]={weight(text)}`"
    else:
        remedy = (
            f"correct the unit with `units[{channel}]={expected or '%'}`, or name another column with "
            f"`columns[{channel}]=COLUMN`"
        )
    problem = f"in {text!r}, which does not convert to" if text else "without a unit: it is in"
    problem = f"it cannot be {problem} {expected or 'a pure number'}"
    raise source.error(problem, remedy, channel)


def _in_mm(column: Column) -> str:
    """Return the remedy for a contraction in millimetres."""
    read = f"`columns[displacement]={column.header}` and `units[displacement]=mm`"
    return f"read it by {read}, and state {REST_LENGTH}"


def _option(channel: str, column: Column, unit: str) -> str:
    return f"`calibration[{channel}]={column.header}:GAIN:OFFSET:{unit}`"


def _stated(channel: str, column: Column, source: Source) -> str | None:
    """Return the unit of the file and the folder; raise a `DataError` if they differ."""
    described = source.request.described
    given = described.time if channel == "time" else described.channels.get(channel)
    in_header = None if source.table.own else parse(column.label).unit
    if channel == "time" and in_header is None:
        in_header = time_unit(column.label)
    stated = {"its header": in_header, "the file": column.unit}
    if given is not None and given.unit is not None and _describes(given, column):
        if isinstance(given, Channel) and given.value is not None:
            stated = {NAME: column.unit}
        elif isinstance(given, Channel) and given.is_calibrated:
            stated = {NAME: given.unit}  # the unit that the calibration results in
        else:
            stated[NAME] = given.unit
    texts = {place: text for place, text in stated.items() if text is not None}
    units = {place: unit for place, text in texts.items() if (unit := find(text))}
    if units:
        texts = {place: texts[place] for place in units}
    last = next(reversed(texts.values()), None)
    if len({(unit.name, unit.reference) for unit in units.values()}) > 1:
        differing = ", ".join(f"{text!r} in {place}" for place, text in texts.items())
        remedy = f"name the right one, as in `units[{channel}]={last}`"
        raise source.error(f"its unit is contradicted: {differing}", remedy, channel)
    return last


def _assumed(channel: str, column: Column, values: Array, source: Source) -> Unit:
    """Return the package's unit; raise a `DataError` if the header or the values contradict it."""
    expected = unit_of(channel)
    if expected is None:
        return Unit("", "")
    if expected and (ending := unknown_ending(column.label)):
        raise source.error(
            f"its unit is not certain: {column.label!r} has {ending!r}",
            f"name its unit, as in `units[{channel}]={expected}`, or calibrate it, as in "
            f"{_option(channel, column, expected)}",
            channel,
        )
    largest = float(np.abs(values[np.isfinite(values)]).max(initial=0.0))
    plausible = PLAUSIBLE[expected]
    if 0 < largest < plausible.least or largest > plausible.most:
        units = quality.fitting_units(largest, expected, expected)
        options = " or ".join(f"`units[{channel}]={unit}`" for unit in units)
        as_it_is = f"`units[{channel}]={expected or 1}` where that is right"
        remedy = f"name its unit, as in {options}, or {as_it_is}"
        if expected == "":
            remedy += f"; where it is in mm, {_in_mm(column)}"
        raise source.error(
            f"it has no unit, and reaches {largest:.3g}: is it in {' or '.join(units)}?",
            remedy,
            channel,
        )
    return Unit(expected, expected)
