"""The other tabs of Compensate, estimates of force and reviews of logs, and what all tabs share."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from nicegui import events, run, ui

from mckibben.app import following, widgets
from mckibben.app.state import State
from mckibben.app.terms import said
from mckibben.app.widgets import mark
from mckibben.errors import DataError
from mckibben.numerals import number
from mckibben.report import interactive
from mckibben.report.drawing import Curve, Drawing, Panel, axis_label


def choose(state: State, key: str, value: Any) -> None:
    """Take a choice, and show what follows."""
    if state.chosen.get(key) != value:
        state.chosen[key] = value
        state.changed()


def model_of(state: State, names: Sequence[str]) -> str:
    """Return the model that is chosen, or else the first of some."""
    return state.model if state.model in names else names[0]


def select_model(state: State, names: Sequence[str]) -> None:
    """Let one of some models be chosen."""
    first = next(iter(state.workspace.models()), "")
    titles = {
        name: f"{name} (first of the leaderboard)" * (name == first) or name for name in names
    }

    def chosen(event: events.ValueChangeEventArguments[Any]) -> None:
        state.model = str(event.value)
        state.changed()

    field = ui.select(titles, value=model_of(state, names), label="Model", on_change=chosen)
    mark(field.props("dense outlined"), "model")


def submit(state: State, work: Any, title: str, given: dict[str, Any]) -> None:
    """Submit a job; what the same one gave before is replaced, and what failed is forgotten."""
    name = ""
    for job in [job for job in state.jobs.jobs.values() if job.kind == work.__name__]:
        same = {**job.given, "name": ""} == {**given, "name": ""}
        if same and job.active:
            return
        if same or job.state == "failed":
            name = str(job.given["name"]) if same else name
            state.jobs.forget(job.name)
    kind = {"review": "reviews", "estimate": "forces"}.get(work.__name__, "runs")
    name = name or state.workspace.new_name(kind, title)
    state.jobs.submit(work, title, **given, name=name)


def going(state: State, kinds: Sequence[str]) -> None:
    """Show the jobs of some kinds that wait or run, and those that failed until they are dismissed."""

    def end(name: str) -> None:
        (state.jobs.cancel if state.jobs.jobs[name].active else state.jobs.forget)(name)
        state.changed()

    for job in [job for job in state.jobs.jobs.values() if job.kind in kinds]:
        if job.active:
            with widgets.row(classes="spread"):
                ui.label(job.title)
                widgets.icon_button("close", f"Cancel {job.title}", partial(end, job.name))
            bar = ui.linear_progress(job.share, show_value=False)
            ui.timer(0.5, lambda bar=bar, job=job: bar.set_value(round(job.share, 2)))
        elif job.state == "failed":
            widgets.error_box(f"{job.title}: {job.message}")
            widgets.button(f"Dismiss {job.title}", partial(end, job.name))


# -- forces and logs ----------------------------------------------------------------------------------


def force(state: State, names: list[str]) -> None:
    """Ask for a model that gives a force, and a recording."""
    name = model_of(state, names)
    needed = {channel.name for channel in following.force_estimate(state.workspace, name).inputs}
    roles = {entry.name: entry.role for entry in state.workspace.entries()}
    fitting = [key for key, one in state.workspace.used().items() if needed <= {*one.channels}]
    fitting.sort(key=lambda key: roles[key] != "test")
    titles = {key: f"{key} ({roles[key]})" for key in fitting}
    with widgets.card("Force from what is measured"):
        ui.label(f"From {', '.join(sorted(needed))}.").classes("muted")
        with widgets.row(classes="fields"):
            select_model(state, names)
            if state.chosen.get("compensate.recording") not in titles:
                state.chosen["compensate.recording"] = next(iter(titles), None)
            field = ui.select(titles, label="Recording").props("dense outlined")
            mark(field.bind_value(state.chosen, "compensate.recording"), "recording")

        def start() -> None:
            recording = state.chosen["compensate.recording"]
            if not recording:
                raise DataError("no recording has what it needs", remedy="add one under Data")
            given = {"model": name, "recording": recording}
            submit(state, following.estimate, f"{name} {recording}", given)
            state.changed()

        with widgets.row(classes="spread"):
            ui.label("As JSON, C or FMU: under Take away.").classes("muted")
            mark(widgets.primary("Estimate", start, "play_arrow"), "estimate")


def estimated(state: State) -> None:
    """Show an estimate of force beside what was measured."""
    found = following.newest(state.workspace, "forces")
    with widgets.card("Estimated force"):
        going(state, ("estimate",))
        if not found:
            text = "Choose a recording and press Estimate: it is drawn beside what was measured."
            widgets.empty("speed", "A force without a load cell", text)
            return
        one = found[_newest_of(state, found, "force")]
        if one.get("rmse") is not None:
            share = f", {100 * one['rmse'] / one['span']:.1f} % of the range" if one["span"] else ""
            rmse, largest = (f"{number(one[key], 3)} {one['unit']}" for key in ("rmse", "largest"))
            text = f"RMSE {rmse}{share}; largest {largest}."
            mark(ui.label(text), "force-error")
        for note in one.get("notes", []):
            ui.label(said(note)).classes("muted")
        _curves(one, "force-plot")


def _newest_of(state: State, found: Mapping[str, Mapping[str, Any]], kind: str) -> str:
    """Let one of several results be chosen, the newest first; return which."""
    key = f"compensate.shown-{kind}"
    if state.chosen.get(key) not in found or state.chosen.get(f"{key}-of") != [*found]:
        state.chosen[key], state.chosen[f"{key}-of"] = next(iter(found)), [*found]
    if len(found) > 1:
        field = ui.select([*found], value=state.chosen[key], label="Result").props("dense outlined")
        field.on_value_change(lambda event: choose(state, key, event.value))
    return str(state.chosen[key])


def _curves(one: Mapping[str, Any], name: str) -> None:
    """Draw stored curves: values, and errors below them."""
    labels = (axis_label(one["output"], one["unit"]), axis_label("error", one["unit"]))
    panels = []
    for below, label in zip((False, True), labels, strict=True):
        curves = [
            Curve(np.array(c["x"], float), np.array(c["y"], float), c["name"], c["colour"])
            for c in one["curves"] if c["below"] == below
        ]  # fmt: skip
        if curves:
            panels.append(Panel("time [s]", label, tuple(curves)))
    (figure,) = interactive.plots(Drawing(tuple(panels), stacked=True))
    mark(widgets.plot_of(figure, height=420), name)


def log(state: State, names: list[str]) -> None:
    """Ask for the log of a loop, and what ran."""
    name = model_of(state, names)
    kinds = following.kinds(state.workspace, name)
    if state.chosen.get("compensate.form") not in kinds:
        state.chosen["compensate.form"] = next(iter(kinds))

    async def loaded(event: events.UploadEventArguments) -> None:
        from mckibben.files import read

        with state.workspace.receiving(event.file.name, event.file.size()) as (part, path):
            await event.file.save(part)
        found = await run.io_bound(lambda: read(path, informative=False))
        if not any(key.startswith("reference_") for one in found or [] for key in one.channels):
            problem, remedy = "it has no reference", "name a column reference_displacement_mm"
            raise DataError(problem, file=path, remedy=remedy)
        _look_back(state, path.name, name, state.chosen["compensate.form"], refit=False)

    with widgets.card("Back from the rig"):
        ui.label(
            "A table over time with what was wanted (reference_displacement), what was measured "
            "(displacement) and the measured pressure; command_pressure too, where there is one."
        ).classes("muted")
        with widgets.row(classes="fields"):
            select_model(state, names)
            field = ui.select(kinds, label="Ran as").props("dense outlined")
            field.bind_value(state.chosen, "compensate.form")
        endings = ".csv,.tsv,.txt,.parquet,.xlsx,.mat,.h5,.tdms"
        mark(widgets.upload("Drop the log here", loaded, endings), "log-file")


def _look_back(state: State, log: str, model: str, form: str, *, refit: bool) -> None:
    given = {"log": log, "model": model, "form": form, "refit": refit, "settings": {}}
    title = log.rpartition(".")[0] + " with refit" * refit
    submit(state, following.review, title, given)
    state.changed()


def reviewed(state: State) -> None:
    """Show where the error of a logged loop comes from."""
    found = following.newest(state.workspace, "reviews")
    with widgets.card("Where the error comes from"):
        going(state, ("review",))
        if not found:
            text = (
                "The log of a loop on your rig tells how much of the error is the model's, the "
                "actuator's, a delay, drift or a limit, and whether a refit helps."
            )
            widgets.empty("fact_check", "How did it go on the rig?", text)
            return
        name = _newest_of(state, found, "log")
        one = found[name]
        sizes = {
            "Achieved": one["achieved"],
            "Predicted for the commands": one.get("predicted"),
            "Of pressures beside the commands": one.get("pressure"),
            "Residual of the model": one.get("residual"),
        }
        rows = [[k, f"{number(v, 3)} {one['unit']}"] for k, v in sizes.items() if v is not None]
        mark(widgets.table(["Error", "RMS"], rows), "review")
        _curves(one, "review-plot")
        with widgets.row():
            if one.get("refitted"):
                widgets.button("Take the refit as a model", partial(_take_refit, state, name, one))
            else:
                log = str(one["log"]), str(one["model"]), str(one.get("form", "inverse"))
                again = partial(_look_back, state, *log, refit=True)
                mark(widgets.button("Try a refit with the log", again), "refit")
        with widgets.details("What it says"):
            for sentence in one["sentences"]:
                ui.label(said(sentence))


def _take_refit(state: State, name: str, one: Mapping[str, Any]) -> None:
    from mckibben.blocks.saving import load

    block = load(state.workspace.path("reviews", f"{name}-refit.json"))
    new = state.workspace.new_name("models", f"{one['model']}-refit")
    block.save(state.workspace.path("models", f"{new}.json"))
    state.model = new
    state.changed()
