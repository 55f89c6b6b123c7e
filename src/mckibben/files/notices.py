"""Warnings about assumptions and corrections, shown at the line of the user's call."""

from __future__ import annotations

import inspect
import warnings
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import TypeVar

from mckibben.errors import DataWarning
from mckibben.printing import printable
from mckibben.recording import Recording

Item = TypeVar("Item")

_HERE = str(Path(__file__).parent)
_NOTED: ContextVar[list[str] | None] = ContextVar("noted", default=None)
_OBSERVED: ContextVar[list[Recording] | None] = ContextVar("observed", default=None)


def listed(items: Sequence[str], most: int = 30) -> str:
    """Return items separated by commas: the first of many, and how many more there are."""
    more = f" and {len(items) - most} more" if len(items) > most else ""
    return ", ".join(items[:most]) + more


def noted() -> AbstractContextManager[list[str]]:
    """Collect the texts of warnings issued within the context."""
    return _collecting(_NOTED)


def observed() -> AbstractContextManager[list[Recording]]:
    """Collect the recordings that are read within the context."""
    return _collecting(_OBSERVED)


@contextmanager
def _collecting(where: ContextVar[list[Item] | None]) -> Iterator[list[Item]]:
    items: list[Item] = []
    token = where.set(items)
    try:
        yield items
    finally:
        where.reset(token)


def observe(recordings: list[Recording]) -> list[Recording]:
    """Return recordings, which whoever observes what is read then has."""
    seen = _OBSERVED.get()
    if seen is not None:
        seen += recordings
    return recordings


def warn(path: Path, text: str, *, quiet: bool = False) -> None:
    """Issue a `DataWarning` about a file, unless ``quiet``, and note it."""
    notes = _NOTED.get()
    if notes is not None and text not in notes:
        notes.append(text)
    if quiet:
        return
    frame, level = inspect.currentframe(), 0
    while frame is not None and frame.f_code.co_filename.startswith(_HERE):
        frame, level = frame.f_back, level + 1
    warnings.warn(f"{printable(path)}: {text}", DataWarning, stacklevel=level + 1)
