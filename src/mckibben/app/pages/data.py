"""Data: files in, what was understood of them, and what is done to recordings before they are used."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from nicegui import events, ui

from mckibben import example
from mckibben.app import sample_times, widgets
from mckibben.app.pages import importing, parts
from mckibben.app.state import State, view
from mckibben.app.steps import UNTOUCHED, Entry, Reading, Step
from mckibben.app.terms import message_of
from mckibben.app.widgets import mark
from mckibben.errors import DataError, MckibbenError
from mckibben.files import read
from mckibben.recording import Recording
from mckibben.report.figures import draw

TITLE = "Data"
ICON = "folder_open"

ROLES = {"train": "Train", "test": "Test", "unused": "Unused"}

MOST_DRAWN = 4
"""Channels that are drawn over time at first."""

SELECTION_ENDS = """(event) => {
    const range = Object.entries(event?.range ?? {}).find(([axis]) => axis.startsWith("x"));
    if (range) emit(range[1]);
}"""
"""Of a selection in a plot, only its ends go to the server."""


def build(state: State) -> None:
    """Build the page."""
    with mark(ui.element("div").classes("page"), "page-data"):
        with widgets.row(classes="spread"):
            text = "Recordings to identify models with, and others to test them on."
            widgets.heading("Data", text)
            mark(widgets.primary("Add files", lambda: files.run_method("pickFiles"), "add"), "add")
        with ui.element("div").style("display: none"):
            files = _upload(state)
        start(state)
        arriving(state)
        with ui.element("div").classes("columns"):
            with ui.element("div").classes("stack"):
                listed(state)
            with ui.element("div").classes("stack"):
                shown(state)


def _upload(state: State) -> Any:
    element = widgets.upload("Drop files here", partial(_received, state))
    return mark(element, "upload")


def _is_empty(state: State) -> bool:
    content = _unread(state) or state.chosen.get("data.removed")
    return not (content or state.workspace.names("recordings"))


async def _changed(state: State, change: Callable[..., Any], *arguments: Any) -> None:
    await asyncio.to_thread(change, *arguments)
    state.changed()


@view
def start(state: State) -> None:
    """Show what to do while there are no recordings."""
    if not _is_empty(state):
        return
    text = (
        "A file with columns such as time, pressure and displacement: CSV, Excel, MATLAB, HDF5, TDMS, "
        "LabVIEW, Parquet or a ROS bag. Names and units of columns are recognised, and can be corrected."
    )

    def add() -> None:
        for file, role in ((example.TRAIN, "train"), (example.TEST, "test")):
            (run,) = read(file)
            state.workspace.add_recording(run, name=run.name, role=role)  # type: ignore[arg-type]

    with widgets.card():
        title = "Start with a recording of your muscle"
        with widgets.empty("show_chart", title, text), widgets.row():
            button = widgets.button("Open the example", partial(_changed, state, add), "science")
            mark(button, "example")
        _upload(state)


@view
def arriving(state: State) -> None:
    """Show which files are being read."""
    if names := state.chosen.get("data.reading"):
        with widgets.card(), widgets.row():
            ui.spinner()
            mark(ui.label(f"Reading {', '.join(names)}"), "reading")


@view
def listed(state: State) -> None:
    """Show all recordings, and what drives and what moves."""
    if not _is_empty(state):
        with widgets.card("Recordings"):
            _recordings(state, state.workspace.entries())
        if state.workspace.used():
            with widgets.card("Inputs and outputs"):
                _sides(state, state.workspace.channels())


@view
def shown(state: State) -> None:
    """Show the recording that is chosen, and what comes next."""
    entries = state.workspace.entries()
    for entry in entries:
        if entry.name == state.recording:
            with widgets.card():
                _recording(state, entry)
    if state.inputs and state.outputs:
        text = "Channels and roles are right? Characterize the muscle."
        widgets.next_step(text, "Look", "/look")


# -- files ------------------------------------------------------------------------------------------


def _unread(state: State) -> dict[str, MckibbenError]:
    """Return the uploads that are not read yet, and why."""
    unread: dict[str, MckibbenError] = state.chosen.setdefault("data.unread", {})
    return unread


async def _received(state: State, event: events.UploadEventArguments) -> None:
    """Keep a file, and read it as it is; where that does not work, ask."""
    with state.workspace.receiving(event.file.name, event.file.size()) as (part, path):
        await event.file.save(part)
    unread, reading = _unread(state), state.chosen.setdefault("data.reading", [])
    reading.append(path.name)
    arriving.refresh()
    try:
        state.recording, *_ = await asyncio.to_thread(state.workspace.add, path.name)
    except MckibbenError as error:
        unread[path.name] = error
    finally:
        reading.remove(path.name)
    state.changed()
    if [*unread] == [path.name]:
        await _ask(state, path.name)


async def _ask(state: State, upload: str) -> None:
    """Ask how a file that is not read yet is to be read, and the others that are not."""
    workspace, unread = state.workspace, _unread(state)

    async def take(reading: Reading, others: bool) -> None:
        add = partial(workspace.add, reading=reading)
        state.recording, *_ = await asyncio.to_thread(add, upload)
        unread.pop(upload, None)
        for name in [*unread] if others else ():
            try:
                await asyncio.to_thread(add, name)
                unread.pop(name, None)
            except MckibbenError as error:
                unread[name] = error
        state.changed()

    path = workspace.path("uploads", upload)
    await importing.ask(path, UNTOUCHED, take, others="All files that are not read yet")


async def _correct(state: State, entry: Entry) -> None:
    """Ask how a recording is to be read instead, and those that are read like it."""
    workspace = state.workspace
    channels = {name: [*run.channels] for name, run in workspace.used().items()}
    same_reading = [other.name for other in workspace.entries() if other.reading == entry.reading]
    own_channels = channels.pop(entry.name, [])
    alike = [name for name in same_reading if channels.get(name) == own_channels]

    async def take(reading: Reading, all_so: bool) -> None:
        for name in [entry.name, *(alike if all_so else ())]:
            await asyncio.to_thread(partial(workspace.change, name, reading=reading))
        state.read_again()

    path = workspace.raw_path(entry)
    text = f"Also read {', '.join(alike[:3])}{' …' * (len(alike) > 3)} so" if alike else ""
    await importing.ask(path, entry.reading, take, others=text, verb="Read again", ticked=False)


# -- the list ---------------------------------------------------------------------------------------


def _recordings(state: State, entries: list[Entry]) -> None:
    names = [entry.name for entry in entries]

    def discard(upload: str) -> Any:
        _unread(state).pop(upload, None)
        return _changed(state, state.workspace.path("uploads", upload).unlink, True)

    def restore() -> Any:
        return _changed(state, state.workspace.restore, state.chosen.pop("data.removed"))

    def choose(at: int) -> None:
        if state.recording != names[at]:
            state.recording = names[at]
            listed.refresh()
            shown.refresh()

    if unread := _unread(state):
        first, *others = unread  # mostly, they are alike
        widgets.error_box(unread[first])
        with widgets.row():
            widgets.button("Import settings", partial(_ask, state, first))
            widgets.button("Discard", partial(discard, first))
        if others:
            ui.label(f"Not read yet either: {', '.join(others)}").classes("muted")
    if removed := state.chosen.get("data.removed"):
        with widgets.row():
            ui.label(f"{removed} was removed.").classes("muted")
            mark(widgets.button("Bring it back", restore, "undo"), "restore")
    if entries:
        chosen = names.index(state.recording) if state.recording in names else None
        heads, rows = (
            ["Name", "Role", "Samples", "Channels"],
            [_line(state, entry) for entry in entries],
        )
        mark(widgets.table(heads, rows, chosen=chosen, on_choose=choose), "recordings")
    if entries and not any(entry.role == "test" for entry in entries):
        ui.label(
            "None is for testing: add another recording, or split this one in two. Without, the last "
            "part of the recordings is held out."
        ).classes("muted")
    if len(dict.fromkeys([*_unread(state), *(entry.upload for entry in entries)])) > 1:
        widgets.button("Join files", partial(_join, state), "merge")
    _upload(state)


def _join(state: State) -> None:
    """Let files be chosen that are pieces of one run, or its channels, and make a recording of them."""
    workspace, unread = state.workspace, _unread(state)
    uploads = dict.fromkeys([*unread, *(upload.upload for upload in workspace.entries())])

    async def join() -> None:
        state.recording = await asyncio.to_thread(workspace.join, files.value)
        for upload in files.value:
            unread.pop(upload, None)
        window.close()
        state.read_again()

    text = "Pieces of one run, one after the other, or channels of one run by several loggers"
    with widgets.dialog("Join files") as window:
        ui.label(text).classes("muted")
        files = ui.select([*uploads], value=[*unread], multiple=True, label="Files")
        mark(files.props("outlined dense use-chips"), "joined")
        mark(widgets.primary("Join", join), "join")


def _line(state: State, entry: Entry) -> list[Any]:
    def role() -> None:
        ui.label(ROLES[entry.role]).classes(f"chip {entry.role}")

    try:
        recording = state.workspace.recording(entry.name)
    except MckibbenError:
        return [entry.name, role, 0, "cannot be read"]
    return [entry.name, role, recording.n_samples, ", ".join(recording.channels)]


@widgets.shielded
def _further(state: State) -> None:
    """Show what models are given beside the inputs, and what is not used."""
    sides = state.sides
    for words, names in (
        ("Every model is given", sides.scheduling),
        ("Models that can take them are given", sides.offered),
        ("Not used:", sides.unused),
    ):
        if names:
            ui.label(f"{words} {', '.join(names)}.").classes("muted")


def _sides(state: State, common: list[str]) -> None:
    """Let inputs, outputs and the load be chosen, of channels that all recordings have."""
    workspace = state.workspace
    if not common:
        widgets.error_box(
            "The recordings in use have no channel in common. Set one of them to unused, or correct how "
            "it is read"
        )
        return
    if times := sample_times.sample_times(workspace):
        slow = f"{times[1]:.4g}"
        with widgets.row():
            ui.label(f"Sample times differ, from {times[0]:.4g} to {slow} s.").classes("muted")
            resample = partial(_changed, state, sample_times.resample, workspace, times[1])
            mark(widgets.button(f"Resample to {slow} s", resample), "one-rate")
    _further(state)
    others = [name for name in common if name not in (*state.inputs, *state.outputs)]

    def choose(side: str, names: Any) -> None:
        if names or side == "load":
            setattr(state, side, names)
        state.changed()

    for side in ("inputs", "outputs"):
        selected = [name for name in getattr(state, side) if name in common]
        mark(parts.several(side.capitalize(), common, selected, partial(choose, side)), side)
    if others:
        loads = {"": "By name, or none", **{name: name for name in others}}
        load: Any = ui.select(loads, value=state.load if state.load in others else "", label="Load")
        load.on_value_change(lambda event: choose("load", event.value or ""))
        mark(load.props("dense outlined"), "load")


# -- one recording ----------------------------------------------------------------------------------


def _recording(state: State, entry: Entry) -> None:
    with widgets.row(classes="spread"):
        ui.label(entry.name).classes("subtitle").props('role=heading aria-level="3"')
        with widgets.row():
            _actions(state, entry)
    recording = state.workspace.recording(entry.name)
    ui.label(importing.summary(recording)).classes("muted")
    _part(state, entry, recording)
    _steps(state, entry, recording)
    if notes := dict.fromkeys(recording.notes):
        with widgets.details("Import notes"):
            for note in notes:
                ui.label(message_of(note)).classes("muted")


def _actions(state: State, entry: Entry) -> None:
    name, workspace, act = entry.name, state.workspace, partial(_changed, state)

    def remove() -> Any:
        state.chosen["data.removed"] = name
        return act(workspace.remove, name)

    def rename() -> None:
        def done() -> None:
            state.recording = workspace.rename(name, field.value)
            window.close()
            state.changed()

        with widgets.dialog(f"Rename {name}") as window:
            field = ui.input("Name", value=name).props("outlined dense autofocus")
            field.on("keydown.enter", widgets.guarded(done), [])
            widgets.primary("Rename", done)

    toggle = ui.toggle(ROLES, value=entry.role).props("dense no-caps unelevated")
    role = widgets.guarded(lambda e: act(partial(workspace.change, name, role=e.value)))
    mark(toggle.props("toggle-color=primary").on_value_change(role), "role")
    mark(widgets.button("Import settings", lambda: _correct(state, entry), "tune"), "correct")
    widgets.icon_button("edit", "Rename", rename)
    mark(widgets.icon_button("delete_outline", "Remove", remove), "remove")


def _part(state: State, entry: Entry, recording: Recording) -> None:
    """Draw a recording over time, and let a part be kept or split off."""
    workspace, time = state.workspace, recording.time
    sides = [name for name in (*state.inputs, *state.outputs) if name in recording]
    channels = list(dict.fromkeys([*sides, *recording.channels]))[: max(MOST_DRAWN, len(sides))]
    drawing, height = draw(recording, "time", channels=channels), min(160 * len(channels) + 60, 420)
    for figure in widgets.plot(drawing, height=height, dragged="select"):
        figure.figure["layout"]["selectdirection"] = "h"
        mark(figure, "over-time")
        figure.on("plotly_selected", lambda event: pick(event.args), js_handler=SELECTION_ENDS)

    def pick(range_: Any) -> None:
        for field, end in zip(ends, sorted(map(float, range_)), strict=True):
            field.value = float(f"{end:.6g}")

    def samples() -> tuple[int, int]:
        low, high = (field.value for field in ends)
        if low is None and high is None:
            remedy = "drag across the plot, or give From and To"
            raise DataError("no part is selected", remedy=remedy)
        half = 0.5 * recording.step
        first = 0 if low is None else np.searchsorted(time, low - half)
        last = len(time) if high is None else np.searchsorted(time, high + half)
        return int(first), int(last)

    def keep() -> Any:
        first, last = samples()
        return _changed(state, workspace.do, entry.name, Step(do="slice", start=first, stop=last))

    def split() -> Any:
        return _changed(state, workspace.split, entry.name, samples()[0])

    unit = "s" if recording.sample_time is not None else "sample"
    with widgets.row():
        ends = [mark(_number(f"{name} [{unit}]"), name.lower()) for name in ("From", "To")]
        mark(widgets.button("Keep this part", keep, "content_cut"), "keep")
        mark(widgets.button("Split at From", split, "call_split"), "split").tooltip(
            "What comes after becomes a recording for testing"
        )
    ui.label("Drag across the plot to select a part.").classes("muted")


def _number(label: str, value: float | None = None) -> Any:
    return ui.number(label, value=value).props("dense outlined").style("width: 140px")


def _steps(state: State, entry: Entry, recording: Recording) -> None:
    """List what was done, let the last be undone, and offer what can be done to all samples."""
    if entry.steps:
        undo = partial(_changed, state, state.workspace.undo, entry.name)
        with widgets.row():
            ui.label("Done:").classes("muted")
            for step in entry.steps:
                ui.label(str(step)).classes("chip")
            mark(widgets.button("Undo", undo, "undo"), "undo")
    driving = next((n for n in state.inputs if n in recording), next(iter(recording.channels)))
    others = [name for name in recording.channels if name != driving]

    def offer(text: str, do: Any, values: Callable[[], dict[str, Any]]) -> None:
        def act() -> Any:
            return _changed(state, state.workspace.do, entry.name, Step(do=do, **values()))

        mark(widgets.button(text, act), do)

    with widgets.details("Filter, resample, zero"), widgets.row():
        if recording.sample_time is not None:
            cutoff = _number("Cutoff [Hz]", float(f"{0.1 / recording.sample_time:.3g}"))
            offer("Low-pass", "low_pass", lambda: {"cutoff": cutoff.value})
            step = _number("Sample time [s]", recording.sample_time)
            offer("Resample", "resample", lambda: {"sample_time": step.value})
        selection = ui.select(others, value=others[:1], multiple=True, label="Channels")
        selection.props("dense outlined")
        zero = f"Zero where {driving} is lowest"
        offer(zero, "zero", lambda: {"channels": selection.value, "over": driving})
        offer("Remove drift", "detrend", lambda: {"channels": selection.value})
