"""Compensate: a desired motion, a compensator, and its tracking error."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from contextlib import suppress
from functools import partial
from typing import Any

import numpy as np
from nicegui import events, run, ui

from mckibben.app import compensators, forms, loops, modelling, motions, widgets
from mckibben.app.pages import force_and_log, parts
from mckibben.app.state import State
from mckibben.app.widgets import mark
from mckibben.errors import DataError, MckibbenError
from mckibben.numerals import number
from mckibben.options import InvertOptions, TrackOptions
from mckibben.recording import COMMAND, Recording
from mckibben.report import interactive, words
from mckibben.report.drawing import (
    Curve,
    Drawing,
    Panel,
    Style,
    axis_label,
    over_time,
    series_colour,
)

TITLE = "Compensate"
ICON = "moving"

TABS = {"motion": "Follow a motion", "force": "Estimate a force", "log": "Review a log"}

TEXTS = {"formula": "5 + 3*sin(2*pi*t/10)", "drawn": "0 5; 2 10; 4 5"}
"""Motions that are written, each with an example."""

SHAPES = {
    **motions.MOTIONS,
    "hold": "Stay at one value",
    "formula": "Formula of t",
    "drawn": "Points: time and value",
    "points": "From a file or a recording",
}

LOOP_OPTIONS = ("approach", "settle", "noise", "delay", "slew", "preview", "pressure_loop", "seed")
"""Fields of `TrackOptions` that are asked for."""

DEFAULT_LAWS = ("feedforward", "feedforward-pid")
"""Controllers that are tried first."""

COMMAND_PREFIXES = ("pressure", "voltage", "force", "command")
"""What channels that drive a plant begin with."""

Json = dict[str, Any]


async def build(state: State) -> None:
    """Build the page."""
    with mark(ui.element("div").classes("page"), "page-compensate"):
        widgets.heading(
            "Compensate",
            "Inverses of models: commands for a desired motion, and the tracking error.",
        )
        spinner = ui.spinner()
        await run.io_bound(_prepare, state)
        if spinner.is_deleted:  # the page was left
            return
        spinner.delete()
        page(state)
        widgets.next_step("Right on your model? Take it to your rig.", "Take away", "/takeaway")


def _prepare(state: State) -> None:
    """Find what takes a moment, so that clicks find it ready."""
    with suppress(MckibbenError):
        if compensators.models_usable_as(state.workspace, "inverse"):
            _wish(state)
            loops.plants(state.workspace, _able(state))


@parts.steady("models")
def page(state: State) -> None:
    """Show the tab that is chosen."""
    able = compensators.models_usable_as(state.workspace, "inverse")
    forces = compensators.models_usable_as(state.workspace, "force")
    tab = state.chosen.setdefault("compensate.tab", "force" if forces and not able else "motion")
    names = forces if tab == "force" else able

    def turn(event: events.ValueChangeEventArguments[Any]) -> None:
        state.chosen["compensate.tab"] = str(event.value)
        page.refresh()

    if able or forces:
        with ui.tabs(value=tab).props("dense no-caps align=left inline-label") as tabs:
            for name, title in TABS.items():
                mark(ui.tab(name, title), f"tab-{name}")
        tabs.on_value_change(turn)
    if not names:
        _empty(state, tab)
        return
    left, right = {
        "motion": (_motion, followed),
        "force": (force_and_log.force, force_and_log.estimated),
        "log": (force_and_log.log, force_and_log.reviewed),
    }[tab]
    with ui.element("div").classes("columns"):
        with ui.element("div").classes("stack"):
            left(state, names)
        with ui.element("div").classes("stack"):
            right(state)


def _empty(state: State, tab: str) -> None:
    if fitting := ", ".join(job.title for job in state.jobs.active() if job.kind == "fit"):
        title, text = "Models are being fitted", f"They can be tried here then: {fitting}."
    elif tab == "force":
        title = "No model here gives a force"
        text = "Fit balance-force with the force as output, or balance on recordings with a force."
    else:
        title = "A compensator is the inverse of a model"
        text = (
            "It computes the commands for a desired motion. Fit a model that "
            "has one, such as gpi for one muscle, or balance or sdchm for several."
        )
    rows = [row for row in state.workspace.results() if row["current"] and tab != "force"]
    with widgets.card(), widgets.empty("moving", title, text):
        for row in rows:
            if why := row.get("no_compensator"):
                widgets.error_box(f"{row['name']}: {why}")
        ui.link("Models →", "/models")


# -- the motion -------------------------------------------------------------------------------------


def _able(state: State) -> str:
    """Return the model that is inverted: the one that is chosen, or the best that can be."""
    return parts.model_of(state, compensators.models_usable_as(state.workspace, "inverse"))


def _wish(state: State) -> Json:
    """Return the motion that is wanted of the chosen model: made by default, or the newest that ran."""
    workspace, name = state.workspace, _able(state)
    wish: Json = state.chosen.get("compensate.wish", {})
    data = (workspace.read("results", name) or {}).get("data", "")
    channels = [[*some] for some in compensators.reference_channels(workspace, name)]
    if [data, *channels] == [
        wish.get("data"),
        [*wish.get("channels", {})],
        [*wish.get("held", {})],
    ]:
        return wish
    wish = state.chosen["compensate.wish"] = motions.default_motion(workspace, name) | {
        "data": data
    }
    for newest_run in [*_runs(state).values()][:1]:
        with suppress(MckibbenError):  # it may be gone
            _take(wish, loops.read_run(workspace, newest_run["reference"]), newest_run["reference"])
    return wish


def _runs(state: State) -> dict[str, Json]:
    """Return the runs of the model that is inverted, the newest first."""
    runs, name = loops.newest(state.workspace, "runs"), _able(state)
    return {run: content for run, content in runs.items() if content["model"] == name}


def _take(wish: Json, recording: Recording, stored: str = "") -> None:
    """Take the motion of a recording; a stored one keeps its name, so that its runs are shown."""
    for channel, points in motions.points_of_recording(recording, wish["channels"]).items():
        wish["channels"][channel] |= {"kind": "points", "points": points}
    for channel in {*wish["held"]} & {*recording.channels}:
        wish["held"][channel] = float(recording[channel][0])
    wish["stored"] = stored


def _reference(state: State) -> Recording:
    wish, (channels, held) = (
        _wish(state),
        compensators.reference_channels(state.workspace, _able(state)),
    )
    units = motions.units_of(channels | held)
    return motions.reference_from_points(
        motions.motion_points(wish), wish["held"], wish["step"], units
    )


def _motion(state: State, names: list[str]) -> None:
    """Show the controls of the motion, and of the compensator that follows it."""
    with widgets.card("Motion"):
        _MotionForm(state, parts.model_of(state, names)).show()
    _compensator(state, parts.model_of(state, names))


class _MotionForm:
    """The controls of the motion of one channel; they change the wish, and draw it again."""

    def __init__(self, state: State, model: str) -> None:
        self.state, self.wish = state, _wish(state)
        self.channels, self.held = compensators.reference_channels(state.workspace, model)
        self.motion = self.wish["channels"][self.wish["now"]]
        self.unit = self.channels[self.wish["now"]].unit

    def show(self) -> None:
        """Build the controls: channel, shape, size and source."""
        if len(self.channels) > 1:
            toggle = ui.toggle([*self.channels]).bind_value(self.wish, "now")
            toggle.props("dense no-caps unelevated").on_value_change(lambda _: page.refresh())
            mark(toggle, "channel")
        self._shape()
        self._duration()
        self._source()

    def _shape(self) -> None:
        shape = self.motion["kind"]
        with widgets.row(classes="fields"):
            kind = ui.select(SHAPES, label="Shape").bind_value(self.motion, "kind")
            mark(kind.props("dense outlined"), "shape").on_value_change(self._reshape)
            if shape in TEXTS:
                self.motion.setdefault("text", "")
                text = ui.input(axis_label("Value", self.unit), placeholder=TEXTS[shape])
                text.bind_value(self.motion, "text").props("dense outlined debounce=600")
                mark(text, "field-text").on_value_change(widgets.guarded(self._read_text))
            elif shape != "points":
                label = axis_label("At" if shape == "hold" else "From", self.unit)
                self._field(self.motion, "first", label)
            if shape in motions.MOTIONS:
                self._field(self.motion, "other", axis_label("To", self.unit))

    def _duration(self) -> None:
        shape = self.motion["kind"]
        with widgets.row(classes="fields" if shape != "points" or self.held else "hidden"):
            if shape not in ("points", "drawn"):
                self._field(self.wish, "seconds", "Duration [s]")
            if shape in motions.MOTIONS:
                self._field(self.wish, "cycles", "Cycles")
            for key, channel in self.held.items():
                self._field(self.wish["held"], key, axis_label(f"{key}, held", channel.unit))

    def _source(self) -> None:
        """Offer a file, or a recording in use, as the motion."""
        recordings = {
            run.name: run
            for run in self.state.workspace.used().values()
            if run.sample_time is not None and all(key in run for key in self.channels)
        }

        async def load(event: events.UploadEventArguments) -> None:
            _take(self.wish, (await force_and_log.received(self.state, event))[1])
            page.refresh()

        def take(event: events.ValueChangeEventArguments[Any]) -> None:
            _take(self.wish, recordings[event.value])
            page.refresh()

        with widgets.row():
            with ui.element("div").style("display: none"):
                files = widgets.upload("", load, ".csv,.tsv,.txt,.parquet,.xlsx,.mat")
                mark(files, "reference-file")
            widgets.button("From a file", lambda: files.run_method("pickFiles"), "upload_file")
            if recordings:
                source = ui.select([*recordings], label="From a recording")
                source.props("dense outlined").style("min-width: 200px")
                mark(source, "reference-recording").on_value_change(widgets.guarded(take))

    def _field(self, values: Json, key: str, label: str) -> None:
        field = ui.number(label, format="%.6g").bind_value(values, key)
        field.props("dense outlined debounce=400").classes("number")
        mark(field, f"field-{key}").on_value_change(self._redraw)

    def _redraw(self) -> None:
        self.wish["stored"] = ""
        with suppress(DataError):  # while it is being filled in
            motions.fill_points(self.wish)
            followed.refresh()

    def _read_text(self) -> None:
        motions.fill_points(self.wish)  # errors are shown, as it is a whole text
        self._redraw()

    def _reshape(self) -> None:
        self._redraw()
        page.refresh()


# -- compensator, plant, run --------------------------------------------------------------------------


def _compensator(state: State, name: str) -> None:
    workspace, uses = state.workspace, compensators.uses(state.workspace, name)
    kinds = {kind: words for kind, words in compensators.KINDS.items() if kind in uses}
    with widgets.card("Compensator"):
        with widgets.row(classes="fields"):
            parts.select_model(state, compensators.models_usable_as(workspace, "inverse"))
            form = parts.select(state, "compensate.form", kinds, "As", page.refresh)
        if form == "inverse":
            _expected(state, name)
        if fields := compensators.SETTINGS.get(form):
            title = "How it learns" if form == "adaptive" else "Limits and horizon"
            with widgets.details(title), widgets.row():
                forms.fields(InvertOptions, fields, values_of(state, form))
        plants = loops.plants(workspace, name)
        key = f"compensate.plant-of-{name}"
        plant = parts.select(state, key, plants, "Tried on", page.refresh)
        fitting = loops.laws(workspace, name, plant) if plant else {}
        names = [x for x in state.chosen.get("compensate.laws", DEFAULT_LAWS) if x in fitting]
        state.chosen["compensate.laws"] = names or [*fitting][:1]
        laws = ui.select(fitting, multiple=True, label="Controllers").props("dense outlined")
        mark(laws.bind_value(state.chosen, "compensate.laws").props("use-chips"), "laws")
        with widgets.details("Imperfections of the loop"), widgets.row(classes="fields"):
            forms.fields(TrackOptions, LOOP_OPTIONS, values_of(state, "loop"))
        with widgets.row(classes="spread"):
            ui.label("Compared with no compensation.").classes("muted")
            mark(widgets.primary("Run", partial(_start, state, name), "play_arrow"), "run")


def _expected(state: State, name: str) -> None:
    """Show the error to expect of the model's compensator, or why it is not recommended."""
    parts.warn_of_other_data(state, name)
    row = state.workspace.read("results", name) or {}
    if compensator := row.get("compensator"):
        mark(ui.label(words.expected(compensator)), "expected")
    elif why := row.get("no_compensator"):
        widgets.error_box(f"This compensator is not recommended: {why}")


