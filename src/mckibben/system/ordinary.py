"""Opening regular files for reading, with a size limit.

Readers of recordings, rigs, protocols and saved models open files here. A pipe or a device would
block or never end, and a file may be larger than memory. The open file is checked, so that it
cannot be replaced between the check and the reading.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from io import BufferedReader
from pathlib import Path

from mckibben.errors import DataError

DESCRIPTION = 4 * 2**20
"""Largest size of a description (a sidecar, a protocol, a job, a rig) [bytes]."""


@contextmanager
def opened(path: str | Path, *, most: int) -> Iterator[BufferedReader]:
    """Open a regular file of at most so many bytes for reading.

    Raises
    ------
    DataError
        If it is missing, no ordinary file, may not be read, or has more bytes.
    """
    try:
        # without waiting for whoever writes to a pipe
        flags = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
        descriptor = os.open(path, flags)
    except IsADirectoryError:
        raise DataError("this is a folder", file=path, remedy="give a file in it") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        remedy = "check the path and its rights"
        raise DataError(f"it cannot be read ({reason.lower()})", file=path, remedy=remedy) from None
    try:
        status = os.fstat(descriptor)
        if stat.S_ISDIR(status.st_mode):
            raise DataError("this is a folder", file=path, remedy="give a file in it")
        if not stat.S_ISREG(status.st_mode):
            raise DataError("this is no ordinary file", file=path, remedy="give a file on disk")
        if status.st_size > most:
            problem = f"{status.st_size} bytes are more than the {most} that are read"
            raise DataError(problem, file=path, remedy="cut it into smaller files")
        with open(descriptor, "rb", closefd=False) as file:
            yield file
    finally:
        os.close(descriptor)


def read_bytes(path: str | Path, *, most: int) -> bytes:
    """Return the bytes of a regular file; errors as in `opened`."""
    with opened(path, most=most) as file:
        return file.read(most)


def read_text(path: str | Path, *, most: int) -> str:
    """Return the text of a regular file; raise an error also if it is not UTF-8."""
    try:
        return read_bytes(path, most=most).decode("utf-8-sig")  # which Windows' editors write
    except UnicodeDecodeError:
        raise DataError("it is not text in UTF-8", file=path, remedy="give a text file") from None


def named_toml(name: str | Path, folder: Path, kind: str) -> Path:
    """Return the path of a TOML file: ``name`` if it ends in .toml, else that of a folder.

    Raises
    ------
    DataError
        On a name that is in neither.
    """
    path = Path(name)
    if path.suffix == ".toml":
        return path
    names = sorted(file.stem for file in folder.glob("*.toml"))
    if str(name) not in names:
        raise DataError(
            f"there is no {kind} {str(name)!r}",
            remedy=f"use one of {', '.join(names)}, or a file that ends in .toml",
        )
    return folder / f"{name}.toml"
