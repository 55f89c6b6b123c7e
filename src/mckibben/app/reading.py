"""Reading what was uploaded: large files in a process of their own, whose memory goes with it."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypeVar

from mckibben.app.kept import Reading
from mckibben.errors import DataError, TooLargeError
from mckibben.files import formats, read
from mckibben.files.choosing import assign
from mckibben.files.headers import channel_of, parse
from mckibben.files.own import description
from mckibben.files.request import Request
from mckibben.files.table import Column, Table
from mckibben.recording import Recording
from mckibben.system.workers import Tell, Workers

LARGE = 16 * 2**20
"""Bytes of a file beyond which it is worth starting a process for."""

MOST_MEMORY = 4 * 2**30
"""Bytes that such a process may address."""

MOST_CELLS = 40_000_000
"""Samples times channels of all recordings of a file."""

START = 2**18
"""Bytes of a long text that tell its columns."""

FIRST = 4
"""Cells of a column that are shown."""

Result = TypeVar("Result")

AS_FOUND = Reading()
"""Everything by its header."""


@dataclass(frozen=True)
class Seen:
    """A column of a file.

    Parameters
    ----------
    header : str
        As it stands in the file.
    unit : str
        As the file says it; empty where it does not.
    first : tuple of str
        Its first cells.
    channel : str
        What it is taken for; empty where it is left out.
    unasked : str
        What it is taken for by its header alone.
    """

    header: str
    unit: str
    first: tuple[str, ...]
    channel: str
    unasked: str


def options(reading: Reading) -> dict[str, Any]:
    """Return what `mckibben.read` is to be told."""
    return reading.model_dump(exclude_defaults=True)


def read_upload(path: Path, reading: Reading = AS_FOUND) -> list[Recording]:
    """Return the recordings of a file.

    Raises
    ------
    DataError
        If it cannot be read, or holds or takes more than is kept in memory here.
    """
    return _aside(_read, path, reading)


def columns(path: Path, reading: Reading) -> list[Seen]:
    """Return the columns of a file, and what each is taken for; errors are those of `read_upload`.

    Of a long text, the first lines do.
    """
    start = _start(path)
    if start is None:
        return _aside(_columns, path, reading)
    with TemporaryDirectory() as folder:
        short = Path(folder, path.name)
        short.write_bytes(start)
        return _columns(short, reading)


def _start(path: Path) -> bytes | None:
    """Return the first lines of a long text without a description; None of all other files."""
    beside = description(path)
    if path.stat().st_size <= LARGE or beside is None or beside.exists():
        return None
    with path.open("rb") as file:
        start = file.read(START)
    wide = start.startswith((b"\xff\xfe", b"\xfe\xff"))
    return None if wide else start[: start.rfind(b"\n") + 1] or None


def _aside(what: Callable[[Path, Reading], Result], path: Path, reading: Reading) -> Result:
    if path.stat().st_size <= LARGE:
        return what(path, reading)
    with Workers(1) as workers:
        (outcome,) = workers.results(_bounded, [(what, path, reading)])
        found: Result = outcome.result()
    return found


def _bounded(
    _: object, item: tuple[Callable[[Path, Reading], Any], Path, Reading], tell: Tell
) -> Any:
    if sys.platform != "win32":
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (MOST_MEMORY, MOST_MEMORY))
    what, path, reading = item
    return what(path, reading)


def _read(path: Path, reading: Reading) -> list[Recording]:
    found = read(path, informative=False, **options(reading))
    if reading.channels is not None:
        found = [one.select(reading.channels) for one in found]
    if sum(len(one) * len(one.channels) for one in found) > MOST_CELLS:
        raise TooLargeError(
            f"it holds more than {MOST_CELLS:,} numbers",
            file=path,
            remedy="cut or thin it before it is dropped here",
        )
    return found


def _columns(path: Path, reading: Reading) -> list[Seen]:
    (table, *_) = formats.tables(path)
    found, unasked = _channels(table, reading, path), _channels(table, AS_FOUND, path)
    return [
        Seen(
            column.header,
            column.unit or parse(column.label).unit or "",
            _first(column),
            found.get(id(column), ""),
            unasked.get(id(column), ""),
        )
        for column in table.columns
    ]


def _channels(table: Table, reading: Reading, path: Path) -> dict[int, str]:
    request = Request(reading.columns, {}, reading.rate, reading.gaps, None)
    try:
        named, _ = assign(table, request, path)
    except DataError:  # two columns are one channel, say: each is then named by its header alone
        named = {}
        for column in table.columns:
            if column.values is not None:
                named.setdefault(channel_of(parse(column.label)), column)
    kept = reading.channels
    return {id(c): name for name, c in named.items() if kept is None or name in (*kept, "time")}


def _first(column: Column) -> tuple[str, ...]:
    if column.values is None:
        return tuple(f"{text}"[:40] for text in column.texts[:FIRST])
    return tuple(f"{value:.6g}" for value in column.values[:FIRST])
