"""Recordings from a virtual rig: which paper's muscle, and which of its runs."""

from __future__ import annotations

from nicegui import ui

from mckibben import registry
from mckibben.app.desk import Desk, named

FIRST = "field-models"
"""The protocol that is offered first."""

TITLES = {
    "activation-pressure": "One muscle that moves a carriage under several forces",
    "field-models": "One muscle with a hanging load",
    "mpi-narmax": "One muscle on a rail, driven by a valve's voltage, under several loads",
    "multistate-friction": "One muscle in a test stand: force at held lengths, and while it moves",
    "sdchm": "A soft arm of three muscles, and one in its middle that lengthens and stiffens it",
}
"""What the rig of a protocol of this package is; others are called by their names."""


def ask(desk: Desk) -> None:
    """Ask what is to be recorded."""
    from mckibben.signals.protocol import protocol

    with ui.dialog() as dialog, ui.card().classes("w-full max-w-xl"):
        ui.label("Runs of a paper's protocol, on its virtual rig").classes("text-lg")
        names = {name: TITLES.get(name, name) for name in registry.names("protocols")}
        chosen = named(ui.select(names, value=FIRST, label="Rig").classes("w-full"), "protocol")
        source = named(ui.label("").classes("text-sm opacity-70 break-words"), "protocol-source")
        runs = named(
            ui.select({}, multiple=True, with_input=True, label="Runs: write a part of a name")
            .classes("w-full")
            .props("use-chips"),
            "runs",
        )

        def listed() -> None:
            plan = protocol(str(chosen.value))
            source.set_text(f"{plan.source} ({plan.name}). {len(plan.runs)} runs.")
            found = {run.name: f"{run.name} ({run.role})" for run in plan.runs}
            runs.set_options(found, value=list(found)[:2])

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
