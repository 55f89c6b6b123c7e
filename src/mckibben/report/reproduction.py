"""Pages of a paper's re-run: one self-contained HTML file, and Markdown."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from importlib.metadata import version
from typing import TYPE_CHECKING

import numpy as np

from mckibben.report import builder, interactive
from mckibben.report.builder import Code, Item, Page, Section, Text
from mckibben.report.drawing import N_COLOURS, Curve, Drawing, Mark, Panel, Style

if TYPE_CHECKING:
    from mckibben.papers.experiment import Figure, Reproduction, Table
    from mckibben.papers.paper import Item as Indexed

RECORDED = ("", "simulated", "measured", "sensor", "extracted", "reference", "of every loop")
"""Names of curves that are drawn in ink, as what a muscle did."""

LONGEST = 40
"""Letters of all names of curves for which a third of the page is wide enough."""

DOTS = 40
"""Most points of a curve that is drawn as dots; more are a line."""


def heading(one: Table | Figure, *, quick: bool = False) -> str:
    """Return a title, with the corresponding item of the paper, and whether the run was quick."""
    of = f" ({one.text.of})" if one.text.of else ""
    return f"{one.text.title}{of}{', quick run' if quick else ''}"


def reproduction_page(found: Reproduction) -> str:
    """Return the report of a re-run as HTML: printed results with ours first, figures last."""
    paper = found.paper
    quick = ["A quick run: what takes long was left out, so figures are rougher."] * found.quick
    pictured = [table for table in found.tables if table.text.drawn]
    published = ". ".join(filter(None, (paper.authors, paper.published, paper.doi)))
    charts = [
        chart(f"comparison-{k}", comparison(table), heading(table), "tall" * (len(table.rows) > 12))
        for k, table in enumerate(pictured)
    ]
    figures = [
        chart(f"figure-{k}", drawing(one), heading(one), "square", min(len(one.panels), 3))
        for k, one in enumerate(found.figures)
    ]
    command = f"mckibben reproduce {found.name}{' --quick' if found.quick else ''}"
    code = Code("", f"{command} --seed {found.seed} -o {found.name}")
    return Page(
        paper.title,
        published,
        [
            Section(
                "question",
                "",
                [Text([paper.question, f"{paper.protocol} Here: {found.on}.", *quick])],
            ),
            Section("results", "Results", [Text(found.summary, listed=True)]),
            Section("comparison", "Printed and ours", charts),
            Section("tables", "Tables", tables(found.tables, found.quick)),
            Section("differences", "What differs from the paper", [Text(found.notes, listed=True)]),
            Section("figures", "Figures", figures),
            Section("method", "How to repeat", [code]),
        ],
    ).html()


def items(found: Reproduction) -> list[Item]:
    """Return the tables of a re-run, and their findings."""
    return [*tables(found.tables, found.quick), Text(["", *found.summary])]


def tables(given: Sequence[Table], quick: bool = False) -> list[Item]:
    """Return every table under its heading, with its note."""
    shown: list[Item] = []
    for one in given:
        shown += [
            Text([heading(one, quick=quick)], "lead"),
            builder.Table(one.columns, one.rows),
        ]
        shown.append(Text([one.text.note], "muted") if one.text.note else None)
    return shown


def chart(
    name: str, drawn: Drawing, label: str, shape: str = "", columns: int = 1
) -> builder.Figure:
    """Return a drawing as a figure of a page, with its heading as caption."""
    return builder.Figure(name, [interactive.plots(drawn)], label, label, shape, columns)


def comparison(table: Table) -> Drawing:
    """Return a table's drawn columns: printed values as open rings, ours in colours.

    Drawn are those in the unit of ``table.text.drawn``, and all others if none names a unit of its own.
    """
    curves: list[Curve] = []
    found = n_printed = 0
    for column in _drawn(table):
        cells = [row[table.columns.index(column)] for row in table.rows]
        places = [place for place, cell in enumerate(cells) if isinstance(cell, int | float)]
        printed = column.endswith("printed")
        n_printed += printed
        found += not printed
        ours = f"series-{(found - 1) % N_COLOURS + 1}"
        curves.append(
            Curve(
                np.array([cells[place] for place in places], dtype=float),
                np.array(places, dtype=float),
                column,
                ("measured" if n_printed == 1 else "input") if printed else ours,
                "rings" if printed else "dots",
            )
        )
    bound = () if table.text.bound is None else (Mark(table.text.bound, "printed: below"),)
    names = tuple(str(row[0]) for row in table.rows)
    return Drawing((Panel(table.text.drawn, "", tuple(curves), marks=bound, categories=names),))


def _drawn(table: Table) -> list[str]:
    """Return the drawn columns: those of the measure, or with a printed figure."""
    named = [column for column in table.columns[1:] if table.text.drawn in column]
    printed = {c.removesuffix(", printed") for c in table.columns if c.endswith(", printed")}
    both = [c for c in table.columns[1:] if c.removesuffix(", printed") in printed]
    return named or both or list(table.columns[1:])


def drawing(figure: Figure) -> Drawing:
    """Return a paper's figure as a drawing: measurements in ink, models in colours on top.

    A curve is named in the first panel that has one of its name.
    """
    panels = []
    names = dict.fromkeys(name for given in figure.panels.values() for name in given)
    models = [name for name in names if name not in RECORDED]
    seen: set[str] = set()
    for title, given in figure.panels.items():
        curves = []
        for name, (x, y) in given.items():
            ink = name not in models
            colour = "measured" if ink else f"series-{models.index(name) % N_COLOURS + 1}"
            style: Style = "line" if len(x) > DOTS else "dots"
            curves.append(Curve(x, y, "" if name in seen else name, colour, style))
        seen |= {*given}
        panels.append(Panel(figure.text.x, figure.text.y, tuple(curves), title))
    wide = sum(map(len, names)) > LONGEST
    return Drawing(tuple(panels), abreast=2 if wide or len(panels) in (2, 4) else 3)


# -- Markdown ------------------------------------------------------------------------------------------


def markdown(found: Reproduction, date: str, pictures: str) -> str:
    """Return a re-run as a page in Markdown: an index of the paper first, then tables and figures.

    Parameters
    ----------
    found : Reproduction
    date : str
        Of the run, as 2026-11-26.
    pictures : str
        Folder of the pictures, relative to the page, each called by its figure's key.
    """
    return "\n".join(_lines(found, date, pictures)).rstrip("\n") + "\n"


def _lines(found: Reproduction, date: str, pictures: str) -> Iterator[str]:
    paper = found.paper
    yield f"# {paper.number}. {paper.title}\n"
    doi = f"[doi:{paper.doi}](https://doi.org/{paper.doi})" if paper.doi else ""
    yield ". ".join(filter(None, (paper.authors, paper.published, doi))) + ".\n"
    yield f"{paper.question}\n"
    command = f"mckibben reproduce {found.name}{' --quick' if found.quick else ''}"
    kind = "Quick run" if found.quick else "Full run"
    yield (
        f"{kind} of {date} by `{command}`, seed {found.seed}, on {found.on}, mckibben "
        f"{version('mckibben')}. The rig is not the paper's hardware: orders and ratios can be "
        "compared, digits cannot.\n"
    )
    yield f"{paper.protocol}\n"
    yield "## Where everything is\n"
    yield (
        "The commands run in one folder, in the order of the rows, once "
        f"`{paper.commands['record']}` has recorded the rig.\n"
    )
    yield "| in the paper | what it is | here | exact, or how it differs | command |"
    yield "|---|---|---|---|---|"
    yield from (_indexed(item, found) for item in paper.items)
    parts: dict[str, list[Item]] = {
        "What came out": [Text(found.summary, listed=True)],
        "Given, and found": [
            Text([f"Given: {text}" for text in paper.given], listed=True),
            Text([f"Found: {text}" for text in paper.found], listed=True),
        ],
        "What differs from the paper": [Text(found.notes, listed=True)],
        "Tables": tables(found.tables, found.quick),
    }
    for title, shown in parts.items():
        yield f"\n## {title}\n\n{builder.markdown(shown)}"
    yield "\n## Figures\n"
    for figure in found.figures:
        yield f"### {heading(figure, quick=found.quick)}\n"
        yield f"![{figure.text.title}]({pictures}/{figure.key}.png)\n"
    yield "## On your own rig\n"
    yield (
        f"`mckibben reproduce {found.name} --data FOLDER` takes recordings of its runs on a rig of any "
        f"size, in files of any name, and shows first which run each is; `mckibben rig record "
        f"{found.name} --rig FILE` moves your rig so, and shows how each level is scaled.\n"
    )


def _indexed(item: Indexed, found: Reproduction) -> str:
    """Return the line of an equation, table or figure in the index."""
    kind, _, key = item.here.partition(":")
    shown: tuple[Table | Figure, ...] = found.tables if kind == "table" else found.figures
    titles = [heading(one, quick=found.quick) for one in shown if one.key == key]
    here = f'`printed("{key}")`' if kind == "model" else f"`{item.here}`" if item.here else "–"
    here = f"[{key}](#{_anchor(titles[0])})" if titles else here
    differs = item.differs or ("the same quantities, on the rig" if titles else "exact")
    command = f"`{found.paper.commands[item.computed_by]}`" if item.computed_by else ""
    return f"| {item.of} | {item.what} | {here} | {differs} | {command} |"


def _anchor(title: str) -> str:
    """Return the anchor of a heading."""
    return re.sub(r"\s", "-", re.sub(r"[^\w\s-]", "", title.lower()))
