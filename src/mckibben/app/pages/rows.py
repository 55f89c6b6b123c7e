"""The recordings, a row for each: only what has changed is made anew, so that no click is lost."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from nicegui import ui

from mckibben.app.desk import LONGEST, Desk, guarded, hinted, labelled, named, refused, told
from mckibben.app.drawn import Drawn
from mckibben.app.fields import READING, said
from mckibben.app.pages import shared_notes
from mckibben.app.pages.asking import ask_again
from mckibben.app.recordings import Entry
from mckibben.errors import MckibbenError
from mckibben.recording import Recording

SHOWN = 6
"""Notes of reading that are shown of a recording."""


@dataclass
class _Row:
    """What a row was made for, what holds it and its words, and what gives its role another value."""

    state: tuple[Entry, int]
    place: ui.row
    words: ui.column
    role: Callable[[str], Any]


class Rows:
    """The rows of all recordings.

    Parameters
    ----------
    desk : Desk
    dialogs : element
        Where dialogs go.
    coming : callable
        Returns how many files are just coming in.
    """

    def __init__(self, desk: Desk, dialogs: Any, coming: Callable[[], int]) -> None:
        self.desk, self.dialogs, self.coming = desk, dialogs, coming
        self._rows: dict[str, _Row] = {}
        with named(ui.card().classes("w-full"), "empty") as self._empty:
            ui.label("Nothing here yet.").classes("text-base")
            ui.label(
                "Drop a recording of your muscle: pressure and displacement over time. "
                "Or open the example, a virtual muscle with a hanging load."
            )
            if beside := desk.workspace.beside():
                ui.label(
                    f"In {desk.workspace.folder} itself, which this workbench keeps its work in, lie "
                    f"{len(beside)} files of recordings, such as {beside[0].name}: they stay as they "
                    "are. Drop those that you mean here."
                )
        Drawn(desk, self._lots, lambda: shared_notes.show(self._lots()), "recordings", "coming")
        self._place = ui.column().classes("w-full gap-3")
        for _ in self._updating():
            pass
        for topic in ("recordings", "coming"):
            desk.when(topic, self.update)

    def _lots(self) -> list[dict[str, str]]:
        """Return the notes that are not said under each recording."""
        return shared_notes.shared(self.desk.workspace.entries())

    async def update(self) -> None:
        """Show what is there now; clicks are answered between one row and the next."""
        for _ in self._updating():
            await asyncio.sleep(0)

    def _updating(self) -> Iterator[None]:
        """Show what is there now, and yield after every row that is made."""
        lots = self._lots()
        entries = {
            entry.name: replace(entry, notes=shared_notes.own(entry, lots))
            for entry in self.desk.workspace.entries()
        }
        states = {name: state_of(entry) for name, entry in entries.items()}
        self._empty.set_visibility(not entries and not self.coming())
        for name in self._rows.keys() - entries.keys():
            self._rows.pop(name).place.delete()
        for name, row in self._rows.items():
            entry = entries[name]
            if (
                row.state != states[name]
            ):  # what is clicked stays: a click that comes now must count
                row.state = states[name]
                row.words.clear()
                self._tell(row.words, name, entry)
            row.role(entry.role)
        for at, (name, entry) in enumerate(entries.items()):
            if name not in self._rows:
                self._rows[name] = row = self._made(entry, states[name])
                if at < len(self._rows) - 1:
                    row.place.move(target_index=at)
                yield

    def _made(self, entry: Entry, state: tuple[Entry, int]) -> _Row:
        desk, name = self.desk, entry.name
        with self._place, ui.row().classes("items-center w-full gap-2") as place:
            words = ui.column().classes("gap-0 flex-1 min-w-40")
            toggle = ui.toggle(["train", "test", "unused"], value=entry.role)
            toggle.props(f'dense role=group aria-label="Role of {name}"')
            toggle.on_value_change(lambda event: _set_role(desk, name, event.value))
            named(toggle, f"role-{name}")
            with ui.row().classes("gap-0 items-center"):
                ask = guarded(lambda: ask_again(desk, self.dialogs, name))
                button = ui.button(READING, icon="tune", on_click=ask).props("flat dense no-caps")
                labelled(button, "aria-label", f"{READING}: {name}")
                self._button("show_chart", "Show", name, _show)
                self._button("delete", "Remove", name, _remove)
        self._tell(words, name, entry)
        return _Row(state, named(place, f"recording-{name}"), words, toggle.set_value)

    def _tell(self, words: ui.column, name: str, entry: Entry) -> None:
        with words:
            try:
                recording = self.desk.workspace.recording(name)
            except MckibbenError as error:
                refused(error, name)
                return
            duration = "" if recording.duration is None else f", {recording.duration:.4g} s"
            ui.label(name).classes("font-medium break-all")
            listed = ", ".join(_channel(recording, name) for name in recording.channels)
            ui.label(f"{len(recording)} samples{duration}; {listed}").classes(
                "text-xs opacity-70 break-words"
            )
            _aside_said(recording, name)
            for note in entry.notes[:SHOWN]:
                named(ui.label(said(note)).classes(shared_notes.COLOUR), f"note-{name}")

    def _button(self, icon: str, word: str, name: str, action: Callable[[Desk, str], None]) -> None:
        button = ui.button(icon=icon, on_click=lambda: action(self.desk, name)).props("flat dense")
        labelled(hinted(button, word), "aria-label", f"{word} {name}")


def _channel(recording: Recording, name: str) -> str:
    """Return a channel with its unit, and its value where that is one: a load, a held length."""
    values, unit = recording[name], recording.units[name]
    if len(values) > 1 and np.ptp(values) == 0:
        return f"{name} {values[0]:.4g} {unit}".rstrip()
    return f"{name} [{unit or '-'}]"


def state_of(entry: Entry) -> tuple[Entry, int]:
    """Return what is shown of a recording, its role aside, to be compared."""
    try:
        stamp = entry.path.stat().st_mtime_ns
    except OSError:
        stamp = 0
    return replace(entry, role="train"), stamp


def _aside_said(recording: Recording, name: str) -> None:
    """Say what is missing: times, and columns that were left out."""
    ignored = recording.meta.get("ignored_columns") or ()
    words = []
    if recording.sample_time is None:
        words.append(f"no time: only models without rates take it; give a rate by “{READING}”")
    if ignored:
        words.append(f"left out: {', '.join(map(str, ignored))}")
    if words:
        text = "; ".join(words)[:LONGEST]
        named(ui.label(text).classes("text-xs opacity-70 break-words"), f"understood-{name}")


def _set_role(desk: Desk, name: str, role: Any) -> None:
    with told():
        if role != desk.workspace.entry(name).role:
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
