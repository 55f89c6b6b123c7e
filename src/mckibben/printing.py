"""Texts with names of files and channels, which may hold anything: to print, to write, in commands."""

from __future__ import annotations

import os
import shlex
from collections.abc import Iterable


def printable(name: str | os.PathLike[str]) -> str:
    r"""Return a text in one line: blanks of any kind as plain ones, what cannot be printed written out.

    >>> print(printable("\x1b[31mpressure\xa0(bar)"))
    \x1b[31mpressure (bar)
    """
    text = os.fspath(name)
    if text.isprintable():
        return text
    written = (c if c.isprintable() else " " if c.isspace() else ascii(c)[1:-1] for c in text)
    return "".join(written)


def encoded(text: str) -> bytes:
    r"""Return a text in UTF-8, with bytes of names that are no text written out, as JSON does.

    >>> encoded("run\udcff.csv")
    b'run\\udcff.csv'
    """
    return text.encode("utf-8", "backslashreplace")


def command(words: Iterable[str | os.PathLike[str]]) -> str:
    r"""Return a command line, in one line of printable letters.

    >>> print(command(["mckibben", "info", "two words.csv", "run\udcff.csv"]))
    mckibben info 'two words.csv' $'run\377.csv'
    """
    return " ".join(_quoted(os.fspath(word)) for word in words)


def _quoted(word: str) -> str:
    if word.isprintable():
        return shlex.quote(word)
    letters = (
        chr(b) if 32 <= b < 127 and b not in b"'\\" else f"\\{b:03o}" for b in os.fsencode(word)
    )
    return f"$'{''.join(letters)}'"
