"""File formats: ending to reader module, one line each."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from io import BufferedReader
from pathlib import Path
from types import ModuleType

from mckibben.errors import DataError, MckibbenError
from mckibben.files.table import Table, distinct, legible
from mckibben.system.ordinary import opened
from mckibben.system.validation import reason

MOST_BYTES = 2**31
"""Largest file that is read by default [bytes]."""

READERS: dict[str, str] = {
    ".csv": "text",
    ".tsv": "text",
    ".txt": "text",
    ".dat": "text",
    ".log": "text",
    ".lvm": "text",
    ".parquet": "parquet",
    ".mat": "matlab",
    ".h5": "hdf5",
    ".hdf5": "hdf5",
    ".tdms": "tdms",
    ".xlsx": "xlsx",
    ".bag": "bags",
    ".mcap": "bags",
    ".db3": "bags",
}
"""Ending of the file's name -> module of this folder with ``read(file, path) -> list[Table]``."""

SOUGHT = tuple(ending for ending in READERS if ending != ".log")
"""Endings that a folder is searched for."""


def tables(path: Path) -> list[Table]:
    """Return the raw contents of a file; errors as in `read`."""
    with opened(path, most=MOST_BYTES) as file:
        return read(file, path)


def read(file: BufferedReader, path: Path) -> list[Table]:
    """Return the raw contents of an open file.

    Raises
    ------
    DataError
        If it is empty or damaged, or its ending is unknown.
    """
    module = _module(path)
    with refusing(path):
        if not file.peek(1):
            remedy = "give a file with a header and samples"
            raise DataError("there is nothing in it", file=path, remedy=remedy)
        return [distinct(legible(table)) for table in module.read(file, path)]


def laid_out(
    file: BufferedReader, path: Path, header: int, skip: int, encoding: str | None
) -> BufferedReader:
    """Return a text as `mckibben.files.text.laid_out` does; raise a `DataError` for other formats."""
    if header <= 1 and not skip and encoding is None:
        return file
    if READERS.get(path.suffix.casefold()) != "text":
        problem, remedy = "only text has lines and an encoding", "leave both as found"
        raise DataError(problem, file=path, remedy=remedy)
    text = _module(path)
    found: BufferedReader = text.laid_out(file, path, header, skip, encoding)
    return found


def bag(folder: Path) -> list[Table]:
    """Return the contents of a ROS 2 bag folder; errors as in `read`."""
    with refusing(folder):
        return [legible(table) for table in import_module("mckibben.files.bags").folder(folder)]


@contextmanager
def refusing(path: Path) -> Iterator[None]:
    """Convert any exception of a library to an error that names the file."""
    try:
        yield
    except MckibbenError:
        raise
    except MemoryError:
        problem, remedy = "it needs more memory than there is", "split it into shorter recordings"
        raise DataError(problem, file=path, remedy=remedy) from None
    except Exception as error:
        problem = f"it is damaged, or not {path.suffix[1:] or 'a bag'} ({reason(error)})"
        remedy = "export it again from its source"
        if isinstance(error, OSError) and error.strerror:  # without, it is about the contents
            problem = f"it cannot be read ({error.strerror})"
            remedy = "check the path and its rights"
        raise DataError(problem, file=path, remedy=remedy) from None


def _module(path: Path) -> ModuleType:
    ending = path.suffix.casefold()
    if ending not in READERS:
        ended = f"ending in {ending!r}" if ending else "without an ending"
        raise DataError(
            f"files {ended} cannot be read", file=path, remedy=f"give one of {', '.join(READERS)}"
        )
    return import_module(f"mckibben.files.{READERS[ending]}")
