"""Which column of a table is which channel, and its samples in the package's units."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from mckibben.arrays import Array
from mckibben.errors import DataError
from mckibben.files import clocks, instants, quality, timebase
from mckibben.files.channels import NAME, Channel
from mckibben.files.headers import LONGEST, by_units, channel_of, parse, snake_case, unit_of
from mckibben.files.notices import listed, warn
from mckibben.files.request import Request
from mckibben.files.table import Column, Table
from mckibben.files.units import Unit, convert, find, weight

ROLES = ("reference_", "command_")
"""Beginnings of the names of a loop's channels."""

ASSUMED = "no unit is given, so these are assumed: "
"""Beginning of a note on assumed units."""

EXAMPLES = {"bar": "kPa", "N": "kN", "s": "ms", "rad": "deg", "mm": "um"}


@dataclass(frozen=True)
class Choice:
    """The channels of a table in the package's units, and its times in their own unit.

    Parameters
    ----------
    channels, units : dict
        Samples and unit of every channel.
    recorded : dict
        The channels without gain and offset, by which rows that two recordings share are found.
    time : numpy.ndarray or None
        In the unit ``time_unit``, so that the digits recorded can still be seen.
    stated : bool
        Whether the unit of the times is certain: stated, or they are dates.
    meta : dict
        What else is recorded about the columns.
    """

    channels: dict[str, Array]
    units: dict[str, str]
    recorded: dict[str, Array]
    time: Array | None
    time_unit: str
    stated: bool
    meta: dict[str, Any]


@dataclass(frozen=True)
class Seen:
    """A column of a file, as an import shows it.

    Parameters
    ----------
    header, unit : str
        As in the file; the unit is empty where the file states none.
    first : tuple of str
        Its first cells.
    channel : str
        The channel that it is read as; empty where it is left out.
    unasked : str
        The channel that it is read as without options.
    """

    header: str
    unit: str
    first: tuple[str, ...]
    channel: str
    unasked: str


@dataclass
class _Notes:
    """What is recorded while columns are converted."""

    left_out: dict[str, str]
    converted: list[str] = field(default_factory=list)
    assumed: list[str] = field(default_factory=list)
    references: dict[str, str] = field(default_factory=dict)
    calibration: dict[str, Any] = field(default_factory=dict)


def seen(table: Table, request: Request, path: Path) -> list[Seen]:
    """Return the columns of a table and what each is read as; of a refusal, what headers name."""
    nothing = replace(request, columns={}, units={}, channels=None, rate=None)
    asked, unasked = (_by_place(table, one, path) for one in (request, nothing))
    return [
        Seen(
            column.header,
            column.unit or parse(column.label).unit or "",
            tuple(_cell(column, k) for k in range(min(4, column.size))),
            asked.get(id(column), ""),
            unasked.get(id(column), ""),
        )
        for column in table.columns
    ]


def choose(table: Table, request: Request, path: Path) -> Choice:
    """Choose and convert the channels of a table.

    Raises
    ------
    DataError
        If a channel asked for is missing, two columns are one channel, a cell is no number, a unit is
        unknown, contradicted or of the wrong dimension, or a value is impossible.
    """
    request = request.describing(table)
    named, left_out = assign(table, request, path)
    named, dropped = clocks.on_one(named, request, path)
    left_out |= dict.fromkeys(dropped, "no samples at the others' times")
    notes = _Notes(left_out)
    time, time_unit, stated = None, "s", True
    if "time" in named:
        time, time_unit, stated = _time(named.pop("time"), table, request, path, notes)
    channels: dict[str, Array] = {}
    units: dict[str, str] = {}
    recorded: dict[str, Array] = {}
    for channel, column in named.items():
        try:
            found = _converted(channel, column, table, request, path, notes)
        except DataError as error:
            if request.needs(channel) and (
                unit_of(channel) is not None or request.asks_for(channel)
            ):
                raise
            left_out[column.header] = error.problem
            continue
        channels[channel], recorded[channel], units[channel] = found
    if not channels:
        raise DataError(
            "there is no column of numbers", file=path, remedy="give a file with samples in columns"
        )
    if notes.assumed:
        warn(
            path,
            f"{ASSUMED}{listed(notes.assumed)}; use --unit CHANNEL=UNIT where that is wrong",
        )
    absolute = [name for name, kind in notes.references.items() if kind == "absolute"]
    if absolute:
        warn(path, f"absolute pressure, not gauge: {listed(absolute)}; no offset was removed")
    if left_out and not (table.own or request.names_channels):
        reasons = [f"{header} ({why})" for header, why in left_out.items()]
        warn(path, f"not read: {listed(reasons)}")
    found_meta = {
        "ignored_columns": list(left_out),
        "converted_units": notes.converted,
        "pressure_reference": notes.references,
        "calibration": notes.calibration,
    }
    meta = {name: note for name, note in found_meta.items() if note}
    return Choice(channels, units, recorded, time, time_unit, stated, meta)


