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
from mckibben.files.converting import in_package_units
from mckibben.files.headers import channel_of, is_standard, is_time, parse, unit_of
from mckibben.files.request import Request
from mckibben.files.table import Column, Table
from mckibben.files.units import convert

REMEDY = (
    "name the files as channels, such as pressure.csv and displacement.csv; or write in "
    f'{NAME} which belong together, as in join = ["*_pressure.csv", "*_displacement.csv"]; or give '
    "files instead of the folder, where each is a recording"
)


def are_one(paths: Sequence[Path], said: Folder) -> bool:
    """Return whether the files of a folder hold one signal each and are one recording together.

    They are where each has one column beside the times, and these are of different channels, at least
    one of them a standard one, by its header or the file's name. They are not where one has more
    columns, or all are of one channel; otherwise `DataError`.
    """
    if len(paths) < 2:
        return False
    channels: list[str] = []
    for path in paths:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            tables = formats.tables(path)
        signals, _ = _split(tables[0], said.of(path.name).time.column)
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
    stamp = request.columns.get("time", request.described.time.column)
    parts = {path: _split(table, stamp) for path, table in tables.items()}
    for path, (found, clocks) in parts.items():
        problem = None
        if len(found) != 1:
            problem = f"{len(found)} columns of numbers, where one signal is expected"
        elif len(clocks) != 1 and any(times for _, times in parts.values()):
            problem = f"{len(clocks)} columns of times, where another file has one"
        if problem:
            raise DataError(
                f"it has {problem}",
                file=path,
                channel="time" if len(found) == 1 else None,
                remedy="save one signal in every file, and one column of times in all or in none, "
                f"and give --rate; or leave the file out of join in {NAME}",
            )
    signals = [
        _named(found[0], name) for (found, _), name in zip(parts.values(), names, strict=True)
    ]
    clocks = [each for _, times in parts.values() for each in times]
    first = next(iter(tables.values()))
    if not clocks:
        lengths = {path.name: table.n_samples for path, table in tables.items()}
        if len(set(lengths.values())) > 1:
            raise DataError(
                "its files have no times and differ in length: "
                + ", ".join(f"{name} {n}" for name, n in lengths.items()),
                file=next(iter(tables)).parent,
                remedy=REMEDY,
            )
        alike = {(each.sample_time, *each.rates.items()) for each in tables.values()}
        step, rates = (first.sample_time, first.rates) if len(alike) == 1 else (None, {})
        return Table(tuple(signals), first.lines, step, first.start_time, rates=rates)
    if all(_same(each, clocks[0]) for each in clocks):
        return Table((clocks[0], *signals), first.lines)
    return Table(
        tuple(
            replace(signal, times=_seconds(times, table, request, path))
            for signal, times, (path, table) in zip(signals, clocks, tables.items(), strict=True)
        )
    )


def _split(table: Table, stamp: str | None) -> tuple[list[Column], list[Column]]:
    """Return the signals of a table, and its times."""
    signals: list[Column] = []
    times: list[Column] = []
    for column in table.columns:
        if stamp in (column.header, parse(column.label).name) or is_time(column.label):
            times.append(column)
        elif column.values is not None:
            signals.append(column)
    return signals, times


def _named(column: Column, name: str) -> Column:
    """Return a column with the name of its file for the channel, or else with that of its header."""
    if is_standard(column.header) and not is_standard(name):
        return replace(column, header=name, says=column.header)
    return replace(column, header=name, unit=column.unit or parse(column.header).unit)


def _same(one: Column, other: Column) -> bool:
    if (one.header, one.unit, list(one.texts)) != (other.header, other.unit, list(other.texts)):
        return False
    if one.values is None or other.values is None:
        return one.values is other.values
    return np.array_equal(one.values, other.values, equal_nan=True)


def _seconds(clock: Column, table: Table, request: Request, path: Path) -> Array:
    """Return the times of a file [s]."""
    units = {name: unit for name, unit in request.units.items() if name == "time"}
    said = Described(time=Time(unit=request.described.time.unit))
    alone = Request({}, units, None, request.gaps, None, informative=False, described=said)
    time = replace(clock, header="time", says=None, unit=clock.unit or parse(clock.label).unit)
    rest = Column("signal", np.zeros(table.n_samples), "1")
    source = alone.of(replace(table, columns=(time, rest)), path)
    _, times, _ = in_package_units(source)
    assert times is not None
    return convert(timebase.checked(times.values, source), times.unit, "s")