def values_of(state: State, group: str) -> Json:
    """Return what is filled in of a compensator's settings, or of the loop's."""
    values: Json = state.chosen.setdefault(f"compensate.values-{group}", {})
    return values


def settings_of(state: State, form: str) -> Json:
    """Return the settings of a compensator that differ from the default."""
    values = {key: values_of(state, form).get(key) for key in compensators.SETTINGS.get(form, ())}
    return forms.given(InvertOptions, values)


async def _start(state: State, name: str) -> None:
    """Run the compensator with every controller that is chosen, each as a job."""
    form, plant, laws = (
        state.chosen[f"compensate.{key}"] for key in ("form", f"plant-of-{name}", "laws")
    )
    if not laws:
        raise DataError("there is no controller", remedy="choose one, such as Compensator alone")
    state.model = name  # what is taken away next
    request = {"model": name, "form": form, "settings": settings_of(state, form), "plant": plant}
    request["options"] = forms.given(TrackOptions, values_of(state, "loop"))
    wish, reference = _wish(state), _reference(state)
    wish["stored"] = wish["stored"] or await run.io_bound(
        loops.store_reference, state.workspace, reference
    )
    for law in laws:
        title = " ".join([name, *([form] if form != "inverse" else []), law])
        job_settings = {"reference": wish["stored"], "controller": law}
        force_and_log.start(state, loops.loop, title, request | job_settings)


