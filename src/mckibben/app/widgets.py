"""Parts that every page is made of: cards, buttons, plots, tables, uploads, errors, empty states.

All sizes are multiples of one unit (8 px), all text has one of four sizes, and all colours are of the
report's style sheet, light or dark. Pages use these parts, and no colours or sizes of their own.
"""

from __future__ import annotations

import inspect
import re
import traceback
from collections.abc import Awaitable, Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from functools import cache, partial, wraps
from importlib import resources
from pathlib import Path
from typing import Any, Literal

import numpy as np
from nicegui import binding, context, events, run, ui

from mckibben.app.steps import LARGEST_UPLOAD
from mckibben.app.terms import message_of
from mckibben.arrays import Array
from mckibben.errors import MckibbenError, unforeseen
from mckibben.numerals import typeset, typeset_within
from mckibben.report import interactive
from mckibben.report.builder import Equations, Figure, Item, Table, Text
from mckibben.report.builder import cell as as_text
from mckibben.report.drawing import Drawing
from mckibben.report.glossary import definition
from mckibben.report.mathematics import mathml

Json = dict[str, Any]

TEXT_SIZE = 12
"""Of text in plots [px]."""


class Theme:
    """Whether pages are dark; ``known`` once a browser has said so, or a person."""

    dark = binding.BindableProperty()
    known = False

    def __init__(self) -> None:
        self.dark = False


theme = Theme()

# -- colours and style ----------------------------------------------------------------------------


@cache
def colours(dark: bool) -> dict[str, str]:
    """Return the report's colours by name."""
    style = resources.files("mckibben.report").joinpath("templates/report.css").read_text("utf-8")
    light, _, rest = style.partition("@media")
    colours_by_name = dict(re.findall(r"--([\w-]+):\s*(#[0-9a-fA-F]{3,8})", light))
    if dark:
        colours_by_name |= dict(
            re.findall(r"--([\w-]+):\s*(#[0-9a-fA-F]{3,8})", rest.partition("@media")[0])
        )
    return colours_by_name


def style() -> str:
    """Return the style sheet of all pages."""
    sheets = []
    for body, dark in (("body", False), ("body.body--dark", True)):
        named = "; ".join(f"--{name}: {colour}" for name, colour in colours(dark).items())
        text_colour = "#10161b" if dark else "#ffffff"
        brand = "; ".join(
            f"--q-{name}: {colours(dark)[colour]} !important"
            for name, colour in {"primary": "accent", "negative": "warn", "warning": "warn"}.items()
        )
        sheets.append(f"{body} {{ {named}; --on: {text_colour}; {brand} }}")
    sheet = resources.files("mckibben.app").joinpath("style.css").read_text("utf-8")
    return "\n".join([*sheets, sheet])


def mark(element: Any, name: str) -> Any:
    """Give an element a name for tests and the tour of screenshots (``data-testid``)."""
    element.props["data-testid"] = name
    return element


def labelled(element: Any, text: str) -> Any:
    """Give an element a label for screen readers; in a text of props, names could be code."""
    element.props["aria-label"] = text
    return element


# -- frame of a page --------------------------------------------------------------------------------


def heading(title: str, explanation: str = "") -> None:
    """Show the title of a page, and what it is for in a line."""
    with ui.element("div").classes("heading"):
        ui.label(title).classes("title").props('role=heading aria-level="2"')
        if explanation:
            ui.label(explanation).classes("muted")


def card(title: str = "") -> Any:
    """Make a card; what is made with it is in it."""
    section = ui.element("section").classes("card")
    if title:
        with section:
            ui.label(title).classes("subtitle").props('role=heading aria-level="3"')
    return section


def row(classes: str = "") -> Any:
    """Make a row of controls, which wraps."""
    return ui.element("div").classes(f"controls {classes}")


def details(title: str) -> Any:
    """Make a fold-out, closed at first, for what is rarely needed."""
    with ui.expansion(title).classes("details").props("dense"):
        return ui.element("div")


