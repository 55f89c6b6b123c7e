"""Notes of reading that several recordings share, numbers aside: said once, with a count."""

from __future__ import annotations

import re
from collections.abc import Iterable

from nicegui import ui

from mckibben.app.desk import named
from mckibben.app.fields import said
from mckibben.app.recordings import Entry

COLOUR = "text-xs text-amber-900 dark:text-amber-300 break-words"
"""Of notes, on the page."""

_NUMBER = re.compile(r"\d+(\.\d+)?(e[+-]?\d+)?")


def shared(entries: Iterable[Entry]) -> list[dict[str, str]]:
    """Return each note that several recordings have, as each has it, by their names."""
    found: dict[str, dict[str, str]] = {}
    for entry in entries:
        for note in entry.notes:
            found.setdefault(_NUMBER.sub("#", note), {})[entry.name] = note
    return [of for of in found.values() if len(of) > 1]


def own(entry: Entry, lots: Iterable[dict[str, str]]) -> tuple[str, ...]:
    """Return the notes that a recording has for itself alone."""
    elsewhere = [of.get(entry.name) for of in lots]
    return tuple(note for note in entry.notes if note not in elsewhere)


def show(lots: Iterable[dict[str, str]]) -> None:
    """Show every shared note once; where its numbers differ, those of each are a click away."""
    for of in lots:
        first, note = next(iter(of.items()))
        alike = len(set(of.values())) == 1
        such = "" if alike else f", such as {first}"
        with ui.column().classes("w-full gap-0"):
            named(ui.label(f"{len(of)} recordings{such}: {said(note)}"), "shared-note").classes(
                COLOUR
            )
            if not alike:
                with ui.expansion("Each of them").classes("w-full text-xs").props("dense"):
                    for name, each in of.items():
                        ui.label(f"{name}: {said(each)}").classes(COLOUR)
