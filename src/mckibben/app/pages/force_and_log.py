"""The other tabs of Compensate: estimates of force, and reviews of logs of a loop."""

from __future__ import annotations

from typing import Any

from nicegui import events, run, ui

from mckibben.app import compensators, loops, widgets
from mckibben.app.background import later
from mckibben.app.modelling import restored
from mckibben.app.pages import parts
from mckibben.app.state import State
from mckibben.app.widgets import mark
from mckibben.errors import DataError
from mckibben.recording import REFERENCE, Recording
from mckibben.report import results
from mckibben.report.drawing import Curve, Drawing, Panel, axis_label, over_time


def force(state: State, names: list[str]) -> None:
    """Ask for a model that gives a force, and for a recording."""
    workspace, used = state.workspace, state.workspace.used()
    block = compensators.block_for_use(workspace, parts.model_of(state, names), "force", {})
    inputs, estimates = (
        {channel.name for channel in side} for side in (block.inputs, block.outputs)
    )
    fitting = {
        entry.name: f"{entry.name} ({entry.role})"
        for entry in sorted(workspace.entries(), key=lambda entry: entry.role)
        if entry.name in used and inputs <= {*used[entry.name].channels}
    }
    order = sorted(
        fitting, key=lambda name: not estimates <= {*used[name].channels}
    )  # to compare with
    with widgets.card("Force from other channels"):
        text = f"From {', '.join(sorted(inputs))}. As JSON, C or FMU: under Take away."
        ui.label(text).classes("muted")
        with widgets.row(classes="fields"):
            parts.select_model(state, names)
            parts.warn_of_other_data(state, parts.model_of(state, names))
            options = {name: fitting[name] for name in order}
            parts.select(state, "compensate.recording", options, "Recording", estimated.refresh)


@parts.steady("models", own=True)
def estimated(state: State) -> None:
    """Show a force that is estimated over a recording, beside what was measured."""
    workspace, recording = state.workspace, str(state.chosen.get("compensate.recording") or "")
    name = parts.model_of(state, compensators.models_usable_as(workspace, "force"))

    def show(simulation: Any) -> None:
        widgets.items(results.simulation(simulation))
        run, panels = simulation.recording, []
        for channel in compensators.block_for_use(workspace, name, "force", {}).outputs:
            y = run[f"{channel.name}_model"]
            curves = [Curve(*over_time(run.time, y), "estimated", "series-1", "line")]
            label = axis_label(channel.name, channel.unit)
            if channel.name in run:
                measured_force = run[channel.name]
                measured = Curve(
                    *over_time(run.time, measured_force), "measured", "measured", "broad"
                )
                error = Curve(*over_time(run.time, measured_force - y), "error", "series-2", "line")
                panels.append(Panel("time [s]", label, (measured, *curves)))
                label, curves = axis_label("error", channel.unit), [error]
            panels.append(Panel("time [s]", label, tuple(curves)))
        (plot,) = widgets.plot(Drawing(tuple(panels), stacked=True), height=420)
        mark(plot, "force-plot")

    with widgets.card("Estimated force"):
        if recording:
            stamps = parts.stamps(workspace, "models", of=name)
            key = "force", stamps, recording, workspace.digest()
            later(
                key,
                lambda: compensators.estimate_force(workspace, name, recording),
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
    name = parts.model_of(state, names)

    async def loaded(event: events.UploadEventArguments) -> None:
        path, recording = await received(state, event)
        if not any(key.startswith(REFERENCE) for key in recording.channels):
            problem, remedy = "it has no reference", "name a column reference_displacement_mm"
            raise DataError(problem, file=path, remedy=remedy)
        request = {"log": path.name, "model": name, "form": state.chosen["compensate.form"]}
        start(state, loops.review, path.stem, request)

    with widgets.card("Log of a loop"):
        ui.label(
            "A table over time with the reference (reference_displacement), the measured displacement "
            "and pressure, and, if recorded, command_pressure."
        ).classes("muted")
        with widgets.row(classes="fields"):
            parts.select_model(state, names)
            uses = compensators.uses(state.workspace, name)
            forms = {form: words for form, words in compensators.KINDS.items() if form in uses}
            parts.select(state, "compensate.form", forms, "Ran as", lambda: None)
        endings = ".csv,.tsv,.txt,.parquet,.xlsx,.mat,.h5,.tdms"
        mark(widgets.upload("Drop the log here", loaded, endings), "log-file")


async def received(state: State, event: events.UploadEventArguments) -> tuple[Any, Recording]:
    """Return where an uploaded file is, and its first recording."""
    from mckibben.files import read

    with state.workspace.receiving(event.file.name, event.file.size()) as (part, path):
        await event.file.save(part)
    recordings = await run.io_bound(lambda: read(path, informative=False))
    if not recordings:
        raise DataError("it has no recording", file=path, remedy="give another file")
    return path, recordings[0]


@parts.steady("reviews", jobs=["review"])
def reviewed(state: State) -> None:
    """Show where the error of a logged loop comes from."""
    reviews = loops.newest(state.workspace, "reviews")
    with widgets.card("Sources of the error"):
        for job in parts.jobs_of(state, ["review"]):
            parts.show_job(state, job)
        if not reviews:
            text = (
                "A review splits the error of a loop on your rig into parts of model, actuator, delay, "
                "drift and limits."
            )
            widgets.empty("fact_check", "No log was reviewed yet", text)
            return
        key = f"compensate.review-of-{len(reviews)}"  # so that a new one is shown at once
        options = {name: str(content["log"]) for name, content in reviews.items()}
        name = parts.select(state, key, options, "Review", reviewed.refresh)
        with mark(ui.element("div").classes("stack"), "review"):
            widgets.items(restored(reviews[name]))


def start(state: State, work: Any, title: str, asked: dict[str, Any]) -> None:
    """Start a job that writes a result, and forget those of its kind that ended."""
    state.jobs.forget_ended(work.__name__)
    state.jobs.submit(
        work, title, name=loops.result_name(title.replace(" ", "-"), asked), asked=asked
    )
    state.changed()