def assign(table: Table, request: Request, path: Path) -> tuple[dict[str, Column], dict[str, str]]:
    """Return the column of every channel, in the order of the file, and why others are left out.

    Columns that the request names go before those that the folder describes, and these before those
    whose headers name the channel; numbers go before text. Unless columns have clocks of their own,
    all are of one length: that of the columns asked for, or else the longest that several have.

    Raises
    ------
    DataError
        If a channel asked for is missing, or two columns are one channel.
    """
    long = next((c for c in table.columns if len(c.header) > LONGEST and not table.own), None)
    if long is not None:
        raise DataError(
            f"the header {long.header[:40]!r}... has {len(long.header)} characters",
            file=path,
            remedy=f"shorten it to {LONGEST} at most",
        )
    mapped = {
        channel: find_column(wanted, channel, table, path)
        for channel, wanted in request.columns.items()
        if not (channel == "time" and table.has_clocks)
    }
    table, left_out = _of_one_length(table, mapped, path)
    mapped = _described(table, request, path) | mapped
    named: dict[str, Column] = dict(mapped)
    for column in sorted(table.columns, key=lambda column: column.values is None):
        if any(column is taken for taken in mapped.values()):
            continue
        header = parse(column.label)
        whole = snake_case(column.header)
        channel = column.header if table.own else channel_of(header)
        if (channel in mapped and not table.own) or (
            channel in named and channel.startswith(ROLES)
        ):
            channel = snake_case(header.name)  # the first of several references is the loop's
        if channel in named and channel not in mapped and not request.needs(channel):
            channel = whole
        text = column.values is None
        wanted = channel not in named and (channel == "time" or request.asks_for(channel))
        if text and not wanted:
            left_out[column.header] = "text"
        elif channel in mapped:
            left_out[column.header] = f"{channel} is read from another column"
        elif channel in named:
            raise DataError(
                f"columns {named[channel].header!r} and {column.header!r} both hold it",
                file=path,
                channel=channel,
                remedy=f"name one, with --column {channel}={named[channel].header!r}; "
                "the columns of a file need different headers",
            )
        else:
            named[channel] = column
    order = {id(column): place for place, column in enumerate(table.columns)}
    named = dict(sorted(named.items(), key=lambda item: order.get(id(item[1]), len(order))))
    if "time" not in named and not table.own and not table.has_clocks:
        named, left_out = _with_time(named, left_out, table, path)
    renamed = {} if table.own else _by_units(named, request)
    said = [f"{named[name].header!r} as {channel}" for name, channel in renamed.items()]
    named = {renamed.get(channel, channel): column for channel, column in named.items()}
    _require(named, table, request, path)
    if said:
        warn(
            path,
            f"no name identifies these columns, so they are read by their units: {listed(said)}; "
            "use --column CHANNEL=COLUMN where that is wrong",
        )
    return named, left_out | dict(table.unread)


