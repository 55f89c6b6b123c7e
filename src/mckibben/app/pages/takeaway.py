"""Take away: one list of things to take, each a row with what it is for, and the script of it all."""

from __future__ import annotations

import asyncio
from functools import partial
from typing import Any

from nicegui import ui

from mckibben.app import compensators, downloads, forms, widgets
from mckibben.app.downloads import THINGS, Thing
from mckibben.app.pages import parts
from mckibben.app.pages.compensate import settings_of
from mckibben.app.state import State, view
from mckibben.app.widgets import mark
from mckibben.errors import MckibbenError

TITLE = "Take away"
ICON = "inventory_2"


def build(state: State) -> None:
    """Build the page."""
    with mark(ui.element("div").classes("page"), "page-takeaway"):
        widgets.heading("Take away", "Results as files, for a paper, a controller or a colleague.")
        page(state)
        script(state)
        widgets.next_step("Run it on your rig, then review its log.", "Compensate", "/compensate")


@parts.steady("models", "recordings")
def page(state: State) -> None:
    """Show the list."""
    models, use = state.workspace.models(), ""
    with widgets.card():
        if not models and not state.workspace.entries():
            text = "Recordings, models, figures and code come here once there are some."
            widgets.empty("inventory_2", "Nothing to take away yet", text)
            return
        if models:
            uses = compensators.uses(state.workspace, state.model)
            if state.chosen.get("takeaway.of") != state.model:
                state.chosen["takeaway.of"] = state.model
                usual = state.chosen.get("compensate.form", "inverse")
                usual = usual if usual in uses else next(reversed(uses))
                state.chosen["takeaway.take-use"] = usual
            with widgets.row():
                parts.select_model(state, models, "take-model")
                again = state.changed, page.refresh
                on_change = lambda: [do() for do in again]  # noqa: E731
                use = parts.select(state, "takeaway.take-use", uses, "Used as", on_change)
        muscle = bool(models) and compensators.is_balance(state.workspace, state.model)
        rows = [
            [thing.title, thing.purpose, partial(_options, state, key, thing),
             partial(_button, state, key, thing)]
            for key, thing in THINGS.items()
            if (models or "{stem}" not in thing.file)
            and (key != "ros2" or use in compensators.KINDS)
            and (key != "mjcf" or (use == "model" and muscle))
        ]  # fmt: skip
        mark(widgets.table(["", "What it is for", "", ""], rows), "things")


def _subject(state: State) -> dict[str, Any]:
    """Return what all things are of: model and what it is used as, and channels."""
    use = str(state.chosen.get("takeaway.take-use", "model"))
    subject = {"model": state.model, "use": use, "settings": settings_of(state, use)}
    return subject | {"inputs": [*state.inputs], "outputs": [*state.outputs], "load": state.load}


def _options(state: State, key: str, thing: Thing) -> None:
    """Make the button behind which the options of a thing are; they stay as they are set."""
    values = state.chosen.setdefault(f"takeaway.{key}", {})

    def ask(kind: type) -> None:
        with widgets.dialog(f"{thing.title}: options") as window:
            with widgets.row(classes="fields"):
                forms.fields(kind, thing.fields, values)
            with widgets.row(classes="spread"):
                ui.space()
                widgets.button("Done", window.close)

    if thing.kind is not None:
        button = widgets.button("Options", partial(ask, thing.kind), "tune")
        mark(widgets.labelled(button, f"Options of {thing.title}"), f"options-{key}")


def _button(state: State, key: str, thing: Thing) -> None:
    """Make the button that writes a thing in a job, and hands it over when it is done."""

    async def take() -> None:
        values, subject = state.chosen[f"takeaway.{key}"], _subject(state)
        options = forms.given(thing.kind, values) if thing.kind else {}
        stem = state.model if subject["use"] == "model" else f"{state.model}-{subject['use']}"
        stem_wish, _, ending = thing.file.format(stem=stem).rpartition(".")
        file = f"{state.workspace.new_name('takeaway', stem_wish, '.' + ending)}.{ending}"
        path = state.workspace.path("takeaway", file)
        path.unlink()  # only its name was reserved; exports replace what they wrote alone
        job = state.jobs.submit(
            thing.work, file, file=file, options=options, of=subject, **thing.more
        )
        while job.active:
            await asyncio.sleep(0.1)
        if job.state != "done":
            raise MckibbenError(f"{thing.title}: {job.message or job.state}".rstrip("."))
        await widgets.download(path)

    make = widgets.primary if key == "report" else widgets.button
    button = widgets.labelled(make("Download", take, "download"), f"Download {thing.title}")
    mark(button, f"take-{key}")


@view
def script(state: State) -> None:
    """Show the script that does it all again."""
    if not downloads.fitted(state.workspace):
        return
    text = downloads.script(state.workspace, _subject(state))
    with widgets.card("All of it as a script"):
        take = partial(ui.download.content, text, "script.py")
        mark(widgets.button("script.py", take, "download"), "take-script")
        mark(ui.label(text).classes("code script"), "script")
