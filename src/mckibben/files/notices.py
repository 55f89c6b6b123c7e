"""Warnings about what was assumed or mended, shown at the line that called the package."""

from __future__ import annotations

import inspect
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path

from mckibben.errors import DataWarning

_HERE = str(Path(__file__).parent)
_NOTED: ContextVar[list[str] | None] = ContextVar("noted", default=None)

PLAIN = "; other columns of the file show that mark"
"""End of a note on what was understood and is hardly in doubt, so that nothing was assumed."""


def listed(items: Sequence[str], most: int = 30) -> str:
    """Return items side by side: the first of many, and how many more there are."""
    more = f" and {len(items) - most} more" if len(items) > most else ""
    return ", ".join(items[:most]) + more


def is_plain(note: str) -> bool:
    """Tell whether a note is of what was understood, not of what was assumed or mended."""
    return note.endswith(PLAIN)


@contextmanager
def noted() -> Iterator[list[str]]:
    """Yield a list that takes what is said inside, without the name of the file."""
    notes: list[str] = []
    token = _NOTED.set(notes)
    try:
        yield notes
    finally:
        _NOTED.reset(token)


def warn(path: Path, text: str) -> None:
    """Issue a `DataWarning` about a file, and note it."""
    notes = _NOTED.get()
    if notes is not None and text not in notes:
        notes.append(text)
    frame, level = inspect.currentframe(), 0
    while frame is not None and frame.f_code.co_filename.startswith(_HERE):
        frame, level = frame.f_back, level + 1
    warnings.warn(f"{path}: {text}", DataWarning, stacklevel=level + 1)
