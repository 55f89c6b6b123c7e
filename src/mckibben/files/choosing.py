"""Assignment of table columns to channels."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from difflib import get_close_matches

import numpy as np

from mckibben.arrays import Array
from mckibben.errors import DataError
from mckibben.files.channels import NAME
from mckibben.files.headers import (
    by_units,
    by_words,
    channel_of,
    parse,
    snake_case,
    time_unit,
    unit_of,
)
from mckibben.files.instants import may_be_instant
from mckibben.files.notices import listed
from mckibben.files.request import Source
from mckibben.files.table import Column, Table
from mckibben.files.timebase import MOST_WITHOUT_TIME
from mckibben.files.units import find, weight
from mckibben.recording import COMMAND, REFERENCE, REST_LENGTH, conversion
from mckibben.system.atomic import Numbers


@dataclass(frozen=True)
class Seen(Numbers):
    """A column of a file, as shown in an import, with its ``first`` cells and all its numbers.

    The unit is empty where the file states none, and ``channel``, which it is read as, where it is left
    out; ``unasked`` is the channel that it is read as without options. Text has no numbers.
    """

    header: str
    unit: str
    first: tuple[str, ...]
    channel: str
    unasked: str
    numbers: Array | None = field(default=None, repr=False, compare=False)


def seen(source: Source) -> list[Seen]:
    """Return the columns of a table and their channels; on an error, channels by header."""
    plain = replace(
        source.request, columns={}, units={}, channels=None, rate=None, sample_time=None
    )
    channels, plain_channels = (named_in(each) for each in (source, replace(source, request=plain)))
    return [
        Seen(
            column.header,
            column.unit or parse(column.label).unit or "",
            tuple(str(text)[:40] for text in column.texts[:4])
            if column.values is None
            else tuple(f"{value:.6g}" for value in column.values[:4]),
            channels.get(column.header, ""),
            plain_channels.get(column.header, ""),
            column.values,
        )
        for column in source.table.columns
    ]


def named_in(source: Source) -> dict[str, str]:
    """Return the channel of every column by its header; on an error, channels by header."""
    try:
        named, _ = assign(source)
    except DataError:  # two columns are one channel, for example: each is then named by its header
        named = {}
        for column in source.table.columns:
            if column.values is not None:
                named.setdefault(channel_of(parse(column.label)), column)
    wanted = source.request.channels
    return {
        c.header: name for name, c in named.items() if wanted is None or name in (*wanted, "time")
    }


def assign(source: Source) -> tuple[dict[str, Column], dict[str, str]]:
    """Return the column of every channel, in the order of the file, and why others are left out.

    Columns that the request names go before those that the folder describes, and these before those
    whose headers name the channel; numbers go before text. Unless columns have clocks of their own,
    all have one length: that of the requested columns, or else the longest that several have.

    Raises
    ------
    DataError
        If a channel asked for is missing, or two columns are one channel.
    """
    table = source.table
    requested = _requested(source)
    source, of_other_length = _of_one_length(source, requested)
    named, left_out = _by_header(source, _described(source) | requested)
    left_out = of_other_length | left_out

    places = {id(column): i for i, column in enumerate(source.table.columns)}
    named = dict(sorted(named.items(), key=lambda item: places.get(id(item[1]), len(places))))
    if not table.own:
        time = None if "time" in named or table.has_clocks else _only_time(named, source)
        if time is not None:
            left_out.pop(time.header, None)
            rest = {name: column for name, column in named.items() if column is not time}
            named = {"time": time} | rest
        named = _by_unit(source, named)

    _require(named, source)
    return named, left_out | dict(table.unread)


def _requested(source: Source) -> dict[str, Column]:
    """Return the columns that the request names."""
    request, columns = source.request, dict[str, Column]()
    for channel, header in request.columns.items():
        if not (channel == "time" and source.table.has_clocks):
            try:
                columns[channel] = find_column(header, channel, source)
            except DataError:
                if not request.join:  # where another file may have it
                    raise
    return columns


def _by_header(
    source: Source, fixed: Mapping[str, Column]
) -> tuple[dict[str, Column], dict[str, str]]:
    """Return ``fixed`` columns and those that their headers name, and why others are left out."""
    named, left_out = dict(fixed), dict[str, str]()
    fixed_ids = {id(column) for column in fixed.values()}
    for column in sorted(source.table.columns, key=lambda column: column.values is None):
        if id(column) in fixed_ids:
            continue
        channel = _channel(column, source, fixed, named)
        is_wanted = channel == "time" or source.request.asks_for(channel)
        if column.values is None and (channel in named or not is_wanted):
            left_out[column.header] = "text"
        elif channel in fixed:
            left_out[column.header] = f"{channel} is read from another column"
        elif channel in named:
            headers = [named[channel].header, column.header]
            problem = f"columns {headers[0]!r} and {headers[1]!r} both hold it"
            options = [{"columns": {channel: header}} for header in headers]
            raise source.error(problem, "give them different headers", channel, options=options)
        else:
            named[channel] = column
    return named, left_out


def _channel(
    column: Column, source: Source, fixed: Mapping[str, Column], named: Mapping[str, Column]
) -> str:
    """Return the channel that a header names; its own name where the channel has a column already.

    That is for references and commands, of which the first is the loop's, and for channels that nobody
    asks for.
    """
    request, is_own, header = source.request, source.table.own, parse(column.label)
    channel = column.header if is_own else channel_of(header)
    without_unit = channel_of(replace(header, unit=None))
    if not is_own and without_unit in request.units:  # whatever the header says of its unit
        channel = without_unit
    of_loop = channel.startswith((REFERENCE, COMMAND))
    if (channel in fixed and not is_own) or (channel in named and of_loop):
        channel = snake_case(header.name)
    if channel in named and channel not in fixed and not request.needs(channel):
        channel = snake_case(column.header)
    return channel


def _by_unit(source: Source, named: Mapping[str, Column]) -> dict[str, Column]:
    """Return columns by the channels of their units and words, but for those that options name."""
    request = source.request
    stated = {*request.columns, *request.units, *request.calibration, *(request.channels or ())}
    stated |= request.described.channels.keys()
    units = {name: "" if name in stated else _target(column) for name, column in named.items()}
    renamed = by_words(units)
    renamed |= by_units({renamed.get(name, name): unit for name, unit in units.items()})
    notes = [f"{named[name].header!r} as {channel}" for name, channel in renamed.items()]
    if notes:
        source.warn(
            f"these columns are read by their units, or by a word in their names: {listed(notes)}; "
            "use `columns[CHANNEL]=COLUMN` where that is wrong"
        )
    return {renamed.get(name, name): column for name, column in named.items()}


def find_column(wanted: str, channel: str, source: Source) -> Column:
    """Return the column of a name: exact, without its unit, or in another case."""
    table = source.table
    readings = (
        lambda column: column.header == wanted,
        lambda column: parse(column.header).name == wanted.strip(),
        lambda column: column.header.casefold().strip() == wanted.casefold().strip(),
        lambda column: snake_case(parse(column.header).name) == snake_case(wanted),
        lambda column: column.label == wanted,
        lambda column: column.place == wanted,
    )
    for reading in readings:
        matches = [column for column in table.columns if reading(column)]
        if len(matches) > 1:
            headers = [column.header for column in matches]
            differ = len(set(headers)) == len(headers)
            options = [{"columns": {channel: header}} for header in headers if differ]
            problem = f"{len(matches)} columns are named {wanted!r}: {listed(headers)}"
            raise source.error(problem, "give them different headers", channel, options=options)
        if matches:
            return matches[0]
    for path, why in table.unread.items():
        if wanted in (path, path.rpartition(".")[2]):
            remedy = "save it as one vector of numbers"
            raise source.error(f"{path!r} cannot be read: {why}", remedy, channel)
    problem = f"there is no column {wanted!r}; there are {_headers(table)}"
    near = get_close_matches(wanted, [column.header for column in table.columns], 1)
    options = [{"columns": {channel: header}} for header in near]
    remedy = f"name one of them with `columns[{channel}]=COLUMN`"
    raise source.error(problem, remedy, channel, options=options)


def _of_one_length(source: Source, fixed: Mapping[str, Column]) -> tuple[Source, dict[str, str]]:
    """Return the source with columns of the recording's length, and why others are left out."""
    columns = source.table.columns
    if source.table.has_clocks or source.table.lines is not None:
        return source, {}
    sizes_asked = {channel: column.size for channel, column in fixed.items()}
    if len(set(sizes_asked.values())) > 1:
        sizes = ", ".join(f"{channel} {size}" for channel, size in sizes_asked.items())
        problem = f"the requested columns have different numbers of samples: {sizes}"
        remedy = "name columns of one length with `columns[CHANNEL]=COLUMN`"
        raise source.error(problem, remedy, next(iter(sizes_asked)))
    counts = Counter(column.size for column in columns if column.size > 1)
    if not counts:
        remedy = "save each channel as one vector, all of one length, or as a column of one matrix"
        raise source.error("there are no vectors of numbers in it", remedy)
    shared = [size for size, several in counts.items() if several > 1]
    size = next(iter(sizes_asked.values()), max(shared or counts))
    table = replace(source.table, columns=tuple(c for c in columns if c.size == size))
    left_out = {c.header: f"{c.size} of {size} samples" for c in columns if c.size != size}
    return replace(source, table=table), left_out


