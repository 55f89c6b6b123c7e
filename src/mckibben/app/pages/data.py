"""Data: files in, what was understood of them, and what is done to recordings before they are used."""

from __future__ import annotations

import asyncio
from functools import partial
from typing import Any

import numpy as np
from nicegui import events, ui

from mckibben.app import widgets
from mckibben.app.pages import importing
from mckibben.app.state import State, view
from mckibben.app.steps import Reading, Step
from mckibben.app.terms import said
from mckibben.app.virtual import FIRST, TITLES, record
from mckibben.app.widgets import mark
from mckibben.app.workspace import Entry
from mckibben.errors import DataError, MckibbenError, TooLargeError
from mckibben.files.formats import READERS
from mckibben.recording import Recording

TITLE = "Data"
ICON = "folder_open"

ROLES = {"train": "Train", "test": "Test", "unused": "Unused"}

MOST_DRAWN = 4
"""Channels that are drawn over time at first."""

PICKED = """(event) => {
    const range = Object.entries(event?.range ?? {}).find(([axis]) => axis.startsWith("x"));
    if (range) emit(range[1]);
}"""
"""Of a selection in a plot, only its ends go to the server."""


def build(state: State) -> None:
    """Build the page."""
    with mark(ui.element("div").classes("page"), "page-data"):
        with widgets.row(classes="spread"):
            widgets.heading(
                "Data", "Recordings to identify models with, and others to test them on."
            )
            mark(widgets.primary("Add files", lambda: files.run_method("pickFiles"), "add"), "add")
        with ui.element("div").style("display: none"):
            files = _upload(state)
        start(state)
        with ui.element("div").classes("columns"):
            with ui.element("div").classes("stack"):
                listed(state)
            with ui.element("div").classes("stack"):
                shown(state)


def _upload(state: State) -> Any:
    endings = ",".join(READERS)
    return mark(
        widgets.upload("Drop files here", lambda event: _received(state, event), endings), "upload"
    )


def _is_empty(state: State) -> bool:
    known = state.workspace.names("recordings")
    return not known and not _unread(state) and "data.removed" not in state.chosen


@view
def start(state: State) -> None:
    """Show what to do while there are no recordings."""
    if _is_empty(state):
        _empty(state)


@view
def listed(state: State) -> None:
    """Show all recordings, and what drives and what moves."""
    if not _is_empty(state):
        _recordings(state, state.workspace.entries())
        _sides(state)


@view
def shown(state: State) -> None:
    """Show the recording that is chosen, and what comes next."""
    entries = state.workspace.entries()
    for entry in entries:
        if entry.name == state.recording:
            _recording(state, entry)
    _next(entries)


def _next(entries: list[Entry]) -> None:
    from mckibben.app.main import pages

    following = [(page.TITLE, path) for path, page in pages().items()][1:]
    if following and any(one.role == "train" for one in entries):
        text = "Channels and roles are right? See what the muscle does."
        widgets.next_step(text, *following[0])


def _empty(state: State) -> None:
    with widgets.card():
        with (
            widgets.empty(
                "show_chart",
                "Start with a recording of your muscle",
                "A file with columns such as time, pressure and displacement: CSV, Excel, MATLAB, "
                "HDF5, TDMS, LabVIEW, Parquet or a ROS bag. Names and units of columns are "
                "recognised, and can be corrected.",
            ),
            widgets.row(),
        ):
            example = widgets.button("Open the example", lambda: _example(state), "science")
            mark(example, "example")
            _virtual(state)
        _upload(state)


def _virtual(state: State) -> None:
    """Offer to record a virtual muscle, of which there are runs to choose."""
    from mckibben import registry
    from mckibben.signals.protocol import protocol

    def ask() -> None:
        with widgets.dialog("Record a virtual muscle") as shown:
            names = {name: TITLES.get(name, name) for name in registry.names("protocols")}
            rig = mark(ui.select(names, value=FIRST, label="Rig"), "rig").props("dense outlined")
            runs = ui.select([], multiple=True, with_input=True, label="Runs")
            runs.props("dense outlined use-chips")

            def listed() -> None:
                plan = protocol(str(rig.value))
                found = {run.name: f"{run.name} ({run.role})" for run in plan.runs}
                runs.set_options(found, value=list(found)[:2])

            def start() -> None:
                if not runs.value:
                    raise DataError("no run is chosen", remedy="choose one under Runs")
                chosen = {"protocol": rig.value, "runs": list(runs.value)}
                state.jobs.submit(record, TITLES.get(rig.value, rig.value), **chosen)
                shown.close()

            rig.on_value_change(listed)
            listed()
            mark(widgets.primary("Record", start), "record")

    mark(widgets.button("Record a virtual muscle", ask, "smart_toy"), "virtual")


