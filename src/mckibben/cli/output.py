"""What commands print: JSON on standard output when asked, else words and tables; progress beside."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from mckibben.atomic import to_json
from mckibben.errors import MckibbenError


class InterruptionError(MckibbenError):
    """Work that the user stopped; the text says what was kept."""


def print_json(value: Any) -> None:
    """Print a value as JSON on standard output."""
    print(to_json(value))


def print_table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a table on standard output; all columns but the first are aligned right."""
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, pad_edge=False, header_style="bold")
    for index, heading in enumerate(headings):
        table.add_column(Text(heading), justify="left" if index == 0 else "right", overflow="fold")
    for row in rows:
        table.add_row(*(Text(cell) for cell in row))
    console = Console()
    if not console.is_terminal:
        console = Console(width=200)
    console.print(table)


def figure(value: float | None, digits: int = 3) -> str:
    """Return a number for a table, or a dash.

    >>> figure(0.123456), figure(None)
    ('0.123', '-')
    """
    return "-" if value is None or not math.isfinite(value) else f"{value:.{digits}g}"


@contextmanager
def progress_bar(what: str, *, plainly: bool = False) -> Iterator[Callable[[float, str], None]]:
    """Show progress on standard error; yields what to tell the share done and where it stands.

    Parameters
    ----------
    what : str
        Work in hand.
    plainly : bool
        Whether to print a line for every step where standard error is no terminal; else nothing.
    """
    if sys.stderr is None or not sys.stderr.isatty():
        last = -1.0

        def line(share: float, text: str) -> None:
            nonlocal last
            if plainly and share > last and sys.stderr is not None:
                print(text, file=sys.stderr, flush=True)
                last = share

        yield line
        return
    from rich.console import Console
    from rich.progress import Progress, SpinnerColumn, TextColumn

    # words only: what is left takes longest, so that any estimate of the time left would jump
    columns = (SpinnerColumn(), TextColumn("{task.description}", markup=False))
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(f"{what} ...", total=None)

        def tell(share: float, text: str) -> None:
            del share
            bar.update(task, description=f"{what} {text}")

        yield tell


def make_folder(path: Path) -> Path:
    """Create a folder for results, or say why it cannot be."""
    from mckibben.errors import DataError

    try:
        path.mkdir(parents=True, exist_ok=True)
    except FileExistsError:
        raise DataError(
            "there is a file of that name", file=path, remedy="give a folder with -o"
        ) from None
    return path
