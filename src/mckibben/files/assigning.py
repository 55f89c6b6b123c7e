"""Which column of a table is which channel."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from mckibben.errors import DataError
from mckibben.files.calibration import constants
from mckibben.files.channels import NAME
from mckibben.files.headers import LONGEST, by_units, channel_of, parse, snake_case
from mckibben.files.notices import listed, warn
from mckibben.files.request import Request
from mckibben.files.table import Column, Table
from mckibben.files.timebase import rises_evenly
from mckibben.files.units import find

ROLES = ("reference_", "command_")
"""What names of a loop's channels begin with."""


def assign(table: Table, request: Request, path: Path) -> tuple[dict[str, Column], list[str]]:
    """Return the column of every channel, in the order of the file, and the columns left out.

    Columns that the request maps go before those that the folder describes, and these before those
    whose headers say the channel; numbers go before text, and text is left out unless it was asked for
    or may be the time.

    Raises
    ------
    DataError
        If a channel asked for is missing, or two columns are one channel.
    """
    for column in table.columns:
        if len(column.header) > LONGEST and not table.own:
            raise DataError(
                f"the header {column.header[:40]!r}... has {len(column.header)} characters",
                file=path,
                remedy=f"shorten it to {LONGEST} at most",
            )
    mapped = {
        channel: _column(wanted, channel, table, path)
        for channel, wanted in request.columns.items()
        if not (channel == "time" and table.has_clocks)
    }
    mapped = _described(table, request, path) | mapped
    named: dict[str, Column] = dict(mapped)
    left_out: list[str] = []
    numbers_first = sorted(table.columns, key=lambda column: column.values is None)
    for column in numbers_first:
        if any(column is taken for taken in mapped.values()):
            continue
        header = parse(column.label)
        channel = column.header if table.own else channel_of(header)
        if channel in mapped and not table.own:
            channel = snake_case(header.name)
        if channel in named and channel.startswith(ROLES):
            channel = snake_case(header.name)  # the first of several references is the loop's
        text = column.values is None
        wanted = channel not in named and (channel == "time" or request.asks_for(channel))
        if channel in mapped or (text and not wanted):
            left_out.append(column.header)
        elif channel in named:
            raise DataError(
                f"columns {named[channel].header!r} and {column.header!r} both hold it",
                file=path,
                channel=channel,
                remedy=f"say which, with --column {channel}={named[channel].header!r}; "
                "the columns of a file need different headers",
            )
        else:
            named[channel] = column
    order = {id(column): place for place, column in enumerate(table.columns)}
    named = dict(sorted(named.items(), key=lambda item: order.get(id(item[1]), len(order))))
    found = {} if table.own else _by_units(named, request)
    said = [f"{named[name].header!r} as {channel}" for name, channel in found.items()]
    named = {found.get(channel, channel): column for channel, column in named.items()}
    _require(named, table, request, path)
    if said:
        warn(
            path,
            f"no name tells what these columns are, so they are taken by their units: {listed(said)}; "
            "say --column CHANNEL=COLUMN where that is wrong",
        )
    return named, left_out


def _described(table: Table, request: Request, path: Path) -> dict[str, Column]:
    """Return the columns and constants that the folder names; what is not needed may be missing."""
    time, found = request.described.time, constants(request.described, table)
    said = {name: given.column for name, given in request.described.channels.items()}
    for channel, wanted in {"time": time.column, **said}.items():
        if wanted is None or channel in request.columns or (channel == "time" and table.has_clocks):
            continue
        try:
            found[channel] = _column(wanted, channel, table, path)
        except DataError as error:
            if time.sample_time is not None if channel == "time" else not request.asks_for(channel):
                warn(path, f"channel {channel!r} is left out: {error.problem}")
                continue
            raise DataError(
                error.problem,
                file=path,
                channel=channel,
                remedy=f"correct its column in {NAME}, or say --column {channel}=COLUMN",
            ) from None
    return found


def _column(wanted: str, channel: str, table: Table, path: Path) -> Column:
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
            numbered = matches[0].matrix is not None
            raise DataError(
                f"{len(matches)} columns are named {wanted!r}",
                file=path,
                channel=channel,
                remedy=f"name one of {headers}" if numbered else "give them different headers",
            )
        if matches:
            return matches[0]
    raise DataError(
        f"there is no column {wanted!r}; there are {_listed(table)}",
        file=path,
        channel=channel,
        remedy=f"name one of them with --column {channel}=COLUMN",
    )


def _require(named: Mapping[str, Column], table: Table, request: Request, path: Path) -> None:
    for channel in request.channels or ():
        if channel not in named:
            raise DataError(
                f"there is no such channel; the columns are {_listed(table)}",
                file=path,
                channel=channel,
                remedy=f"name its column with --column {channel}=COLUMN"
                f"{of_matrix(table, time='time' not in named)}",
            )
    for word, option, asked in (
        ("unit", "--unit", request.units),
        ("calibration", "a calibration", request.calibration),
    ):
        for channel in asked:
            if channel not in named:
                raise DataError(
                    f"a {word} is given for it and it is not there; there are {', '.join(named)}",
                    file=path,
                    channel=channel,
                    remedy=f"give {option} for one of them",
                )


def of_matrix(table: Table, *, time: bool) -> str:
    """Return what to add to a remedy where columns are those of a matrix, whose names tell nothing."""
    columns = [column for column in table.columns if column.matrix is not None]
    if not columns:
        return ""
    said = f", one of {listed([column.header for column in columns])}"
    first = columns[0]
    if time and first.values is not None and rises_evenly(first.values):
        said += f"; {first.header} rises evenly, as time does: --column time={first.header}"
    return said


def _by_units(named: Mapping[str, Column], request: Request) -> dict[str, str]:
    """Return what columns without telling names, such as u1, are called, as their units tell.

    What the caller or the folder speaks of by its own name keeps it.
    """
    spoken = {*request.columns, *request.units, *request.calibration, *(request.channels or ())}
    spoken |= request.described.channels.keys()
    units = {}
    for channel, column in named.items():
        unit = find(column.unit or parse(column.label).unit or "")
        units[channel] = (unit.target or "") if unit and channel not in spoken else ""
    return by_units(units)


def _listed(table: Table) -> str:
    return listed([column.header for column in table.columns])
