"""Reading what was uploaded: large files in a process of their own, whose memory goes with it."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypeVar

from mckibben.app.kept import Reading
from mckibben.errors import TooLargeError
from mckibben.files import columns_of, read
from mckibben.files.choosing import Seen
from mckibben.files.own import description
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

Result = TypeVar("Result")

AS_FOUND = Reading()
"""Everything by its header."""


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
    return columns_of(path, **options(reading))
