"""Folder and formatting of generated pages."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path

from mckibben.report.mathematics import mathml

GREEK = "sum|alpha|beta|gamma|zeta|theta|kappa|lambda|mu|sigma|tau|omega"
SYMBOL = re.compile(
    rf"(?<!\w)((?:[A-Za-z]|{GREEK})(?:[_^](?:\{{[^{{}}]*\}}|-?[A-Za-z0-9]{{1,2}}(?![A-Za-z0-9])))+"
    r"(?:\[\w\](?:_\w)?)?)"
)
"""A letter with indices or powers, and its argument: w_{t-1}, x^2, F_{r_i}[u]_t."""

OPTION = re.compile(r"(?<![\w-])(--[a-z][a-z-]*)")
"""An option in a sentence: where it is code, its hyphens stay, and lines do not break within it."""

DOCS = Path(__file__).parents[1]
MADE = DOCS / "_generated"


def write(path: Path, text: str) -> None:
    """Write a page if it changed, so that Sphinx does not read unchanged pages again."""
    path.parent.mkdir(parents=True, exist_ok=True)
    if not path.is_file() or path.read_text(encoding="utf-8") != text:
        path.write_text(text, encoding="utf-8")


def plain(text: str) -> str:
    """Return text escaped for Markdown, with paragraphs and inline code preserved.

    Symbols with an index or a power, as docstrings write them, are set as mathematics.
    """

    def shown(paragraph: str) -> Iterator[str]:
        for place, piece in enumerate(re.split(r"(`+[^`]*`+)", paragraph)):
            for where, part in enumerate([piece] if place % 2 else SYMBOL.split(piece)):
                if where % 2:
                    yield symbol(part)
                else:
                    yield (
                        part
                        if place % 2
                        else OPTION.sub(r"`\1`", re.sub(r"([\\*_\[\]<>$|#])", r"\\\1", part))
                    )

    paragraphs = [" ".join(part.split()) for part in re.split(r"\n\s*\n", text)]
    return "\n\n".join("".join(shown(paragraph)) for paragraph in paragraphs)


def symbol(written: str) -> str:
    """Return a symbol of a docstring as mathematics, as HTML.

    >>> "<msub>" in symbol("gamma_R"), symbol("w_{t-1}") == inline("w_{t-1}")
    (True, True)
    """
    indexed = re.sub(r"([_^])(-?\w+)", r"\1{\2}", written)
    return inline(re.sub(rf"\b({GREEK})(?=[_^])", r"\\\1", indexed))


def equation(latex: str) -> list[str]:
    """Return an equation on lines of its own."""
    return ["```{math}", latex, "```", ""]


def inline(latex: str) -> str:
    """Return a symbol within a line, as HTML."""
    return str(mathml(latex, "inline"))


def table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Return a table as Markdown; empty if it has no rows."""
    if not rows:
        return []
    lines = [heads, ["---"] * len(heads), *rows]
    return [f"| {' | '.join(cell.replace(chr(10), ' ') for cell in row)} |" for row in lines] + [""]


def toctree(entries: Sequence[str], *options: str) -> list[str]:
    """Return a list of pages below this one."""
    return ["```{toctree}", *(f":{option}:" for option in options), "", *entries, "```", ""]