@contextmanager
def dialog(title: str) -> Iterator[Any]:
    """Make and open a dialog; it is deleted when it closes. Yields it, with ``close()``."""
    with ui.dialog() as window, ui.element("div").classes("card dialog"):
        with ui.element("div").classes("controls spread"):
            ui.label(title).classes("subtitle").props('role=heading aria-level="3"')
            ui.button(icon="close", on_click=window.close).props(
                'flat round dense aria-label="Close"'
            )
        yield window
    window.on("hide", window.delete)
    window.open()


def sure(title: str, text: str, act: Callable[[], Any]) -> None:
    """Ask whether to delete something, and ``act`` if so."""
    with dialog(title) as window:
        ui.label(text)

        def yes() -> None:
            act()
            window.close()

        mark(primary("Delete", yes), "delete-sure")


def empty(icon: str, title: str, text: str) -> Any:
    """Show what a place is for while there is nothing in it; add a button with ``with``."""
    with ui.element("div").classes("empty") as place:
        ui.icon(icon).classes("large")
        ui.label(title).classes("subtitle")
        ui.label(text).classes("muted")
    return place


def next_step(text: str, page: str, path: str) -> None:
    """Say what comes next, and lead there."""
    with ui.element("div").classes("next"):
        ui.label(text).classes("muted")
        ui.link(f"{page} →", path)


# -- actions ---------------------------------------------------------------------------------------


def guarded(action: Callable[..., Any]) -> Callable[..., Awaitable[None]]:
    """Make an action show its errors; it may be a coroutine, and take an event or nothing."""

    @wraps(action)  # so that it is called with an event if the action takes one
    async def act(*arguments: Any) -> None:
        with context.client:  # what was clicked may be gone before this is done
            try:
                result = action(*arguments)
                if inspect.iscoroutine(result):
                    await result
            except MckibbenError as error:
                error_toast(error)
            except Exception as error:
                traceback.print_exception(error)
                error_toast(unforeseen(error))

    return act


def shielded(build: Callable[..., None]) -> Callable[..., None]:
    """Let a part of a page show its error in its place, such as that of a damaged model."""

    @wraps(build)
    def built(*arguments: Any) -> None:
        try:
            build(*arguments)
        except MckibbenError as error:
            error_box(error)

    return built


def primary(text: str, action: Callable[..., Any], icon: str = "") -> Any:
    """Make the primary button of a page, of which there is one."""
    return button(text, action, icon).props("unelevated", remove="flat dense")


def button(text: str, action: Callable[..., Any], icon: str = "") -> Any:
    """Make any other button; without text, the icon needs a tooltip and an ``aria-label``."""
    act = guarded(action)

    async def click() -> None:
        made.props("loading")  # so that it is not clicked twice
        await act()
        if not made.is_deleted:
            made.props(remove="loading")

    made = ui.button(text, icon=icon or None, on_click=click).props("flat dense no-caps")
    return made


def icon_button(icon: str, label: str, action: Callable[..., Any]) -> Any:
    """Make a button that is an icon, whose label is its tooltip."""
    return labelled(button("", action, icon).props("round"), label).tooltip(label)


def error_toast(error: Exception | str) -> None:
    """Show an error, with its remedy in terms of controls, until it is read or closed."""
    more: Any = {"multi_line": True, "timeout": 20_000, "close_button": "Close", "color": "warning"}
    ui.notify(message_of(error), type="negative", **more)


def error_box(error: Exception | str) -> None:
    """Show an error in its place in a page."""
    with ui.element("div").classes("error").props("role=alert"):
        ui.icon("error_outline")
        ui.label(message_of(error))


def upload(
    text: str, action: Callable[[events.UploadEventArguments], Any], endings: str = ""
) -> Any:
    """Make a place to drop files, which are streamed to the disk, or to choose them."""
    too_large = f"A file has more than {LARGEST_UPLOAD // 2**20} MiB"
    refused = (
        f"A file is not {endings.replace(',', ', ')}, or {too_large[2:]}" if endings else too_large
    )
    element = ui.upload(
        label=f"{text}, or click to choose",
        multiple=True,
        auto_upload=True,
        max_file_size=LARGEST_UPLOAD,
        on_upload=guarded(action),
        on_rejected=partial(error_toast, refused),
    )
    accepted = f' accept="{endings}"' if endings else ""
    return element.props(f"flat{accepted}").classes("upload")


