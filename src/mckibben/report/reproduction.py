"""Pages of a paper's re-run: one self-contained HTML file, and Markdown."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from importlib.metadata import version
from typing import TYPE_CHECKING

import numpy as np

from mckibben.arrays import Array
from mckibben.report import builder, interactive
from mckibben.report.builder import Code, Item, Page, Section, Text
from mckibben.report.drawing import (
    N_COLOURS,
    Curve,
    Drawing,
    Mark,
    Panel,
    Style,
    axis_label,
    jumps,
    left_out,
    series_colour,
    within,
)

if TYPE_CHECKING:
    from mckibben.papers.experiment import Figure, Reproduction, Table
    from mckibben.papers.paper import Item as Indexed

RECORDED = ("", "virtual rig", "measured", "extracted", "reference")
"""Names of curves that are drawn in ink, as what a muscle did or should do: one of them in a figure."""

MOST_DOTS = 40
"""Largest number of points of a curve that are drawn one by one."""

OVERSHOOT_SHARE = 0.5
"""What a panel shows at least above and below its recorded curve, relative to the height of the highest
recorded curve on an axis of the same label."""

LEAST_HEIGHT_SHARE = 0.1
"""Least height of a panel, so that noise does not fill it, relative to the same height."""


def heading(item: Table | Figure, *, quick: bool = False) -> str:
    """Return a title, with the corresponding item of the paper, and whether the run was quick."""
    source = f" ({item.text.of})" if item.text.of else ""
    return f"{item.text.title}{source}{', quick run' if quick else ''}"


def reproduction_page(result: Reproduction, command: str = "") -> str:
    """Return the report of a re-run as HTML: printed results with ours first, figures last.

    ``command`` repeats it; default the one on the paper's rig.
    """
    paper = result.paper
    quick = ["A quick run: what takes long was left out, so figures are rougher."] * result.quick
    drawn_tables = [table for table in result.tables if table.text.drawn]
    published = ". ".join(filter(None, (paper.authors, paper.published, paper.doi)))
    charts = [
        chart(f"comparison-{k}", comparison(table), heading(table), "tall" * (len(table.rows) > 12))
        for k, table in enumerate(drawn_tables)
    ]
    drawings = [drawing(figure) for figure in result.figures]
    figures = [
        chart(
            f"figure-{k}", drawn, heading(figure), "square", min(len(drawn.panels), drawn.abreast)
        )
        for k, (drawn, figure) in enumerate(zip(drawings, result.figures, strict=True))
    ]
    quick_flag = " --quick" * result.quick
    command = command or f"mckibben reproduce {result.name}{quick_flag} --seed {result.seed}"
    return Page(
        paper.title,
        published,
        [
            Section(
                "question",
                "",
                [Text([paper.question, f"{paper.protocol} Here: {result.on}.", *quick])],
            ),
            Section("results", "Results", [Text(result.summary, listed=True)]),
            Section("comparison", "Printed and ours", charts),
            Section("tables", "Tables", tables(result.tables, result.quick)),
            Section(
                "differences", "What differs from the paper", [Text(result.notes, listed=True)]
            ),
            Section("figures", "Figures", figures),
            Section("method", "How to repeat", [Code("", command)]),
        ],
    ).html()


def items(result: Reproduction) -> list[Item]:
    """Return the tables of a re-run, and their findings."""
    return [*tables(result.tables, result.quick), Text(["", *result.summary])]


def tables(paper_tables: Sequence[Table], quick: bool = False) -> list[Item]:
    """Return every table under its heading, with its note."""
    items: list[Item] = []
    for table in paper_tables:
        items += [
            Text([heading(table, quick=quick)], "lead"),
            builder.Table(table.columns, table.rows),
        ]
        items.append(Text([table.text.note], "muted") if table.text.note else None)
    return items


def chart(
    name: str, drawn: Drawing, label: str, shape: str = "", columns: int = 1
) -> builder.Figure:
    """Return a drawing as a figure of a page, with its heading as caption."""
    caption = ". ".join(filter(None, (label, drawn.note)))
    return builder.Figure(name, [interactive.plots(drawn)], label, caption, shape, columns)


def comparison(table: Table) -> Drawing:
    """Return a table's drawn columns: printed values as open rings, ours in colours.

    Drawn are those in the unit of ``table.text.drawn``, and all others if none names a unit of its own.
    """
    curves: list[Curve] = []
    series = (f"series-{k + 1}" for k in range(N_COLOURS))
    inks = iter(("measured", "input"))
    for column in _plotted_columns(table):
        cells = [row[table.columns.index(column)] for row in table.rows]
        numbered = [row for row, cell in enumerate(cells) if isinstance(cell, int | float)]
        printed = column.endswith("printed")
        colour = (next(inks, "") if printed else "") or next(series)
        x = np.array([cells[row] for row in numbered], dtype=float)
        style: Style = "rings" if printed else "dots"
        curves.append(Curve(x, np.array(numbered, dtype=float), column, colour, style))
    bound = () if table.text.bound is None else (Mark(table.text.bound, "printed: below"),)
    names = tuple(str(row[0]) for row in table.rows)
    label = axis_label(table.text.drawn, table.text.unit)
    return Drawing((Panel(label, "", tuple(curves), marks=bound, categories=names),))


def _plotted_columns(table: Table) -> list[str]:
    """Return the drawn columns: those of the measure, or with a printed number."""
    of_measure = [column for column in table.columns[1:] if table.text.drawn in column]
    printed = {c.removesuffix(", printed") for c in table.columns if c.endswith(", printed")}
    of_pairs = [c for c in table.columns[1:] if c.removesuffix(", printed") in printed]
    return of_measure or of_pairs or list(table.columns[1:])


def drawing(figure: Figure) -> Drawing:
    """Return a paper's figure as a drawing: the recorded curve in ink below models, each in a colour.

    A curve is named in the first panel that has one of its name.
    """
    names = dict.fromkeys(name for axes in figure.panels.values() for name in axes.curves)
    recorded = next((name for name in names if name in RECORDED), "")
    models = [name for name in names if name != recorded]
    colours = _colours(recorded, models)
    panels = _scale_axes(_panels(figure, recorded, colours))
    n = len(panels)
    full = (abreast for abreast in (3, 4, 2) if n > abreast and n % abreast == 0)  # rows
    note = _note(panels, colours, models[N_COLOURS:])
    return Drawing(tuple(panels), abreast=next(full, 3), note=note)


def _colours(recorded: str, models: Sequence[str]) -> dict[str, str]:
    """Return the colours by name of the curves that are drawn, the recorded one first."""
    of_models = {name: series_colour(k) for k, name in enumerate(models[:N_COLOURS])}
    return {recorded: "measured"} | of_models


def _panels(figure: Figure, recorded: str, colours: dict[str, str]) -> list[Panel]:
    """Return the panels of a figure; names of curves and of shaded parts appear once."""
    panels, unnamed, shading = list[Panel](), {*colours}, figure.text.shaded
    for title, axes in figure.panels.items():
        labels = figure.text.axes.get(axes.key, figure.text)
        curves_here = {name: axes.curves[name] for name in colours if name in axes.curves}
        wide_curve = recorded if len(curves_here) > 1 else None
        curves = tuple(
            Curve(
                x, y, name if name in unnamed else "", colours[name], _style(x, name == wide_curve)
            )
            for name, (x, y) in curves_here.items()
        )
        unnamed -= {*curves_here}

        marks = []
        for start, end in axes.shaded:
            marks.append(Mark(start, shading, end))
            shading = ""
        panels.append(Panel(labels.x, labels.y, curves, title, marks=tuple(marks)))
    return panels


def _note(panels: Sequence[Panel], colours: dict[str, str], undrawn: Sequence[str]) -> str:
    """Return what a figure does not show: curves that leave the axes, and models without a colour."""
    curves = [curve for panel in panels for curve in panel.curves]
    beyond = {curve.colour for curve in curves if curve.style in ("above", "below")}
    leaving = [name for name, colour in colours.items() if colour in beyond]
    heads = f"Arrow heads: beyond the axis, {'; '.join(leaving)}." if leaving else ""
    return " ".join(filter(None, (heads, left_out(undrawn))))


def _scale_axes(panels: Sequence[Panel]) -> list[Panel]:
    """Return panels whose axes go by their recorded curve, and by the highest on such an axis."""
    heights = [float(np.ptp(panel.curves[0].y)) if _recorded(panel) else 0.0 for panel in panels]
    scaled = []
    for panel in panels:
        alike = (other.y_label == panel.y_label for other in panels)
        highest = max(height for height, same in zip(heights, alike, strict=True) if same)
        if _recorded(panel):
            least = replace(panel, least=LEAST_HEIGHT_SHARE * highest)
            panel = within(least, OVERSHOOT_SHARE * highest)
        scaled.append(panel)
    return scaled


def _recorded(panel: Panel) -> bool:
    """Return whether the first curve of a panel is the recorded one."""
    return bool(panel.curves) and panel.curves[0].colour == "measured"


def _style(x: Array, under: bool) -> Style:
    """Return how a curve is drawn: points, or a line, which is wide where models lie on it."""
    few = x.size <= MOST_DOTS
    if jumps(x):
        return "dots" if few else "specks"
    return "beads" if few else "broad" if under else "line"


# -- Markdown ------------------------------------------------------------------------------------------


def markdown(result: Reproduction, date: str, pictures: str) -> str:
    """Return a re-run as a page in Markdown: an index of the paper first, then tables and figures.

    Parameters
    ----------
    found : Reproduction
    date : str
        Of the run, as 2026-11-26.
    pictures : str
        Folder of the pictures, relative to the page, each called by its figure's key.
    """
    return "\n".join(_lines(result, date, pictures)).rstrip("\n") + "\n"


def _lines(result: Reproduction, date: str, pictures: str) -> Iterator[str]:
    paper = result.paper
    yield f"# {paper.number}. {paper.title}\n"
    doi = f"[doi:{paper.doi}](https://doi.org/{paper.doi})" if paper.doi else ""
    yield ". ".join(filter(None, (paper.authors, paper.published, doi))) + ".\n"
    yield f"{paper.question}\n"
    command = f"mckibben reproduce {result.name}{' --quick' if result.quick else ''}"
    kind = "Quick run" if result.quick else "Full run"
    yield (
        f"{kind} of {date} by `{command}`, seed {result.seed}, on {result.on}, mckibben "
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
    yield from (_indexed(item, result) for item in paper.items)
    parts: dict[str, list[Item]] = {
        "What came out": [Text(result.summary, listed=True)],
        "Given, and found": [
            Text([f"Given: {text}" for text in paper.given], listed=True),
            Text([f"Found: {text}" for text in paper.found], listed=True),
        ],
        "What differs from the paper": [Text(result.notes, listed=True)],
        "Tables": tables(result.tables, result.quick),
    }
    for title, items in parts.items():
        yield f"\n## {title}\n\n{builder.markdown(items)}"
    yield "\n## Figures\n"
    for figure in result.figures:
        yield f"### {heading(figure, quick=result.quick)}\n"
        yield f"![{figure.text.title}]({pictures}/{figure.key}.png)\n"
    yield "## On your own rig\n"
    yield (
        f"`mckibben reproduce {result.name} --data FOLDER` takes recordings of its runs on a rig of any "
        f"size, in files of any name, and shows first which run each is; `mckibben rig record "
        f"{result.name} --rig FILE` moves your rig so, and shows how each level is scaled.\n"
    )


def _indexed(item: Indexed, result: Reproduction) -> str:
    """Return the line of an equation, table or figure in the index."""
    kind, _, key = item.here.partition(":")
    candidates: tuple[Table | Figure, ...] = result.tables if kind == "table" else result.figures
    titles = [
        heading(candidate, quick=result.quick) for candidate in candidates if candidate.key == key
    ]
    place = f'`printed("{key}")`' if kind == "model" else f"`{item.here}`" if item.here else "–"
    place = f"[{key}](#{_anchor(titles[0])})" if titles else place
    differs = item.differs or ("the same quantities, on the rig" if titles else "exact")
    command = f"`{result.paper.commands[item.computed_by]}`" if item.computed_by else ""
    return f"| {item.of} | {item.what} | {place} | {differs} | {command} |"


def _anchor(title: str) -> str:
    """Return the anchor of a heading."""
    return re.sub(r"\s", "-", re.sub(r"[^\w\s-]", "", title.lower()))
