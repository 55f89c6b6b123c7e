"""Models: fit in the background, choose by cross-validation, and see why."""

from __future__ import annotations

import asyncio
import math
import re
from collections.abc import Sequence
from typing import Any

import numpy as np
from nicegui import ui

from mckibben import registry
from mckibben.app import plots, scripts
from mckibben.app.desk import Desk, code, guarded, labelled, named, on_event, tell
from mckibben.app.jobs import ENDED, RUNNING, Job
from mckibben.comparison.channels import Channels
from mckibben.comparison.columns import Column, columns_of
from mckibben.comparison.free_run import run_free
from mckibben.comparison.offered import defaults, objections, settings_of, summary
from mckibben.errors import DataError, MckibbenError, ModelError
from mckibben.numerals import typeset
from mckibben.report import subjects, wording
from mckibben.system.atomic import to_json

LONGEST = 200_000
"""Characters of a model's parameters that are shown."""

SENSIBLE = (
    *("pi", "gpi", "mpi", "cpi", "preisach"),
    *("balance", "coupled-memory", "coupled-pi"),
)
"""Models to start with, of those that have a place."""


SEPARATOR = re.compile(r"\n|,(?![^\[]*\])")
"""Between settings: ends of lines, and commas that are in no list."""


def build(desk: Desk) -> None:
    """Build the page."""
    settings: dict[str, str] = {}
    with ui.row().classes("w-full items-end gap-3"):
        chosen = named(
            ui.select([], multiple=True, label="Models to fit").classes("min-w-80 flex-1"), "models"
        )
        _names_only(chosen)
        _offer(desk, chosen)
        ui.button("Settings", on_click=lambda: _settings(list(chosen.value), settings)).props(
            "flat"
        )
        named(ui.button("Fit", on_click=lambda: _fit(desk, list(chosen.value), settings)), "fit")
        named(
            ui.checkbox("Go on where recordings share data").bind_value(desk, "allow_shared"),
            "allow-shared",
        )
    with ui.row().classes("w-full items-start gap-4"):
        with ui.column().classes("min-w-72 flex-1"):
            _running(desk)
        with ui.column().classes("min-w-96 flex-[2]"):
            _leaderboard(desk)


def _names_only(chosen: ui.select) -> None:
    """Show the short names of what is chosen; the menu describes them."""

    def show() -> None:
        labelled(chosen, "display-value", ", ".join(chosen.value or []) or "none")

    chosen.on_value_change(show)
    show()


def _offer(desk: Desk, chosen: ui.select) -> None:
    """Offer the models that have a place on the channels of the recordings in use."""

    def offer() -> None:
        offered = _offered(desk)
        if set(offered) != set(chosen.options):
            kept = [name for name in chosen.value or [] if name in offered]
            first = [name for name in SENSIBLE if name in offered]
            chosen.set_options(offered, value=kept or first)

    desk.when("recordings", offer)
    desk.when("channels", offer)
    offer()


def _offered(desk: Desk) -> dict[str, str]:
    names = registry.names("estimators")
    recordings = desk.workspace.readable()
    has_channels = set(desk.inputs + desk.outputs) <= set(desk.workspace.channels())
    against = {}
    if recordings and has_channels:
        against = objections(names, recordings, Channels(desk.inputs, desk.outputs))
    return {name: f"{name}: {summary(name)}" for name in names if name not in against}


def _settings(models: list[str], kept: dict[str, str]) -> None:
    """Show every setting of the models with its default; lines of name=value change them."""
    with ui.dialog() as dialog, ui.card().classes("w-full max-w-3xl"):
        ui.label("Settings, one name=value a line; empty for the defaults").classes("text-lg")
        for model in models:
            known = [
                f"{name}={default}"
                for name, default in defaults(model).items()
                if name not in ("input", "output", "scheduling")
            ]
            ui.label(f"{model}: {', '.join(known)}").classes("text-xs opacity-70")
            ui.textarea(model, value=kept.get(model, "")).classes("w-full").on_value_change(
                lambda event, model=model: kept.__setitem__(model, event.value)
            )
        ui.button("Done", on_click=dialog.close)
    dialog.open()


