"""Models: a leaderboard of those fitted, the one that is chosen beside it, and a drawer to fit more."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from nicegui import ui

from mckibben.app import modelling, widgets
from mckibben.app.background import later
from mckibben.app.pages import model_choice, parts
from mckibben.app.state import State, view
from mckibben.app.terms import message_of
from mckibben.app.widgets import mark
from mckibben.arrays import Array
from mckibben.channels import Channels
from mckibben.diagnosis.coupling import coupling
from mckibben.diagnosis.description import ModelDescription, describe
from mckibben.estimators.catalogue import full_name
from mckibben.numerals import number, typeset, typeset_within
from mckibben.recording import Recording
from mckibben.report import interactive, results, subjects
from mckibben.report.builder import Figure
from mckibben.report.columns import Column, columns_of
from mckibben.report.words import CAREFUL, CHOICES

TITLE = "Models"
ICON = "leaderboard"

FIGURES = {"loop": "loops", "time": "fit", "residual": "residuals"}
"""Tabs with a figure, and its kind."""

TABS = (*FIGURES, "parameters", "check")

HEIGHT = 380
"""Height of a figure [px]."""

MOST_ENDED = 6
"""Fits that did not work that are shown."""

BOARD_COLUMNS = ("chosen", "test")
"""Columns of the leaderboard; the report has all."""

OTHER_DATA = (
    "Those marked “other data” were fitted or tested on other recordings, or on these before they were "
    "changed: their errors do not compare."
)

Json = dict[str, Any]


def build(state: State) -> None:
    """Build the page."""
    with mark(ui.element("div").classes("page"), "page-models"):
        with widgets.row(classes="spread"):
            widgets.heading(
                "Models", "Fitted to the recordings for training, tested on others in simulation."
            )
            fit = widgets.primary("Fit models", partial(model_choice.choose, state), "add")
            mark(fit, "fit-models")
        preselect(state)
        fits(state)
        with ui.element("div").classes("columns"):
            with ui.element("div").classes("stack"):
                board(state)
            with ui.element("div").classes("stack"):
                closer(state)
        widgets.next_step(
            "Let the inverse of a model follow a reference.", "Compensate", "/compensate"
        )


@view
def preselect(state: State) -> None:
    """Choose the first model until one is picked, before the parts that show it are built."""
    rows = modelling.comparable(state.workspace, state.sides)
    if rows and not (state.chosen.get("models.picked") and state.model in state.workspace.models()):
        state.model = rows[0]["name"]


# -- fits that run, or did not work ----------------------------------------------------------------


@parts.steady("models", jobs=["fit"])
def fits(state: State) -> None:
    """Show the fits that wait, run or did not work; those that did are in the leaderboard."""
    jobs = parts.jobs_of(state, ["fit"])
    active, ended = [job for job in jobs if job.active], [job for job in jobs if not job.active]
    if not active and not state.workspace.models():
        _empty(state)
    if not jobs:
        return
    with widgets.card() as card:
        mark(card, "fits")
        with widgets.row(classes="spread"):
            text = f"Fitting, {len(active)} to go" if active else f"{len(ended)} did not finish"
            ui.label(text).classes("subtitle")
            if active:
                mark(widgets.button("Cancel all", partial(parts.end, state, active)), "cancel-all")
            else:
                with widgets.row():
                    again = partial(parts.again, state, ended, modelling.fit)
                    mark(widgets.button("Do again", again, "replay"), "again")
                    widgets.button("Clear", partial(parts.end, state, ended))
        for job in [
            *(job for job in active if job.state == "running"),
            *ended[: -MOST_ENDED - 1 : -1],
        ]:
            title = f"{full_name(job.title)} · {job.title}"
            parts.show_job(state, job, title)
        if waiting := [job.title for job in active if job.state == "waiting"]:
            more = f" and {len(waiting) - MOST_ENDED} more" if len(waiting) > MOST_ENDED else ""
            ui.label(f"Next: {', '.join(waiting[:MOST_ENDED])}{more}").classes("muted")


def _empty(state: State) -> None:
    title, text = (
        "Which model describes your muscle?",
        "“Fit models” lists those that apply to your recordings, and why others do not. Each is "
        "fitted in the background; here they are then compared, the best first.",
    )
    lacking = not any(entry.role == "train" for entry in state.workspace.entries())
    if lacking:
        title, text = (
            "Models need recordings",
            "Add at least one with the role Train. With another of the role Test, errors are on "
            "motion that no model has seen; else the last part is held out for that.",
        )
    with widgets.card(), widgets.empty("leaderboard", title, text):
        if lacking:
            ui.link("Add recordings →", "/")


# -- leaderboard -----------------------------------------------------------------------------------


@parts.steady("models", "results")
def board(state: State) -> None:
    """Show the models that compare, best first, and behind a fold-out those of other channels."""
    rows = modelling.comparable(state.workspace, state.sides)
    compared = [row["name"] for row in rows]
    others = [name for name in state.workspace.models() if name not in compared]
    if not rows and not others:
        return
    with widgets.card("Leaderboard") as card:
        mark(card, "leaderboard")
        if rows:
            columns = columns_of(rows, rows[0]["unit"], (), rows[0]["chosen_by"])
            shown = [column for column in columns if column.key in BOARD_COLUMNS]
            lines = []
            for row in rows:
                values = [column.value(row) for column in shown]
                texts = ["–" if value is None else value for value in values]
                lines.append([partial(_title, row), *texts])
            _choosable(state, ["Model", *(column.label for column in shown)], lines, compared)
            _remarks(rows, shown)
        else:
            ui.label("No model of these inputs and outputs is fitted yet.").classes("muted")
        if others:
            results = {row["name"]: row for row in state.workspace.results()}
            rows = [results.get(name, {}) for name in others]
            words = [f"{row.get('output', '')} {row.get('input', '')}" for row in rows]
            with widgets.details(f"{len(others)} of other channels, or not fitted here"):
                lines = [list(line) for line in zip(others, words, strict=True)]
                _choosable(state, ["Model", "Output, input"], lines, others)


def _choosable(state: State, heads: list[str], lines: list[list[Any]], names: list[str]) -> None:
    def pick(at: int) -> None:
        state.model, state.chosen["models.picked"] = names[at], True
        state.changed()

    chosen = names.index(state.model) if state.model in names else None
    widgets.table(heads, lines, chosen=chosen, on_choose=pick)


def _title(result: Json) -> None:
    with ui.element("div"):
        ui.label(full_name(result["model"]) + "*" * bool(result.get("doubted")))
        ui.label(result["name"] + " · other data" * (not result["current"])).classes("muted")


def _remarks(rows: list[Json], shown: Sequence[Column]) -> None:
    best = rows[0]
    if best["current"] and (constant := best.get("constant")):
        errors = [
            f"{column.heading} {typeset(column.text(constant))} {column.unit}".rstrip()
            for column in shown
        ]
        text = f"The mean of the output, to compare with: {', '.join(errors)}."
        ui.label(text).classes("muted")
    if why := modelling.against(rows):
        with mark(ui.element("div").classes("error"), "not-recommended"):
            ui.icon("info_outline")
            ui.label(typeset_within(message_of(why)))
    choice = CHOICES[best["chosen_by"]]
    notes = [f"Ordered by {choice[0]} ({choice[1]}), as the test is to judge, not to choose."]
    notes += [f"{best['split'][:1].upper()}{best['split'][1:]}."]
    notes += dict.fromkeys(why for row in rows for why in row.get("shared", ()))
    notes += [f"* {CAREFUL}."] * any(row.get("doubted") for row in rows)
    notes += [OTHER_DATA] * (not all(row["current"] for row in rows))
    ui.label(typeset_within(message_of(" ".join(notes)))).classes("muted")


# -- the model that is chosen ----------------------------------------------------------------------


@parts.steady("models", "results", jobs=["check"])
def closer(state: State) -> None:
    """Show the model that is chosen, in tabs."""
    sides, workspace, name = state.sides, state.workspace, state.model
    if name not in workspace.models():
        return
    row = workspace.read("results", name) or {}
    tab = state.chosen.get("models.tab", TABS[0])

    def choose(event: Any) -> None:
        state.chosen["models.tab"] = event.value
        closer.refresh()

    with widgets.card() as card:
        mark(card, "closer")
        with widgets.row(classes="spread"):
            with ui.element("div").classes("grow"):
                title = f"{full_name(row['model'])} · {name}" if row.get("model") else name
                ui.label(title).classes("subtitle").props('role=heading aria-level="3"')
                ui.label(_summary(row)).classes("muted")
            delete = partial(_delete, state)
            mark(widgets.icon_button("delete_outline", f"Delete {name}", delete), "delete-model")
        parts.warn_of_other_data(state, name)
        with ui.tabs(value=tab, on_change=choose).props(
            "dense no-caps align=left active-color=primary indicator-color=primary"
        ):
            for key in TABS:
                mark(ui.tab(key, key.capitalize()), f"tab-{key}")
        if tab == "check":
            _check(state, row)
        elif tab == "parameters":
            _show_parameters(state, sides)
        else:
            _show_figure(state, tab, sides)


def _summary(row: Json) -> str:
    if not row.get("test"):
        return "Not fitted here."
    test, unit = row["test"], row.get("unit", "")
    text = f"Test RMSE {number(test['rmse'], 3)} {unit}"
    if ends := test.get("rmse_interval"):
        text += f" ({number(ends[0], 2)} to {number(ends[1], 2)} in 95 %)"
    inverse = model_choice.INVERSES.get(row.get("inverse") or "", "")
    about = [text, inverse, f"{row.get('n_parameters')} parameters"]
    return typeset_within(" · ".join(filter(None, about)))


def _delete(state: State) -> None:
    model = state.model

    def delete() -> None:
        for kind in ("models", "results"):
            state.workspace.delete(kind, model)
        state.chosen.pop("models.picked", None)
        state.changed()

    text = "The model and its results are deleted; what was exported of it stays."
    widgets.sure(f"Delete {model}?", text, delete)


def _show_parameters(state: State, sides: Channels) -> None:
    """Show equations and parameters of the chosen model, from the recordings that it was fitted to."""
    workspace, runs = state.workspace, _drawable_runs(state, sides)
    if not runs:
        return
    block = workspace.model(state.model)
    names = {channel.name for channel in (*block.inputs, *block.outputs)}
    fitted = [run for run in workspace.with_role("train") if names <= {*run.channels}]
    on = fitted or [run for run, *_ in runs.values()]
    describing = partial(describe, block, on, fitted=bool(fitted))
    later(("parameters", *_model_key(state)), describing, _parameters, height=HEIGHT)


def _show_figure(state: State, tab: str, sides: Channels) -> None:
    """Draw the chosen model, and others beside it, on a recording."""
    workspace, name = state.workspace, state.model
    runs = _drawable_runs(state, sides)
    if not runs:
        return
    block = workspace.model(name)
    outputs = [channel.name for channel in block.outputs]
    with widgets.row():
        uses = {key: f"{key} ({use})" for key, (*_, use) in runs.items()}
        run, tested, _ = runs[_select(state, "run", "Recording", uses)]
        output = _select(state, "output", "Output", {key: key for key in outputs})
        models = [name, *_beside(state)]
    inputs = [channel.name for channel in block.inputs]
    driving = [key for key in sides.inputs if key in inputs] or inputs[:1]
    pair = coupling([run], driving, [output]).pairs([run])[0]

    def simulate() -> dict[str, Recording]:
        return {model: workspace.model(model).simulate(run) for model in models}

    def show(simulated: Mapping[str, Recording]) -> None:
        curves = {model: recording[output] for model, recording in simulated.items()}
        plots = interactive.plots(subjects.against(FIGURES[tab], run, pair, curves, tested))
        with ui.element("div").classes("columns-even" if len(plots) > 1 else "stack"):
            for plot in plots:
                mark(widgets.plot_of(plot, height=HEIGHT), f"closer-{tab}")
        ui.label(_errors_text(run, output, curves, tested)).classes("muted")

    later(("free", *_model_key(state), *models[1:], run.name), simulate, show, height=HEIGHT)


def _drawable_runs(state: State, sides: Channels) -> dict[str, tuple[Recording, int | None, str]]:
    """Return the recordings with all channels of the chosen model; say so where there are none."""
    block = state.workspace.model(state.model)
    names = {channel.name for channel in (*block.inputs, *block.outputs)}
    parts_of_data = modelling.parts(state.workspace, sides).items()
    runs = {key: part for key, part in parts_of_data if names <= {*part[0].channels}}
    if not runs:
        ui.label(f"No recording has {', '.join(sorted(names))}.").classes("muted")
    return runs


def _model_key(state: State) -> tuple[Any, ...]:
    """Return what all that is drawn of the chosen model depends on."""
    return state.workspace.digest(), parts.stamps(state.workspace, "models", of=state.model)


def _select(state: State, what: str, label: str, options: dict[str, str]) -> str:
    """Let one of several options be chosen; a single one needs no control."""
    if len(options) == 1:
        return next(iter(options))
    return parts.select(state, f"models.closer-{what}", options, label, closer.refresh)


def _errors_text(
    run: Recording, output: str, curves: Mapping[str, Array], tested: int | None
) -> str:
    """Return the RMSE of every model from the first sample that is tested on, in a sentence."""
    rows, unit = slice(tested or 0, None), run.units[output]
    errors = [
        f"{model} {number(np.sqrt(np.mean((y - run[output])[rows] ** 2)), 3)} {unit}".rstrip()
        for model, y in curves.items()
    ]
    on = f"{'the held-out part of ' if tested else ''}{run.name}"
    return typeset_within(f"RMSE of {output} on {on}: {', '.join(errors)}.")


def _beside(state: State) -> list[str]:
    """Let other models of the same channels be drawn beside the chosen one; return which are."""
    rows = modelling.comparable(state.workspace, state.sides)
    others = [row["name"] for row in rows if row["name"] != state.model]
    names_beside = [name for name in state.chosen.get("models.beside", ()) if name in others]

    def draw_beside(names: list[str]) -> None:
        state.chosen["models.beside"] = names
        closer.refresh()

    if others:
        mark(parts.several("Beside", others, names_beside, draw_beside), "closer-beside")
    return names_beside


def _parameters(description: ModelDescription) -> None:
    with mark(ui.element("div").classes("stack"), "parameters"):
        widgets.items(results.description(description))


CHECK = (
    "Validate the model",
    "Residuals are tested for dependence on speed, load, creep, hysteresis, lags and drift.",
)


def _check(state: State, row: Json) -> None:
    content: Mapping[str, Any] = row.get("check") or {}
    if not content:
        _work(state, modelling.check, "Check it", "fact_check", CHECK)
        return
    items = modelling.restored(content)
    with mark(ui.element("div").classes("stack"), "verdict"):
        widgets.items([item for item in items if not isinstance(item, Figure)])
    if figures := [item for item in items if isinstance(item, Figure)]:
        with widgets.details("What the residual follows"):
            widgets.items(figures)
    data_used = "the test recordings" if content["on"] == "test" else "its training recordings"
    outdated = "" if content["data"] == state.workspace.digest() else ", as they were"
    ui.label(f"Checked on {data_used}{outdated}.").classes("muted")
    _work(state, modelling.check, "Check again", "fact_check")


def _work(
    state: State,
    work: Callable[..., str],
    text: str,
    icon: str,
    about: tuple[str, str] | None = None,
) -> None:
    """Show a button for a job on the model, and what it is for; while it runs, that it does."""
    jobs = parts.jobs_of(state, [work.__name__])
    own_jobs = [job for job in jobs if job.given.get("name") == state.model]

    def start() -> None:
        state.jobs.forget_ended(work.__name__)
        state.jobs.submit(work, f"{work.__name__} {state.model}", name=state.model)
        state.changed()

    for job in own_jobs[-1:]:
        parts.show_job(state, job)
    if not any(job.active for job in own_jobs):
        with widgets.empty(icon, *about) if about else widgets.row():
            mark(widgets.button(text, start, icon), work.__name__)
