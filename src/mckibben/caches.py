"""Where compiled functions are kept: in a folder that nobody but this user can write to, or nowhere.

What is kept there is loaded as code, so that whoever can put a file there could run anything.
"""

from __future__ import annotations

import os
import stat
import sys
import tempfile
import warnings
from collections.abc import Iterator
from functools import cache
from pathlib import Path

NAME = "mckibben"


class CacheWarning(UserWarning):
    """Compiled functions are not kept where they usually are."""


@cache
def place() -> Path | None:
    """Return the folder for compiled functions, or None if there is no safe one.

    ``NUMBA_CACHE_DIR`` if that is set, else the user's cache folder, else one of this user's among the
    temporary files; the first in which nobody else can write. That it is not the first is said once.
    """
    tried = [*_candidates()]
    found = next((path for path in tried if _is_private(path)), None)
    if found is None:
        warnings.warn(
            "no folder to keep compiled functions in is this user's alone, so that every start "
            "compiles them anew; NUMBA_CACHE_DIR may name one",
            CacheWarning,
            stacklevel=2,
        )
    elif found != tried[0]:
        warnings.warn(
            f"{tried[0]} cannot be written to, or not by this user alone: compiled functions are "
            f"kept in {found}",
            CacheWarning,
            stacklevel=2,
        )
    return found


def _candidates() -> Iterator[Path]:
    given = os.environ.get("NUMBA_CACHE_DIR")
    if given:
        yield Path(given).absolute()
    if sys.platform == "win32":
        yield Path(os.environ.get("LOCALAPPDATA", "~"), NAME)
    elif sys.platform == "darwin":
        yield _home() / "Library" / "Caches" / NAME
    else:
        chosen = Path(os.environ.get("XDG_CACHE_HOME", ""))
        yield (chosen if chosen.is_absolute() else _home() / ".cache") / NAME
    # others can foresee that name, so it is looked at whose it is; but the next process finds it
    user = str(os.getuid()) if hasattr(os, "getuid") else ""
    yield Path(tempfile.gettempdir()).absolute() / f"{NAME}-{user}"


def _home() -> Path:
    """Return the home folder, or a tilde of a user who has none."""
    try:
        return Path.home()
    except RuntimeError:
        return Path("~")


def _is_private(folder: Path) -> bool:
    """Tell whether a folder, made if missing, is this user's, and written to by nobody else."""
    if not folder.is_absolute():
        return False
    try:
        # the cache folder of a home may be missing, a home is not made
        folder.parent.mkdir(mode=0o700, exist_ok=True)
        folder.mkdir(mode=0o700, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
        if not hasattr(os, "getuid"):
            return True  # there, rights are inherited from the user's own folder
        folder = folder.resolve()
        return _alone(folder.stat(), own=True) and all(
            _alone(above.stat(), own=False) for above in folder.parents
        )
    except (OSError, RuntimeError, ValueError):
        return False


def _alone(found: os.stat_result, *, own: bool) -> bool:
    """Tell whether no other user can change what is in a folder, or put another in its place.

    In folders above, names may be added by others where the sticky bit keeps them from touching what
    is not theirs, and the administrator may do anything anyway.
    """
    user = os.getuid()
    if found.st_uid != user and (own or found.st_uid != 0):
        return False
    shared = bool(found.st_mode & (stat.S_IWGRP | stat.S_IWOTH))
    return not shared or (not own and bool(found.st_mode & stat.S_ISVTX))