def find_column(wanted: str, channel: str, table: Table, path: Path) -> Column:
    """Return the column of a name: as written, without its unit, or in another case."""
    readings = (
        lambda column: column.header == wanted,
        lambda column: parse(column.header).name == wanted.strip(),
        lambda column: column.header.casefold().strip() == wanted.casefold().strip(),
        lambda column: snake_case(parse(column.header).name) == snake_case(wanted),
        lambda column: column.label == wanted,
    )
    for reading in readings:
        matches = [column for column in table.columns if reading(column)]
        if len(matches) > 1:
            headers = listed([column.header for column in matches])
            numbered = len({column.header for column in matches}) == len(matches)
            raise DataError(
                f"{len(matches)} columns are named {wanted!r}",
                file=path,
                channel=channel,
                remedy=f"name one of {headers}" if numbered else "give them different headers",
            )
        if matches:
            return matches[0]
    unread = {
        place: why
        for place, why in table.unread.items()
        if wanted in (place, place.rpartition(".")[2])
    }
    if unread:
        ((place, why), *_) = unread.items()
        raise DataError(
            f"{place!r} cannot be read: {why}",
            file=path,
            channel=channel,
            remedy="save it as one vector of numbers",
        )
    raise DataError(
        f"there is no column {wanted!r}; there are {_headers(table)}",
        file=path,
        channel=channel,
        remedy=f"name one of them with --column {channel}=COLUMN",
    )


def matrix_hint(table: Table, *, time: bool) -> str:
    """Return what to add to a remedy where columns are those of a matrix, whose names mean nothing."""
    columns = [column for column in table.columns if column.matrix is not None]
    if not columns:
        return ""
    said = f", one of {listed([column.header for column in columns])}"
    first = columns[0]
    if time and first.values is not None and timebase.rises_evenly(first.values):
        said += f"; {first.header} rises evenly, as time does: --column time={first.header}"
    return said


def _of_one_length(
    table: Table, mapped: Mapping[str, Column], path: Path
) -> tuple[Table, dict[str, str]]:
    """Return the columns of the recording's length, and the others with the reason."""
    if table.has_clocks or table.lines is not None:
        return table, {}
    asked = {channel: column.size for channel, column in mapped.items()}
    if len(set(asked.values())) > 1:
        said = ", ".join(f"{channel} {size}" for channel, size in asked.items())
        raise DataError(
            f"the columns asked for have unlike numbers of samples: {said}",
            file=path,
            channel=next(iter(asked)),
            remedy="name columns of one length with --column CHANNEL=COLUMN",
        )
    sizes = Counter(column.size for column in table.columns if column.size > 1)
    if not sizes:
        raise DataError(
            "there are no vectors of numbers in it",
            file=path,
            remedy="save each channel as one vector, all of one length, or as a column of one matrix",
        )
    shared = [size for size, several in sizes.items() if several > 1]
    size = next(iter(asked.values()), max(shared or sizes))
    kept = tuple(column for column in table.columns if column.size == size)
    others = {c.header: f"{c.size} of {size} samples" for c in table.columns if c.size != size}
    return replace(table, columns=kept), others


def _described(table: Table, request: Request, path: Path) -> dict[str, Column]:
    """Return the columns and constants that the folder names; what is not needed may be missing.

    Of a force, a mass is the weight that hangs there: nobody measured it.
    """
    found: dict[str, Column] = {}
    time = request.described.time
    for name, given in request.described.channels.items():
        if given.value is not None:
            unit = weight(given.unit) if given.unit and unit_of(name) == "N" else given.unit
            found[name] = Column(name, np.full(table.n_samples, given.value), unit)
    said = {name: given.column for name, given in request.described.channels.items()}
    for channel, wanted in {"time": time.column, **said}.items():
        if wanted is None or channel in request.columns or (channel == "time" and table.has_clocks):
            continue
        try:
            found[channel] = find_column(wanted, channel, table, path)
        except DataError as error:
            optional = (
                time.sample_time is not None if channel == "time" else not request.asks_for(channel)
            )
            if not optional and not table.own:
                raise DataError(
                    error.problem,
                    file=path,
                    channel=channel,
                    remedy=f"correct its column in {NAME}, or use --column {channel}=COLUMN",
                ) from None
            if not table.own:
                warn(path, f"channel {channel!r} is left out: {error.problem}")
    return found


