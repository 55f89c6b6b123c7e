"""Builder of pages: a title, tiles, and sections of text, tables and figures, in one HTML file.

A page needs nothing but itself, and a browser runs nothing else under it.
"""

from __future__ import annotations

import base64
import hashlib
import lzma
import platform
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib import resources
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

from mckibben.errors import in_terms_of
from mckibben.numerals import number, numeral, percent, typeset, typeset_within
from mckibben.printing import printable
from mckibben.report import interactive
from mckibben.report.glossary import definition
from mckibben.report.mathematics import mathml

if TYPE_CHECKING:
    from jinja2 import Environment, Template

PLOTLY = "plotly.min.js.xz"
"""What reports use of plotly.js 4.1.1 (MIT), packed by recipe/plotly.mjs: in Python 60 MB."""

NUMBER_CELL = re.compile(r"[-−+±<>]? ?\d[\d.,e+−-]*( (to [-−]?\d\S*|\S+))?")
"""A cell that holds a number, perhaps with its unit, or an interval."""

PACKAGES = ("mckibben", "numpy", "scipy", "numba")

Variants = list[list[interactive.Json]]
"""A figure for each recording that can be chosen, or once for all: its plots side by side."""


@dataclass(frozen=True)
class Text:
    """A paragraph, or a list of sentences, in a style of the style sheet; ``lead`` is a heading."""

    sentences: Sequence[str]
    style: str = ""
    listed: bool = False
    kind: str = "text"

    def __post_init__(self) -> None:  # names in it may hold anything
        object.__setattr__(self, "sentences", [printable(sentence) for sentence in self.sentences])


@dataclass(frozen=True)
class Table:
    """A table: headings, and rows of cells; numbers are right-aligned.

    ``best`` is the row that is marked, ``titles`` explain first cells to whoever points at them. With
    ``keys``, rows of what a column is sorted by, headings sort.
    """

    headings: Sequence[str]
    rows: Sequence[Sequence[Any]]
    best: int | None = None
    titles: Sequence[str] = ()
    keys: Sequence[Sequence[Any]] = ()
    marked: Mapping[tuple[int, int], str] = field(default_factory=dict)
    """Single cells that are ``"least"``, ``"chosen"`` or both."""
    summary: str = ""
    """Of a table that is folded: what it is called."""
    kind: str = "table"

    def __post_init__(self) -> None:
        rows = [[printable(x) if isinstance(x, str) else x for x in row] for row in self.rows]
        object.__setattr__(self, "rows", rows)

    @property
    def numeric_columns(self) -> set[int]:
        """Columns of numbers, which are right-aligned."""

        def number_share(place: int) -> float:
            cells = [row[place] for row in self.rows if row[place] not in (None, "", "–", "-")]
            are_numbers = [
                isinstance(cell_value, int | float) or bool(NUMBER_CELL.fullmatch(str(cell_value)))
                for cell_value in cells
            ]
            return sum(are_numbers) / max(len(are_numbers), 1)

        return {k for k in range(1, len(self.headings)) if number_share(k) > 0.5}


@dataclass(frozen=True)
class Figure:
    """A figure: its plots by variant, its caption, and its layout in the style sheet."""

    name: str
    plots: Variants
    label: str
    caption: str = ""
    shape: str = ""
    columns: int = 1
    height: float = 0.0
    """Of each plot [rem]; 0 for that of the style sheet."""
    toggled: bool = False
    """Whether curves of models are shown and hidden by choosing models on the page."""
    kind: str = "figure"


@dataclass(frozen=True)
class Code:
    """A command, and its effect."""

    what: str
    text: str
    kind: str = "code"


@dataclass(frozen=True)
class Equations:
    """Equations of a model: a `mckibben.diagnosis.description.Written`."""

    written: Any
    kind: str = "equations"


Item = Text | Table | Figure | Code | Equations | None
"""None is left out."""


@dataclass(frozen=True)
class Section:
    """A part of a page with a heading in the contents; without one, before the contents."""

    name: str
    heading: str
    items: Sequence[Item]
    chooser: Sequence[str] = ()
    """Recordings to choose between."""
    models: Sequence[Mapping[str, str]] = ()
    """Models to choose among: name and colour of each."""


@dataclass(frozen=True)
class Tile:
    """A number on the first screen: its label, the number, and its unit or a remark."""

    label: str
    value: str
    note: str = ""
    target: str = ""
    """Section with more."""