def _fit(desk: Desk, models: list[str], settings: dict[str, str]) -> None:
    if all(entry.role != "train" for entry in desk.workspace.entries()):
        tell(
            "There is no recording to train on. Remedy: add one under Data, with the role 'train'."
        )
        return
    for model in models:
        lines = SEPARATOR.split(settings.get(model, ""))
        try:
            given = settings_of(model, filter(None, map(str.strip, lines)))
        except ModelError as error:
            tell(error)
            continue
        call = scripts.fit_call(model, desk.channels, given, 0)
        desk.jobs.submit(
            "fit",
            {"model": model, "name": model, **desk.channels}
            | {"settings": given, "seed": 0, "call": call, "allow_shared": desk.allow_shared},
        )
        desk.did(f"started fitting {model}", call)
    desk.changed("jobs")


def _running(desk: Desk) -> None:
    ui.label("Fits").classes("text-lg")

    @ui.refreshable
    def shown() -> None:
        fits = [job for job in desk.jobs.jobs.values() if job.kind == "fit"]
        if not fits:
            ui.label("None yet.").classes("opacity-70")
        for job in reversed(fits[-12:]):
            _job(desk, job)
        _best_so_far(desk, fits)

    desk.when("jobs", shown.refresh)
    desk.when("theme", shown.refresh)
    shown()


def _job(desk: Desk, job: Job) -> None:
    told = desk.jobs.progress(job.name)
    with named(ui.row().classes("items-center w-full gap-2 no-wrap"), f"job-{job.title}"):
        ui.label(job.title).classes("w-28")
        if job.state in ENDED:
            ui.label(f"{job.state}: {job.message}").classes("flex-1 text-xs")
            if job.state != "done":
                ui.button(icon="replay", on_click=lambda: _again(desk, job)).props(
                    'flat dense aria-label="Again"'
                )
            ui.button(icon="close", on_click=lambda: _forget(desk, job)).props(
                'flat dense aria-label="Forget"'
            )
            return
        share = told[-1][1] if told and job.state == RUNNING else 0.0
        ui.linear_progress(value=round(share, 2), show_value=False).classes("flex-1")
        ui.label(job.state).classes("text-xs")
        named(
            ui.button("Cancel", on_click=lambda: _cancel(desk, job)).props("flat dense"),
            f"cancel-{job.title}",
        )


def _cancel(desk: Desk, job: Job) -> None:
    desk.jobs.cancel(job.name)
    desk.changed("jobs")


def _forget(desk: Desk, job: Job) -> None:
    desk.jobs.forget(job.name)
    desk.changed("jobs")


def _again(desk: Desk, job: Job) -> None:
    desk.jobs.submit(job.kind, job.given)
    desk.jobs.forget(job.name)
    desk.changed("jobs")


def _best_so_far(desk: Desk, fits: list[Job]) -> None:
    """Plot the least cost that each search has found, over time."""
    curves = []
    for place, job in enumerate(fits[-6:]):
        told = [(s, cost) for s, _, cost in desk.jobs.progress(job.name) if math.isfinite(cost)]
        if len(told) >= 2:
            seconds, costs = np.array(told).T
            curves.append((job.title, seconds, costs, f"series-{place % 6 + 1}"))
    if curves:
        ui.label("Best so far").classes("text-sm")
        figure = plots.lines(
            curves, x="time [s]", y=f"training RMSE of {', '.join(desk.outputs)}", dark=desk.dark
        )
        figure["layout"]["yaxis"]["type"] = "log"
        named(ui.plotly(figure).classes("w-full"), "best-so-far")