async def _example(state: State) -> None:
    def add() -> list[str]:
        from mckibben import example
        from mckibben.files import read

        runs = {"train": read(example.TRAIN), "test": read(example.TEST)}
        put = state.workspace.add_recording
        return [put(run, name=run.name, role=role) for role, (run,) in runs.items()]  # type: ignore[arg-type]

    state.recording = (await asyncio.to_thread(add))[0]
    state.changed()


# -- files ------------------------------------------------------------------------------------------


def _unread(state: State) -> dict[str, MckibbenError]:
    """Return the uploads that are not read yet, and why."""
    found: dict[str, MckibbenError] = state.chosen.setdefault("data.unread", {})
    return found


async def _received(state: State, event: events.UploadEventArguments) -> None:
    """Keep a file, and read it as it is; where that does not work, ask."""
    with state.workspace.receiving(event.file.name, event.file.size()) as (part, path):
        await event.file.save(part)
    upload = path.name
    try:
        names = await asyncio.to_thread(state.workspace.add, upload)
    except TooLargeError:
        state.workspace.path("uploads", upload).unlink(missing_ok=True)
        raise
    except MckibbenError as error:
        _unread(state)[upload] = error
        state.changed()
        if len(_unread(state)) == 1:
            await _ask(state, upload)
        return
    state.recording = names[0]
    state.changed()


async def _ask(state: State, upload: str) -> None:
    """Ask how a file that is not read yet is to be read, and the others that are not."""
    workspace, unread = state.workspace, _unread(state)

    async def take(reading: Reading, others: bool) -> None:
        names = await asyncio.to_thread(partial(workspace.add, upload, reading=reading))
        unread.pop(upload, None)
        for other in list(unread) if others else []:
            try:
                await asyncio.to_thread(partial(workspace.add, other, reading=reading))
                unread.pop(other, None)
            except MckibbenError as error:
                unread[other] = error
        state.recording = names[0]
        state.changed()

    path = workspace.path("uploads", upload)
    await importing.ask(path, Reading(), take, others="All files that are not read yet")


async def _correct(state: State, entry: Entry) -> None:
    """Ask how a recording is to be read instead, and those that are read like it."""
    workspace = state.workspace
    channels = _channels(state, entry.name)
    alike = [
        one.name
        for one in workspace.entries()
        if one.name != entry.name
        and one.way == entry.way
        and _channels(state, one.name) == channels
    ]

    async def take(reading: Reading, others: bool) -> None:
        for name in [entry.name, *(alike if others else ())]:
            await asyncio.to_thread(workspace.read_again, name, reading)
        state.changed()

    path = workspace.path("uploads", entry.upload) if entry.upload else workspace.raw_path(entry)
    others = f"The {len(alike)} others like it, too" if alike else ""
    await importing.ask(path, entry.way, take, others=others, verb="Read it so")


def _channels(state: State, name: str) -> list[str] | None:
    try:
        return list(state.workspace.recording(name).channels)
    except MckibbenError:
        return None


def _discard(state: State, upload: str) -> None:
    _unread(state).pop(upload, None)
    state.workspace.path("uploads", upload).unlink(missing_ok=True)
    state.changed()


# -- the list ---------------------------------------------------------------------------------------


