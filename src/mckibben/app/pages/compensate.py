"""Compensate: a desired motion, a compensator, and its tracking error."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from functools import partial
from typing import Any

import numpy as np
from nicegui import events, run, ui

from mckibben.app import following, forms, modelling, widgets
from mckibben.app.pages import parts, trying
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
    **following.MOTIONS,
    "hold": "Stay at one value",
    "formula": "Formula of t",
    "drawn": "Points: time and value",
    "points": "From a file or a recording",
}

LOOP = ("approach", "settle", "noise", "delay", "slew", "preview", "pressure_loop", "seed")
"""Fields of `TrackOptions` that are asked for."""

USUAL = ("feedforward", "feedforward-pid")
"""Controllers that are tried first."""

DRIVEN = ("pressure", "voltage", "force", "command")
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
        if following.having(state.workspace, "inverse"):
            _wish(state)
            following.plants(state.workspace, _able(state))


@parts.steady("models")
def page(state: State) -> None:
    """Show the tab that is chosen."""
    able = following.having(state.workspace, "inverse")
    forces = following.having(state.workspace, "force")
    chosen = state.chosen.setdefault("compensate.tab", "force" if forces and not able else "motion")
    names = forces if chosen == "force" else able

    def turn(event: events.ValueChangeEventArguments[Any]) -> None:
        state.chosen["compensate.tab"] = str(event.value)
        page.refresh()

    if able or forces:
        with ui.tabs(value=chosen).props("dense no-caps align=left inline-label") as tabs:
            for name, title in TABS.items():
                mark(ui.tab(name, title), f"tab-{name}")
        tabs.on_value_change(turn)
    if not names:
        _empty(state, chosen)
        return
    left, right = {
        "motion": (_motion, followed),
        "force": (trying.force, trying.estimated),
        "log": (trying.log, trying.reviewed),
    }[chosen]
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
    return parts.model_of(state, following.having(state.workspace, "inverse"))


def _wish(state: State) -> Json:
    """Return the motion that is wanted of the chosen model: made by default, or the newest that ran."""
    workspace, name = state.workspace, _able(state)
    wish: Json = state.chosen.get("compensate.wish", {})
    data = (workspace.read("results", name) or {}).get("data", "")
    asked = [[*some] for some in following.asked_for(workspace, name)]
    if [data, *asked] == [wish.get("data"), [*wish.get("channels", {})], [*wish.get("held", {})]]:
        return wish
    wish = state.chosen["compensate.wish"] = following.wish(workspace, name) | {"data": data}
    for one in [*_runs(state).values()][:1]:
        with suppress(MckibbenError):  # it may be gone
            _take(wish, following.read_run(workspace, one["reference"]), one["reference"])
    return wish


def _runs(state: State) -> dict[str, Json]:
    """Return the runs of the model that is inverted, the newest first."""
    runs, name = following.newest(state.workspace, "runs"), _able(state)
    return {run: one for run, one in runs.items() if one["model"] == name}


def _take(wish: Json, recording: Recording, stored: str = "") -> None:
    """Take the motion of a recording; a stored one keeps its name, so that its runs are shown."""
    for channel, points in following.of_file(recording, wish["channels"]).items():
        wish["channels"][channel] |= {"kind": "points", "points": points}
    for channel in {*wish["held"]} & {*recording.channels}:
        wish["held"][channel] = float(recording[channel][0])
    wish["stored"] = stored


def _reference(state: State) -> Recording:
    wish, (channels, held) = _wish(state), following.asked_for(state.workspace, _able(state))
    units = following.units_of(channels | held)
    return following.reference(following.points_of(wish), wish["held"], wish["step"], units)


def _motion(state: State, names: list[str]) -> None:
    name, wish = parts.model_of(state, names), _wish(state)
    channels, held = following.asked_for(state.workspace, name)
    own, unit = wish["channels"][wish["now"]], channels[wish["now"]].unit
    ready = own["kind"] != "points"

    def moved() -> None:
        wish["stored"] = ""
        with suppress(DataError):  # while it is being filled in
            following.shape(wish)
            followed.refresh()

    def written() -> None:
        following.shape(wish)  # errors are shown, as it is a whole text
        moved()

    def reshaped() -> None:
        moved()
        page.refresh()

    async def loaded(event: events.UploadEventArguments) -> None:
        _take(wish, (await trying.received(state, event))[1])
        page.refresh()

    def field(values: Json, key: str, label: str) -> None:
        found = ui.number(label, format="%.6g").bind_value(values, key)
        found.props("dense outlined debounce=400").classes("number")
        mark(found, f"field-{key}").on_value_change(moved)

    def of_recording(event: events.ValueChangeEventArguments[Any]) -> None:
        _take(wish, recordings[event.value])
        page.refresh()

    recordings = {
        run.name: run
        for run in state.workspace.used().values()
        if run.sample_time is not None and all(key in run for key in channels)
    }

    with widgets.card("Motion"):
        if len(channels) > 1:
            toggle = ui.toggle([*channels]).bind_value(wish, "now")
            toggle.props("dense no-caps unelevated").on_value_change(lambda _: page.refresh())
            mark(toggle, "channel")
        with widgets.row(classes="fields"):
            kind = ui.select(SHAPES, label="Shape").bind_value(own, "kind").props("dense outlined")
            mark(kind, "shape").on_value_change(reshaped)
            if own["kind"] in TEXTS:
                own.setdefault("text", "")
                text = ui.input(axis_label("Value", unit), placeholder=TEXTS[own["kind"]])
                text.bind_value(own, "text").props("dense outlined debounce=600")
                mark(text, "field-text").on_value_change(widgets.guarded(written))
            elif ready:
                field(own, "first", axis_label("At" if own["kind"] == "hold" else "From", unit))
            if own["kind"] in following.MOTIONS:
                field(own, "other", axis_label("To", unit))
        with widgets.row(classes="fields" if ready or held else "hidden"):
            if ready and own["kind"] != "drawn":
                field(wish, "seconds", "Duration [s]")
            if own["kind"] in following.MOTIONS:
                field(wish, "cycles", "Cycles")
            for key, channel in held.items():
                field(wish["held"], key, axis_label(f"{key}, held", channel.unit))
        with widgets.row():
            with ui.element("div").style("display: none"):
                files = widgets.upload("", loaded, ".csv,.tsv,.txt,.parquet,.xlsx,.mat")
                mark(files, "reference-file")
            widgets.button("From a file", lambda: files.run_method("pickFiles"), "upload_file")
            if recordings:
                run_of = ui.select([*recordings], label="From a recording").props("dense outlined")
                run_of.style("min-width: 200px")
                mark(run_of, "reference-recording").on_value_change(widgets.guarded(of_recording))
    _compensator(state, name)


# -- compensator, plant, run --------------------------------------------------------------------------


def _compensator(state: State, name: str) -> None:
    workspace, uses = state.workspace, following.uses(state.workspace, name)
    kinds = {kind: words for kind, words in following.KINDS.items() if kind in uses}
    with widgets.card("Compensator"):
        with widgets.row(classes="fields"):
            parts.select_model(state, following.having(workspace, "inverse"))
            form = parts.select(state, "compensate.form", kinds, "As", page.refresh)
        if form == "inverse":
            _expected(state, name)
        if asked := following.SETTINGS.get(form):
            title = "How it learns" if form == "adaptive" else "Limits and horizon"
            with widgets.details(title), widgets.row():
                forms.fields(InvertOptions, asked, values_of(state, form))
        plants = following.plants(workspace, name)
        key = f"compensate.plant-of-{name}"
        plant = parts.select(state, key, plants, "Tried on", page.refresh)
        fitting = following.laws(workspace, name, plant) if plant else {}
        chosen = [x for x in state.chosen.get("compensate.laws", USUAL) if x in fitting]
        state.chosen["compensate.laws"] = chosen or [*fitting][:1]
        laws = ui.select(fitting, multiple=True, label="Controllers").props("dense outlined")
        mark(laws.bind_value(state.chosen, "compensate.laws").props("use-chips"), "laws")
        with widgets.details("Imperfections of the loop"), widgets.row(classes="fields"):
            forms.fields(TrackOptions, LOOP, values_of(state, "loop"))
        with widgets.row(classes="spread"):
            ui.label("Compared with no compensation.").classes("muted")
            mark(widgets.primary("Run", partial(_start, state, name), "play_arrow"), "run")


def _expected(state: State, name: str) -> None:
    """Show the error to expect of the model's compensator, or why it is not recommended."""
    parts.warn_of_other_data(state, name)
    row = state.workspace.read("results", name) or {}
    if own := row.get("compensator"):
        mark(ui.label(words.expected(own)), "expected")
    elif why := row.get("no_compensator"):
        widgets.error_box(f"This compensator is not recommended: {why}")