# -- results ----------------------------------------------------------------------------------


@parts.steady("runs", jobs=["loop"])
def followed(state: State) -> None:
    """Show the motion, the chosen run, and the errors of all runs of the model."""
    wish, runs, reference = _wish(state), _runs(state), _reference(state)
    reach = motions.reach(state.workspace, _able(state), wish["held"])
    matching = [
        run for run, run_content in runs.items() if run_content["reference"] == wish["stored"]
    ]
    name = state.chosen.get("compensate.run")
    name = name if name in matching else next(iter(matching), "")
    with widgets.card("Desired and measured motion" if name else "Desired motion"):
        _plot(state, reference, reach, runs[name] | {"name": name} if name else None)
        if doubt := modelling.against(modelling.comparable(state.workspace, state.sides)):
            widgets.error_box(doubt)
        together = "; each channel by itself, all at once less" if len(reach) > 1 else ""
        ui.label(f"Shaded: what the model reaches{together}.").classes("muted")
        for channel, (low, high) in reach.items():
            margin, values = 1e-6 * (high - low), reference[channel]
            if (out := (values < low - margin) | (values > high + margin)).any():
                share = f"{100 * out.mean():.0f} % of {channel} is out of reach"
                mark(ui.label(f"{share}: {low:.3g} to {high:.3g}."), "out-of-reach")
        for job in parts.jobs_of(state, ["loop"]):
            if job.given["asked"]["model"] == _able(state):
                parts.show_job(state, job)
        if runs:
            _errors(state, runs, name)
        else:
            text = "Run shows the errors with and without compensation, and the commands."
            mark(ui.label(text).classes("muted"), "nothing-yet")
        if name:
            with widgets.details(f"More of {_title(runs[name])}"):
                widgets.items(modelling.restored(runs[name]))


