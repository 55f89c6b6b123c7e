"""Take away: one list of things to take, each a row with what it is for, and the script of it all."""

from __future__ import annotations

import asyncio
from functools import partial
from typing import Any

from nicegui import ui

from mckibben.app import following, forms, taking, widgets
from mckibben.app.jobs import DONE
from mckibben.app.state import State, view
from mckibben.app.taking import THINGS, Thing
from mckibben.app.widgets import mark
from mckibben.errors import DataError
from mckibben.options import InvertOptions

TITLE = "Take away"
ICON = "inventory_2"


def build(state: State) -> None:
    """Build the page."""
    with mark(ui.element("div").classes("page"), "page-takeaway"):
        widgets.heading("Take away", "What was found, for a paper, a controller or a colleague.")
        page(state)
        watch(state)
        script(state)
        before(state)
        widgets.next_step("Run it on your rig, then review its log.", "Compensate", "/compensate")


@view
def watch(state: State) -> None:
    """Build the list again when models or recordings are others; it shows nothing."""
    key = (state.workspace.models(), [one.name for one in state.workspace.entries()])
    known, state.chosen["takeaway.key"] = state.chosen.get("takeaway.key"), key
    if known not in (None, key):
        page.refresh()


@ui.refreshable
@widgets.shielded
def page(state: State) -> None:
    """Show the list."""
    models, use = state.workspace.models(), ""
    with widgets.card():
        if not models and not state.workspace.entries():
            text = "Recordings, models, figures and code come here once there are some."
            widgets.empty("inventory_2", "Nothing to take away yet", text)
            return
        if models:
            use = _use(state)
        rows = [
            [thing.title, thing.purpose, partial(_options, state, key, thing),
             partial(_button, state, key, thing)]
            for key, thing in THINGS.items()
            if (models or "{stem}" not in thing.file) and (key != "ros2" or use in following.KINDS)
        ]  # fmt: skip
        mark(widgets.table(["", "What it is for", "", ""], rows), "things")


def _use(state: State) -> str:
    """Let a model be chosen, and what it is used as; return that."""
    uses = following.uses(state.workspace, state.model)
    if state.chosen.get("takeaway.use") not in uses:
        usual = str(state.chosen.get("compensate.form", "inverse"))
        state.chosen["takeaway.use"] = usual if usual in uses else next(reversed(uses))

    def changed() -> None:
        state.changed()
        page.refresh()

    with widgets.row():
        names = state.workspace.models()
        field = ui.select(names, label="Model").bind_value(state, "model").props("dense outlined")
        mark(field, "take-model").on_value_change(changed)
        field = ui.select(uses, label="Used as").bind_value(state.chosen, "takeaway.use")
        mark(field.props("dense outlined"), "take-use").on_value_change(changed)
    return str(state.chosen["takeaway.use"])


def _of(state: State) -> dict[str, Any]:
    """Return what all things are of: model and what it is used as, and channels."""
    use = str(state.chosen.get("takeaway.use", "model"))
    values = state.chosen.get(f"compensate.values-{use}", {})
    asked = {key: values.get(key) for key in following.SETTINGS.get(use, ())}
    found = {"model": state.model, "use": use, "settings": forms.given(InvertOptions, asked)}
    return found | {"inputs": [*state.inputs], "outputs": [*state.outputs], "load": state.load}


def _values(state: State, key: str) -> dict[str, Any]:
    values: dict[str, Any] = state.chosen.setdefault(f"takeaway.{key}", {})
    return values


def _options(state: State, key: str, thing: Thing) -> None:
    """Make the button behind which the options of a thing are; they stay as they are set."""

    def ask() -> None:
        with widgets.dialog(f"{thing.title}: options") as window:
            with widgets.row(classes="fields"):
                assert thing.kind is not None
                forms.fields(thing.kind, thing.fields, _values(state, key), taking.FIGURES)
            with widgets.row(classes="spread"):
                ui.space()
                widgets.button("Done", window.close)

    if thing.kind is not None:
        button = widgets.labelled(
            widgets.button("Options", ask, "tune"), f"Options of {thing.title}"
        )
        mark(button, f"options-{key}")


def _button(state: State, key: str, thing: Thing) -> None:
    """Make the button that writes a thing in a job, and hands it over when it is done."""

    async def take() -> None:
        options = forms.given(thing.kind, _values(state, key)) if thing.kind else {}
        of, plain = _of(state), vars(thing.kind()) if thing.kind else {}
        stem = state.model if of["use"] == "model" else f"{state.model}-{of['use']}"
        wish, _, ending = thing.file.format_map({"stem": stem, **plain, **options}).rpartition(".")
        file = f"{state.workspace.new_name('takeaway', wish, '.' + ending)}.{ending}"
        path = state.workspace.path("takeaway", file)
        path.unlink()  # only its name was reserved; exports replace what they wrote alone
        job = state.jobs.submit(thing.work, file, file=file, options=options, of=of)
        button.props("loading")
        try:
            while job.active:
                await asyncio.sleep(0.1)
        finally:
            button.props(remove="loading")
        if job.state != DONE:
            problem = f"{thing.title}: {job.message or job.state}"
            raise DataError(problem, remedy="see its options")
        await widgets.download(path)
        before.refresh()

    make = widgets.primary if key == "report" else widgets.button
    button = widgets.labelled(make("Download", take, "download"), f"Download {thing.title}")
    mark(button, f"take-{key}")


@view
def script(state: State) -> None:
    """Show the script that does it all again."""
    if not taking.fitted(state.workspace)[0]:
        return
    text = taking.script(state.workspace, _of(state))
    with widgets.card("All of it as a script"):
        take = widgets.button(
            "script.py", lambda: ui.download.content(text, "script.py"), "download"
        )
        mark(take, "take-script")
        mark(ui.label(text).classes("code script"), "script")


@view
def before(state: State) -> None:
    """Offer what was taken before."""
    folder = state.workspace.folder / "takeaway"
    files = [path for path in folder.iterdir() if path.is_file() and path.stat().st_size]
    if files:
        with widgets.details(f"Taken before ({len(files)})"):
            for path in sorted(files, key=lambda path: -path.stat().st_mtime_ns):
                widgets.button(path.name, partial(widgets.download, path), "download")