def values_of(state: State, of: str) -> Json:
    """Return what is filled in of a compensator's settings, or of the loop's."""
    values: Json = state.chosen.setdefault(f"compensate.values-{of}", {})
    return values


def settings_of(state: State, form: str) -> Json:
    """Return the settings of a compensator that differ from the default."""
    asked = {key: values_of(state, form).get(key) for key in following.SETTINGS.get(form, ())}
    return forms.given(InvertOptions, asked)


async def _start(state: State, name: str) -> None:
    """Run the compensator with every controller that is chosen, each as a job."""
    form, plant, laws = (
        state.chosen[f"compensate.{key}"] for key in ("form", f"plant-of-{name}", "laws")
    )
    if not laws:
        raise DataError("there is no controller", remedy="choose one, such as Compensator alone")
    state.model = name  # what is taken away next
    asked = {"model": name, "form": form, "settings": settings_of(state, form), "plant": plant}
    asked["options"] = forms.given(TrackOptions, values_of(state, "loop"))
    wish, reference = _wish(state), _reference(state)
    wish["stored"] = wish["stored"] or await run.io_bound(
        following.stored, state.workspace, reference
    )
    for law in laws:
        title = " ".join([name, *([form] if form != "inverse" else []), law])
        more = {"reference": wish["stored"], "controller": law}
        trying.start(state, following.loop, title, asked | more)


