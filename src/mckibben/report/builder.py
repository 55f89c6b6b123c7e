"""One builder of pages: a title, tiles, and sections of text, tables and figures, in one HTML file.

A page needs nothing but itself, and a browser runs nothing else under it.
"""

from __future__ import annotations

import base64
import hashlib
import lzma
import platform
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib import resources
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

from mckibben.numerals import number, percent, typeset, typeset_within
from mckibben.report import interactive
from mckibben.report.mathematics import mathml

if TYPE_CHECKING:
    from jinja2 import Environment, Template

PLOTLY = "plotly-basic.min.js.xz"
"""plotly.js 4.1.1 as published (plotly.js-basic-dist-min, MIT), packed: in Python 60 MB."""

PACKAGES = ("mckibben", "numpy", "scipy", "numba")

Variants = list[list[interactive.Json]]
"""A figure for each recording that can be chosen, or once for all: its plots side by side."""


@dataclass(frozen=True)
class Text:
    """A paragraph, or a list of sentences, in a style of the style sheet."""

    sentences: Sequence[str]
    style: str = ""
    listed: bool = False
    kind: str = "text"


@dataclass(frozen=True)
class Table:
    """A table: headings, and rows of cells; numbers are set right.

    ``best`` is the row that is marked, ``titles`` explain first cells to whoever points at them. With
    ``keys``, rows of what a column is sorted by, headings sort.
    """

    headings: Sequence[str]
    rows: Sequence[Sequence[Any]]
    best: int | None = None
    titles: Sequence[str] = ()
    keys: Sequence[Sequence[Any]] = ()
    summary: str = ""
    """Of a table that is folded: what it is called."""
    kind: str = "table"

    @property
    def figures(self) -> set[int]:
        """Columns of numbers, which are set right."""

        def numbers(place: int) -> float:
            cells = [row[place] for row in self.rows if row[place] not in (None, "")]
            plain = [
                isinstance(c, int | float) or bool(re.match(r"[-−+±<]? ?\d", str(c))) for c in cells
            ]
            return sum(plain) / max(len(plain), 1)

        return {k for k in range(1, len(self.headings)) if numbers(k) > 0.5}


@dataclass(frozen=True)
class Figure:
    """A figure: its plots by variant, what it shows, and how it is laid out by the style sheet."""

    name: str
    plots: Variants
    label: str
    caption: str = ""
    shape: str = ""
    columns: int = 1
    height: float = 0.0
    """Of each plot [rem]; 0 for that of the style sheet."""
    toggled: bool = False
    kind: str = "figure"


@dataclass(frozen=True)
class Code:
    """A command, and what it does."""

    what: str
    text: str
    kind: str = "code"


@dataclass(frozen=True)
class Equations:
    """What a model is, in equations: a `mckibben.diagnosis.description.Written`."""

    written: Any
    kind: str = "equations"


Item = Text | Table | Figure | Code | Equations


@dataclass(frozen=True)
class Section:
    """A part of a page, behind a heading that the contents list; without one, before the contents."""

    name: str
    heading: str
    items: Sequence[Item | None]
    chooser: Sequence[str] = ()
    """Recordings to choose between."""
    models: Sequence[Mapping[str, str]] = ()
    """Models to choose among: name and colour of each."""


@dataclass(frozen=True)
class Tile:
    """A number on the first screen: what it is, the number, and its unit or what else belongs to it."""

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
        drawn = [item for one in self.sections for item in one.items if isinstance(item, Figure)]
        figures = {one.name: one.plots for one in (*([self.lead] if self.lead else []), *drawn)}
        scripts = _scripts() if figures else ()
        return template("page.html.j2").render(
            page=self,
            figures=figures,
            bar=interactive.BAR,
            scripts=scripts,
            policy=policy(*scripts),
        )


@cache
def _scripts() -> tuple[str, ...]:
    """Return what a page runs."""
    folder = resources.files("mckibben.report").joinpath("templates")
    packed = folder.joinpath(PLOTLY).read_bytes()
    return lzma.decompress(packed).decode(), folder.joinpath("report.js").read_text("utf-8")


def policy(*scripts: str) -> str:
    """Return a page's content security policy: these scripts run, and nothing is fetched or sent."""
    own = " ".join(
        f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"
        for text in scripts
    )
    own = own or "'none'"
    return (
        f"default-src 'none'; script-src {own}; style-src 'unsafe-inline'; "
        "img-src data: blob:; connect-src 'none'; form-action 'none'; base-uri 'none'"
    )


def template(name: str) -> Template:
    """Return a template: everything escaped, nothing undefined, numbers as they are printed."""
    return _environment().get_template(name)


@cache
def _environment() -> Environment:
    """Return where templates are compiled, each once for all pages."""
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
        "typeset_within": typeset_within,
        "mathml": mathml,
    }
    environment.policies["json.dumps_kwargs"] = {"allow_nan": False, "separators": (",", ":")}
    return environment


def versions() -> str:
    """Return the versions of Python, this package, and those that its numbers come from."""
    found = [f"{name} {version(name)}" for name in PACKAGES]
    return ", ".join([f"Python {platform.python_version()}", *found])