def _leaderboard(desk: Desk) -> None:
    ui.label("Leaderboard: free-running, in the order of the choice").classes("text-lg")

    @ui.refreshable
    def shown() -> None:
        results = desk.results()
        if not results:
            ui.label("Fit models to see them compared here.").classes("opacity-70")
            return
        by = results[0]["chosen_by"]
        columns = columns_of(results, results[0]["unit"], desk.outputs, by)
        rows = [_row(result, columns) for result in results]
        table = named(
            ui.table(
                rows=rows,
                columns=[
                    {"name": key, "label": label, "field": key, "sortable": True}
                    | {"align": "left" if key == "name" else "right"}
                    for key, label in (("name", "model"), *((c.key, c.label) for c in columns))
                ],
                row_key="name",
                selection="multiple",
            )
            .classes("w-full")
            .props("dense flat"),
            "leaderboard",
        )
        ui.label(
            "The first is to be chosen: least error in cross-validation on the training side; nothing "
            "is chosen by the test. "
            "Gap kept: 100 % where the model keeps rising and falling branches as far apart as the data "
            "do, 0 where it forgot. Select one or two models to look closer."
        ).classes("text-xs opacity-70")
        for said in _judged(results):
            ui.label(said).classes("text-sm")
        place = named(ui.column().classes("w-full"), "closer")

        async def closer() -> None:
            place.clear()
            names = [row["name"] for row in table.selected][:2]
            if names:
                await _closer(desk, names, place)

        table.on_select(on_event(lambda _: closer()))
        table.selected = rows[:1]
        ui.timer(0.05, guarded(closer), once=True)

    desk.when("results", shown.refresh)
    desk.when("theme", shown.refresh)
    shown()


def _judged(results: Sequence[dict[str, Any]]) -> list[str]:
    """Return what every model has to beat, and what speaks against models or their tests."""
    said = []
    for result in results:
        constant = result.get("constant") or {}
        tested = wording.number((constant.get("test") or {}).get("rmse"))
        validated = wording.number(constant.get("validation_rmse"))
        if constant:
            said.append(
                f"constant, the mean of the training output: CV RMSE {validated}, test RMSE {tested}. "
                "Every model has to beat it."
            )
        against = [result.get("not_recommended"), *result.get("shared", ())]
        said += [f"{result['name']}: {one}" for one in against if one]
    return list(dict.fromkeys(said))


def _row(result: dict[str, Any], columns: Sequence[Column]) -> dict[str, str]:
    shown = {column.key: typeset(column.text(result)) for column in columns}
    return {"name": result["name"]} | shown


async def _closer(desk: Desk, names: list[str], place: Any) -> None:
    """Show measured against modelled, residuals and parameters, of one model or two side by side."""
    recordings = desk.workspace.with_role("test") or desk.workspace.with_role("train")
    if not recordings:
        raise DataError("there is no recording to run it on", remedy="add one under Data")
    recording = recordings[0]
    blocks = {name: desk.workspace.model(name) for name in names}
    known = desk.workspace.with_role("train")

    def modelled() -> dict[str, Any]:
        return {
            name: run_free(block, recording, desk.outputs, known) for name, block in blocks.items()
        }

    try:
        outputs = await asyncio.to_thread(modelled)
    except MckibbenError as error:
        raise ModelError(f"{', '.join(names)} on {recording.name}: {error}") from None
    with place:
        ui.label(f"On {recording.name}").classes("text-base")
        drawings = []
        for place, pair in enumerate(desk.pairs):
            own = {name: found[:, place] for name, found in outputs.items()}
            drawings += [
                subjects.fit_over_time(recording, pair[1], own),
                subjects.fit_loops(recording, *pair, own),
                subjects.residuals(recording, *pair, own),
            ]
        for number, drawing in enumerate(drawings):
            with ui.row().classes("w-full"):
                for figure in plots.figures(drawing, dark=desk.dark, height=360):
                    figure["layout"]["showlegend"] = True
                    plot = ui.plotly(figure).classes("flex-1 min-w-72")
                    named(plot, f"closer-{number}")
        with ui.row().classes("w-full items-start"):
            for name, block in blocks.items():
                content = {key: value for key, value in block.to_dict().items() if key != "format"}
                with ui.expansion(f"Parameters of {name}").classes("flex-1 min-w-0"):
                    code(to_json(content)[:LONGEST]).classes("max-h-96 overflow-y-auto")
