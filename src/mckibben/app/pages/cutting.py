"""A recording over time, and parts of it kept or split off by dragging."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from nicegui import ui

from mckibben.app.desk import Desk, named, tell
from mckibben.errors import DataError, MckibbenError

if TYPE_CHECKING:
    from mckibben.recording import Recording


def preview(desk: Desk) -> None:
    """Show a recording over time; dragging across it selects a part to keep or to split at."""
    part: dict[str, float] = {}

    @ui.refreshable
    def shown() -> None:
        name = desk.preview
        entries = [entry.name for entry in desk.workspace.entries()]
        if name not in entries:
            name = entries[0] if entries else None
        if name is None:
            return
        part.clear()
        try:
            recording = desk.workspace.recording(name)
        except MckibbenError as error:
            ui.label(f"{name}: {error}").classes("text-negative")
            return
        ui.label(f"{name}: drag across the plot to select a part").classes("text-lg")
        channels = list(recording.channels)[:4]
        time_plot(desk, recording, channels, "preview-plot", part)
        with ui.row():
            for text, action in (("Keep only the selection", _keep), ("Split there", _split)):
                named(
                    ui.button(
                        text, on_click=lambda action=action: _cut(desk, name, part, action)
                    ).props("outline"),
                    text.split()[0].lower(),
                )

    desk.when("recordings", shown.refresh)
    desk.when("preview", shown.refresh)
    desk.when("theme", shown.refresh)
    shown()


def time_plot(
    desk: Desk,
    recording: Recording,
    channels: list[str],
    name: str,
    part: dict[str, float] | None = None,
) -> None:
    """Plot channels over time; panning and zooming thin the samples anew, on the server."""
    from mckibben.app import plots
    from mckibben.report import subjects

    drawing = subjects.time_course([recording], channels, plots.POINTS)
    (figure,) = plots.figures(drawing, dark=desk.dark, height=170 * len(channels) + 60)
    figure["layout"]["dragmode"] = "zoom" if part is None else "select"
    figure["layout"]["selectdirection"] = "h"
    plot = named(ui.plotly(figure).classes("w-full"), name)
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
            part["low"], part["high"] = sorted(map(float, ends))

    plot.on("plotly_relayout", moved)
    plot.on("plotly_selected", selected)


def _cut(desk: Desk, name: str, part: dict[str, float], action: Any) -> None:
    try:
        if not part:
            raise DataError("nothing is selected", remedy="drag across the plot first")
        action(desk, name, part)
    except MckibbenError as error:
        tell(error)
        return
    desk.changed("recordings", "channels")


def _places(recording: Recording, part: dict[str, float]) -> tuple[int, int]:
    step = recording.sample_time or 1.0
    low = round((part["low"] - recording.start_time) / step)
    high = round((part["high"] - recording.start_time) / step) + 1
    low, high = max(low, 0), min(high, len(recording))
    if high - low < 2:
        raise DataError("the selection holds fewer than two samples", remedy="select more")
    return low, high


def _pieces(desk: Desk, name: str, cuts: list[tuple[int, int]]) -> None:
    entry, recording = desk.workspace.entry(name), desk.workspace.recording(name)
    for low, high in cuts:
        if high - low >= 2:
            desk.workspace.add(
                recording.slice(low, high),
                origin=f"samples {low + 1} to {high} of {name}",
                call=f"{entry.call}[0].slice({low}, {high})",
                role=entry.role,
                name=name,
                notes=entry.notes,
            )
    desk.workspace.set_role(name, "unused")
    desk.did(f"cut {name}", f"recording.slice(...), {cuts}")


def _keep(desk: Desk, name: str, part: dict[str, float]) -> None:
    _pieces(desk, name, [_places(desk.workspace.recording(name), part)])


def _split(desk: Desk, name: str, part: dict[str, float]) -> None:
    recording = desk.workspace.recording(name)
    low, _ = _places(recording, part)
    _pieces(desk, name, [(0, low), (low, len(recording))])