@dataclass(frozen=True)
class Page:
    """A page.

    Parameters
    ----------
    title, subtitle : str
    sections : sequence of Section
    tiles : sequence of Tile
        On the first screen.
    lead : Figure or None
        Beside the answers on the first screen.
    answers : sequence of (str, str)
        Question and answer.
    footer : str
    """

    title: str
    subtitle: str
    sections: Sequence[Section]
    tiles: Sequence[Tile] = ()
    lead: Figure | None = None
    answers: Sequence[tuple[str, str]] = ()
    footer: str = field(default_factory=lambda: versions())

    def html(self) -> str:
        """Return the page as HTML."""
        figures_drawn = [
            item for section in self.sections for item in section.items if isinstance(item, Figure)
        ]
        figures = {
            section.name: section.plots
            for section in (*([self.lead] if self.lead else []), *figures_drawn)
        }
        scripts = _scripts() if figures else ()
        return template("page.html.j2").render(
            page=self,
            figures=figures,
            bar=interactive.BAR,
            scripts=scripts,
            policy=policy(*scripts),
        )

    def markdown(self) -> str:
        """Return the page as Markdown: its texts and tables."""
        lines = [f"# {plain(self.title)}", plain(self.subtitle)]
        for section in self.sections:
            lines += [f"## {plain(section.heading)}"] if section.heading else []
            lines.append(markdown(section.items))
        return "\n\n".join(filter(None, lines)) + "\n"


def markdown(items: Sequence[Item]) -> str:
    """Return texts, tables and code as Markdown."""
    lines = []
    for item in items:
        if isinstance(item, Table):
            lines.append("\n".join(_table(item)))
        elif isinstance(item, Code):
            lines.append(f"```\n{item.text}\n```")
        elif isinstance(item, Text):
            start = "### " if item.style == "lead" else "- " if item.listed else ""
            mark = "\n" if item.listed else " "
            lines.append(mark.join(f"{start}{plain(sentence)}" for sentence in item.sentences))
    return "\n\n".join(filter(None, lines))


def cell(value: Any, digits: int = 3) -> str:
    """Return the text of a table cell."""
    return (
        "–" if value is None else numeral(value, digits) if isinstance(value, float) else str(value)
    )


def plain(text: str) -> str:
    """Return text on one line, with Markdown characters escaped."""
    return re.sub(r"([\\`*\[\]<>|#])", r"\\\1", " ".join(text.split()))


def _table(content: Table) -> Iterator[str]:
    sides = (
        "---:" if k in content.numeric_columns else "---" for k in range(len(content.headings))
    )
    yield f"| {' | '.join(map(plain, content.headings))} |"
    yield f"|{'|'.join(sides)}|"
    for row_number, row in enumerate(content.rows):
        cells = []
        for column, value in enumerate(row):
            text = typeset(cell(value, 4)) if isinstance(value, float) else plain(cell(value))
            mark = content.marked.get((row_number, column), "")
            text = f"**{text}**" if "least" in mark else text
            cells.append(f"<u>{text}</u>" if "chosen" in mark else text)
        yield f"| {' | '.join(cells)} |"


@cache
def _scripts() -> tuple[str, ...]:
    """Return the scripts of a page."""
    folder = resources.files("mckibben.report").joinpath("templates")
    packed = folder.joinpath(PLOTLY).read_bytes()
    return lzma.decompress(packed).decode(), folder.joinpath("report.js").read_text("utf-8")


def policy(*scripts: str) -> str:
    """Return a page's content security policy: only these scripts run, and nothing is loaded or sent."""
    digests = " ".join(
        f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"
        for text in scripts
    )
    digests = digests or "'none'"
    return (
        f"default-src 'none'; script-src {digests}; style-src 'unsafe-inline'; "
        "img-src data: blob:; connect-src 'none'; form-action 'none'; base-uri 'none'"
    )


def template(name: str) -> Template:
    """Return a template: with escaping, strict variables, and typeset numbers."""
    return _environment().get_template(name)


@cache
def _environment() -> Environment:
    """Return the template environment, with compiled templates cached."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("mckibben.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {
        "number": number,
        "percent": percent,
        "typeset": typeset,
        "typeset_within": lambda text: typeset_within(in_terms_of(str(text))),
        "mathml": mathml,
        "definition": definition,
    }
    environment.policies["json.dumps_kwargs"] = {"allow_nan": False, "separators": (",", ":")}
    return environment


def versions() -> str:
    """Return the versions of Python, this package, and its numerical libraries."""
    parts = [f"{name} {version(name)}" for name in PACKAGES]
    return ", ".join([f"Python {platform.python_version()}", *parts])
