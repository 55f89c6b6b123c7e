"""Data: files and virtual rigs in, what was understood of them, roles, changes and their undoing."""

from __future__ import annotations

import asyncio
from importlib.util import find_spec
from typing import Any

from nicegui import ui

from mckibben.app.desk import Desk, guarded, named
from mckibben.app.drawn import Drawn
from mckibben.app.dropping import drop_zone
from mckibben.app.pages import apart, editing, rigs
from mckibben.app.pages.cutting import preview
from mckibben.app.pages.importing import Intake
from mckibben.app.pages.rows import Rows, state_of

KINDS = {
    "Excel (.xlsx)": "openpyxl",
    "Parquet": "pyarrow",
    "MAT": "scipy",
    "HDF5": "h5py",
    "TDMS": "nptdms",
    "ROS bags": "rosbags",
}
"""Kinds of files beside text, and the libraries that read them."""

WATCH = 1.0
"""How often a page looks whether another one changed recordings [s]."""


def build(desk: Desk) -> None:
    """Build the page."""
    seen = _seen(desk)
    dialogs = ui.element("div")  # outside of what is drawn anew, which would take them along
    with ui.column().classes("w-full"):
        with ui.row().classes("w-full gap-4 items-start"):
            with ui.column().classes("min-w-64 flex-1"):
                intake = _sources(desk, dialogs)
            with ui.column().classes("min-w-72 flex-[2]"):
                with ui.row().classes("items-center"):
                    ui.label("Recordings").classes("text-lg")
                    editing.undoing(desk)
                _list(desk, dialogs, intake)
        preview(desk)
    _watch(desk, intake, seen)


def _seen(desk: Desk) -> dict[str, int]:
    """Return what tells of changes, noted before anything is shown: what changes meanwhile is seen."""
    seen: dict[str, int] = {}

    def noted() -> None:
        seen["stamp"] = desk.workspace.stamp()

    noted()
    desk.when("recordings", noted)
    return seen


def _watch(desk: Desk, intake: Intake, seen: dict[str, int]) -> None:
    """Draw anew what other windows, or workbenches over the same folder, have changed.

    Not while files are coming in here: what is drawn twice takes the click that came between.
    """

    async def look() -> None:
        if not intake.seen and desk.workspace.stamp() != seen["stamp"]:
            await asyncio.to_thread(desk.workspace.warm)
            desk.changed("recordings", "channels")

    ui.timer(WATCH, look)


def taken() -> list[str]:
    """Return the kinds of files that are read here, by the libraries that are installed."""
    return ["CSV", "TSV", *(kind for kind, library in KINDS.items() if find_spec(library))]


def _sources(desk: Desk, dialogs: Any) -> Intake:
    ui.label("Add recordings").classes("text-lg")
    intake = Intake(desk, dialogs)
    upload = named(
        drop_zone(f"Drop files here: {', '.join(taken())}", multiple=True).classes("w-full"),
        "upload",
    )
    intake.watch(upload)
    intake.reading = named(ui.label("").classes("text-sm").props("role=status"), "reading")
    intake.pending = named(ui.button(on_click=lambda: intake.list()).props("flat"), "left-unread")
    intake.show_left()
    with ui.row().classes("items-center"):
        example = named(ui.button("Open the example"), "example")
        example.on_click(guarded(lambda: _example(desk)))
        named(
            ui.button("From a virtual rig", on_click=lambda: rigs.ask(desk)).props("outline"), "rig"
        )
    return intake


async def _example(desk: Desk) -> None:
    added = await asyncio.to_thread(desk.workspace.add_example)
    desk.settle_channels()
    call = "mckibben.read(mckibben.example.TRAIN), mckibben.read(mckibben.example.TEST)"
    desk.did("opened the example", call)
    desk.changed("recordings", "channels")
    if added:
        ui.notify("A virtual muscle with a hanging load: one run to train on, one to test on.")
    else:
        ui.notify("The example is open already.")


def _list(desk: Desk, dialogs: Any, intake: Intake) -> None:
    desk.when("recordings", desk.settle_channels)
    Drawn(desk, lambda: _compared(desk), lambda: apart.build(desk), "recordings", "channels")
    Rows(desk, dialogs, lambda: intake.seen)
    _sides(desk)


def _compared(desk: Desk) -> Any:
    """Return what tells whether recordings can be fitted together."""
    entries = [(entry.role, *state_of(entry)) for entry in desk.workspace.entries()]
    return entries, desk.inputs, desk.outputs


def _sides(desk: Desk) -> None:
    """Let inputs and outputs be chosen."""
    with ui.row().classes("items-center") as row:
        fields = {
            side: named(
                ui.select(
                    [],
                    multiple=True,
                    label=side.capitalize(),
                    on_change=lambda event, side=side: _chosen(desk, side, event.value),
                ).classes("min-w-40"),
                side,
            )
            for side in ("inputs", "outputs")
        }
    told = named(ui.label("").classes("text-sm opacity-70 break-words"), "sides")

    def update() -> None:
        known = desk.workspace.channels()
        row.set_visibility(bool(desk.workspace.entries()))
        told.set_text(told_of(desk))
        for side, field in fields.items():
            chosen = list(getattr(desk, side))
            shown = [name for name in chosen if name in known]
            if (field.options, field.value) != (known or chosen, shown):
                field.set_options(known or chosen, value=shown)

    update()
    desk.when("recordings", update)
    desk.when("channels", update)


def told_of(desk: Desk) -> str:
    """Return what is modelled of what, and which channels were converted when they were read."""
    from mckibben.app.offering import sides

    if not desk.workspace.entries():
        return ""
    read = [run.meta.get("converted_units") or () for run in desk.workspace.readable()]
    converted = list(dict.fromkeys(str(each) for one in read for each in one))
    if set(desk.inputs + desk.outputs).difference(desk.workspace.channels()):
        return ""  # of recordings of several kinds: what keeps them apart is said above
    return f"{sides(desk)}{'; converted: ' if converted else ''}{', '.join(converted)}"


def _chosen(desk: Desk, side: str, channels: list[str]) -> None:
    if channels and tuple(channels) != getattr(desk, side):
        desk.choose(side, channels)
        desk.changed("channels", "results")