async def download(path: Path) -> None:
    """Hand a file over to the browser, through the page's own connection."""
    ui.download.content(await run.io_bound(path.read_bytes) or b"", path.name)


# -- what is shown -----------------------------------------------------------------------------------


def plot(drawing: Drawing, *, height: int = 320, dragged: str = "zoom") -> list[Any]:
    """Show a drawing of `mckibben.report.figures.draw`; return its plots, one for each plane."""
    return [
        plot_of(figure, height=height, dragged=dragged) for figure in interactive.plots(drawing)
    ]


def plot_of(figure: Json, *, height: int = 320, dragged: str = "zoom") -> Any:
    """Show one figure as `mckibben.report.interactive` makes them; its colours follow the theme."""
    layout = dict(figure["layout"])
    axis = {"automargin": True, "gridcolor": "--grid"}
    axis |= dict.fromkeys(("linecolor", "zerolinecolor"), "--rule")
    for key in [key for key in layout if key.startswith(("xaxis", "yaxis"))]:
        layout[key] = axis | layout[key]
        _place_title(layout, key, height)
    lifted = any(
        annotation.get("y") == 1 for annotation in layout.get("annotations", ())
    )  # a title at the top
    layout |= {
        "height": height,
        "dragmode": dragged,
        "margin": {"l": 56, "r": 16, "t": 32 if "title" in layout or lifted else 16, "b": 40},
        "paper_bgcolor": "rgba(0,0,0,0)",
        "plot_bgcolor": "rgba(0,0,0,0)",
        "font": {"color": "--ink", "family": "system-ui, sans-serif", "size": TEXT_SIZE},
        "legend": {"orientation": "h", "x": 0, "y": 1 + lifted * 20 / height, "yanchor": "bottom"},
        "modebar": {"bgcolor": "rgba(0,0,0,0)", "color": "--muted", "activecolor": "--accent"},
        "uirevision": "same",
    }
    config = interactive.CLOSED | {"displayModeBar": "hover", "responsive": True}
    resolved = interactive.resolved({"data": figure["data"], "layout": layout}, colours(theme.dark))
    return ui.plotly(resolved | {"config": config}).classes("plot")


def _place_title(layout: Json, key: str, height: int) -> None:
    """Put the title of an axis near it, or over its panel where that is too low for it."""
    title = layout[key].get("title")
    text = title.get("text", "") if isinstance(title, dict) else title or ""
    layout[key]["title"] = {"text": text, "font": {"size": TEXT_SIZE}, "standoff": 8}
    low, high = layout[key].get("domain", (0, 1))
    if key[0] == "y" and 0.55 * TEXT_SIZE * len(text) > (high - low) * height:
        annotation = {"xref": "paper", "x": 0, "yref": "paper", "y": high, "text": text}
        annotation |= {
            "xanchor": "left",
            "yanchor": "bottom",
            "showarrow": False,
            "font": {"size": TEXT_SIZE},
        }
        layout["annotations"] = [*layout.get("annotations", ()), annotation]
        layout[key]["title"] = {"text": ""}


MOST_OVERLAY_POINTS = 160
"""Points of a small picture: the least and the largest of each part, so that no peak is lost."""


