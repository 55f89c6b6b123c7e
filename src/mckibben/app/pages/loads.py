"""A card that offers to tell models the loads that the names of files speak of."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from functools import partial
from pathlib import PurePath

from nicegui import ui

from mckibben.app import adding
from mckibben.app.desk import Desk, guarded, named
from mckibben.app.kept import Reading
from mckibben.app.loads import Load, loads_in
from mckibben.app.workspace import Workspace
from mckibben.comparison.channels import FORCE
from mckibben.files.notices import listed

SHOWN = 12
"""Recordings that are named."""


def build(desk: Desk) -> None:
    """Show what loads the names speak of, where no force was recorded."""
    found = untold(desk.workspace)
    if not found:
        return
    said = listed([f"{name} {load.force:.3g} N" for name, load in found.items()], SHOWN)
    with named(ui.card().classes("w-full border border-warning gap-1"), "loads"):
        ui.label("Their names speak of loads").classes("font-medium")
        ui.label(f"{said}. Models can be told.").classes("text-sm break-words")
        button = ui.button("Take them as force", on_click=guarded(partial(_take, desk, found)))
        named(button.props("outline dense no-caps"), "take-loads")


def untold(workspace: Workspace) -> Mapping[str, Load]:
    """Return the loads of several recordings in use that have no force, unless any was measured."""
    used = workspace.used()
    entries = [entry for entry in workspace.entries() if entry.name in used]
    if any(FORCE in used[e.name] and FORCE not in e.reading.constants for e in entries):
        return {}
    names = {
        entry.name: PurePath(entry.origin.removeprefix("file ")).stem
        if entry.upload  # whose point, as of 10.04kg, is not in the recording's name
        else entry.name
        for entry in entries
        if FORCE not in used[entry.name]
    }
    found = loads_in(dict.fromkeys(names.values()))
    told = {name: found[text] for name, text in names.items() if text in found}
    return told if len(entries) > 1 else {}


def taking(reading: Reading, load: Load) -> Reading:
    """Return a reading that tells a load, too."""
    constants = {**reading.constants, FORCE: (load.value, load.unit)}
    channels = reading.channels and [*reading.channels, FORCE]
    return reading.model_copy(update={"constants": constants, "channels": channels})


async def _take(desk: Desk, found: Mapping[str, Load]) -> None:
    ways = {n: taking(desk.workspace.entry(n).reading, load) for n, load in found.items()}
    await asyncio.to_thread(adding.replaced_each, desk, ways)
    desk.settle_channels()
    desk.changed("recordings", "channels", "log")
