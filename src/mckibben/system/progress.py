"""Progress of long work: ``progress=True`` shows a bar; a callable is called.

It is called with the share done, from 0 to 1, perhaps with words or the least error so far; or with an
object that has a ``share`` and prints as words.
"""

from __future__ import annotations

import math
import os
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from html import escape
from importlib import import_module
from typing import Any, TypeVar

from mckibben.numerals import duration

Tell = Callable[..., None]

Show = Callable[[float, str], None]

Item = TypeVar("Item")

LEAST_PROGRESS = 0.01
"""Least progress between two lines, as a share of the whole."""


FORECAST_SHARE = 0.1
"""Share of the work after which the time left is extrapolated from the progress so far."""


@contextmanager
def telling(
    progress: bool | Tell | None, title: str, *, lines: bool = False
) -> Iterator[Tell | None]:
    """Return the callback of the progress of work; None without progress.

    Parameters
    ----------
    progress : bool, callable or None
        Whether to show a bar, on standard error or in a notebook; or what is called.
    title : str
        The work, in a word or two.
    lines : bool
        Whether each step is a line where standard error is no terminal; else nothing is shown there.
    """
    if progress is not True:
        yield progress or None
        return
    begin = time.monotonic()
    shell = sys.modules.get("IPython")
    if shell is not None and hasattr(shell.get_ipython(), "kernel"):
        display: AbstractContextManager[Show] = _in_notebook(title)
    elif sys.stderr is not None and sys.stderr.isatty() and "JPY_PARENT_PID" not in os.environ:
        display = _on_terminal(title)
    else:  # in a log, or in a notebook's shell, which cannot go back in a line
        display = _in_lines(title) if lines else nullcontext(lambda *_: None)
    with display as show:

        def tell(first: Any, *rest: Any) -> None:
            share, words = getattr(first, "share", first), str(first)
            if share is first:
                words = ", ".join(
                    filter(None, [words_of(*rest), time_left(share, time.monotonic() - begin)])
                )
            show(share, words)

        yield tell


def words_of(progress: str | float = "", *_: object) -> str:
    """Return a text, or the smallest error as text.

    >>> words_of(1.234), words_of("folds"), words_of(math.inf), words_of()
    ('best so far 1.23', 'folds', '', '')
    """
    if isinstance(progress, str):
        return progress
    return f"best so far {progress:.3g}" if math.isfinite(progress) else ""


def time_left(share: float, elapsed: float) -> str:
    """Return the time left in words, from the share done in some time [s].

    Nothing within the first second, before `FORECAST_SHARE` is done, and at the end.

    >>> time_left(0.2, 10.0), time_left(0.05, 10.0)
    ('about 40 s left', '')
    """
    if elapsed < 1 or not FORECAST_SHARE <= share < 1:
        return ""
    return f"about {duration(elapsed * (1 - share) / share)} left"


def one_by_one(items: Iterable[Item], tell: Tell | None) -> Iterator[Item]:
    """Yield items one after another, and report the share done."""
    listed = list(items)
    for k in range(len(listed) + 1):
        if tell is not None:
            tell(k / len(listed) if listed else 1.0, f"{k} of {len(listed)}")
        if k < len(listed):
            yield listed[k]


@contextmanager
def _on_terminal(title: str) -> Iterator[Show]:
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn

    columns = (TextColumn("{task.description}", markup=False), BarColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(title, total=1.0)

        def show(share: float, words: str) -> None:
            bar.update(task, completed=share, description=_line(title, words))

        yield show


@contextmanager
def _in_lines(title: str) -> Iterator[Show]:
    last = -1.0

    def show(share: float, words: str) -> None:
        nonlocal last
        if share >= last + LEAST_PROGRESS or share == 1.0 > last:
            with suppress(OSError):
                print(_line(title, words), file=sys.stderr, flush=True)
            last = share

    yield show


def _line(title: str, words: str) -> str:
    """Return a progress line, with control characters of names escaped."""
    words = "".join(c if c.isprintable() else " " for c in words)
    return f"{title}: {words}" if words else title


@contextmanager
def _in_notebook(title: str) -> Iterator[Show]:
    display: Any = import_module("IPython.display")

    def html(share: float, words: str) -> Any:
        bar = f'<progress value="{share:.4f}" max="1" style="vertical-align:middle"></progress>'
        return display.HTML(f"<div>{escape(title)} {bar} {escape(words)}</div>")

    handle = display.display(html(0.0, ""), display_id=True)
    yield lambda share, words: handle.update(html(share, words))
