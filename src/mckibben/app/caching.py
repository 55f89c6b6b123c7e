"""What files hold, read again only when they have changed."""

from __future__ import annotations

import stat
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Generic, TypeVar

from mckibben.errors import DataError, MckibbenError, ModelError

Stamp = tuple[int, int, int]


Value = TypeVar("Value")


class Cache(Generic[Value]):
    """What files hold, read again only when they have changed, wherever the clock stands.

    Parameters
    ----------
    most : int
        Of the sizes of all that is kept together.
    """

    def __init__(self, most: int) -> None:
        self.most = most
        self._kept: dict[Path, tuple[Stamp, Value | MckibbenError, int]] = {}
        self._lock = threading.Lock()

    def get(self, path: Path, make: Callable[[], tuple[Value, int]]) -> Value:
        """Return what a file holds; ``make`` reads it, and tells its size.

        Raises
        ------
        MckibbenError
            If it is missing, or ``make`` says that it is damaged; that is remembered likewise.
        """
        try:
            found = path.stat()
        except OSError as error:
            raise DataError(
                f"it cannot be read ({error.strerror})", file=path, remedy="add it again"
            ) from None
        if not stat.S_ISREG(found.st_mode):
            raise DataError("this is no ordinary file", file=path, remedy="remove it")
        stamp = found.st_mtime_ns, found.st_size, found.st_ino
        known = self._kept.get(path)
        if known is None or known[0] != stamp:
            try:
                known = (stamp, *make())
            except MckibbenError as error:
                known = stamp, error, 1
            except Exception as error:  # of a file made to raise anything at all
                problem = f"it is damaged ({type(error).__name__}: {error})"
                known = stamp, ModelError(problem, file=path, remedy="remove it"), 1
        with self._lock:
            self._kept.pop(path, None)
            self._kept[path] = known  # the last used is the last to go
            while len(self._kept) > 1 and sum(size for *_, size in self._kept.values()) > self.most:
                del self._kept[next(iter(self._kept))]
        value = known[1]
        if isinstance(value, MckibbenError):
            raise value.with_traceback(None)
        return value
