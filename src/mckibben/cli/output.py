"""Output of commands: text, tables or JSON on standard output; notes and progress on standard error."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any

from mckibben.cli.parameters import as_command, as_flag, as_note
from mckibben.errors import MckibbenError, in_terms_of
from mckibben.printing import printable
from mckibben.system.atomic import to_json

if TYPE_CHECKING:
    from mckibben.recording import Recording

INTERRUPTED = 130
"""Exit code of an interrupted command."""

_UNSEEN = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]"
)
"""Control characters and surrogates, which are not printed."""


class InterruptionError(MckibbenError):
    """Work that the user stopped; the text states what was finished."""


def visible(text: str) -> str:
    r"""Return text with control characters escaped; names in files may contain any.

    >>> visible("\x1b[2J")
    '\\u001b[2J'
    """
    return _UNSEEN.sub(lambda match: f"\\u{ord(match.group()):04x}", text)


def say(text: str = "", *, end: str = "\n", flush: bool = False, error: bool = False) -> None:
    """Print words on standard output, or on standard error, which is done without where it is closed."""
    if error:
        with suppress(OSError):
            print(visible(text), end=end, file=sys.stderr, flush=True)
        return
    with _to_output():
        print(visible(text), end=end, flush=flush)


_noted: set[str] = set()


def note(text: str, *, error: bool = False) -> None:
    """Print a note once, with its parameters as flags."""
    line = f"Note: {as_note(text)}"
    if line not in _noted:
        _noted.add(line)
        say(line, error=error)


def forget_notes() -> None:
    """Reset the printed notes at the start of a command."""
    _noted.clear()


def finish() -> None:
    """Flush standard output."""
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
            f"standard output cannot be written to ({error.strerror or error})",
            remedy="send it to a file on a disk that is not full",
        ) from None


def show(
    result: Any,
    lines: Callable[[], Iterable[str]],
    as_json: bool,
    notes: Iterable[str] = (),
    written: Sequence[object] = (),
    read: Sequence[Recording] = (),
) -> None:
    """Print a result: as JSON, or what was read for it, its lines, notes, and what was written.

    Parameters
    ----------
    result : object
        JSON of it, or what has ``to_dict()``.
    lines : callable
        Returns the lines of words.
    """
    if as_json:
        say(to_json(result.to_dict() if hasattr(result, "to_dict") else result))
        return
    from mckibben.report.words import read_lines

    for line in (*read_lines(read), *lines()):
        if line.startswith("Note: "):
            note(line.removeprefix("Note: "))
        else:
            say(in_terms_of(line, as_flag, as_command))
    for text in notes:
        note(text)
    if paths := [printable(str(path)) for path in written if path is not None]:
        say(f"Written: {', '.join(paths)}")
