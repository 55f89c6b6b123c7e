"""The channels of a table in the units of the package."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from mckibben.arrays import Array
from mckibben.errors import DataError
from mckibben.files import clocks, glitches, instants, plausible, timebase
from mckibben.files.assigning import assign
from mckibben.files.calibration import calibrated
from mckibben.files.channels import Described
from mckibben.files.headers import LONGEST, parse, unit_of
from mckibben.files.notices import listed, warn
from mckibben.files.request import Request
from mckibben.files.table import Column, Table
from mckibben.files.units import Unit, convert, find

IMPLAUSIBLE_BAR = 50.0
"""No muscle sees this pressure; larger numbers without a unit are kPa, psi or the like."""

ASSUMED = "no unit is given, so these are assumed: "
"""What a note on assumed units begins with."""


@dataclass(frozen=True)
class Choice:
    """The channels of a table in the package's units, and its times in their own unit.

    Parameters
    ----------
    channels, units : dict
        Samples and unit of every channel.
    recorded : dict
        The channels as they are without gain and offset, by which the same rows are known again.
    time : numpy.ndarray or None
        In the unit ``time_unit``, so that the digits recorded can still be seen.
    meta : dict
        What else to tell about the columns.
    """

    channels: dict[str, Array]
    units: dict[str, str]
    recorded: dict[str, Array]
    time: Array | None
    time_unit: str
    meta: dict[str, Any]


@dataclass
class _Findings:
    """What comes up while columns are looked at."""

    ignored: list[str]
    converted: list[str] = field(default_factory=list)
    assumed: list[str] = field(default_factory=list)
    references: dict[str, str] = field(default_factory=dict)


def choose(table: Table, request: Request, path: Path) -> Choice:
    """Choose and convert the channels of a table.

    Raises
    ------
    DataError
        If a channel asked for is missing, two columns are one channel, a cell is no number, or a
        unit is unknown or of the wrong dimension.
    """
    described = Described() if table.own else request.described
    request = replace(request, described=request.describing(described))
    named, left_out = assign(table, request, path)
    named, dropped = clocks.on_one(named, request, path)
    left_out += dropped
    before = named
    named, calibration = calibrated(named, request.described, request.calibration)
    found = _Findings(ignored=[*table.meta.get("ignored_columns", ()), *left_out])
    time, time_unit = None, "s"
    if "time" in named:
        time, time_unit = _time(named.pop("time"), table, request, path, found)
    channels: dict[str, Array] = {}
    units: dict[str, str] = {}
    recorded: dict[str, Array] = {}
    for channel, column in named.items():
        values = _numbers(channel, column, table, request, path, found)
        if values is not None:
            unit = _unit(channel, column, values, table.own, request, path, found)
            target = unit_of(channel)
            target = unit.target if target is None else target
            keeps = target is None or (table.own and unit_of(channel) is None)
            units[channel] = unit.name if keeps or target is None else target
            channels[channel] = recorded[channel] = convert(values, unit.name, units[channel])
            if channel in calibration and (raw := before[channel].values) is not None:
                recorded[channel] = convert(raw, unit.name, units[channel])
            if units[channel] != unit.name:
                found.converted.append(f"{channel} from {unit.name} to {units[channel]}")
            if not table.own or channel in request.units:
                plausible.check(
                    channel, channels[channel], unit_of(channel), unit.name, table, path
                )
                if unit_of(channel) is not None:
                    glitches.check(channel, channels[channel], units[channel], values, table, path)
    if not channels:
        raise DataError(
            "there is no column of numbers", file=path, remedy="give a file with samples in columns"
        )
    if found.assumed:
        warn(
            path,
            f"{ASSUMED}{listed(found.assumed)}; say --unit CHANNEL=UNIT where that is wrong",
        )
    notes = {
        "ignored_columns": found.ignored,
        "converted_units": found.converted,
        "pressure_reference": found.references,
        "calibration": calibration,
    }
    meta = {name: note for name, note in notes.items() if note}
    return Choice(channels, units, recorded, time, time_unit, meta)


def _numbers(
    channel: str, column: Column, table: Table, request: Request, path: Path, found: _Findings
) -> Array | None:
    """Return the samples of a column, or None where it is to be left out."""
    if column.values is None:
        raise DataError(
            f"column {column.header!r} holds text",
            file=path,
            channel=channel,
            row=table.row(0),
            remedy=f"name a column of numbers with --column {channel}=COLUMN",
        )
    if column.flaw is None:
        return column.values
    flaw = column.flaw
    if request.asks_for(channel) or unit_of(channel) is not None:
        raise DataError(
            flaw.problem,
            file=path,
            channel=channel,
            row=table.row(flaw.sample),
            remedy=flaw.remedy,
        )
    warn(path, f"column {column.header!r} is left out: {flaw.problem}")
    found.ignored.append(column.header)
    return None


def _unit(
    channel: str,
    column: Column,
    values: Array,
    own: bool,
    request: Request,
    path: Path,
    found: _Findings,
) -> Unit:
    """Return the unit of a column: as given, as the file states it, or as assumed."""
    given = request.units.get(channel)
    text = column.unit if given is None else given
    if text is None and not own:
        text = parse(column.label).unit
    expected = unit_of(channel)
    if text is None:
        return _assumed(channel, expected, values, path, found)
    if own and given is None and text == (text if expected is None else expected):
        return Unit(text, expected)
    unit = find(text)
    example = {"bar": "kPa", "N": "kN", "s": "ms"}.get(expected or "", "UNIT")
    if unit is None and expected is None and given is None and len(text) <= LONGEST:
        return Unit(text, None)
    if unit is None:
        raise DataError(
            f"the unit {text[:40]!r} is unknown",
            file=path,
            channel=channel,
            remedy=f"say which it is, as in --unit {channel}={example}",
        )
    if expected is not None and unit.target != expected:
        said = f"in {text!r}, which does not convert to" if text else "without a unit: it is in"
        raise DataError(
            f"it cannot be {said} {expected or 'a pure number'}",
            file=path,
            channel=channel,
            remedy=f"correct the unit with --unit {channel}={expected or '%'}, "
            f"or name another column with --column {channel}=COLUMN",
        )
    if unit.reference is not None:
        found.references[channel] = unit.reference
    if unit.name == "mm" and given is None:
        plausible.doubt(channel, values, path)
    return unit


def _assumed(
    channel: str, expected: str | None, values: Array, path: Path, found: _Findings
) -> Unit:
    if expected is None:
        return Unit("", "")
    finite = np.abs(values[np.isfinite(values)])
    largest = float(finite.max()) if finite.size else 0.0
    if expected == "bar" and largest > IMPLAUSIBLE_BAR:
        fitting = plausible.meant(largest, expected, expected)
        raise DataError(
            f"it has no unit and reaches {largest:g}, which cannot be bar",
            file=path,
            channel=channel,
            remedy=f"say its unit, as in --unit {channel}={f' or --unit {channel}='.join(fitting[:2])}",
        )
    hint = ""
    if expected == "mm" and 0 < largest < 0.5:
        hint = f" (at most {largest:.3g}: is it in m?)"
    if expected == "" and largest > 1.5:
        hint = f" (up to {largest:.3g}: is it in %?)"
    if expected or hint:
        found.assumed.append(f"{channel} in {expected or 'parts of one'}{hint}")
    return Unit(expected, expected)


def _time(
    column: Column, table: Table, request: Request, path: Path, found: _Findings
) -> tuple[Array | None, str]:
    if column.values is None:
        return _instants(column, table, request, path, found), "s"
    values = _numbers("time", column, table, request, path, found)
    assert values is not None  # time is a channel that _numbers never leaves out
    stated = request.units.get("time") or column.unit or parse(column.label).unit
    unit = None if stated else timebase.unit_by_size(values, table, path)
    if unit is None:
        unit = _unit("time", column, values, table.own, request, path, found).name
    else:
        warn(
            path,
            f"the times have no unit; by their size they are counted in {unit} since 1970; "
            "say --unit time=UNIT where that is wrong",
        )
    plausible.check("time", convert(values, unit, "s"), "s", unit, table, path)
    return values, unit


def _instants(
    column: Column, table: Table, request: Request, path: Path, found: _Findings
) -> Array | None:
    """Return instants as seconds since the first; None where the rate is given instead."""
    if request.rate is not None:
        found.ignored.append(column.header)
        return None
    return instants.seconds(column.texts, table, path)
