"""Data: files and virtual rigs in, problems explained, roles, and cutting by dragging."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING, Any

from nicegui import ui
from nicegui.events import UploadEventArguments

from mckibben import registry
from mckibben.app import scripts
from mckibben.app.desk import LONGEST, Desk, guarded, kept, labelled, named, on_event, tell
from mckibben.app.guard import LARGEST_UPLOAD, TOO_LARGE
from mckibben.app.pages.cutting import preview
from mckibben.errors import MckibbenError

if TYPE_CHECKING:
    from mckibben.files.table import Column

SHOWN = 6
"""Notes of reading that are shown of a recording."""

EXAMPLE = "field-models"
"""Protocol whose runs are the example."""

MAPPED = ("time", "pressure", "displacement", "length", "force", "voltage")
"""Channels that columns can be mapped to by hand."""


def build(desk: Desk) -> None:
    """Build the page."""
    with ui.row().classes("w-full gap-4 items-start"):
        with ui.column().classes("min-w-64 flex-1"):
            _sources(desk)
        with ui.column().classes("min-w-80 flex-[2]"):
            _list(desk)
    preview(desk)


def _sources(desk: Desk) -> None:
    ui.label("Add recordings").classes("text-lg")
    named(
        ui.upload(
            label="Drop files here: CSV, TSV, Parquet, MAT, HDF5, TDMS",
            multiple=True,
            auto_upload=True,
            max_file_size=LARGEST_UPLOAD,
            on_upload=on_event(lambda event: _uploaded(desk, event)),
            on_rejected=lambda: tell(TOO_LARGE),
        ).classes("w-full"),
        "upload",
    )
    with ui.row().classes("items-center"):
        named(ui.button("Open the example", on_click=lambda: _example(desk)), "example")
        named(ui.button("From a virtual rig", on_click=lambda: _rig(desk)).props("outline"), "rig")


def _example(desk: Desk) -> None:
    from mckibben.signals.protocol import protocol

    runs = [run.name for run in protocol(EXAMPLE).runs]
    _record(desk, EXAMPLE, runs)


def _record(desk: Desk, protocol: str, runs: list[str]) -> None:
    call = f"mckibben.rigs.record(protocol({protocol!r}), load_rig(...), runs={runs!r}, seed=0)"
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
            ui.select(names, value=EXAMPLE, label="Protocol").classes("w-full"), "protocol"
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


async def _uploaded(desk: Desk, event: UploadEventArguments) -> None:
    path = await kept(desk, event.file)
    await _take(desk, path.name, event.file.name, {})


async def _take(desk: Desk, held: str, shown: str, options: dict[str, Any]) -> bool:
    """Read an uploaded file and add its recordings; where that fails, ask how it is to be read."""
    from mckibben.app.reading import read_upload

    path = desk.workspace.path("uploads", held)
    call = scripts.read_call(str(path), options)

    def taken() -> tuple[int, list[str]]:
        recordings = read_upload(path, options)
        added: list[str] = []
        for recording in recordings:
            added += desk.workspace.add(recording, origin=f"file {shown}", call=call).notes
        desk.workspace.warm()
        return len(recordings), list(dict.fromkeys(added))

    try:
        number, notes = await asyncio.to_thread(taken)
    except MckibbenError as error:
        await _ask(desk, held, shown, options, error)
        return False
    desk.settle_channels()
    desk.did(f"read {shown}", call)
    desk.changed("recordings")
    ui.notify(f"{shown}: {number} recording(s)")
    for note in notes:
        ui.notify(note[:LONGEST], type="warning", multi_line=True, timeout=10_000)
    return True


async def _ask(
    desk: Desk, held: str, shown: str, options: dict[str, Any], error: MckibbenError
) -> None:
    """Show why a file could not be read, what is in it, and let columns and units be named."""
    from mckibben.app.reading import LARGE
    from mckibben.files import formats

    path = desk.workspace.path("uploads", held)
    try:
        if path.stat().st_size > LARGE:  # it is not read again in this process
            raise error
        tables = await asyncio.to_thread(formats.tables, path)
        columns = [column.header for column in tables[0].columns]
        first = [
            {f"{place}": _cell(column, row)[:80] for place, column in enumerate(tables[0].columns)}
            for row in range(5)
        ]
    except (MckibbenError, IndexError):
        path.unlink(missing_ok=True)  # nobody can be asked how it is to be read
        tell(f"{shown}: {error}")
        return
    with ui.dialog() as dialog, ui.card().classes("w-full max-w-4xl"):
        ui.label(f"{shown} needs help").classes("text-lg")
        named(ui.label(str(error)).classes("text-negative"), "problem")
        ui.table(
            rows=first,
            columns=[
                {"name": f"{place}", "label": column[:80], "field": f"{place}", "align": "right"}
                for place, column in enumerate(columns)
            ],
        ).classes("w-full").props("dense flat")
        picks: dict[str, tuple[Any, Any]] = {}
        with ui.grid(columns=3).classes("items-center"):
            for channel in MAPPED:
                ui.label(channel)
                column = ui.select(["", *columns], value="", label="Column").props("dense")
                unit = ui.input("Unit", placeholder="as the header says").props("dense")
                picks[channel] = named(column, f"column-{channel}"), named(unit, f"unit-{channel}")
        rate = ui.number("Samples per second, without a column of times", min=0).classes("w-80")
        gaps = ui.select(["error", "split", "interpolate"], value="error", label="Gaps in time")

        async def again() -> None:
            chosen: dict[str, Any] = {
                "columns": {name: pick[0].value for name, pick in picks.items() if pick[0].value},
                "units": {name: pick[1].value for name, pick in picks.items() if pick[1].value},
                "gaps": gaps.value,
            }
            if rate.value:
                chosen["rate"] = float(rate.value)
            dialog.close()
            await _take(desk, held, shown, chosen)

        with ui.row():
            named(ui.button("Read it so", on_click=guarded(again)), "read-again")
            ui.button("Leave it", on_click=dialog.close).props("flat")
    dialog.open()


def _cell(column: Column, row: int) -> str:
    cells = column.texts if column.values is None else column.values.tolist()[:5]
    return f"{cells[row]}" if row < len(cells) else ""


def _list(desk: Desk) -> None:
    ui.label("Recordings").classes("text-lg")

    @ui.refreshable
    def shown() -> None:
        entries = desk.workspace.entries()
        if not entries:
            with named(ui.card().classes("w-full"), "empty"):
                ui.label("Nothing here yet.").classes("text-base")
                ui.label(
                    "Drop a recording of your muscle on the left: pressure and displacement over "
                    "time. Or open the example, a virtual muscle with a hanging load."
                )
            return
        for entry in entries:
            _row(desk, entry.name)
        known = desk.workspace.channels()
        desk.settle_channels()
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
        setattr(desk, side, tuple(channels))
        desk.changed("channels", "results")


def _row(desk: Desk, name: str) -> None:
    entry = desk.workspace.entry(name)
    try:
        recording = desk.workspace.recording(name)
    except MckibbenError as error:
        ui.label(f"{name}: {error}").classes("text-negative")
        return
    duration = "" if recording.duration is None else f", {recording.duration:.4g} s"
    with named(ui.row().classes("items-center w-full gap-2"), f"recording-{name}"):
        with ui.column().classes("gap-0 flex-1 min-w-40"):
            ui.label(name).classes("font-medium")
            listed = ", ".join(f"{c} [{recording.units[c] or '-'}]" for c in recording.channels)
            ui.label(f"{len(recording)} samples{duration}; {listed}").classes("text-xs opacity-70")
            for note in entry.notes[:SHOWN]:
                named(ui.label(note[:LONGEST]).classes("text-xs text-warning"), f"note-{name}")
        named(
            ui.toggle(
                ["train", "test", "unused"],
                value=entry.role,
                on_change=lambda event: _set_role(desk, name, event.value),
            ).props("dense"),
            f"role-{name}",
        )
        for icon, word, action in (("show_chart", "Show", _show), ("delete", "Remove", _remove)):
            button = ui.button(icon=icon, on_click=lambda action=action: action(desk, name))
            labelled(button.props("flat dense").tooltip(word), "aria-label", f"{word} {name}")


def _set_role(desk: Desk, name: str, role: Any) -> None:
    desk.workspace.set_role(name, role)
    desk.changed("channels")


def _remove(desk: Desk, name: str) -> None:
    desk.workspace.remove(name)
    desk.changed("recordings", "channels")


def _show(desk: Desk, name: str) -> None:
    desk.preview = name
    desk.changed("preview")
