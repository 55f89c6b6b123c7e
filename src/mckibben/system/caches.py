"""Where compiled functions are kept: in a folder that nobody but this user can enter, or nowhere.

What is kept there is loaded as code, so that whoever can put a file there could run anything. Numba
makes files and folders in it with the rights that the user's mask leaves to others, so that these must
not get there at all.
"""

from __future__ import annotations

import os
import stat
import sys
import tempfile
import warnings
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path

NAME = "mckibben"

OTHERS = stat.S_IRWXG | stat.S_IRWXO
"""Rights of anybody else."""

WRITING = stat.S_IWGRP | stat.S_IWOTH
"""Those of them that change something."""


class CacheWarning(UserWarning):
    """Compiled functions are not kept where they usually are."""


@cache
def place() -> Path | None:
    """Return the folder for compiled functions, or None if there is no safe one.

    In ``NUMBA_CACHE_DIR`` if that is set, else in the user's cache folder, else among the temporary
    files: the first that can be this user's alone. That it is not the first is said once.
    """
    usual, *others = _candidates()
    first = _private(usual)
    found = first or next(filter(None, map(_private, others)), None)
    if found is None:
        warnings.warn(
            "no folder to keep compiled functions in is this user's alone, so that every start "
            "compiles them anew; NUMBA_CACHE_DIR may name one",
            CacheWarning,
            stacklevel=2,
        )
    elif first is None:
        warnings.warn(
            f"{usual} cannot be this user's alone, or not be written to: compiled functions are "
            f"kept in {found}",
            CacheWarning,
            stacklevel=2,
        )
    return found


def _candidates() -> Iterator[Path]:
    # others can foresee that name, so it is looked at whose it is; but the next process finds it
    own = f"{NAME}-{os.getuid()}" if hasattr(os, "getuid") else NAME
    given = os.environ.get("NUMBA_CACHE_DIR")
    if given:
        base = Path(given).absolute()
        with suppress(OSError):
            base.parent.mkdir(mode=0o700, exist_ok=True)
        yield base / own
    if sys.platform == "win32":
        yield Path(os.environ.get("LOCALAPPDATA", "~"), NAME)
    elif sys.platform == "darwin":
        yield _home() / "Library" / "Caches" / NAME
    else:
        chosen = Path(os.environ.get("XDG_CACHE_HOME", ""))
        yield (chosen if chosen.is_absolute() else _home() / ".cache") / NAME
    yield Path(tempfile.gettempdir()).absolute() / own


def _home() -> Path:
    """Return the home folder, or a tilde of a user who has none."""
    try:
        return Path.home()
    except RuntimeError:
        return Path("~")


def _private(folder: Path) -> Path | None:
    """Return where a folder, made if missing, really is, if nobody but this user can get into it."""
    if not folder.is_absolute():
        return None
    try:
        # the cache folder of a home may be missing, a home is not made
        folder.parent.mkdir(mode=0o700, exist_ok=True)
        folder.mkdir(mode=0o700, exist_ok=True)
        folder = folder.resolve()  # a link may be changed afterwards
        if hasattr(os, "getuid"):  # elsewhere, rights are inherited from the user's own folder
            if not all(_stays(above.stat()) for above in folder.parents):
                return None
            if not _closed(folder):
                return None
        tempfile.TemporaryFile(dir=folder).close()
    except (OSError, RuntimeError, ValueError):
        return None
    return folder


def _closed(folder: Path) -> bool:
    """Tell whether a folder is this user's and closed to others, with what it takes to make it so."""
    found = folder.stat()
    if found.st_uid != os.getuid():
        return False
    if not found.st_mode & OTHERS:
        return True
    # what others could write to, they may have written, and it stays as it is
    inside = (path.lstat() for path in folder.rglob("*"))
    if any(path.st_uid != found.st_uid or path.st_mode & WRITING for path in (found, *inside)):
        return False
    folder.chmod(0o700)
    return not folder.stat().st_mode & OTHERS  # there are disks without rights


def _stays(above: os.stat_result) -> bool:
    """Tell whether no other user can put another in the place of what is in a folder.

    Names may be added by others where the sticky bit keeps them from touching what is not theirs, and
    the administrator may do anything anyway.
    """
    if above.st_uid not in (os.getuid(), 0):
        return False
    return not above.st_mode & WRITING or bool(above.st_mode & stat.S_ISVTX)
