"""Where pages are made, and how they are written."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from mckibben.report.mathematics import mathml

DOCS = Path(__file__).parents[1]
MADE = DOCS / "_generated"


def write(path: Path, text: str) -> None:
    """Write a page, unless it is there as it should be: Sphinx then need not read it again."""
    path.parent.mkdir(parents=True, exist_ok=True)
    if not path.is_file() or path.read_text(encoding="utf-8") != text:
        path.write_text(text, encoding="utf-8")


def plain(text: str) -> str:
    """Return text as Markdown that shows it as it is, paragraphs kept; what is between ` stays code."""
    paragraphs = [" ".join(part.split()) for part in re.split(r"\n\s*\n", text)]
    return "\n\n".join(
        "".join(
            piece if place % 2 else re.sub(r"([\\*_\[\]<>$|#])", r"\\\1", piece)
            for place, piece in enumerate(re.split(r"(`+[^`]*`+)", paragraph))
        )
        for paragraph in paragraphs
    )


def equation(latex: str) -> list[str]:
    """Return an equation on lines of its own."""
    return ["```{math}", latex, "```", ""]


def inline(latex: str) -> str:
    """Return a symbol within a line, as HTML."""
    return str(mathml(latex, "inline"))


def table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Return a table as Markdown; nothing where it has no rows."""
    if not rows:
        return []
    lines = [heads, ["---"] * len(heads), *rows]
    return [f"| {' | '.join(cell.replace(chr(10), ' ') for cell in row)} |" for row in lines] + [""]


def toctree(entries: Sequence[str], *options: str) -> list[str]:
    """Return a list of pages below this one."""
    return ["```{toctree}", *(f":{option}:" for option in options), "", *entries, "```", ""]
