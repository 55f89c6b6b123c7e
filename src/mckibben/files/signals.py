"""Files that hold one signal each, and are one recording together."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from mckibben.arrays import Array
from mckibben.errors import DataError
from mckibben.files import formats, timebase
from mckibben.files.channels import NAME, Described, Folder, Time
from mckibben.files.choosing import choose
from mckibben.files.headers import channel_of, parse, unit_of
from mckibben.files.request import Request
from mckibben.files.table import Column, Table
from mckibben.files.units import convert

REMEDY = (
    "name the files as channels, such as pressure.csv and displacement.csv; or say in "
    f'{NAME} which belong together, as in join = ["*_pressure.csv", "*_displacement.csv"]; or give '
    "files instead of the folder, where each is a recording"
)


def are_one(paths: Sequence[Path], said: Folder) -> bool:
    """Tell whether the files of a folder hold one signal each and are one recording together.

    They are where each has one column beside the times, and these are of different channels, at least
    one of them a standard one, by its header or the file's name. They are not where one has more
    columns, or all are of one channel.

    Raises
    ------
    DataError
        If neither can be told.
    """
    if len(paths) < 2:
        return False
    channels: list[str] = []
    for path in paths:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            tables = formats.tables(path)
        signals = _signals(tables[0], said.of(path.name).time.column)
        if len(tables) > 1 or len(signals) != 1:
            return False
        channels.append(channel_of(parse(_named(signals[0], path.stem).label)))
    if len(set(channels)) == 1:
        return False
    if len(set(channels)) < len(channels) or not any(map(unit_of, channels)):
        raise DataError(
            "its files hold one signal each, and neither their names nor their headers tell which "
            f"belong together: {', '.join(path.name for path in paths[:10])}",
            file=paths[0].parent,
            remedy=REMEDY,
        )
    return True


def joined(tables: Mapping[Path, Table], names: Sequence[str], request: Request) -> Table:
    """Return the table of several files that hold one signal each.

    Parameters
    ----------
    tables : mapping of Path to Table
        What is in each file.
    names : sequence of str
        What to call the signal in each.
    request : Request

    Raises
    ------
    DataError
        If one holds no or several signals; if some have times and others not, or none has and their
        lengths differ.
    """
    signals: dict[Path, Column] = {}
    stamp = request.columns.get("time", request.described.time.column)
    for (path, table), name in zip(tables.items(), names, strict=True):
        found = _signals(table, stamp)
        if len(found) != 1:
            raise DataError(
                f"it has {len(found)} columns of numbers, where one signal is expected",
                file=path,
                remedy=f"leave it out of join in {NAME}, or save one column beside the times in it",
            )
        signals[path] = _named(found[0], name)
    clocks = [
        [column for column in table.columns if _is_time(column, stamp)] for table in tables.values()
    ]
    first = next(iter(tables.values()))
    columns = tuple(signals.values())
    if not any(clocks):
        lengths = {path.name: table.n_samples for path, table in tables.items()}
        if len(set(lengths.values())) > 1:
            said = ", ".join(f"{name} {n}" for name, n in lengths.items())
            raise DataError(
                f"its files have no times and differ in length: {said}",
                file=next(iter(tables)).parent,
                remedy=REMEDY,
            )
        stated = (first.sample_time, first.rates)
        same = all((table.sample_time, table.rates) == stated for table in tables.values())
        step, told = stated if same else (None, {})
        return Table(columns, first.lines, step, first.start_time, rates=told)
    for path, clock in zip(tables, clocks, strict=True):
        if len(clock) != 1:
            raise DataError(
                f"it has {len(clock)} columns of times, where another file has one",
                file=path,
                channel="time",
                remedy="save one column of times in every file, or in none and give --rate",
            )
    if all(_same(clock[0], clocks[0][0]) for clock in clocks):
        return Table((clocks[0][0], *columns), first.lines)
    return Table(
        tuple(
            replace(signals[path], times=_seconds(clock[0], table, request, path))
            for (path, table), clock in zip(tables.items(), clocks, strict=True)
        )
    )


def _is_time(column: Column, stamp: str | None) -> bool:
    header = parse(column.label)
    return stamp in (column.header, header.name) or channel_of(header) == "time"


def _signals(table: Table, stamp: str | None) -> list[Column]:
    return [each for each in table.columns if each.values is not None and not _is_time(each, stamp)]


def _named(column: Column, name: str) -> Column:
    """Return a column that is called by a name, which tells the channel; or else its own header does."""
    header = parse(column.header)
    if not _is_standard(name) and _is_standard(column.header):
        return replace(column, header=name, says=column.header)
    return replace(column, header=name, unit=column.unit or header.unit)


def _is_standard(header: str) -> bool:
    return unit_of(channel_of(parse(header))) is not None


def _same(one: Column, other: Column) -> bool:
    if one.header != other.header or one.unit != other.unit:
        return False
    if one.values is None or other.values is None:
        return one.values is other.values and list(one.texts) == list(other.texts)
    return np.array_equal(one.values, other.values, equal_nan=True)


def _seconds(clock: Column, table: Table, request: Request, path: Path) -> Array:
    """Return the times of a file [s]."""
    units = {name: unit for name, unit in request.units.items() if name == "time"}
    said = Described(time=Time(unit=request.described.time.unit))
    alone = Request({}, units, None, request.gaps, None, informative=False, described=said)
    time = replace(clock, header="time", says=None, unit=clock.unit or parse(clock.label).unit)
    rest = Column("signal", np.zeros(table.n_samples), "1")
    choice = choose(replace(table, columns=(time, rest)), alone, path)
    assert choice.time is not None
    return convert(timebase.checked(choice.time, table, path), choice.time_unit, "s")