def _described(source: Source) -> dict[str, Column]:
    """Return the columns and constants of the folder's settings; optional ones may be missing.

    A mass that is described as a force is its weight.
    """
    table, request = source.table, source.request
    time, channels = request.described.time, request.described.channels
    columns: dict[str, Column] = {}
    for name, info in channels.items():
        if info.value is not None:
            unit = weight(info.unit) if info.unit and unit_of(name) == "N" else info.unit
            columns[name] = Column(name, np.full(table.n_samples, info.value), unit)
    headers = {"time": time.column, **{name: info.column for name, info in channels.items()}}
    for channel, header in headers.items():
        if header is None or channel in request.columns or (channel == "time" and table.has_clocks):
            continue
        try:
            columns[channel] = find_column(header, channel, source)
        except DataError as error:
            if table.own:
                continue
            if time.sample_time is None if channel == "time" else request.asks_for(channel):
                remedy = f"correct its column in {NAME}, or use `columns[{channel}]=COLUMN`"
                raise source.error(error.problem, remedy, channel, options=error.options) from None
            source.warn(f"channel {channel!r} is left out: {error.problem}")
    return columns


def _only_time(named: Mapping[str, Column], source: Source) -> Column | None:
    """Return the only possible time column: in seconds and increasing, or else of dates."""
    in_seconds = [
        column
        for column in named.values()
        if column.values is not None
        and (_target(column) == "s" or time_unit(column.label))
        and np.isfinite(column.values).mean() > 1 - MOST_WITHOUT_TIME
        and np.all(np.diff(column.values[np.isfinite(column.values)]) > 0)
    ]
    dates = [
        column
        for column in source.table.columns
        if column.values is None and column.texts and may_be_instant(column.texts[0])
    ]
    return next((few[0] for few in (in_seconds, dates) if len(few) == 1), None)


def _target(column: Column) -> str:
    """Return the package's unit for the unit of a column, empty if there is none."""
    unit = find(column.unit or parse(column.label).unit or "")
    return (unit.target or "") if unit else ""


def _require(named: Mapping[str, Column], source: Source) -> None:
    """Raise an error for requested channels that are missing."""
    request, table = source.request, source.table
    for channel in () if request.join else request.channels or ():
        if channel not in named and channel not in source.derived(named):
            problem = f"there is no such channel; the columns are {_headers(table)}"
            remedy = f"name its column with `columns[{channel}]=COLUMN`"
            if convertible := [name for name in named if conversion(channel, name, 1.0)]:
                remedy = f"state {REST_LENGTH}, which makes it of {convertible[0]}"
            raise source.error(problem, remedy, channel)
    for option, stated in (("calibration", request.calibration), ("units", request.units)):
        for channel in stated:
            if channel not in named and not request.join:
                problem = f"it is not there; there are {', '.join(named)}"
                raise source.error(problem, f"give `{option}` of one of them", channel)


def _headers(table: Table) -> str:
    return listed([*(column.header for column in table.columns), *table.unread])
