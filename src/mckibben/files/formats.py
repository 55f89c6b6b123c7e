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
    ".json": "jsontext",
    ".jsonl": "jsontext",
    ".ndjson": "jsontext",
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

SOUGHT = tuple(ending for ending in READERS if ending not in (".log", ".json"))
"""Endings that a folder is searched for; of JSON are also models, results and descriptions."""


def tables(path: Path) -> list[Table]:
    """Return the raw contents of a file; errors as in `read`."""
    with opened(path, most=MOST_BYTES) as file:
        return read(file, path)


def read(file: BufferedReader, path: Path, sheet: str | None = None) -> list[Table]:
    """Return the raw contents of an open file, of spreadsheets those of a sheet.

    Raises
    ------
    DataError
        If it is empty or damaged, or its ending is unknown; if a sheet is named where there are none.
    """
    module = _module(path)
    options = {} if sheet is None else {"sheet": sheet}
    if options and _reader(path) != "xlsx":
        problem, remedy = "only spreadsheets have sheets", "leave it out"
        raise DataError(problem, file=path, parameter="sheet", remedy=remedy)
    with refusing(path):
        if not file.peek(1):
            remedy = "give a file with a header and samples"
            raise DataError("there is nothing in it", file=path, remedy=remedy)
        try:
            return [distinct(legible(table)) for table in module.read(file, path, **options)]
        except DataError as error:
            if path.suffix.casefold() in READERS:
                raise
            ended = f"ending in {path.suffix!r}" if path.suffix else "without an ending"
            problem = f"files {ended} are read as text, and {error.problem}"
            remedy = f"if it is none, give one of {', '.join(READERS)}"
            raise DataError(problem, file=path, row=error.row, remedy=remedy) from None


def laid_out(
    file: BufferedReader, path: Path, header: int, skip: int, encoding: str | None
) -> BufferedReader:
    """Return a text as `mckibben.files.text.laid_out` does; raise a `DataError` for other formats."""
    if header <= 1 and not skip and encoding is None:
        return file
    if _reader(path) != "text":
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


def _reader(path: Path) -> str:
    """Return the name of the reader of a file; of an unknown ending, as of instruments, that of text."""
    return READERS.get(path.suffix.casefold(), "text")


def _module(path: Path) -> ModuleType:
    return import_module(f"mckibben.files.{_reader(path)}")