def _title(content: Mapping[str, Any]) -> str:
    form = "" if content.get("form", "inverse") == "inverse" else f" ({content['form']})"
    plant = str(content.get("plant") or content.get("rig") or "").rpartition(" ")[2]
    law = loops.controller_title(str(content.get("controller", "")))
    return f"{law}{form} on {plant}" if plant else f"{law}{form}"


def _scored(state: State, name: str) -> Recording | None:
    """Return the recording of a run without its approach; None where it is gone."""
    with suppress(MckibbenError):
        recording = loops.read_run(state.workspace, f"{name}.csv")
        return recording.slice(
            max(round(-recording.start_time / recording.step), 0), len(recording)
        )
    return None


def _plot(
    state: State, reference: Recording, reach: Mapping[str, tuple[float, float]], run: Json | None
) -> None:
    """Draw the desired motion, the reachable range, and what a run measured; below, its commands."""
    recording = None if run is None else _scored(state, run["name"])
    panels: list[Panel] = []
    errors: list[Panel] = []
    for channel in reach:
        label = axis_label(channel, reference.units.get(channel, ""))
        name = "" if panels else "desired"  # in the legend once
        desired = Curve(*over_time(reference.time, reference[channel]), name, "measured", "line")
        curves: list[Curve] = []
        if recording is not None and run is not None:
            names = ("", "") if panels else ("no compensation", _title(run))
            curves, error_curves = _run_curves(recording, reference, channel, names)
            errors.append(Panel("time [s]", f"error of {label}", error_curves, zero=True))
        panels.append(Panel("time [s]", label, (desired, *curves)))
    panels += errors
    if recording is not None and run is not None:
        panels += _command_panels(recording, {*run.get("rmse", {}), *_wish(state)["held"]})
    (figure,) = interactive.plots(Drawing(tuple(panels), stacked=True))
    _shade(figure, reach)
    height = 300 if len(panels) == 1 else 60 + 170 * len(panels)
    mark(widgets.plot_of(figure, height=height), "motion-plot")