def _with_time(
    named: dict[str, Column], left_out: dict[str, str], table: Table, path: Path
) -> tuple[dict[str, Column], dict[str, str]]:
    """Return columns with the one that can only be the time: in seconds, or of dates, and rising."""
    found = [name for name, column in named.items() if _rises(column)]
    if len(found) == 1:
        return {"time" if name == found[0] else name: c for name, c in named.items()}, left_out
    dates = [
        c for c in table.columns if c.values is None and c.texts and _are_dates(c, table, path)
    ]
    if len(dates) != 1:
        return named, left_out
    rest = {header: why for header, why in left_out.items() if header != dates[0].header}
    return {"time": dates[0]} | named, rest


def _rises(column: Column) -> bool:
    unit = find(column.unit or parse(column.label).unit or "")
    seconds = unit is not None and unit.target == "s"
    return seconds and column.values is not None and bool(np.all(np.diff(column.values) > 0))


def _are_dates(column: Column, table: Table, path: Path) -> bool:
    if not instants.may_be_instant(column.texts[0]):
        return False
    try:
        return bool(np.all(np.diff(instants.seconds(column.texts, table, path)) >= 0))
    except DataError:
        return False


def _by_units(named: Mapping[str, Column], request: Request) -> dict[str, str]:
    """Return the channels of columns without a known name, such as u1, by their units.

    A name that the caller or the folder uses stays.
    """
    used = {*request.columns, *request.units, *request.calibration, *(request.channels or ())}
    used |= request.described.channels.keys()
    units = {}
    for channel, column in named.items():
        unit = find(column.unit or parse(column.label).unit or "")
        units[channel] = (unit.target or "") if unit and channel not in used else ""
    return by_units(units)


def _require(named: Mapping[str, Column], table: Table, request: Request, path: Path) -> None:
    for channel in request.channels or ():
        if channel not in named:
            raise DataError(
                f"there is no such channel; the columns are {_headers(table)}",
                file=path,
                channel=channel,
                remedy=f"name its column with --column {channel}=COLUMN"
                f"{matrix_hint(table, time='time' not in named)}",
            )
    for word, option, asked in (
        ("unit", "--unit", request.units),
        ("calibration", "--calibrate", request.calibration),
    ):
        for channel in asked:
            if channel not in named:
                raise DataError(
                    f"a {word} is given for it and it is not there; there are {', '.join(named)}",
                    file=path,
                    channel=channel,
                    remedy=f"give {option} for one of them",
                )


def _headers(table: Table) -> str:
    return listed([*(column.header for column in table.columns), *table.unread])


def _converted(
    channel: str, column: Column, table: Table, request: Request, path: Path, notes: _Notes
) -> tuple[Array, Array, str]:
    """Return the samples of a channel, the same without calibration, and their unit."""
    raw = _numbers(channel, column, table, path)
    gain, offset, calibrated = _calibration(channel, column, table, request, notes)
    with np.errstate(over="ignore"):
        values = gain * raw + offset if calibrated else raw
    unit = _unit(channel, column, values, table, request, path, notes)
    target = unit_of(channel)
    target = unit.target if target is None else target
    keeps = target is None or (table.own and unit_of(channel) is None)
    final = unit.name if keeps or target is None else target
    samples = convert(values, unit.name, final)
    recorded = convert(raw, unit.name, final) if calibrated else samples
    if final != unit.name:
        notes.converted.append(f"{channel} from {unit.name} to {final}")
    if not table.own or channel in request.units or calibrated:
        if not table.own:
            samples = quality.without_codes(channel, samples, raw, table, path)
        quality.refuse_impossible(channel, samples, unit_of(channel), unit.name, table, path)
        if not table.own and unit_of(channel) is not None:
            quality.note_outliers(channel, samples, table, path)
    return samples, recorded, final