def overlay(traces: Mapping[str, Array]) -> None:
    """Draw signals over each other in a small picture, each over its own range, with a legend."""
    lines = []
    for place, samples in enumerate(traces.values(), start=1):
        finite = samples[np.isfinite(samples)]
        parts = np.array_split(finite, min(MOST_OVERLAY_POINTS // 2, len(finite)))
        rows = [sorted((part.argmin(), part.argmax())) for part in parts]
        ends = np.concatenate([part[row] for part, row in zip(parts, rows, strict=True)])
        heights = 30 - 28 * (ends - ends.min()) / (np.ptp(ends) or 1.0)
        across = np.linspace(0, 100, len(ends))
        points = " ".join(f"{x:.4g},{y:.4g}" for x, y in zip(across, heights, strict=True))
        lines.append(f'<polyline points="{points}" style="stroke: var(--series-{place})"/>')
    picture = f'<svg viewBox="0 0 100 32" preserveAspectRatio="none">{"".join(lines)}</svg>'
    with ui.element("div").classes("overlay"):
        ui.html(picture, sanitize=False)  # numbers alone
        for place, name in enumerate(filter(None, traces), start=1):
            ui.label(name).style(f"color: var(--series-{place})")


SCROLL = """{const row = getHtmlElement(%d), list = row?.closest(".list");
if (list) list.scrollTop = row.offsetTop - list.clientHeight / 2}"""
"""Keeps the chosen row of a long list in sight when it is built again."""


def table(
    columns: Sequence[str],
    rows: Sequence[Sequence[Any]],
    *,
    chosen: int | None = None,
    on_choose: Callable[[int], Any] | None = None,
) -> Any:
    """Show rows of text and numbers; a row can be chosen by click or keyboard.

    Numbers are to the right and have three digits. A cell that is callable makes its own elements.
    """
    scrolls = "wide" if on_choose is None else "wide list"
    with ui.element("div").classes(scrolls), ui.element("table").classes("table") as element:
        with ui.element("thead"), ui.element("tr"):
            for name, first in zip(columns, rows[0] if rows else columns, strict=True):
                with ui.element("th").classes("number" * isinstance(first, int | float)):
                    _titled(name, definition(name))
        with ui.element("tbody"):
            for index, cells in enumerate(rows):
                line = ui.element("tr")
                if on_choose is not None:
                    choose = guarded(partial(on_choose, index))
                    line.classes("choosable" + " chosen" * (index == chosen)).props("tabindex=0")
                    if index == chosen:
                        ui.run_javascript(SCROLL % line.id)
                    line.on("click", choose, []).on("keydown.enter.self", choose, [])
                for cell in cells:
                    number = isinstance(cell, int | float)
                    with line, ui.element("td").classes("number" * number):
                        if callable(cell):
                            cell()
                        else:
                            ui.label(typeset(as_text(cell)) if number else as_text(cell))
    return element


def items(parts: Sequence[Item]) -> None:
    """Show what is shown of a result everywhere (`mckibben.report.results`); tables may be folded."""
    for item in filter(None, parts):
        if isinstance(item, Text):
            for sentence in item.sentences:
                label = ui.label(typeset_within(message_of(sentence)))
                label.classes("muted" if item.style else "")
        elif isinstance(item, Table):
            with details(item.summary) if item.summary else nullcontext():
                titles = item.titles or [""] * len(item.rows)
                lines = zip(item.rows, titles, strict=True)
                table(
                    item.headings,
                    [
                        [partial(_titled, as_text(x), title), *map(_with_mathematics, rest)]
                        for (x, *rest), title in lines
                    ],
                )
        elif isinstance(item, Equations):
            _equations(item.written)
        elif isinstance(item, Figure):
            for figure in item.plots[0]:
                plot_of(figure)


def _mathematics(latex: str, display: Literal["block", "inline"] = "block") -> None:
    ui.html(mathml(latex, display), sanitize=False)  # elements of MathML alone


def _with_mathematics(cell: Any) -> Any:
    """Return a cell, or what sets its symbol."""
    if isinstance(cell, dict):
        return partial(_mathematics, cell["latex"], "inline")
    return cell


def _equations(written: Any) -> None:
    """Show the equations of a model, and of its parts, with numbers folded."""
    for line in written.equations:
        _mathematics(line)
    if written.numbers:
        with details("Numbers"):
            for line in written.numbers:
                _mathematics(line)
    if written.remark:
        ui.label(written.remark).classes("muted")
    for part in written.parts:
        ui.label(part.title).classes("muted")
        _equations(part)


def _titled(text: str, title: str) -> None:
    label = ui.label(text)
    if title:
        label.tooltip(title)