def _recordings(state: State, entries: list[Entry]) -> None:
    with widgets.card("Recordings"):
        for upload, error in _unread(state).items():
            widgets.error_box(error)
            with widgets.row():
                widgets.button("How is it read?", lambda upload=upload: _ask(state, upload))
                widgets.button("Discard", lambda upload=upload: _discard(state, upload))

        def choose(at: int) -> None:
            if state.recording != entries[at].name:
                state.recording = entries[at].name
                listed.refresh()
                shown.refresh()

        if removed := state.chosen.get("data.removed"):

            def restore() -> None:
                state.workspace.restore(state.chosen.pop("data.removed"))
                state.changed()

            with widgets.row():
                ui.label(f"{removed} was removed.").classes("muted")
                mark(widgets.button("Bring it back", restore, "undo"), "restore")

        names = [one.name for one in entries]
        chosen = names.index(state.recording) if state.recording in names else None
        rows = [_line(state, one) for one in entries]
        if rows:
            mark(
                widgets.table(
                    ["Name", "Role", "Samples", "Channels"], rows, chosen=chosen, on_choose=choose
                ),
                "recordings",
            )
        if not any(one.role == "test" for one in entries) and entries:
            ui.label(
                "None is for testing: add another recording, or split this one in two. Without, models "
                "are judged by cross-validation alone."
            ).classes("muted")
        _upload(state)
        _virtual(state)


def _line(state: State, entry: Entry) -> list[Any]:
    def role() -> None:
        ui.label(ROLES[entry.role]).classes(f"chip {entry.role}")

    try:
        recording = state.workspace.recording(entry.name)
    except MckibbenError:
        return [entry.name, role, 0, "cannot be read"]
    return [entry.name, role, recording.n_samples, ", ".join(recording.channels)]


def _sides(state: State) -> None:
    """Let inputs, outputs and the load be chosen, of channels that all recordings have."""
    known = state.workspace.channels()
    if not known:
        if state.workspace.used():
            with widgets.card("What drives, what moves"):
                widgets.error_box(
                    "The recordings in use have no channel in common. Set one of them to unused, or "
                    "correct how it is read"
                )
        return
    with widgets.card("What drives, what moves"):
        for side in ("inputs", "outputs"):

            def chosen(event: events.ValueChangeEventArguments[Any], side: str = side) -> None:
                if event.value and event.value != getattr(state, side):
                    setattr(state, side, list(event.value))
                    state.changed()

            value = [name for name in getattr(state, side) if name in known]
            field = ui.select(
                known, value=value, multiple=True, label=side.capitalize(), on_change=chosen
            )
            mark(field.props("dense outlined"), side)
        rest = [name for name in known if name not in (*state.inputs, *state.outputs)]
        if rest:

            def load(event: events.ValueChangeEventArguments[Any]) -> None:
                state.load = event.value or ""
                state.changed()

            given = state.load if state.load in rest else ""
            options = {"": "None, or as found", **{name: name for name in rest}}
            ui.select(options, value=given, label="Load", on_change=load).props("dense outlined")


# -- one recording ----------------------------------------------------------------------------------


def _recording(state: State, entry: Entry) -> None:
    name, workspace = entry.name, state.workspace
    with widgets.card():
        with widgets.row(classes="spread"):
            ui.label(name).classes("subtitle").props('role=heading aria-level="3"')
            with widgets.row():
                _actions(state, entry)
        try:
            recording = workspace.recording(name)
        except MckibbenError as error:
            widgets.error_box(error)
            return
        ui.label(importing.summary(recording)).classes("muted")
        _part(state, entry, recording)
        _steps(state, entry)
        _process(state, entry, recording)
        if recording.notes or entry.notes:
            with widgets.details("Notes of the reading"):
                for note in dict.fromkeys([*recording.notes, *entry.notes]):
                    ui.label(said(note)).classes("muted")


def _actions(state: State, entry: Entry) -> None:
    def role(event: events.ValueChangeEventArguments[Any]) -> None:
        state.workspace.change(entry.name, role=event.value)
        state.changed()

    def remove() -> None:
        state.workspace.remove(entry.name)
        state.chosen["data.removed"] = entry.name
        state.changed()

    picked = ui.toggle(ROLES, value=entry.role, on_change=widgets.guarded(role))
    mark(picked.props("dense no-caps unelevated toggle-color=primary"), "role")
    mark(widgets.button("How it is read", lambda: _correct(state, entry), "tune"), "correct")
    widgets.icon_button("edit", "Rename", lambda: _rename(state, entry))
    mark(widgets.icon_button("delete_outline", "Remove", remove), "remove")


def _rename(state: State, entry: Entry) -> None:
    with widgets.dialog(f"Rename {entry.name}") as shown:
        field = ui.input("Name", value=entry.name).props("outlined dense autofocus")

        def rename() -> None:
            state.recording = state.workspace.rename(entry.name, field.value)
            shown.close()
            state.changed()

        field.on("keydown.enter", widgets.guarded(rename), [])
        widgets.primary("Rename", rename)


