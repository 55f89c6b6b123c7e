"""A recording over time, and a part of it kept, dropped or split off: by dragging, numbers or keys."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from nicegui import ui

from mckibben.app.desk import Desk, guarded, hinted, labelled, named, refused
from mckibben.app.drawn import Drawn, picture
from mckibben.app.kept import Step
from mckibben.app.pages import editing
from mckibben.app.pages.rows import state_of
from mckibben.errors import DataError, MckibbenError

if TYPE_CHECKING:
    from mckibben.recording import Recording

FEW, MOST = 4, 12
"""Channels that are drawn unasked: as many as this, or as are chosen, up to the second."""

MOVED = 0.01
"""Share of the recording that an arrow key moves the selection by."""

KEYS = """(event) => {
    const moves = {ArrowLeft: -1, ArrowRight: 1, Enter: 0};
    if (event.key in moves) {
        event.preventDefault();
        emit({move: moves[event.key], wide: event.shiftKey});
    }
}"""


@dataclass
class Part:
    """The part of a recording that is selected, in its time or in samples.

    Parameters
    ----------
    whole : tuple of float
        The ends of the recording.
    low, high : float, optional
        Those of the part.
    shown : callable
        Called when it has changed.
    """

    whole: tuple[float, float]
    low: float | None = None
    high: float | None = None
    shown: Callable[[], None] = lambda: None

    def choose(self, low: float | None, high: float | None) -> None:
        """Select a part, of what there is."""
        if low is not None and high is not None and low > high:
            low, high = high, low
        first, last = self.whole
        self.low = None if low is None else min(max(low, first), last)
        self.high = None if high is None else min(max(high, first), last)
        self.shown()

    def move(self, by: float, *, wide: bool) -> None:
        """Move the part by shares of the recording, or widen it; the first time, take the middle."""
        first, last = self.whole
        length = last - first
        low = first + 0.25 * length if self.low is None else self.low
        high = last - 0.25 * length if self.high is None else self.high
        step = by * MOVED * length
        if wide:
            low, high = low - step, high + step
            if low > high:
                return
        else:
            step = min(max(step, first - low), last - high)
            low, high = low + step, high + step
        self.choose(low, high)

    def samples(self, recording: Recording) -> tuple[int, int]:
        """Return the first sample of the part, and the one after its last."""
        if self.low is None or self.high is None:
            raise DataError(
                "nothing is selected", remedy="drag across the plot, or give two numbers, first"
            )
        step = recording.sample_time or 1.0
        low = max(round((self.low - recording.start_time) / step), 0)
        high = min(round((self.high - recording.start_time) / step) + 1, len(recording))
        if high - low < 2:
            raise DataError("the selection holds fewer than two samples", remedy="select more")
        return low, high


def preview(desk: Desk) -> None:
    """Show a recording over time, what was done to it, and what can be."""

    def state() -> Any:
        entries = {entry.name: entry for entry in desk.workspace.entries()}
        name = desk.preview if desk.preview in entries else next(iter(entries), None)
        return name, state_of(entries[name]) if name else None

    def shown() -> None:
        name, _ = state()
        if name is None:
            return
        try:
            recording = desk.workspace.recording(name)
        except MckibbenError as error:
            refused(error, name)
            return
        ui.label(f"{name}: drag across the plot to select a part").classes("text-lg")
        _channels(desk, name, recording)
        editing.steps(desk, name, recording)

    Drawn(desk, state, shown, "recordings", "preview")


def first_shown(desk: Desk, recording: Recording) -> list[str]:
    """Return the channels that are drawn unasked: what is chosen, else what is measured, a few.

    A column without a unit beside those chosen is mostly a count: of levels, branches or cycles.
    """
    chosen = [name for name in (*desk.inputs, *desk.outputs) if name in recording]
    others = [name for name in recording.channels if name not in chosen]
    others = [name for name in others if recording.units[name] or not chosen]
    return [*chosen, *others][: max(FEW, min(len(chosen), MOST))]


def _channels(desk: Desk, name: str, recording: Recording) -> None:
    """Let the channels to draw be chosen, and draw them."""
    every, seen = list(recording.channels), desk.workspace.entry(name).steps
    part = Part((float(recording.time[0]), float(recording.time[-1])))
    asked = [each for each in desk.drawn if each in every]
    field = ui.select(
        every,
        value=asked or first_shown(desk, recording),
        multiple=True,
        label="Channels to draw",
    )
    named(field.classes("min-w-56 max-w-full"), "draw-channels")
    field.set_visibility(len(every) > 1)
    left = named(ui.label("").classes("text-sm opacity-70 break-words"), "not-drawn")

    @ui.refreshable
    def drawn() -> None:
        rest = [each for each in every if each not in field.value]
        left.set_text(f"Not drawn: {', '.join(rest)}" if rest else "")
        if field.value:
            _plot(desk, name, recording, list(field.value), part, seen)

    def chosen() -> None:
        desk.drawn = list(field.value)
        drawn.refresh()

    field.on_value_change(chosen)
    drawn()


def _plot(
    desk: Desk,
    name: str,
    recording: Recording,
    channels: list[str],
    part: Part,
    seen: Sequence[Step],
) -> None:
    words = (
        "Part to cut: arrow keys move it, with shift they make it wider or narrower, Enter keeps it"
    )
    with named(ui.element("div").classes("w-full"), "select-part") as area:
        plot = time_plot(desk, recording, channels, "preview-plot", part)
    area.props("tabindex=0 role=group")
    labelled(area, "aria-label", words)

    async def cut(which: str) -> None:
        low, high = part.samples(recording)
        # samples are counted in what is seen, which may be another recording by now
        await editing.do(desk, name, *_ways(which, low, high, len(recording)), seen=seen)

    async def pressed(event: Any) -> None:
        given = event.args or {}
        if given.get("move"):
            part.move(float(given["move"]), wide=bool(given.get("wide")))
        else:
            await guarded(lambda: cut("keep"))()

    area.on("keydown", pressed, js_handler=KEYS)
    unit = "sample" if recording.sample_time is None else "s"
    with ui.row().classes("items-end gap-3"):
        fields = [
            named(ui.number(f"{word} [{unit}]").props("dense").classes("w-32"), name)
            for word, name in (("From", "part-from"), ("To", "part-to"))
        ]
        for text, which, hint in (
            ("Keep only the selection", "keep", "Everything outside of it goes"),
            ("Drop the selection", "drop", "What is before and after it stays, as two recordings"),
            ("Split there", "split", "Two recordings, before and from its start"),
        ):
            button = ui.button(text, on_click=guarded(partial(cut, which)))
            named(hinted(button.props("outline"), hint), which)

    def drawn() -> None:
        for field, value in zip(fields, (part.low, part.high), strict=True):
            wanted = None if value is None else float(f"{value:.6g}")
            if field.value != wanted:
                field.set_value(wanted)
        plot.run_plot_method("relayout", {"shapes": _shapes(part)})

    def typed() -> None:
        low, high = (field.value for field in fields)
        part.low = part.whole[0] if low is None else low
        part.high = part.whole[1] if high is None else high
        plot.run_plot_method("relayout", {"shapes": _shapes(part)})

    part.shown = drawn

    def again() -> None:
        # a picture that is drawn anew has no part shaded; before one is chosen it may not be there yet
        if part.low is not None:
            drawn()

    with plot:
        desk.when("theme", again)
    for field in fields:
        field.on("change", typed)
        field.on("keydown.enter", guarded(lambda: cut("keep")))


def _shapes(part: Part) -> list[dict[str, Any]]:
    if part.low is None or part.high is None:
        return []
    look = {"fillcolor": "#56b4e9", "opacity": 0.25, "line": {"width": 1, "color": "#56b4e9"}}
    return [
        {"type": "rect", "xref": "x", "yref": "paper", "y0": 0, "y1": 1}
        | {"x0": part.low, "x1": part.high, **look}
    ]


def _ways(which: str, low: int, high: int, n: int) -> list[Step]:
    """Return the pieces that are left, each as a step."""
    pieces = {"keep": [(low, high)], "drop": [(0, low), (high, n)], "split": [(0, low), (low, n)]}
    kept = [(start, stop) for start, stop in pieces[which] if stop - start >= 2]
    if not kept:
        raise DataError("nothing would be left", remedy="select less, or remove the recording")
    return [Step(do="slice", start=start, stop=stop) for start, stop in kept]


def time_plot(
    desk: Desk,
    recording: Recording,
    channels: list[str],
    name: str,
    part: Part | None = None,
) -> Any:
    """Plot channels over time; panning and zooming thin the samples anew, on the server."""
    from mckibben.app import plots
    from mckibben.report import subjects

    drawing = subjects.time_course([recording], channels, plots.POINTS)
    (figure,) = plots.figures(drawing, height=170 * len(channels) + 60)
    for axis in (axis for key, axis in figure["layout"].items() if key.startswith("yaxis")):
        axis["title"]["text"] = axis["title"]["text"].replace(
            " [", "<br>["
        )  # else it meets the next
    figure["layout"]["dragmode"] = "zoom" if part is None else "select"
    figure["layout"]["selectdirection"] = "h"
    plot = picture(desk, figure, name)
    whole = (float(recording.time[0]), float(recording.time[-1]))

    def moved(event: Any) -> None:
        given = event.args or {}
        low, high = given.get("xaxis.range[0]"), given.get("xaxis.range[1]")
        if given.get("xaxis.autorange"):
            low, high = whole
        if isinstance(low, int | float) and isinstance(high, int | float):
            places = list(range(len(channels)))
            seen = plots.window(recording, channels, low, high)
            update = {"x": [curve["x"] for curve in seen], "y": [curve["y"] for curve in seen]}
            plot.run_plot_method("restyle", update, places)

    def selected(event: Any) -> None:
        ends = (event.args or {}).get("range", {})
        ends = next((value for key, value in ends.items() if key.startswith("x")), None)
        if part is not None and isinstance(ends, list) and len(ends) == 2:
            part.choose(*sorted(map(float, ends)))

    plot.on("plotly_relayout", moved)
    plot.on("plotly_selected", selected)
    return plot
