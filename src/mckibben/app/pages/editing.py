"""What can be done to a recording after it was read, and how each is taken back."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Sequence
from typing import Any, Literal

from nicegui import ui
from nicegui.events import KeyEventArguments

from mckibben.app import edits
from mckibben.app.desk import Desk, guarded, hinted, labelled, named
from mckibben.app.kept import Step
from mckibben.recording import Recording

FIELDS: list[Literal["input", "select", "button", "textarea"]] = ["input", "select", "textarea"]
"""Where Ctrl+Z is the field's own."""


def undoing(desk: Desk) -> None:
    """Show buttons that undo and do again; Ctrl+Z and Ctrl+Y are the same while they are shown."""

    def step(redo: bool) -> Callable[[], Awaitable[None]]:
        async def act() -> None:
            workspace = desk.workspace
            what = await asyncio.to_thread(workspace.redo if redo else workspace.undo)
            ui.notify(
                f"{'Done again' if redo else 'Undone'}: {what}"
                if what
                else "There is nothing left."
            )
            if what:
                desk.changed("recordings", "channels")

        return guarded(act)

    async def pressed(event: KeyEventArguments) -> None:
        held, key = event.modifiers, str(event.key.name).lower()
        if event.action.keydown and (held.ctrl or held.meta) and key in ("z", "y"):
            await step(key == "y" or held.shift)()

    # of the whole page: what was removed leaves the focus nowhere
    ui.keyboard(on_key=pressed, repeating=False, ignore=FIELDS)

    buttons = {}
    with ui.row().classes("gap-0"):
        for word, icon, redo in (("Undo", "undo", False), ("Redo", "redo", True)):
            button = named(ui.button(icon=icon, on_click=step(redo)), word.lower())
            buttons[word] = button.props("flat dense")

    def update() -> None:
        for (word, button), what in zip(buttons.items(), desk.workspace.history(), strict=True):
            button.set_enabled(what is not None)
            labelled(button, "aria-label", f"{word}: {what}" if what else f"{word}: nothing")
            hinted(button, f"{word}: {what}" if what else f"Nothing to {word.lower()}")

    update()
    desk.when("recordings", update)
    desk.when("channels", update)


def steps(desk: Desk, name: str, recording: Recording) -> None:
    """Show what was done to a recording, and what else can be done."""
    done = desk.workspace.entry(name).steps
    if done:
        with named(ui.row().classes("items-center gap-1"), "steps"):
            ui.label("Done to it:").classes("text-sm")
            for place, step in enumerate(done):
                words = edits.words(step)
                back = _remover(desk, name, f"{name}: without {words}", done, place)
                chip = ui.chip(words, removable=True, on_value_change=back)
                labelled(chip.props("outline dense"), "remove-aria-label", f"Take back {words}")
    rate = None if recording.sample_time is None else 1 / recording.sample_time
    with ui.row().classes("items-end gap-3"):
        channels = ui.select(
            list(recording.channels),
            value=list(recording.channels),
            multiple=True,
            label="Channels to filter",
        ).classes("w-56")
        named(channels, "edit-channels")
        if rate is not None:
            cutoff = named(ui.number("Low-pass [Hz]", value=_round(rate / 20), min=0), "cutoff")
            apply = _button("Low-pass", "low-pass")
            apply.on_click(
                guarded(
                    lambda: do(
                        desk,
                        name,
                        Step(do="low_pass", cutoff=cutoff.value, channels=list(channels.value)),
                    )
                )
            )
            wanted = named(
                ui.number("Sample time [s]", value=_round(1 / rate), min=0), "sample-time"
            )
            apply = _button("Resample", "resample")
            apply.on_click(
                guarded(lambda: do(desk, name, Step(do="resample", sample_time=wanted.value)))
            )
        apply = _button("Take drift out", "detrend")
        apply.on_click(
            guarded(lambda: do(desk, name, Step(do="detrend", channels=list(channels.value))))
        )


async def do(
    desk: Desk, name: str, *ways: Step | Sequence[Step], seen: Sequence[Step] | None = None
) -> None:
    """Do a step to a recording, or to what was seen of it; of several ways, each gives a recording."""
    before = desk.workspace.entry(name).steps if seen is None else seen
    given = [(*before, *([way] if isinstance(way, Step) else way)) for way in ways]
    said = " and ".join(edits.words(steps[-1]) for steps in given)
    what = f"{name}: {said}"
    await asyncio.to_thread(desk.workspace.edit, name, what, *given, seen=before)
    _done(desk, name)


def _remover(
    desk: Desk, name: str, what: str, seen: Sequence[Step], place: int
) -> Callable[[], Any]:
    async def back() -> None:
        await asyncio.to_thread(desk.workspace.take_back, name, what, seen, place)
        _done(desk, name)

    return guarded(back)


def _done(desk: Desk, name: str) -> None:
    desk.preview = name
    desk.changed("recordings", "channels", "log")


def _button(text: str, name: str) -> Any:
    return named(ui.button(text).props("outline"), name)


def _round(value: float) -> float:
    return float(f"{value:.3g}")
