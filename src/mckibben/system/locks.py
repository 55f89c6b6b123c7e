"""Who may write to a folder: one process as long as it lives, and the jobs that it started.

The locks are the system's: they go with the process that holds them, however it ends, and whatever the
clock says.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from mckibben.errors import DataError

WAIT = 0.05
"""Between two tries [s]."""


def keep_to_the_user() -> None:
    """Leave this process with a mask of rights that keeps all that it writes to its user."""
    os.umask(0o077)


class Lock:
    """A file that one process holds, or several that share it, until they end.

    Parameters
    ----------
    path : Path
        Made where it is missing.

    Raises
    ------
    DataError
        If it cannot be opened.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            self._file = os.open(
                path, os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0), mode=0o600
            )
        except OSError as error:
            raise self._cannot(error) from None

    def take(self, *, shared: bool = False, patience: float = 0.0) -> bool:
        """Take it, and tell whether that went well within so many seconds."""
        until = time.monotonic() + patience
        while not self._try(shared):
            if time.monotonic() >= until:
                return False
            time.sleep(WAIT)
        return True

    def leave(self) -> None:
        """Let it go."""
        os.close(self._file)

    def _try(self, shared: bool) -> bool:
        try:
            if sys.platform == "win32":
                import msvcrt

                if not shared:  # there are no shared ones: jobs go unheard of there
                    msvcrt.locking(self._file, msvcrt.LK_NBLCK, 1)
            else:
                import fcntl

                kind = fcntl.LOCK_SH if shared else fcntl.LOCK_EX
                fcntl.flock(self._file, kind | fcntl.LOCK_NB)
        except (BlockingIOError, PermissionError):
            return False
        except OSError as error:
            raise self._cannot(error) from None
        return True

    def _cannot(self, error: OSError) -> DataError:
        return DataError(
            f"it cannot be locked ({error.strerror})",
            file=self.path,
            remedy="use a folder on a disk of this machine that can be written to",
        )


@contextmanager
def alone(folder: Path | None) -> Iterator[None]:
    """Write results to a folder to which no other process writes any meanwhile.

    Where the system cannot lock folders, as Windows and some disks, others are not kept away.

    Parameters
    ----------
    folder : Path or None
        One that is there; None for results that are not written.

    Raises
    ------
    DataError
        If another process is at it.
    """
    if folder is None or sys.platform == "win32":
        yield
        return
    import fcntl

    held = os.open(folder, os.O_RDONLY)
    try:
        with suppress(OSError):
            try:
                fcntl.flock(held, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise DataError(
                    "another process is writing its results there",
                    file=folder,
                    remedy="wait until it has ended, or give another folder with -o",
                ) from None
        yield
    finally:
        os.close(held)
