"""The other tabs of Compensate, estimates of force and reviews of logs, and what all tabs share."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from nicegui import events, run, ui

from mckibben.app import following, widgets
from mckibben.app.later import later
from mckibben.app.state import State
from mckibben.app.widgets import mark
from mckibben.errors import DataError
from mckibben.recording import Recording
from mckibben.report.drawing import Curve, Drawing, Panel, axis_label, over_time

Course = tuple[Any, Any, str, str, Any]
"""Times, values, name, colour and style of a curve."""


def drawing(panels: Sequence[tuple[str, Sequence[Course]]]) -> Drawing:
    """Return curves over time in panels below each other; a name is in the legend once."""
    drawn, named = [], set[str]()
    for label, courses in panels:
        curves = [
            Curve(*over_time(time, y), name * (name not in named), colour, style)
            for time, y, name, colour, style in courses
        ]
        named |= {course[2] for course in courses}
        drawn.append(Panel("time [s]", label, tuple(curves)))
    return Drawing(tuple(drawn), stacked=True)


def model_of(state: State, names: Sequence[str]) -> str:
    """Return the model that is chosen, or else the first of some."""
    return state.model if state.model in names else names[0]


def select_model(state: State, names: Sequence[str]) -> None:
    """Let one of some models be chosen."""
    first = next(iter(state.workspace.models()), "")
    titles = {x: f"{x} (first of the leaderboard)" * (x == first) or x for x in names}

    def chosen(event: events.ValueChangeEventArguments[Any]) -> None:
        state.model = str(event.value)
        state.changed()

    field = ui.select(titles, value=model_of(state, names), label="Model", on_change=chosen)
    mark(field.props("dense outlined"), "model")


def select(
    state: State, key: str, options: dict[str, str], label: str, changed: Callable[[], Any]
) -> str:
    """Let one of some options be chosen, the first by default; return which is."""
    key = f"compensate.{key}"
    if state.chosen.get(key) not in options:
        state.chosen[key] = next(iter(options), "")
    field = ui.select(options, label=label).bind_value(state.chosen, key).props("dense outlined")
    mark(field, key.partition(".")[2]).on_value_change(lambda _: changed())
    return str(state.chosen[key])


def submit(
    state: State, work: Any, kind: str, title: str, asked: dict[str, Any], **more: Any
) -> None:
    """Submit a job that writes a result of a kind, in place of one of the same; forget failed ones."""
    for job in [job for job in state.jobs.jobs.values() if job.kind == work.__name__]:
        if job.active and job.given["asked"] == asked:
            return
        if job.state == "failed":
            state.jobs.forget(job.name)
    before = following.newest(state.workspace, kind).items()
    same = (
        [name for name, one in before if all(one.get(key) == x for key, x in asked.items())]
        if not more
        else []
    )
    name = next(iter(same), "") or state.workspace.new_name(kind, title)
    state.jobs.submit(work, title, name=name, asked=asked, **more)
    state.changed()


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
    """Ask for a model that gives a force, and for a recording."""
    workspace, name = state.workspace, model_of(state, names)
    block = following.made(workspace, name, "force", {})
    needed = {channel.name for channel in block.inputs}
    used = workspace.used()
    roles = {x.name: f"{x.name} ({x.role})" for x in workspace.entries() if x.name in used}
    given = [channel.name for channel in block.outputs]  # recordings that have it come first
    order = sorted(roles, key=lambda key: (given[0] not in used[key], "(test)" not in roles[key]))
    fitting = {key: roles[key] for key in order if needed <= {*used[key].channels}}
    with widgets.card("Force from what is measured"):
        text = f"From {', '.join(sorted(needed))}. As JSON, C or FMU: under Take away."
        ui.label(text).classes("muted")
        with widgets.row(classes="fields"):
            select_model(state, names)
            select(state, "recording", fitting, "Recording", state.changed)


def estimated(state: State) -> None:
    """Show a force that is estimated over a recording, beside what was measured."""
    from mckibben.report import results

    workspace = state.workspace
    name = model_of(state, following.having(workspace, "force"))
    recording = str(state.chosen.get("compensate.recording") or "")

    def show(found: Any) -> None:
        widgets.items(results.simulation(found))
        run, block = found.recording, following.made(workspace, name, "force", {})
        for key, unit in {channel.name: channel.unit for channel in block.outputs}.items():
            values = run[f"{key}_model"]
            courses: list[Course] = [(run.time, values, "estimated", "series-1", "line")]
            panels = [(axis_label(key, unit), courses)]
            if key in run:
                courses.insert(0, (run.time, run[key], "measured", "measured", "broad"))
                error = (run.time, run[key] - values, "error", "series-2", "line")
                panels.append((axis_label("error", unit), [error]))
            (plot,) = widgets.plot(drawing(panels), height=420)
            mark(plot, "force-plot")

    with widgets.card("Estimated force"):
        if recording:
            version = workspace.path("models", f"{name}.json").stat().st_mtime_ns
            later(
                ("force", name, version, recording, workspace.digest()),
                lambda: following.estimate(workspace, name, recording),
                show,
                height=420,
            )
        else:
            text = (
                "A recording with all that it is made from is drawn here, beside what was measured."
            )
            widgets.empty("speed", "A force without a load cell", text)


def log(state: State, names: list[str]) -> None:
    """Ask for the log of a loop, and what ran."""
    name = model_of(state, names)

    async def loaded(event: events.UploadEventArguments) -> None:
        path, found = await received(state, event)
        if not any(key.startswith("reference_") for key in found.channels):
            problem, remedy = "it has no reference", "name a column reference_displacement_mm"
            raise DataError(problem, file=path, remedy=remedy)
        asked = {"log": path.name, "model": name, "form": state.chosen["compensate.form"]}
        submit(state, following.review, "reviews", path.stem, asked)

    with widgets.card("Back from the rig"):
        ui.label(
            "A table over time with what was wanted (reference_displacement), what was measured "
            "(displacement) and the measured pressure; command_pressure too, where there is one."
        ).classes("muted")
        with widgets.row(classes="fields"):
            select_model(state, names)
            uses = following.uses(state.workspace, name)
            forms = {form: words for form, words in following.KINDS.items() if form in uses}
            select(state, "form", forms, "Ran as", state.changed)
        endings = ".csv,.tsv,.txt,.parquet,.xlsx,.mat,.h5,.tdms"
        mark(widgets.upload("Drop the log here", loaded, endings), "log-file")


async def received(state: State, event: events.UploadEventArguments) -> tuple[Any, Recording]:
    """Return where an uploaded file is, and its first recording."""
    from mckibben.files import read

    with state.workspace.receiving(event.file.name, event.file.size()) as (part, path):
        await event.file.save(part)
    found = await run.io_bound(lambda: read(path, informative=False))
    if not found:
        raise DataError("it has no recording", file=path, remedy="give another file")
    return path, found[0]


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
        known = {name: name for name in found}  # a new one is chosen, as nothing is of that many
        name = select(state, f"review-of-{len(found)}", known, "Review", state.changed)
        one = found[name]
        with mark(ui.element("div").classes("stack"), "review"):
            widgets.items(following.shown(one))
        if one.get("refitted"):
            widgets.button("Take the refit as a model", partial(_take_refit, state, name, one))
            return

        def again() -> None:
            asked = {key: str(one.get(key, "inverse")) for key in ("log", "model", "form")}
            submit(state, following.review, "reviews", f"{name} refit", asked, refit=True)

        mark(widgets.button("Try a refit with the log", again), "refit")


def _take_refit(state: State, name: str, one: dict[str, Any]) -> None:
    from mckibben.blocks.saving import load

    block = load(state.workspace.path("reviews", f"{name}-refit.json"))
    state.model = state.workspace.new_name("models", f"{one['model']}-refit")
    block.save(state.workspace.path("models", f"{state.model}.json"))
    state.changed()