def _numbers(channel: str, column: Column, table: Table, path: Path) -> Array:
    """Return the samples of a column; `DataError` if it is text or has a flaw."""
    if column.values is None:
        raise DataError(
            f"column {column.header!r} holds text",
            file=path,
            channel=channel,
            row=table.row(0),
            remedy=f"name a column of numbers with --column {channel}=COLUMN",
        )
    if column.flaw is not None:
        flaw = column.flaw
        row = table.row(flaw.sample)
        raise DataError(flaw.problem, file=path, channel=channel, row=row, remedy=flaw.remedy)
    return column.values


def _calibration(
    channel: str, column: Column, table: Table, request: Request, notes: _Notes
) -> tuple[float, float, bool]:
    """Return gain and offset of a channel, as asked for or else described, and whether there are any.

    A file of this package that was calibrated when it was first read is not calibrated again.
    """
    given = request.described.channels.get(channel)
    if given is not None and given.value is not None and column.header == channel:
        notes.calibration[channel] = {"value": given.value, "unit": given.unit}
        return 1.0, 0.0, False
    if channel in request.calibration:
        gain, offset = request.calibration[channel]
    elif isinstance(given, Channel) and given.is_calibrated:
        gain, offset = 1.0 if given.gain is None else given.gain, given.offset or 0.0
    else:
        return 1.0, 0.0, False
    notes.calibration[channel] = {"column": column.header, "gain": gain, "offset": offset}
    return gain, offset, True


def _unit(
    channel: str,
    column: Column,
    values: Array,
    table: Table,
    request: Request,
    path: Path,
    notes: _Notes,
) -> Unit:
    """Return the unit of a column: as asked for, as the file or the folder states it, or assumed.

    Raises
    ------
    DataError
        If the file and the folder state different ones, and none is asked for; or if it is unknown or
        of another dimension.
    """
    expected = unit_of(channel)
    text = request.units.get(channel)
    if text is None:
        text = _stated(channel, column, table, request, path)
    if text is None:
        return _assumed(channel, values, path, notes)
    if (
        table.own
        and channel not in request.units
        and text == (text if expected is None else expected)
    ):
        return Unit(text, expected)
    unit = find(text)
    if unit is None and expected is None and channel not in request.units and len(text) <= LONGEST:
        return Unit(text, None)
    if unit is None:
        raise DataError(
            f"the unit {text[:40]!r} is unknown",
            file=path,
            channel=channel,
            remedy=f"name it, as in --unit {channel}={EXAMPLES.get(expected or '', 'UNIT')}",
        )
    if expected is not None and unit.target != expected:
        raw = unit.target == "V" or text.casefold() in ("count", "counts", "lsb", "adc")
        calibrate = (
            f"calibrate it, as in --calibrate {channel}={column.header}:GAIN:OFFSET:{expected}, "
        )
        said = f"in {text!r}, which does not convert to" if text else "without a unit: it is in"
        raise DataError(
            f"it cannot be {said} {expected or 'a pure number'}",
            file=path,
            channel=channel,
            remedy=f"{calibrate if raw else ''}correct the unit with --unit "
            f"{channel}={expected or '%'}, or name another column with --column {channel}=COLUMN",
        )
    if unit.reference is not None:
        notes.references[channel] = unit.reference
    return unit