# -- results ----------------------------------------------------------------------------------


@parts.steady("runs", jobs=["loop"])
def followed(state: State) -> None:
    """Show the motion, the chosen run, and the errors of all runs of the model."""
    wish, runs, reference = _wish(state), _runs(state), _reference(state)
    reach = following.reach(state.workspace, _able(state), wish["held"])
    of_it = [run for run, one in runs.items() if one["reference"] == wish["stored"]]
    chosen = state.chosen.get("compensate.run")
    chosen = chosen if chosen in of_it else next(iter(of_it), "")
    with widgets.card("Desired and measured motion" if chosen else "Desired motion"):
        _plot(state, reference, reach, runs[chosen] | {"name": chosen} if chosen else None)
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
            _errors(state, runs, chosen)
        else:
            text = "Run shows the errors with and without compensation, and the commands."
            mark(ui.label(text).classes("muted"), "nothing-yet")
        if chosen:
            with widgets.details(f"More of {_title(runs[chosen])}"):
                widgets.items(modelling.restored(runs[chosen]))


def _title(one: Mapping[str, Any]) -> str:
    form = "" if one.get("form", "inverse") == "inverse" else f" ({one['form']})"
    where = str(one.get("plant") or one.get("rig") or "").rpartition(" ")[2]
    law = following.titled(str(one.get("controller", "")))
    return f"{law}{form} on {where}" if where else f"{law}{form}"


def _scored(state: State, name: str) -> Recording | None:
    """Return the recording of a run without its approach; None where it is gone."""
    with suppress(MckibbenError):
        one = following.read_run(state.workspace, f"{name}.csv")
        return one.slice(max(round(-one.start_time / one.step), 0), len(one))
    return None


