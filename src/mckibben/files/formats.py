"""The formats of files: which module reads which ending, one line each."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from io import BufferedReader
from pathlib import Path
from types import ModuleType

from mckibben.errors import DataError, MckibbenError, TooLargeError
from mckibben.files.table import Table, printable
from mckibben.system.ordinary import opened

MOST_BYTES = 2**31
"""Largest file that is read [bytes], unless another size is given."""

READERS: dict[str, str] = {
    ".csv": "text",
    ".tsv": "text",
    ".txt": "text",
    ".dat": "text",
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

SOUGHT: tuple[str, ...] = tuple(ending for ending in READERS if ending != ".json")
"""Endings that a folder is searched for; descriptions and models are JSON too."""

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
    """Return what is in a file, as it stands there; errors are those of `read`."""
    with opening(path) as file:
        return read(file, path)


@contextmanager
def opening(path: Path, most: float = MOST_BYTES) -> Iterator[BufferedReader]:
    """Open a recording's file; `DataError` if its ending is unknown, or there is none to be read."""
    _reader(path)
    with opened(path, most=int(most)) as file:
        yield file


def read(file: BufferedReader, path: Path) -> list[Table]:
    """Return what is in an open file, as it stands there.

    Raises
    ------
    DataError
        If its ending is none that is known or not that of its content, it is damaged, or it holds
        more than is read.
    """
    module = _reader(path)
    with _refusing(path):
        _refuse_impostor(file, path)
        if READERS[path.suffix.casefold()] == "text" and file.peek(64).lstrip(BOM).startswith(
            LABVIEW
        ):
            module = import_module("mckibben.files.lvm")
        return [printable(table) for table in module.read(file, path)]


def bag(folder: Path) -> list[Table]:
    """Return what is in the folder of a bag of ROS 2; errors are those of `read`."""
    with _refusing(folder):
        return [printable(table) for table in import_module("mckibben.files.bags").folder(folder)]


@contextmanager
def _refusing(path: Path) -> Iterator[None]:
    """Turn whatever a library raises into errors that name the file."""
    try:
        yield
    except MckibbenError:
        raise
    except OSError as error:
        if error.strerror is None:  # the libraries' own, about the content
            raise _damaged(path, error) from None
        raise DataError(
            f"it cannot be read ({error.strerror})",
            file=path,
            remedy="check the path and its rights",
        ) from None
    except MemoryError:
        raise TooLargeError(
            "it needs more memory than there is",
            file=path,
            remedy="split it into shorter recordings",
        ) from None
    except Exception as error:  # damaged files make the libraries raise anything at all
        raise _damaged(path, error) from None


def writer(path: Path) -> ModuleType:
    """Return the module that writes files of this ending."""
    return _module(path, WRITERS, "written")


def _reader(path: Path) -> ModuleType:
    return _module(path, tuple(READERS), "read")


def _module(path: Path, endings: tuple[str, ...], done: str) -> ModuleType:
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


def _damaged(path: Path, error: Exception) -> DataError:
    reason = " ".join(str(error).split())[:200] or type(error).__name__
    return DataError(
        f"it is damaged, or not {path.suffix[1:] or 'a bag'} ({reason})",
        file=path,
        remedy="export it again from its source",
    )