def _stated(channel: str, column: Column, table: Table, request: Request, path: Path) -> str | None:
    """Return the unit that the file and the folder state; `DataError` if they state different ones."""
    described = (
        request.described.time if channel == "time" else request.described.channels.get(channel)
    )
    in_header = None if table.own else parse(column.label).unit
    stated = {"its header": in_header, "the file": column.unit}
    if described is not None and described.unit is not None:
        if isinstance(described, Channel) and described.value is not None:
            stated = {NAME: column.unit}
        else:
            # what is calibrated has the unit that the calibration gives
            calibrated = isinstance(described, Channel) and described.is_calibrated
            stated = ({} if calibrated else stated) | {NAME: described.unit}
    texts = {place: text for place, text in stated.items() if text is not None}
    units = {place: find(text) for place, text in texts.items()}
    kinds = {(unit.name, unit.reference) for unit in units.values() if unit}
    if kinds:
        texts = {place: text for place, text in texts.items() if units[place]}
    if len(kinds) > 1:
        said = ", ".join(f"{text!r} in {place}" for place, text in texts.items())
        raise DataError(
            f"its unit is contradicted: {said}",
            file=path,
            channel=channel,
            remedy=f"name the right one, as in --unit {channel}={list(texts.values())[-1]}",
        )
    return list(texts.values())[-1] if texts else None


def _assumed(channel: str, values: Array, path: Path, notes: _Notes) -> Unit:
    """Return the package's unit; `DataError` of a size that is a common one in another unit."""
    expected = unit_of(channel)
    if expected is None:
        return Unit("", "")
    finite = np.abs(values[np.isfinite(values)])
    largest = float(finite.max()) if finite.size else 0.0
    if 0 < largest < quality.DOUBTFUL.get(expected, 0.0):
        fitting = quality.fitting_units(largest, expected, expected)[0]
        raise DataError(
            f"it has no unit, and reaches {largest:.3g}: is it in {fitting}?",
            file=path,
            channel=channel,
            remedy=f"name its unit, as in --unit {channel}={fitting}, or --unit {channel}={expected} "
            "where that is right",
        )
    if expected:
        notes.assumed.append(f"{channel} in {expected}")
    elif largest > 1.5:
        notes.assumed.append(f"{channel} in parts of one (up to {largest:.3g}: is it in %?)")
    return Unit(expected, expected)


def _time(
    column: Column, table: Table, request: Request, path: Path, notes: _Notes
) -> tuple[Array | None, str, bool]:
    """Return times, their unit, and whether the unit is certain."""
    if column.values is None:
        if request.rate is not None:
            notes.left_out[column.header] = "the rate is given"
            return None, "s", True
        return instants.seconds(column.texts, table, path), "s", True
    values = _numbers("time", column, table, path)
    stated = request.units.get("time") or _stated("time", column, table, request, path)
    unit = None if stated else timebase.unit_by_size(values, table, path)
    if not stated and unit is None and timebase.counts(values):
        raise DataError(
            "it has no unit and counts in whole numbers: is it in ms?",
            file=path,
            channel="time",
            row=table.row(0),
            remedy="name its unit, as in --unit time=ms, or --unit time=s where that is right",
        )
    if unit is None:
        unit = _unit("time", column, values, table, request, path, notes).name
    else:
        stated = unit
        warn(
            path,
            f"the times have no unit; by their size they are counted in {unit} since 1970; "
            "use --unit time=UNIT where that is wrong",
        )
    quality.refuse_impossible("time", convert(values, unit, "s"), "s", unit, table, path)
    asked = "time" in request.units or request.described.time.unit is not None
    return values, unit, asked or (bool(stated) and unit != "s")


def _by_place(table: Table, request: Request, path: Path) -> dict[int, str]:
    """Return the channel of every column, by its identity."""
    try:
        named, _ = assign(table, request, path)
    except DataError:  # two columns are one channel, for example: each is then named by its header
        named = {}
        for column in table.columns:
            if column.values is not None:
                named.setdefault(channel_of(parse(column.label)), column)
    kept: Sequence[str] | None = request.channels
    return {id(c): name for name, c in named.items() if kept is None or name in (*kept, "time")}


def _cell(column: Column, k: int) -> str:
    return str(column.texts[k])[:40] if column.values is None else f"{column.values[k]:.6g}"