def _plot(
    state: State, reference: Recording, reach: Mapping[str, tuple[float, float]], run: Json | None
) -> None:
    """Draw the desired motion, the reachable range, and what a run measured; below, its commands."""
    one = None if run is None else _scored(state, run["name"])
    panels, errors = [], []
    for place, channel in enumerate(reach):

        def curve(time: Any, y: Any, name: str, colour: str, style: Any = "line") -> Curve:
            shown = "" if place else name  # in the legend once  # noqa: B023
            return Curve(*over_time(time, y), shown, colour, style)

        curves = [curve(reference.time, reference[channel], "desired", "measured")]
        label = axis_label(channel, reference.units.get(channel, ""))
        if one is not None and run is not None:
            due = one.time - (one.sample_time or 0.0)  # it is recorded a step later
            desired = np.interp(due, reference.time, reference[channel])
            away = []
            for name, key, colour in (
                ("no compensation", f"uncompensated_{channel}", "muted"),
                (_title(run), channel, series_colour(0)),
            ):
                if key in one:
                    style: Style = "fine" if colour == "muted" else "line"
                    curves.append(curve(due, one[key], name, colour, style))
                    away.append(curve(due, desired - one[key], "", colour, style))
            errors.append(Panel("time [s]", f"error of {label}", tuple(away), zero=True))
        panels.append(Panel("time [s]", label, tuple(curves)))
    panels += errors
    if one is not None and run is not None:
        known = {*run.get("rmse", {}), *_wish(state)["held"]}
        driven = [key for key in one.channels if key.startswith(DRIVEN) and key not in known]
        sent = [key for key in driven if key.startswith(COMMAND)] or driven
        commands = [
            Curve(
                *over_time(one.time, one[x]), x.removeprefix(COMMAND), series_colour(k + 1), "line"
            )
            for k, x in enumerate(sent)
        ]
        if sent:
            label = axis_label("command", one.units.get(sent[0], ""))
            panels.append(Panel("time [s]", label, tuple(commands)))
    (figure,) = interactive.plots(Drawing(tuple(panels), stacked=True))
    for row, (low, high) in enumerate(reach.values()):
        axis = str(row + 1) if row else ""
        shade = {"type": "rect", "xref": f"x{axis} domain", "yref": f"y{axis}", "x0": 0, "x1": 1}
        shade |= {"y0": low, "y1": high, "fillcolor": "--accent", "opacity": 0.08}
        figure["layout"]["shapes"].append(shade | {"line": {"width": 0}, "layer": "below"})
    height = 300 if len(panels) == 1 else 60 + 170 * len(panels)
    mark(widgets.plot_of(figure, height=height), "motion-plot")


def _errors(state: State, runs: Mapping[str, Json], chosen: str) -> None:
    """Show the errors of all runs of the model; one that is chosen brings its motion back."""
    names, rows = [*runs], []

    def text(one: Json, errors: Mapping[str, float] | None) -> str:
        units = one.get("units", {})
        each = (f"{number(x, 3)} {units.get(key, '')}" for key, x in (errors or {}).items())
        return ", ".join(each) or "–"

    for name, one in runs.items():
        plain = one.get("uncompensated") or {}
        errors = one.get("rmse"), plain.get("rmse", plain), one.get("largest")
        texts = [text(one, of) for of in errors]
        motion, limited = one["reference"].removesuffix(".csv"), str(one.get("clipped", "–"))
        rows.append([_title(one), motion, *texts, limited, partial(_acts, state, name)])

    def choose(at: int) -> None:
        state.chosen["compensate.run"], file = names[at], runs[names[at]]["reference"]
        if file == _wish(state)["stored"]:
            followed.refresh()
        else:
            _take(_wish(state), following.read_run(state.workspace, file), file)
            page.refresh()

    columns = ["Run", "Motion", "RMSE", "No compensation", "Largest", "Steps at a limit", ""]
    at = names.index(chosen) if chosen else None
    mark(widgets.table(columns, rows, chosen=at, on_choose=choose), "runs")


def _acts(state: State, name: str) -> None:
    path = state.workspace.path("runs", f"{name}.csv")

    def away() -> None:
        state.workspace.delete("runs", name)
        path.unlink(missing_ok=True)
        state.changed()

    def ask() -> None:
        widgets.sure(f"Delete {name}?", "The run and its recording are deleted.", away)

    with ui.element("div").classes("acts").on("click.stop", js_handler="() => {}"):
        widgets.icon_button("download", f"Download {name}", partial(widgets.download, path))
        widgets.icon_button("delete_outline", f"Delete {name}", ask)