def _run_curves(
    recording: Recording, reference: Recording, channel: str, names: tuple[str, str]
) -> tuple[list[Curve], tuple[Curve, ...]]:
    """Return a channel without and with compensation, and the errors of both."""
    time = recording.time - (recording.sample_time or 0.0)  # it is recorded a step later
    desired = np.interp(time, reference.time, reference[channel])
    keys = f"uncompensated_{channel}", channel
    styles: list[tuple[str, Style]] = [("muted", "fine"), (series_colour(0), "line")]
    motion, errors = [], []
    for key, name, style in zip(keys, names, styles, strict=True):
        if key in recording:
            motion.append(Curve(*over_time(time, recording[key]), name, *style))
            errors.append(Curve(*over_time(time, desired - recording[key]), "", *style))
    return motion, tuple(errors)


def _command_panels(recording: Recording, known: Collection[str]) -> list[Panel]:
    """Return a panel of the commands of a run, or of what drove the plant; none where there is neither.

    Channels that are known to be outputs or to be held are neither.
    """
    driven = [
        key for key in recording.channels if key.startswith(COMMAND_PREFIXES) and key not in known
    ]
    commands = [key for key in driven if key.startswith(COMMAND)] or driven
    if not commands:
        return []
    curves = tuple(
        Curve(
            *over_time(recording.time, recording[key]),
            key.removeprefix(COMMAND),
            series_colour(k + 1),
            "line",
        )
        for k, key in enumerate(commands)
    )
    label = axis_label("command", recording.units.get(commands[0], ""))
    return [Panel("time [s]", label, curves)]


def _shade(figure: Json, reach: Mapping[str, tuple[float, float]]) -> None:
    """Shade the reachable range in the first panels of a figure."""
    for row, (low, high) in enumerate(reach.values()):
        axis = str(row + 1) if row else ""
        shade = {"type": "rect", "xref": f"x{axis} domain", "yref": f"y{axis}", "x0": 0, "x1": 1}
        shade |= {"y0": low, "y1": high, "fillcolor": "--accent", "opacity": 0.08}
        figure["layout"]["shapes"].append(shade | {"line": {"width": 0}, "layer": "below"})


def _errors(state: State, runs: Mapping[str, Json], chosen: str) -> None:
    """Show the errors of all runs of the model; one that is chosen brings its motion back."""
    names, rows = [*runs], []

    def text(content: Json, errors: Mapping[str, float] | None) -> str:
        units = content.get("units", {})
        texts_of_channels = (
            f"{number(x, 3)} {units.get(key, '')}" for key, x in (errors or {}).items()
        )
        return ", ".join(texts_of_channels) or "–"

    for name, content in runs.items():
        uncompensated = content.get("uncompensated") or {}
        errors = (
            content.get("rmse"),
            uncompensated.get("rmse", uncompensated),
            content.get("largest"),
        )
        texts = [text(content, values) for values in errors]
        motion, limited = (
            content["reference"].removesuffix(".csv"),
            str(content.get("clipped", "–")),
        )
        rows.append([_title(content), motion, *texts, limited, partial(_acts, state, name)])

    def choose(index: int) -> None:
        state.chosen["compensate.run"], file = names[index], runs[names[index]]["reference"]
        if file == _wish(state)["stored"]:
            followed.refresh()
        else:
            _take(_wish(state), loops.read_run(state.workspace, file), file)
            page.refresh()

    columns = ["Run", "Motion", "RMSE", "No compensation", "Largest", "Steps at a limit", ""]
    index = names.index(chosen) if chosen else None
    mark(widgets.table(columns, rows, chosen=index, on_choose=choose), "runs")


def _acts(state: State, name: str) -> None:
    path = state.workspace.path("runs", f"{name}.csv")

    def delete() -> None:
        state.workspace.delete("runs", name)
        path.unlink(missing_ok=True)
        state.changed()

    def confirm() -> None:
        widgets.sure(f"Delete {name}?", "The run and its recording are deleted.", delete)

    with ui.element("div").classes("acts").on("click.stop", js_handler="() => {}"):
        widgets.icon_button("download", f"Download {name}", partial(widgets.download, path))
        widgets.icon_button("delete_outline", f"Delete {name}", confirm)
