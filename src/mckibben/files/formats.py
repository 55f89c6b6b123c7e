"""The formats of files: which module reads which ending, one line each."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from importlib import import_module
from io import BufferedReader
from pathlib import Path
from types import ModuleType

from mckibben.errors import DataError, MckibbenError, TooLargeError
from mckibben.files.table import Table, distinct, printable
from mckibben.system.ordinary import opened

MOST_BYTES = 2**31
"""Largest file that is read [bytes], unless another size is given."""

READERS: dict[str, str] = {
    ".csv": "text",
    ".tsv": "text",
    ".txt": "text",
    ".dat": "text",
    ".log": "text",
    ".lvm": "lvm",
    ".parquet": "parquet",
    ".mat": "matlab",
    ".h5": "hdf5",
    ".hdf5": "hdf5",
    ".tdms": "tdms",
    ".xlsx": "xlsx",
    ".bag": "bags",
    ".mcap": "bags",
    ".db3": "bags",
    ".json": "columns_json",
    ".jsonl": "columns_json",
}
"""Ending of the file's name -> module of this folder with ``read(file, path) -> list[Table]``."""

SOUGHT: tuple[str, ...] = tuple(
    ending for ending in READERS if ending not in (".log", ".json", ".jsonl")
)
"""Endings that a folder is searched for; programs write their own logs and settings in the others."""

BOM, LABVIEW = b"\xef\xbb\xbf", b"LabVIEW Measurement"
"""Beginnings of a text: the mark of UTF-8, and the name that LabVIEW writes, whatever the ending."""

WRITERS: tuple[str, ...] = (".csv", ".tsv", ".parquet")
"""Endings whose module also has ``write(recording, path)``."""

_SIGNATURES: dict[bytes, tuple[str, tuple[str, ...]]] = {
    b"PAR1": ("Parquet", (".parquet",)),
    b"\x89HDF\r\n\x1a\n": ("HDF5", (".h5", ".hdf5", ".mat")),
    b"TDSm": ("TDMS", (".tdms",)),
    b"MATLAB 5.0 MAT": ("MATLAB", (".mat",)),
    b"MATLAB 7.3 MAT": ("MATLAB 7.3", (".mat",)),
    b"PK\x03\x04": ("a spreadsheet or an archive", (".xlsx",)),
    b"#ROSBAG V": ("a bag of ROS 1", (".bag",)),
    b"\x89MCAP0\r\n": ("MCAP", (".mcap",)),
    b"SQLite format 3\x00": ("a database, as bags of ROS 2 are", (".db3",)),
    b"\xd0\xcf\x11\xe0": ("an Excel workbook", ()),
}


def tables(path: Path) -> list[Table]:
    """Return what is in a file, before it is interpreted; errors are those of `read`."""
    _module(path, READERS, "read")  # before a file of another kind is opened
    with opened(path, most=MOST_BYTES) as file:
        return read(file, path)


def read(file: BufferedReader, path: Path) -> list[Table]:
    """Return what is in an open file, before it is interpreted.

    Raises
    ------
    DataError
        If its ending is unknown or not that of its content, or it is damaged.
    """
    module = _module(path, READERS, "read")
    with _refusing(path):
        _refuse_impostor(file, path)
        text = READERS[path.suffix.casefold()] == "text"
        if text and file.peek(64).lstrip(BOM).startswith(LABVIEW):
            module = import_module("mckibben.files.lvm")
        return [distinct(printable(table)) for table in module.read(file, path)]


def bag(folder: Path) -> list[Table]:
    """Return what is in the folder of a bag of ROS 2; errors are those of `read`."""
    with _refusing(folder):
        return [printable(table) for table in import_module("mckibben.files.bags").folder(folder)]


def writer(path: Path) -> ModuleType:
    """Return the module that writes files of this ending."""
    return _module(path, WRITERS, "written")


@contextmanager
def _refusing(path: Path) -> Iterator[None]:
    """Turn whatever a library raises into errors that name the file."""
    try:
        yield
    except MckibbenError:
        raise
    except Exception as error:
        problem = f"it is damaged, or not {path.suffix[1:] or 'a bag'} ({reason(error)})"
        remedy = "export it again from its source"
        if isinstance(error, MemoryError):
            raise TooLargeError(
                "it needs more memory than there is",
                file=path,
                remedy="split it into shorter recordings",
            ) from None
        if isinstance(error, OSError) and error.strerror:  # without, it is about the content
            problem = f"it cannot be read ({error.strerror})"
            remedy = "check the path and its rights"
        raise DataError(problem, file=path, remedy=remedy) from None


def reason(error: Exception) -> str:
    """Return an error of a library in one line."""
    return " ".join(str(error).split())[:200] or type(error).__name__


def _module(path: Path, endings: Iterable[str], done: str) -> ModuleType:
    ending = path.suffix.casefold()
    if ending not in endings:
        raise DataError(
            f"files ending in {ending or 'nothing'!r} cannot be {done}",
            file=path,
            remedy=f"give one of {', '.join(endings)}",
        )
    return import_module(f"mckibben.files.{READERS[ending]}")


def _refuse_impostor(file: BufferedReader, path: Path) -> None:
    """Refuse what is empty, or whose content is that of another ending."""
    start = file.read(16)
    file.seek(0)
    if not start:
        raise DataError(
            "there is nothing in it", file=path, remedy="give a file with a header and samples"
        )
    for signature, (name, endings) in _SIGNATURES.items():
        if start.startswith(signature) and path.suffix.casefold() not in endings:
            better = f"rename it to end in {endings[0]}" if endings else "export it as CSV"
            raise DataError(f"by its content it is {name}", file=path, remedy=better)
