"""What commands print: JSON on standard output when asked, else words and tables; progress beside."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from mckibben.errors import MckibbenError
from mckibben.system.atomic import to_json


class InterruptionError(MckibbenError):
    """Work that the user stopped; the text says what was kept."""


_UNSEEN = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]"
)
"""What a terminal would obey instead of showing it: control characters, marks of direction, and halves
of characters, which stand for bytes of file names that are no text."""


def visible(text: str) -> str:
    r"""Return words with control characters written out, whoever chose the words.

    Names of files and channels, and what models and recordings say of themselves, may hold anything.

    >>> visible("\x1b[2J")
    '\\u001b[2J'
    """
    return _UNSEEN.sub(lambda found: f"\\u{ord(found.group()):04x}", text)


def say(text: str = "", *, end: str = "\n", flush: bool = False, error: bool = False) -> None:
    """Print words on standard output, or standard error, with control characters made visible.

    Raises
    ------
    MckibbenError
        If standard output cannot be written to. Standard error is done without.
    """
    if error:
        with suppress(OSError):
            print(visible(text), end=end, file=sys.stderr, flush=True)
        return
    with _to_output():
        print(visible(text), end=end, flush=flush)


def finish() -> None:
    """See to it that all that was printed is out; errors are those of `say`."""
    with _to_output():
        if sys.stdout is not None:
            sys.stdout.flush()


@contextmanager
def _to_output() -> Iterator[None]:
    try:
        yield
    except BrokenPipeError:  # whoever read it has seen enough
        raise
    except OSError as error:
        raise MckibbenError(
            f"Standard output cannot be written to ({error.strerror or error})",
            remedy="send it to a file on a disk that is not full",
        ) from None


def print_json(value: Any) -> None:
    """Print a value as JSON on standard output."""
    say(to_json(value))


def print_table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a table on standard output; numbers are aligned right, words left."""
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, pad_edge=False, header_style="bold")
    for index, heading in enumerate(headings):
        told = [row[index] for row in rows if row[index] not in ("", "-", "–")]
        numbers = sum(bool(re.match(r"[-−+]?\d", cell)) for cell in told)
        right = index > 0 and 2 * numbers > len(told)
        table.add_column(
            Text(visible(heading)), justify="right" if right else "left", overflow="fold"
        )
    for row in rows:
        table.add_row(*(Text(visible(cell)) for cell in row))
    console = Console()
    if not console.is_terminal:
        console = Console(width=200)
    with _to_output():
        console.print(table)


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
    in_notebook = "JPY_PARENT_PID" in os.environ  # has a terminal that cannot go back in a line
    if sys.stderr is None or not sys.stderr.isatty() or in_notebook:
        last = -1.0

        def line(share: float, text: str) -> None:
            nonlocal last
            if plainly and share > last and sys.stderr is not None:
                say(text, error=True)
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
            bar.update(task, description=visible(f"{what} {text}"))

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
