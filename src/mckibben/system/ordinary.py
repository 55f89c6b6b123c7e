"""Where every file is opened for reading: ordinary ones only, and no more of one than allowed.

A pipe or a device of that name would wait or flow for ever, a link may lead round in circles, and a
file may be larger than memory; what is opened here is looked at after it is open, so that nothing can
be put in its place in between.
"""

from __future__ import annotations

import io
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from io import BufferedReader
from pathlib import Path

from mckibben.errors import DataError

DESCRIPTION = 4 * 2**20
"""Bytes that a description (a sidecar, a protocol, a job, a rig) may have."""

_SMALL = 2**16
"""Bytes that are asked for without a look at how many there are."""


class _Ordinary(io.BufferedReader):
    """A file that makes no room for more than is left in it, whatever a format says there is."""

    def read(self, size: int | None = -1, /) -> bytes:
        if size is not None and size > _SMALL:
            size = min(size, max(0, os.fstat(self.fileno()).st_size - self.tell()))
        return super().read(size)


@contextmanager
def opened(path: str | Path, *, most: int) -> Iterator[BufferedReader]:
    """Open an ordinary file for reading.

    Parameters
    ----------
    path : str or Path
    most : int
        Bytes that it may have.

    Raises
    ------
    DataError
        If it is missing, a folder, a pipe, a device or a circle of links, may not be read, or has more
        bytes.
    """
    path = Path(path)
    try:
        # without waiting for whoever writes to a pipe
        number = os.open(
            path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
        )
    except IsADirectoryError:
        raise _folder(path) from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise DataError(
            f"it cannot be read ({reason.lower()})",
            file=path,
            remedy="check the path and its rights",
        ) from None
    try:
        found = os.fstat(number)
        if stat.S_ISDIR(found.st_mode):
            raise _folder(path)
        if not stat.S_ISREG(found.st_mode):
            raise DataError("this is no ordinary file", file=path, remedy="give a file on disk")
        if found.st_size > most:
            raise DataError(
                f"{found.st_size} bytes are more than the {most} that are read",
                file=path,
                remedy="cut it into smaller files",
            )
        with _Ordinary(io.FileIO(number, "rb", closefd=False)) as file:
            yield file
    finally:
        os.close(number)


def read_bytes(path: str | Path, *, most: int) -> bytes:
    """Return what an ordinary file holds; errors are those of `opened`."""
    with opened(path, most=most) as file:
        return file.read(most)


def read_text(path: str | Path, *, most: int) -> str:
    """Return what an ordinary file holds as text; errors are those of `opened`.

    Raises
    ------
    DataError
        Also if it is not UTF-8.
    """
    try:
        return read_bytes(path, most=most).decode("utf-8-sig")  # which Windows' editors write
    except UnicodeDecodeError:
        raise DataError("it is not text in UTF-8", file=path, remedy="give a text file") from None


def _folder(path: Path) -> DataError:
    return DataError("this is a folder", file=path, remedy="give a file in it")
