"""How far long work is: ``progress=True`` shows a bar, and a callable is told.

What is told differs with the work: a share from 0 to 1, perhaps with words or the least error so far,
or something that has a ``share`` and says itself.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from html import escape
from importlib import import_module
from typing import Any, TypeVar

Tell = Callable[..., None]

Item = TypeVar("Item")


@contextmanager
def telling(progress: bool | Tell | None, what: str) -> Iterator[Tell | None]:
    """Give what to tell how far work is; None where nobody wants to know.

    Parameters
    ----------
    progress : bool, callable or None
        Whether to show a bar, on standard error or in a notebook; or who is told.
    what : str
        The work, in a word or two.
    """
    if progress is not True:
        yield progress or None
        return
    with (_in_notebook if _notebook() else _on_terminal)(what) as show:
        yield lambda *told: show(*_read(told))


def one_by_one(items: Iterable[Item], tell: Tell | None) -> Iterator[Item]:
    """Give items one after another, and tell the share that is done."""
    listed = list(items)
    for place, item in enumerate(listed):
        if tell is not None:
            tell(place / len(listed), f"{place} of {len(listed)}")
        yield item
    if tell is not None:
        tell(1.0, f"{len(listed)} of {len(listed)}")


def _read(told: tuple[Any, ...]) -> tuple[float, str]:
    """Return the share done and words.

    >>> _read((0.5, 1.234)), _read((0.5, "folds"))
    ((0.5, 'best so far 1.23'), (0.5, 'folds'))
    """
    first, *rest = told
    if hasattr(first, "share"):
        return first.share, str(first)
    if rest and isinstance(rest[0], float):
        return first, f"best so far {rest[0]:.3g}" if math.isfinite(rest[0]) else ""
    return first, str(rest[0]) if rest else ""


def _notebook() -> bool:
    shell = sys.modules.get("IPython")
    return shell is not None and hasattr(shell.get_ipython(), "kernel")


@contextmanager
def _on_terminal(what: str) -> Iterator[Callable[[float, str], None]]:
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    words = TextColumn("{task.description}", markup=False)
    columns = (words, BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True)) as bar:
        task = bar.add_task(what, total=1.0)

        def show(share: float, said: str) -> None:
            said = "".join(c if c.isprintable() else " " for c in said)
            bar.update(task, completed=share, description=f"{what}: {said}" if said else what)

        yield show


@contextmanager
def _in_notebook(what: str) -> Iterator[Callable[[float, str], None]]:
    shown: Any = import_module("IPython.display")

    def html(share: float, said: str) -> Any:
        bar = f'<progress value="{share:.4f}" max="1" style="vertical-align:middle"></progress>'
        return shown.HTML(f"<div>{escape(what)} {bar} {escape(said)}</div>")

    place = shown.display(html(0.0, ""), display_id=True)
    yield lambda share, said: place.update(html(share, said))
