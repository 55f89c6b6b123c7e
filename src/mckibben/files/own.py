"""Which recordings this package wrote, and nobody has changed since."""

from __future__ import annotations

import warnings
from pathlib import Path

from mckibben.errors import MckibbenError
from mckibben.files import stored
from mckibben.files.formats import READERS, tables
from mckibben.system import manifest, ordinary


def description(path: Path) -> Path | None:
    """Return where the description of a text file lies; None for other formats."""
    if READERS.get(path.suffix.casefold()) != "text":
        return None
    from mckibben.files.text import sidecar

    return sidecar(path)


def describes(path: Path) -> bool:
    """Tell whether a file is a description by this package."""
    return _described(path) is not None


def is_own(path: Path) -> bool:
    """Tell whether a file is a recording by this package, as it was written."""
    beside = description(path)
    try:
        if beside is None:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                return all(table.own for table in tables(path))
    except MckibbenError:
        return False
    found = _described(beside)
    return found is not None and manifest.holds(path, {found.sha256})


def _described(path: Path) -> stored.Stored | None:
    try:
        found = stored.parse(ordinary.read_bytes(path, most=ordinary.DESCRIPTION))
    except MckibbenError:
        return None
    return None if isinstance(found, str) else found
