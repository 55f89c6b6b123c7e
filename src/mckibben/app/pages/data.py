"""Data: files and virtual rigs in, what was understood of them, roles, changes and their undoing."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from importlib.util import find_spec
from typing import Any

from nicegui import ui

from mckibben import registry
from mckibben.app.desk import (
    LONGEST,
    Desk,
    guarded,
    hinted,
    labelled,
    named,
    on_event,
    refused,
    tell,
)
from mckibben.app.fields import said
from mckibben.app.guard import LARGEST_UPLOAD, TOO_LARGE
from mckibben.app.pages import apart, editing
from mckibben.app.pages.asking import ask_again
from mckibben.app.pages.cutting import preview
from mckibben.app.pages.importing import Intake
from mckibben.errors import MckibbenError
from mckibben.recording import Recording

SHOWN = 6
"""Notes of reading that are shown of a recording."""

PROTOCOL = "field-models"
"""The one that is offered first."""

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
    dialogs = ui.element("div")  # outside of what is drawn anew, which would take them along
    with ui.column().classes("w-full"):
        with ui.row().classes("w-full gap-4 items-start"):
            with ui.column().classes("min-w-64 flex-1"):
                intake = _sources(desk, dialogs)
            with ui.column().classes("min-w-72 flex-[2]"):
                with ui.row().classes("items-center"):
                    ui.label("Recordings").classes("text-lg")
                    editing.undoing(desk)
                _list(desk, dialogs)
        preview(desk)
    _watch(desk, intake)


def _watch(desk: Desk, intake: Intake) -> None:
    """Draw anew what other windows, or workbenches over the same folder, have changed.

    Not while files are coming in here: what is drawn twice takes the click that came between.
    """
    seen = {"stamp": desk.workspace.stamp()}

    def noted() -> None:
        seen["stamp"] = desk.workspace.stamp()

    async def look() -> None:
        if not intake.seen and desk.workspace.stamp() != seen["stamp"]:
            await asyncio.to_thread(desk.workspace.warm)
            desk.changed("recordings", "channels")

    desk.when("recordings", noted)
    ui.timer(WATCH, look)


def taken() -> list[str]:
    """Return the kinds of files that are read here, by the libraries that are installed."""
    return ["CSV", "TSV", *(kind for kind, library in KINDS.items() if find_spec(library))]


def _sources(desk: Desk, dialogs: Any) -> Intake:
    ui.label("Add recordings").classes("text-lg")
    intake = Intake(desk, dialogs)
    named(
        ui.upload(
            label=f"Drop files here: {', '.join(taken())}",
            multiple=True,
            auto_upload=True,
            max_file_size=LARGEST_UPLOAD,
            on_upload=on_event(intake.uploaded),
            on_rejected=lambda: tell(TOO_LARGE),
        ).classes("w-full"),
        "upload",
    )
    intake.reading = named(ui.label("").classes("text-sm").props("role=status"), "reading")
    intake.pending = named(ui.button(on_click=lambda: intake.list()).props("flat"), "left-unread")
    intake.show_left()
    with ui.row().classes("items-center"):
        example = named(ui.button("Open the example"), "example")
        example.on_click(guarded(lambda: _example(desk)))
        named(ui.button("From a virtual rig", on_click=lambda: _rig(desk)).props("outline"), "rig")
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


def _record(desk: Desk, protocol: str, runs: list[str]) -> None:
    call = f"list(mckibben.rigs.record({protocol!r}, runs={runs!r}, seed=0))"
    desk.jobs.submit(
        "record",
        {
            "protocol": protocol,
            "runs": runs,
            "seed": 0,
            "call": call,
            "title": f"record {protocol}",
        },
    )
    desk.changed("jobs")
    ui.notify("Recording in the background.")


def _rig(desk: Desk) -> None:
    from mckibben.signals.protocol import protocol

    with ui.dialog() as dialog, ui.card().classes("w-96"):
        ui.label("Runs of a paper's protocol, on its virtual rig").classes("text-lg")
        names = list(registry.names("protocols"))
        chosen = named(
            ui.select(names, value=PROTOCOL, label="Protocol").classes("w-full"), "protocol"
        )
        runs = named(
            ui.select([], multiple=True, label="Runs").classes("w-full").props("use-chips"), "runs"
        )

        def listed() -> None:
            found = [run.name for run in protocol(str(chosen.value)).runs]
            runs.set_options(found, value=found[: min(2, len(found))])

        chosen.on_value_change(listed)
        listed()

        def record() -> None:
            if runs.value:
                _record(desk, str(chosen.value), list(runs.value))
                dialog.close()

        with ui.row():
            named(ui.button("Record", on_click=record), "record")
            ui.button("Close", on_click=dialog.close).props("flat")
    dialog.open()


def _list(desk: Desk, dialogs: Any) -> None:
    @ui.refreshable
    def shown() -> None:
        entries = desk.workspace.entries()
        if not entries:
            with named(ui.card().classes("w-full"), "empty"):
                ui.label("Nothing here yet.").classes("text-base")
                ui.label(
                    "Drop a recording of your muscle: pressure and displacement over time. "
                    "Or open the example, a virtual muscle with a hanging load."
                )
            return
        desk.settle_channels()
        apart.build(desk)
        for entry in entries:
            _row(desk, entry.name, dialogs)
        known = desk.workspace.channels()
        with ui.row().classes("items-center"):
            for side in ("inputs", "outputs"):
                chosen = list(getattr(desk, side))
                named(
                    ui.select(
                        known or chosen,
                        value=[name for name in chosen if name in known],
                        multiple=True,
                        label=side.capitalize(),
                        on_change=lambda event, side=side: _chosen(desk, side, event.value),
                    ).classes("min-w-40"),
                    side,
                )

    desk.when("recordings", shown.refresh)
    shown()


def _chosen(desk: Desk, side: str, channels: list[str]) -> None:
    if channels:
        desk.choose(side, channels)
        desk.changed("channels", "results")


def _row(desk: Desk, name: str, dialogs: Any) -> None:
    entry = desk.workspace.entry(name)
    try:
        recording = desk.workspace.recording(name)
    except MckibbenError as error:
        with named(ui.row().classes("items-center w-full gap-2"), f"recording-{name}"):
            with ui.column().classes("flex-1 min-w-40"):
                refused(error, name)
            _button("delete", "Remove", name, lambda: _remove(desk, name))
        return
    duration = "" if recording.duration is None else f", {recording.duration:.4g} s"
    with named(ui.row().classes("items-center w-full gap-2"), f"recording-{name}"):
        with ui.column().classes("gap-0 flex-1 min-w-40"):
            ui.label(name).classes("font-medium break-all")
            listed = ", ".join(f"{c} [{recording.units[c] or '-'}]" for c in recording.channels)
            told = f"{len(recording)} samples{duration}; {listed}"
            ui.label(told).classes("text-xs opacity-70 break-words")
            _aside_said(recording, name)
            for note in entry.notes[:SHOWN]:
                named(
                    ui.label(said(note)).classes("text-xs text-amber-900 dark:text-amber-300"),
                    f"note-{name}",
                )
        named(
            ui.toggle(
                ["train", "test", "unused"],
                value=entry.role,
                on_change=lambda event: _set_role(desk, name, event.value),
            ).props(f'dense role=group aria-label="Role of {name}"'),
            f"role-{name}",
        )
        for icon, word, action in (
            ("tune", "How it was read:", guarded(lambda: ask_again(desk, dialogs, name))),
            ("show_chart", "Show", lambda: _show(desk, name)),
            ("delete", "Remove", lambda: _remove(desk, name)),
        ):
            _button(icon, word, name, action)


def _button(icon: str, word: str, name: str, action: Callable[[], Any]) -> None:
    button = ui.button(icon=icon, on_click=action).props("flat dense")
    labelled(hinted(button, word.rstrip(":")), "aria-label", f"{word} {name}")


def _aside_said(recording: Recording, name: str) -> None:
    """Say what is missing: times, and columns that were left out."""
    ignored = recording.meta.get("ignored_columns") or ()
    told = []
    if recording.sample_time is None:
        told.append("no time: only models without rates take it; give a rate by 'How it was read'")
    if ignored:
        told.append(f"left out: {', '.join(map(str, ignored))}")
    if told:
        text = "; ".join(told)[:LONGEST]
        named(ui.label(text).classes("text-xs opacity-70 break-words"), f"understood-{name}")


def _set_role(desk: Desk, name: str, role: Any) -> None:
    try:
        desk.workspace.set_role([name], role)
    finally:  # where that is refused, the role is shown as it stays
        desk.changed("recordings", "channels")


def _remove(desk: Desk, name: str) -> None:
    desk.workspace.remove(name)
    desk.changed("recordings", "channels")
    ui.notify(f"{name} is removed; Undo brings it back.")


def _show(desk: Desk, name: str) -> None:
    desk.preview = name
    desk.changed("preview")
