"""What commands print: JSON on standard output when asked, else words and tables; progress beside."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from mckibben.errors import MckibbenError


class InterruptionError(MckibbenError):
    """Work that the user stopped; the text says what was kept."""


def plain(value: Any) -> Any:
    """Return a value as JSON holds it: numbers that are not finite become null."""
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def to_json(value: Any) -> str:
    """Return a value as indented JSON text."""
    return json.dumps(plain(value), indent=2, allow_nan=False, ensure_ascii=False)


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
        table.add_column(heading, justify="left" if index == 0 else "right", overflow="fold")
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
def progress_bar(what: str) -> Iterator[Callable[[float, str], None]]:
    """Show progress on standard error while it is a terminal; yields what to tell it."""
    if not sys.stderr.isatty():
        yield lambda share, text: None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(what, total=1.0)

        def tell(share: float, text: str) -> None:
            bar.update(task, completed=share, description=f"{what} {text}")

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
