"""Models: a leaderboard of those fitted, the one that is chosen beside it, and a drawer to fit more."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from nicegui import ui

from mckibben.app import modelling, widgets
from mckibben.app.jobs import Job
from mckibben.app.later import later
from mckibben.app.pages import choosing
from mckibben.app.state import State, view
from mckibben.app.terms import said
from mckibben.app.widgets import mark
from mckibben.arrays import Array
from mckibben.blocks.bands import Banded
from mckibben.blocks.base import Block
from mckibben.comparison.channels import Channels
from mckibben.estimators.catalogue import caution, full_name
from mckibben.numerals import number, numeral, typeset, typeset_within
from mckibben.recording import Recording

TITLE = "Models"
ICON = "leaderboard"

TABS = {
    "loop": "Loop",
    "time": "Time",
    "residual": "Residual",
    "parameters": "Parameters",
    "band": "Band",
    "check": "Check",
}

HEIGHT = 380
"""Of a figure [px]."""

ENDED = 6
"""Fits that did not work that are shown."""

FIRST = 12
"""Parameters that are shown before a fold-out."""

OTHER_DATA = (
    "Those marked “other data” were fitted or tested on recordings that have changed since, so that "
    "their errors do not compare: fit them again."
)

Json = dict[str, Any]
Part = tuple[Recording, int | None, str]


def build(state: State) -> None:
    """Build the page."""
    with mark(ui.element("div").classes("page"), "page-models"):
        with widgets.row(classes="spread"):
            widgets.heading(
                "Models", "Fitted to recordings for training, tested on others, running free."
            )
            fit = widgets.primary("Fit models", partial(choosing.choose, state), "add")
            mark(fit, "fit-models")
        fits(state)
        content(state)


# -- fits that run, or did not work ----------------------------------------------------------------


@view
def fits(state: State) -> None:
    """Show the fits that wait, run or did not work; those that did are in the leaderboard."""
    jobs = [job for job in state.jobs.jobs.values() if job.kind == "fit" and job.state != "done"]
    active = [job for job in jobs if job.active]
    ended = [job for job in reversed(jobs) if not job.active]
    if not jobs:
        return
    with widgets.card() as card:
        mark(card, "fits")
        with widgets.row(classes="spread"):
            ui.label(f"Fitting, {len(active)} to go" if active else "Did not work").classes(
                "subtitle"
            )
            if len(active) > 1:
                mark(widgets.button("Cancel all", partial(_end, state, active)), "cancel-all")
            if not active:
                widgets.button("Clear", partial(_end, state, ended))
        for job in [*(job for job in active if job.state == "running"), *ended[:ENDED]]:
            _fit(state, job)
        if waiting := [job for job in active if job.state == "waiting"]:
            with widgets.row():
                ui.label("Next:").classes("muted")
                for job in waiting:
                    button = widgets.button(job.title, partial(_end, state, [job]))
                    widgets.labelled(button.props("icon-right=close"), f"Cancel {job.title}")
                    mark(button, f"cancel-{job.title}")


def _end(state: State, jobs: Sequence[Job]) -> None:
    for job in reversed(jobs):  # those that wait first, or they would begin
        (state.jobs.cancel if job.active else state.jobs.forget)(job.name)
        if job.state == "cancelled":
            state.jobs.forget(job.name)
    state.changed()


def _fit(state: State, job: Job) -> None:
    def again() -> None:
        state.jobs.forget(job.name)
        given = {name: value for name, value in job.given.items() if name != "title"}
        state.jobs.submit(modelling.fit, job.title, **given)
        state.changed()

    with widgets.row(classes="spread"):
        with ui.element("div").classes("grow"):
            ui.label(f"{full_name(job.title)} · {job.title}")
            if not job.active:
                ui.label(said(job.message or job.state)).classes("muted")
        if not job.active:
            widgets.icon_button("replay", f"Fit {job.title} again", again)
        else:
            bar = ui.linear_progress(value=job.share, show_value=False, color="primary")
            share = ui.label().classes("muted")

            def tell() -> None:
                bar.set_value(round(job.share, 3))
                share.set_text(f"{100 * job.share:.0f} %")

            bar.classes("meter").props('aria-label="Progress"')
            tell()
            ui.timer(0.3, tell)
        text = f"Cancel {job.title}" if job.active else f"Take {job.title} off the list"
        mark(widgets.icon_button("close", text, partial(_end, state, [job])), f"cancel-{job.title}")


# -- leaderboard -----------------------------------------------------------------------------------


@view
def content(state: State) -> None:
    """Show the leaderboard with the model that is chosen, or what to do without any."""
    workspace = state.workspace
    if not workspace.models():
        _empty(state)
        return
    sides = modelling.sides_of(workspace, state.inputs, state.outputs, state.load)
    results = modelling.comparable(workspace, sides)
    if results and not (state.chosen.get("models.picked") and state.model in workspace.models()):
        state.model = results[0]["name"]
    with ui.element("div").classes("columns"):
        with ui.element("div").classes("stack"):
            _board(state, sides, results)
        with ui.element("div").classes("stack"):
            if state.model:
                _closer(state, sides)
    if results:
        with widgets.details("All figures of all models"):
            _figures(results, sides)
        widgets.next_step(
            "One is good enough? Let it follow a reference.", "Compensate", "/compensate"
        )


def _empty(state: State) -> None:
    if not state.workspace.with_role("train"):
        with (
            widgets.card(),
            widgets.empty(
                "leaderboard",
                "Models need recordings",
                "Add at least one with the role Train. With another of the role Test, errors are on "
                "motion that no model has seen; else the last part is held out for that.",
            ),
        ):
            ui.link("Add recordings →", "/")
    elif not any(job.active for job in state.jobs.jobs.values()):
        with (
            widgets.card(),
            widgets.empty(
                "leaderboard",
                "Which model describes your muscle?",
                "“Fit models” lists those that apply to your recordings, and why others do not. Each is "
                "fitted in the background; here they are then compared, the best first.",
            ),
        ):
            pass


def _pick(state: State, name: str) -> None:
    state.model, state.chosen["models.picked"] = name, True
    state.changed()


def _board(state: State, sides: Channels, results: list[Json]) -> None:
    from mckibben.report.columns import columns_of
    from mckibben.report.words import CAREFUL

    shared = dict.fromkeys(why for row in results for why in row.get("shared", ()))
    with widgets.card("Leaderboard") as card:
        mark(card, "leaderboard")
        if results:
            first = results[0]
            shown = columns_of(results, first["unit"], (), first["chosen_by"])
            shown = tuple(one for one in shown if one.key in ("chosen", "test"))
            rows = [[partial(_title, row), *(_error(one, row) for one in shown)] for row in results]
            names = [row["name"] for row in results]
            chosen = names.index(state.model) if state.model in names else None

            heads = ["Model", *(one.label for one in shown)]
            widgets.table(heads, rows, chosen=chosen, on_choose=lambda at: _pick(state, names[at]))
            if first["current"] and (mean := first.get("constant")):
                errors = ", ".join(
                    f"{one.heading} {typeset(one.text(mean))} {one.unit}" for one in shown
                )
                ui.label(f"To be beaten: the mean of the output, {errors}.").classes("muted")
            if why := modelling.against(results):
                mark(_warning(why), "not-recommended")
            notes = [f"{first['split'][:1].upper()}{first['split'][1:]}.", *shared]
            notes += [f"* {CAREFUL}."] * any(caution(row["model"]) for row in results)
            notes += [OTHER_DATA] * (not all(row["current"] for row in results))
            ui.label(typeset_within(said(" ".join(notes)))).classes("muted")
        else:
            ui.label("No model of these inputs and outputs is fitted yet.").classes("muted")
        _others(state, results)


def _error(column: Any, row: Json) -> float | str:
    value = column.value(row)
    return column.flag(row) or ("–" if value is None else float(value))


def _title(row: Json) -> None:
    with ui.element("div"):
        ui.label(full_name(row["model"]) + "*" * bool(caution(row["model"])))
        ui.label(row["name"] + " · other data" * (not row["current"])).classes("muted")


def _others(state: State, results: list[Json]) -> None:
    """Show models of other channels, and those that were not fitted here."""
    known = {row["name"] for row in results}
    others = [name for name in state.workspace.models() if name not in known]
    if not others:
        return
    with widgets.details(f"{len(others)} of other channels, or not fitted here"):
        about = {row["name"]: row for row in state.workspace.results()}
        rows: list[list[Any]] = []
        for name in others:
            row = about.get(name, {})
            of = f"{row['output']} of {row['input']}" if row else ""
            of += f", load {row['load']}" if row.get("load") else ""
            rows.append([partial(ui.label, name), of])
        chosen = others.index(state.model) if state.model in others else None
        widgets.table(
            ["Model", "Of"], rows, chosen=chosen, on_choose=lambda at: _pick(state, others[at])
        )


def _figures(results: list[Json], sides: Channels) -> None:
    from mckibben.report.columns import columns_of

    found = columns_of(results, results[0]["unit"], sides.outputs, results[0]["chosen_by"])
    rows = [
        [row["name"], *(f"{typeset(one.text(row))} {one.flag(row)}".strip() for one in found)]
        for row in results
    ]
    widgets.table(["Model", *(one.label for one in found)], rows)
    ui.label(
        "Width reproduced: 100 % where rising and falling branches are as far apart as measured. "
        "Inverse: exact by a formula, solved in every step, or none."
    ).classes("muted")


def _warning(text: str) -> Any:
    with ui.element("div").classes("error") as found:
        ui.icon("info_outline")
        ui.label(typeset_within(said(text)))
    return found


# -- the model that is chosen ----------------------------------------------------------------------


@ui.refreshable  # by itself when a tab is chosen, and with all of the content else
def _closer(state: State, sides: Channels) -> None:
    """Show the model that is chosen in tabs, perhaps beside another."""
    workspace, name = state.workspace, state.model
    row = workspace.read("results", name) or {}
    tab = state.chosen.get("models.tab", "loop")

    def choose_tab(event: Any) -> None:
        state.chosen["models.tab"] = event.value
        _closer.refresh()

    with widgets.card() as card:
        mark(card, "closer")
        with widgets.row(classes="spread"):
            with ui.element("div").classes("grow"):
                title = f"{full_name(row['model'])} · {name}" if row.get("model") else name
                ui.label(title).classes("subtitle").props('role=heading aria-level="3"')
                ui.label(_summary(row)).classes("muted")
            delete = widgets.icon_button(
                "delete_outline", f"Delete {name}", partial(_delete, state)
            )
            mark(delete, "delete-model")
        tabs = ui.tabs(value=tab, on_change=choose_tab).props(
            "dense no-caps align=left active-color=primary indicator-color=primary"
        )
        with tabs:
            for key, label in TABS.items():
                mark(ui.tab(key, label), f"tab-{key}")
        runs = modelling.parts(workspace, sides)
        if tab == "parameters":
            later(
                ("parameters", *_version(state, name)), lambda: workspace.model(name), _parameters
            )
        elif tab == "check":
            _check(state, row)
        elif runs:
            _drawn(state, tab, sides, runs, row)


def _version(state: State, *names: str) -> tuple[Any, ...]:
    """Return what changes when models do."""
    paths = [
        state.workspace.path(kind, f"{n}.json") for n in names for kind in ("models", "banded")
    ]
    return names + tuple(path.stat().st_mtime_ns if path.is_file() else 0 for path in paths)


def _summary(row: Json) -> str:
    if not row.get("test"):
        return "Not fitted here."
    unit, parameters = row.get("unit", ""), row.get("n_parameters")
    test = row["test"]["rmse"]
    ends = row["test"].get("rmse_interval")
    text = f"Test RMSE {number(test, 3)} {unit}"
    text += f" ({number(ends[0], 2)} to {number(ends[1], 2)} in 95 %)" if ends else ""
    inverse = {"exact": "exact inverse", "solved": "inverse by solving", "none": "no inverse"}
    parts = [text, inverse.get(row.get("inverse") or "", ""), f"{parameters} parameters"]
    return typeset_within(" · ".join(filter(None, parts)))


def _delete(state: State) -> None:
    name = state.model

    def delete() -> None:
        for kind in ("models", "banded", "results"):
            state.workspace.delete(kind, name)
        state.chosen.pop("models.picked", None)
        sure.close()
        state.changed()

    with widgets.dialog(f"Delete {name}?") as sure:
        ui.label("The model and its results are deleted; what was exported of it stays.")
        mark(widgets.primary("Delete", delete), "delete-sure")


def _drawn(state: State, tab: str, sides: Channels, runs: Mapping[str, Part], row: Json) -> None:
    """Show the model, and perhaps another, on a recording."""
    workspace, name = state.workspace, state.model
    block: Block = workspace.model(name)
    outputs = [channel.name for channel in block.outputs]
    needed = {*outputs, *(channel.name for channel in block.inputs)}
    runs = {key: one for key, one in runs.items() if needed <= {*one[0].channels}}
    if not runs:
        ui.label(f"No recording has {', '.join(sorted(needed))}.").classes("muted")
        return
    alike = [row["name"] for row in modelling.comparable(workspace, sides)]
    alike = [each for each in alike if each != name] if name in alike else []
    keys = {"models.run": [*runs], "models.output": outputs, "models.other": ["", *alike]}
    chosen: dict[str, str] = {
        key: str(state.chosen[key]) if state.chosen.get(key) in known else known[0]
        for key, known in keys.items()
    }

    def field(key: str, label: str, options: dict[str, str]) -> None:
        def pick(event: Any) -> None:
            state.chosen[key] = event.value
            _closer.refresh()

        found = ui.select(options, value=chosen[key], label=label, on_change=pick)
        mark(found.props("dense outlined"), key.replace("models.", "closer-"))

    with widgets.row():
        if len(runs) > 1:
            uses = {key: f"{key} ({use})" for key, (_, _, use) in runs.items()}
            field("models.run", "Recording", uses)
        if len(outputs) > 1:
            field("models.output", "Output", {each: each for each in outputs})
        if alike and tab != "band":
            field("models.other", "Beside", {"": "No other"} | {each: each for each in alike})
    names = [name, *([chosen["models.other"]] if chosen["models.other"] and tab != "band" else [])]
    run, tested, _ = runs[chosen["models.run"]]
    wanted = chosen["models.output"]
    place = outputs.index(wanted)
    train = workspace.with_role("train")
    if tab == "band" and not workspace.path("banded", f"{name}.json").is_file():
        _no_band(state)
        return
    key = *_version(state, *names), run.name, workspace.digest(), outputs

    def free() -> dict[str, Array]:
        from mckibben.blocks.free_run import run_free

        blocks = {each: workspace.model(each) for each in names}
        return {each: run_free(one, run, outputs, train) for each, one in blocks.items()}

    def show(found: Mapping[str, Array]) -> None:
        modelled = {each: values[:, place] for each, values in found.items()}
        given = _driving(sides, block, run, wanted)
        figures = _figures_of(tab, run, given, wanted, modelled, tested)
        ends = _shade(state, figures[0], run, found[name], place) if tab == "band" else None
        with ui.element("div").classes("columns-even" if len(figures) > 1 else "stack"):
            for figure in figures:
                mark(widgets.plot_of(figure, height=HEIGHT), f"closer-{tab}")
        rows = slice(tested or 0, None)
        off = [
            f"{each} {number(float(np.sqrt(np.mean((y[rows] - run[wanted][rows]) ** 2))), 3)}"
            for each, y in modelled.items()
        ]
        unit = run.units[wanted]
        what = "the held-out part of " if tested else ""
        text = f"RMSE of {wanted} on {what}{run.name}: {', '.join(off)} {unit}."
        mark(ui.label(typeset_within(text)).classes("muted"), "closer-on")
        if ends is not None:
            inside = (ends[0] <= run[wanted]) & (run[wanted] <= ends[1])
            text = f"The band holds {100 * inside[rows].mean():.0f} % of these samples"
            text += (
                f"; its half width is {number(float(np.mean(ends[1] - ends[0])) / 2, 2)} {unit}."
            )
            mark(ui.label(typeset_within(text)), "closer-band")
            for sentence in row.get("calibrated", ()):
                ui.label(typeset_within(said(sentence))).classes("muted")
            _calibrate_button(state, "Calibrate again")

    later(("free", *map(str, key)), free, show, height=HEIGHT)


def _driving(sides: Channels, block: Block, run: Recording, wanted: str) -> str:
    """Return what an output is drawn over."""
    from mckibben.diagnosis.coupling import coupling

    named = [channel.name for channel in block.inputs]
    inputs = [name for name in sides.inputs if name in named] or named[:1]
    return coupling([run], inputs, [wanted]).pairs([run])[0][0]


def _figures_of(
    tab: str,
    run: Recording,
    given: str,
    wanted: str,
    modelled: Mapping[str, Array],
    tested: int | None,
) -> list[Json]:
    from mckibben.report import interactive, subjects

    kind = {"loop": "loops", "time": "fit"}.get(tab, "residuals")
    drawing = subjects.against(kind, run, (given, wanted), modelled, tested)
    return interactive.plots(drawing)[-1 if tab == "band" else 0 :]


def _shade(
    state: State, figure: Json, run: Recording, modelled: Array, place: int
) -> tuple[Array, Array] | None:
    """Shade the band behind the residual over time, and return its ends."""
    from mckibben.report.drawing import POINTS, over_time
    from mckibben.report.interactive import packed

    banded = state.workspace.model(state.model, "banded")
    if not isinstance(banded, Banded):
        return None
    found = banded.band.simulate(modelled, sample_time=run.sample_time)
    low, high = found.reshape(*modelled.shape, 3)[:, place, 1:].T
    ends = (end - modelled.reshape(len(run), -1)[:, place] for end in (low, high))
    (t, lower), (back, upper) = (over_time(run.time, end, POINTS) for end in ends)
    trace = {"type": "scatter", "mode": "lines", "name": "band", "fill": "toself", "opacity": 0.3}
    trace |= {"x": packed(np.append(t, back[::-1])), "y": packed(np.append(lower, upper[::-1]))}
    trace |= {"fillcolor": "--series-1", "line": {"width": 0}, "hoverinfo": "skip"}
    figure["data"].insert(0, trace)
    return low, high


def _submitted(state: State, work: Callable[..., str]) -> None:
    for job in [j for j in state.jobs.jobs.values() if j.kind == work.__name__ and not j.active]:
        state.jobs.forget(job.name)
    state.jobs.submit(work, f"{work.__name__} {state.model}", name=state.model)
    state.changed()


def _work_button(state: State, text: str, work: Callable[..., str], icon: str) -> None:
    """Show a button that does something with the model; while that runs, how it does."""
    jobs = [job for job in state.jobs.jobs.values() if job.kind == work.__name__]
    mine = [job for job in jobs if job.given.get("name") == state.model]
    if any(job.active for job in mine):
        with widgets.row():
            ui.spinner(size="20px")
            ui.label("At work …").classes("muted")
        return
    if mine and mine[-1].state == "failed":
        widgets.error_box(mine[-1].message)
    with widgets.row():
        mark(widgets.button(text, partial(_submitted, state, work), icon), work.__name__)


def _calibrate_button(state: State, text: str) -> None:
    _work_button(state, text, modelling.calibrate, "straighten")


def _no_band(state: State) -> None:
    with widgets.empty(
        "straighten",
        "How far off may it be?",
        "A band around the model's output holds a share of the samples of new recordings, such as 90 %. "
        "It is calibrated on the test recordings.",
    ):
        _calibrate_button(state, "Calibrate a band")


def _check(state: State, row: Json) -> None:
    found = row.get("check")
    if not found:
        with widgets.empty(
            "fact_check",
            "Is the model right?",
            "What it leaves over is tested for what it may have missed: speed, load, creep, hysteresis, "
            "lags and drift.",
        ):
            _work_button(state, "Check it", modelling.check, "fact_check")
        return
    on = "the test recordings" if found["on"] == "test" else "its training recordings"
    old = "" if found["data"] == state.workspace.digest() else ", as they were"
    mark(ui.label(typeset_within(found["verdict"])), "verdict")
    for sentence in found["sentences"]:
        ui.label(typeset_within(said(sentence)))
    ui.label(f"Checked on {on}{old}.").classes("muted")
    _work_button(state, "Check again", modelling.check, "fact_check")


def _parameters(block: Block) -> None:
    from mckibben.blocks.equations import quantities

    rows = [
        [one.name, typeset(numeral(value, 4)), one.unit, one.meaning]
        for one, value in zip(quantities(block), block.pack().tolist(), strict=True)
    ]
    heads = ["Parameter", "Value", "Unit", "What it is"]
    mark(widgets.table(heads, rows[:FIRST]), "parameters")
    if rows[FIRST:]:
        with widgets.details(f"{len(rows) - FIRST} more"):
            widgets.table(heads, rows[FIRST : FIRST + 500])
