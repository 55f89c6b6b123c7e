"""Take away: one list of things to take, each a row with what it is for, and the script of it all."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from functools import partial
from typing import Any

from nicegui import ui

from mckibben.app import following, forms, taking, widgets
from mckibben.app.jobs import DONE
from mckibben.app.state import State, view
from mckibben.app.widgets import mark
from mckibben.errors import DataError
from mckibben.options import COptions, ExportOptions, FMUOptions, InvertOptions

TITLE = "Take away"
ICON = "inventory_2"

C = ("name", "sample_time", "single", "check", "emulate", "link", "limits", "safe", "watchdog")
"""Fields of `COptions` that are asked for."""

USES = {
    "model": "The model itself, as fitted",
    "banded": "The model with its band",
    **following.KINDS,
}
USES |= {"force": "Its estimate of force"}


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
def page(state: State) -> None:
    """Show the list."""
    workspace = state.workspace
    if not workspace.entries() and not workspace.models():
        with widgets.card():
            text = "Recordings, models, figures and code come here once there are some."
            widgets.empty("inventory_2", "Nothing to take away yet", text)
        return
    with widgets.card():
        form = _use(state)
        rows = [_report(state), _recordings(state)]
        if workspace.models():
            rows[1:1] = [_figure(state), *_code(state, form)]
        mark(widgets.table(["", "What it is for", "", ""], rows), "things")


def _use(state: State) -> str:
    """Let a model be chosen, and what it is used as."""
    models = state.workspace.models()
    if not models:
        return ""
    uses = {"model": USES["model"]}
    if state.workspace.path("banded", f"{state.model}.json").is_file():
        uses["banded"] = USES["banded"]
    if state.model in following.having(state.workspace, following.compensator):
        uses |= following.kinds(state.workspace, state.model)
    if state.model in following.having(state.workspace, following.force_estimate):
        uses["force"] = USES["force"]
    if state.chosen.get("takeaway.use") not in uses:
        usual = str(state.chosen.get("compensate.form", "inverse"))
        state.chosen["takeaway.use"] = usual if usual in uses else next(reversed(uses))

    def choose(event: Any) -> None:
        state.model = event.value
        state.changed()
        page.refresh()

    with widgets.row():
        field = ui.select(models, value=state.model, label="Model", on_change=choose)
        mark(field.props("dense outlined"), "take-model")
        field = ui.select(uses, value=state.chosen["takeaway.use"], label="Used as")
        mark(field.props("dense outlined"), "take-use")
        field.bind_value(state.chosen, "takeaway.use").on_value_change(
            lambda _: (page.refresh(), script.refresh())
        )
    return str(state.chosen["takeaway.use"])


def _row(
    state: State, name: str, what: str, purpose: str, options: Callable[[], None] | None,
    start: Callable[[], tuple[Any, str, dict[str, Any]]], *, first: bool = False,
) -> list[Any]:  # fmt: skip
    """Return a row: ``start`` gives the job's work, the file's ending, and what the work is given."""

    def folded() -> None:
        if options is not None:
            opened = widgets.button("Options", partial(_ask, what, options), "tune")
            mark(widgets.labelled(opened, f"Options of {what}"), f"options-{name}")

    def act() -> None:
        make = widgets.primary if first else widgets.button
        button = make("Download", lambda: _take(state, what, start, button), "download")
        mark(widgets.labelled(button, f"Download {what}"), f"take-{name}")

    return [what, purpose, folded, act]


def _ask(what: str, options: Callable[[], None]) -> None:
    with widgets.dialog(f"{what}: options") as window:
        with widgets.row(classes="fields"):
            options()
        with widgets.row(classes="spread"):
            ui.label("They stay as they are set.").classes("muted")
            ui.button("Done", on_click=window.close).props("flat dense no-caps")


async def _take(
    state: State, what: str, start: Callable[[], tuple[Any, str, dict[str, Any]]], button: Any
) -> None:
    """Write a file in a job, and hand it over when it is done."""
    work, file, given = start()
    stem, _, ending = file.rpartition(".")
    file = f"{state.workspace.new_name('takeaway', stem, '.' + ending)}.{ending}"
    path = state.workspace.path("takeaway", file)
    path.unlink()  # only its name was reserved, and exports refuse to replace what they did not write
    job = state.jobs.submit(work, file, file=file, **given)
    button.props("loading")
    try:
        while job.active:
            await asyncio.sleep(0.1)
    finally:
        button.props(remove="loading")
    if job.state != DONE:
        raise DataError(f"{what}: {job.message or job.state}", remedy="see its options")
    await widgets.download(path)
    before.refresh()


def _values(state: State, of: str) -> dict[str, Any]:
    values: dict[str, Any] = state.chosen.setdefault(f"takeaway.{of}", {})
    return values


def _sides(state: State) -> dict[str, Any]:
    return {"inputs": [*state.inputs], "outputs": [*state.outputs]}


def _report(state: State) -> list[Any]:
    values = _values(state, "report")
    models, settings = taking.fitted(state.workspace)

    def options() -> None:
        values.setdefault("title", "")
        values["models"] = [name for name in values.get("models") or models if name in models]
        ui.input("Title").bind_value(values, "title").props("dense outlined")
        field = ui.select(models, multiple=True, label="Models").bind_value(values, "models")
        field.props("dense outlined use-chips")

    def start() -> tuple[Any, str, dict[str, Any]]:
        chosen = values.get("models") or models
        given = {"models": chosen, "heading": values.get("title") or "", "load": state.load}
        given |= {"settings": {key: own for key, own in settings.items() if key in chosen}}
        return taking.report, "report.html", given | _sides(state)

    text = "What the muscle does, the models, their test and inverse: one page that opens anywhere."
    return _row(state, "report", "Report", text, options, start, first=True)


def _figure(state: State) -> list[Any]:
    values = _values(state, "figure")
    values.setdefault("kind", "loops")
    values.setdefault("format", "pdf")

    def options() -> None:
        ui.select(taking.FIGURES, label="Figure").bind_value(values, "kind").props("dense outlined")
        forms_ = ui.toggle(["pdf", "svg", "png"]).bind_value(values, "format")
        forms_.props("dense no-caps unelevated")

    def start() -> tuple[Any, str, dict[str, Any]]:
        kind = values["kind"]
        stem = kind if kind in ("loop", "time") else f"{state.model}-{kind}"
        given = {"kind": kind, "model": state.model} | _sides(state)
        return taking.figure, f"{stem}.{values['format']}", given

    return _row(state, "figure", "Figure", "For print: measured and modelled.", options, start)


def _code(state: State, form: str) -> list[list[Any]]:
    """Return the rows of what runs elsewhere."""
    stem = state.model if form == "model" else f"{state.model}-{form}"
    keys = following.SETTINGS.get(form, ())
    values = state.chosen.get(f"compensate.values-{form}", {})

    def common() -> dict[str, Any]:
        settings = forms.given(InvertOptions, {key: values.get(key) for key in keys})
        return {"model": state.model, "form": form, "settings": settings}

    def exported(target: str, kind: type, ending: str) -> tuple[Any, str, dict[str, Any]]:
        options = forms.given(kind, _values(state, target))
        given = common() | {"target": target, "options": options}
        return taking.code, f"{stem}{ending}", given

    def asked(target: str, kind: type, names: tuple[str, ...]) -> Callable[[], None]:
        return lambda: forms.fields(kind, names, _values(state, target))

    usual = ("name", "sample_time")
    rows = [
        _row(state, "json", "JSON", "For this library again: mckibben.load(file).", None,
             lambda: (taking.block, f"{stem}.json", common())),
        _row(state, "c", "C99", "For a microcontroller or a PC: compiles as it is, with a self-test.",
             asked("c", COptions, C), partial(exported, "c", COptions, "-c.zip")),
        _row(state, "fmu", "FMU", "For Simulink and other tools; it is compiled here, up to a minute.",
             asked("fmu", FMUOptions, (*usual, "platforms")),
             partial(exported, "fmu", FMUOptions, ".fmu")),
    ]  # fmt: skip
    if form in following.KINDS:
        rows.append(
            _row(state, "ros2", "ROS 2", "A controller of ros2_control, to be built by colcon.",
                 asked("ros2", ExportOptions, usual),
                 partial(exported, "ros2", ExportOptions, "-ros2.zip"))
        )  # fmt: skip
    return rows


def _recordings(state: State) -> list[Any]:
    values = _values(state, "recordings")
    values.setdefault("ending", ".csv")

    def options() -> None:
        field = ui.toggle({".csv": "CSV", ".parquet": "Parquet"}).bind_value(values, "ending")
        field.props("dense no-caps unelevated")

    def start() -> tuple[Any, str, dict[str, Any]]:
        return taking.recordings, "recordings.zip", {"ending": values["ending"]}

    text = "As they are after cuts and filters, by role, with units."
    return _row(state, "recordings", "Recordings", text, options, start)


@view
def script(state: State) -> None:
    """Show the script that does it all again."""
    if not taking.fitted(state.workspace)[0]:
        return
    write = taking.shell if state.chosen.get("takeaway.shell") else taking.python
    use = str(state.chosen.get("takeaway.use", "inverse"))
    text = write(state.workspace, state.inputs, state.outputs, state.load, state.model, use)

    def choose(event: Any) -> None:
        state.chosen["takeaway.shell"] = event.value
        script.refresh()

    with widgets.card():
        with widgets.row(classes="spread"):
            ui.label("All of it as a script").classes("subtitle").props(
                'role=heading aria-level="3"'
            )
            with widgets.row():
                chosen = bool(state.chosen.get("takeaway.shell"))
                field = ui.toggle({False: "Python", True: "Shell"}, value=chosen, on_change=choose)
                mark(field.props("dense no-caps unelevated"), "script-kind")
                name = "script.sh" if chosen else "script.py"
                get = widgets.button(name, lambda: ui.download.content(text, name), "download")
                mark(get, "take-script")
        mark(ui.label(text).classes("code script"), "script")


@view
def before(state: State) -> None:
    """Offer what was taken before."""
    folder = state.workspace.folder / "takeaway"
    files = [path for path in folder.iterdir() if path.is_file() and path.stat().st_size]
    if not files:
        return
    with widgets.details(f"Taken before ({len(files)})"):
        for path in sorted(files, key=lambda path: -path.stat().st_mtime_ns):
            widgets.button(path.name, partial(widgets.download, path), "download")