def _part(state: State, entry: Entry, recording: Recording) -> None:
    """Draw a recording over time, and let a part be kept or split off."""
    from mckibben.report.figures import draw

    sides = [name for name in (*state.inputs, *state.outputs) if name in recording]
    channels = list(dict.fromkeys([*sides, *recording.channels]))[: max(MOST_DRAWN, len(sides))]
    drawing = draw(recording, "time", channels=channels)
    height = min(160 * len(channels) + 60, 420)
    unit = "s" if recording.sample_time is not None else "sample"
    for figure in widgets.plot(drawing, height=height, dragged="select"):
        figure.figure["layout"]["selectdirection"] = "h"
        mark(figure, "over-time")
        figure.on("plotly_selected", lambda event: pick(event.args), js_handler=PICKED)

    def pick(ends: Any) -> None:
        low, high = sorted(map(float, ends))
        start.value, stop.value = float(f"{low:.6g}"), float(f"{high:.6g}")

    def samples() -> tuple[int, int]:
        time, low, high = recording.time, start.value, stop.value
        if low is None and high is None:
            raise DataError(
                "no part is selected", remedy="drag across the plot, or give From and To"
            )
        low, high = (-np.inf if low is None else low), (np.inf if high is None else high)
        half = 0.5 * (recording.sample_time or 1.0)
        first, last = np.searchsorted(time, (low - half, high + half))
        return int(first), int(last)

    async def keep() -> None:
        first, last = samples()
        await _do(state, entry.name, Step(do="slice", start=first, stop=last))

    async def split() -> None:
        await asyncio.to_thread(state.workspace.split, entry.name, samples()[0])
        state.changed()

    with widgets.row():
        start = mark(
            ui.number(f"From [{unit}]").props("dense outlined").style("width: 120px"), "from"
        )
        stop = mark(ui.number(f"To [{unit}]").props("dense outlined").style("width: 120px"), "to")
        mark(widgets.button("Keep this part", keep, "content_cut"), "keep")
        mark(widgets.button("Split at From", split, "call_split"), "split").tooltip(
            "What comes after becomes a recording for testing"
        )
    ui.label("Drag across the plot to select a part.").classes("muted")


def _steps(state: State, entry: Entry) -> None:
    """List what was done, and let the last be undone."""
    if not entry.steps:
        return

    async def undo() -> None:
        await asyncio.to_thread(state.workspace.undo, entry.name)
        state.changed()

    with widgets.row():
        ui.label("Done:").classes("muted")
        for step in entry.steps:
            ui.label(str(step)).classes("chip")
        mark(widgets.button("Undo", undo, "undo"), "undo")


def _process(state: State, entry: Entry, recording: Recording) -> None:
    """Offer what can be done to all samples."""
    rate = None if recording.sample_time is None else 1 / recording.sample_time
    driving = next(
        (name for name in state.inputs if name in recording), next(iter(recording.channels))
    )
    with widgets.details("Filter, resample, zero"), widgets.row():
        if rate is not None:
            cutoff = ui.number("Cutoff [Hz]", value=float(f"{rate / 10:.3g}"), min=0)
            cutoff.props("dense outlined").style("width: 120px")
            widgets.button(
                "Low-pass", lambda: _do(state, entry.name, Step(do="low_pass", cutoff=cutoff.value))
            )
            step = ui.number("Sample time [s]", value=recording.sample_time, min=0)
            step.props("dense outlined").style("width: 140px")
            mark(
                widgets.button(
                    "Resample",
                    lambda: _do(state, entry.name, Step(do="resample", sample_time=step.value)),
                ),
                "resample",
            )
        others = [name for name in recording.channels if name != driving]
        zeroed = ui.select(others, value=others[:1], multiple=True, label="Channels")
        zeroed.props("dense outlined")
        mark(
            widgets.button(
                f"Zero where {driving} is lowest",
                lambda: _do(
                    state, entry.name, Step(do="zero", channels=list(zeroed.value), over=driving)
                ),
            ),
            "zero",
        )
        widgets.button(
            "Remove drift",
            lambda: _do(state, entry.name, Step(do="detrend", channels=list(zeroed.value))),
        )


async def _do(state: State, name: str, step: Step) -> None:
    await asyncio.to_thread(state.workspace.do, name, step)
    state.changed()
