"""Compensate: a motion that is wanted, what undoes the hysteresis, and how well the two are followed."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial
from typing import Any

import numpy as np
from nicegui import events, run, ui

from mckibben.app import following, forms, modelling, widgets
from mckibben.app.pages import trying
from mckibben.app.state import State, view
from mckibben.app.widgets import mark
from mckibben.errors import DataError, MckibbenError
from mckibben.numerals import number
from mckibben.options import InvertOptions, TrackOptions
from mckibben.recording import Recording
from mckibben.report import interactive
from mckibben.report.drawing import axis_label, series_colour

TITLE = "Compensate"
ICON = "moving"

TABS = {"motion": "Follow a motion", "force": "Estimate a force", "log": "Review a log"}

LOOP = ("approach", "settle", "noise", "delay", "slew", "preview", "pressure_loop", "seed")
"""Fields of `TrackOptions` that are asked for."""

USUAL = ("feedforward", "feedforward-pid")
"""Controllers that are tried first."""

DRAWN = 4
"""Most runs in a plot."""

ROWS = 100
"""Most points that are edited in a table."""


async def build(state: State) -> None:
    """Build the page."""
    with mark(ui.element("div").classes("page"), "page-compensate"):
        widgets.heading(
            "Compensate",
            "Inverses of models: what to command for a wanted motion, and how well it works.",
        )
        spinner = ui.spinner()
        await run.io_bound(_prepare, state)
        spinner.delete()
        page(state)
        watch(state)
        widgets.next_step("Right on your model? Take it to your rig.", "Take away", "/takeaway")


def _prepare(state: State) -> None:
    """Find what takes a moment, so that clicks find it ready."""
    with suppress(MckibbenError):
        if following.having(state.workspace, "inverse"):
            _wish(state)
            following.plants(state.workspace, _able(state))


@ui.refreshable
@widgets.shielded
def page(state: State) -> None:
    """Show the tab that is chosen; fields in it outlive what happens to jobs."""
    able = following.having(state.workspace, "inverse")
    forces = following.having(state.workspace, "force")
    chosen = state.chosen.setdefault("compensate.tab", "force" if forces and not able else "motion")
    names = forces if chosen == "force" else able
    if able or forces:
        with ui.tabs(value=chosen).props("dense no-caps align=left inline-label") as tabs:
            for name, title in TABS.items():
                mark(ui.tab(name, title), f"tab-{name}")

        def turn(event: events.ValueChangeEventArguments[Any]) -> None:
            state.chosen["compensate.tab"] = str(event.value)
            page.refresh()

        tabs.on_value_change(turn)
    if not names:
        _empty(state, chosen)
        return
    left = {"motion": _motion, "force": trying.force, "log": trying.log}
    with ui.element("div").classes("columns"):
        with ui.element("div").classes("stack"):
            left[chosen](state, names)
        with ui.element("div").classes("stack"):
            results(state)


@view
def watch(state: State) -> None:
    """Build the page again where there are other models or channels; it shows nothing."""
    key = [state.workspace.models(), state.model, state.workspace.channels()]
    before, state.chosen["compensate.key"] = state.chosen.get("compensate.key"), key
    if before not in (None, key):
        page.refresh()


@view
def results(state: State) -> None:
    """Show what came of it, beside the controls."""
    shown = {"motion": _followed, "force": trying.estimated, "log": trying.reviewed}
    shown[state.chosen["compensate.tab"]](state)


def _empty(state: State, tab: str) -> None:
    if fitting := ", ".join(job.title for job in state.jobs.active() if job.kind == "fit"):
        title, text = "Models are being fitted", f"They can be tried here then: {fitting}."
    elif tab == "force":
        title = "No model here gives a force"
        text = "Fit balance-force with the force as output, or balance on recordings with a force."
    else:
        title = "A compensator is the inverse of a model"
        text = (
            "Its inverse says what to command so that the muscle moves as wanted. Fit a model that "
            "has one, such as gpi for one muscle, or balance or sdchm for several."
        )
    with widgets.card(), widgets.empty("moving", title, text):
        ui.link("Models →", "/models")


# -- the motion -------------------------------------------------------------------------------------


def _able(state: State) -> str:
    """Return the model that is inverted: the one that is chosen, or the best that can be."""
    return trying.model_of(state, following.having(state.workspace, "inverse"))


def _wish(state: State) -> dict[str, Any]:
    """Return the motion that is wanted of the chosen model: made by default, or the newest that ran."""
    workspace, name = state.workspace, _able(state)
    wish: dict[str, Any] = state.chosen.get("compensate.wish", {})
    asked = [[*some] for some in following.asked_for(workspace, name)]
    if asked == [[*wish.get("channels", {})], [*wish.get("held", {})]]:
        return wish
    wish = state.chosen["compensate.wish"] = following.wish(workspace, name)
    ran = [one["reference"] for one in _ran(state).values()]
    for file in ran[:1]:
        with suppress(MckibbenError):  # it may be gone
            _take(wish, following.read_run(workspace, file), file)
    return wish


def _ran(state: State) -> dict[str, dict[str, Any]]:
    """Return the runs of the model that is inverted, the newest first."""
    runs, name = following.newest(state.workspace, "runs"), _able(state)
    return {run: one for run, one in runs.items() if one["model"] == name}


def _take(wish: dict[str, Any], recording: Recording, stored: str = "") -> None:
    """Take the motion of a recording; a stored one keeps its name, so that its runs are shown."""
    for channel, points in following.of_file(recording, wish["channels"]).items():
        wish["channels"][channel] |= {"kind": "points", "points": points}
    for channel in {*wish["held"]} & {*recording.channels}:
        wish["held"][channel] = float(recording[channel][0])
    wish["stored"] = stored


def _reference(state: State) -> Recording:
    wish, (channels, held) = _wish(state), following.asked_for(state.workspace, _able(state))
    units = {name: channel.unit for name, channel in (channels | held).items()}
    points = {name: own["points"] for name, own in wish["channels"].items()}
    return following.reference(points, wish["held"], wish["step"], units)


def _motion(state: State, names: list[str]) -> None:
    name, wish = trying.model_of(state, names), _wish(state)
    channels, held = following.asked_for(state.workspace, name)
    own, unit = wish["channels"][wish["now"]], channels[wish["now"]].unit

    def moved() -> None:
        wish["stored"] = ""
        with suppress(DataError):  # while it is being filled in
            following.shape(wish)
            results.refresh()

    def reshaped() -> None:
        moved()
        page.refresh()

    async def loaded(event: events.UploadEventArguments) -> None:
        _take(wish, (await trying.received(state, event))[1])
        page.refresh()

    with widgets.card("Motion"):
        if len(channels) > 1:
            toggle = ui.toggle([*channels]).bind_value(wish, "now")
            toggle.props("dense no-caps unelevated").on_value_change(lambda _: page.refresh())
            mark(toggle, "channel")
        shapes = {
            **following.MOTIONS,
            "hold": "Stay at one value",
            "points": "Points, or from a file",
        }
        with widgets.row(classes="fields"):
            kind = ui.select(shapes, label="Shape").bind_value(own, "kind").props("dense outlined")
            mark(kind, "shape").on_value_change(lambda _: reshaped())
            if own["kind"] == "hold":
                _number(own, "first", f"At [{unit}]", moved)
            elif own["kind"] != "points":
                _number(own, "first", f"From [{unit}]", moved)
                _number(own, "other", f"To [{unit}]", moved)
        with widgets.row(classes="fields" if own["kind"] != "points" or held else "hidden"):
            if own["kind"] != "points":
                _number(wish, "seconds", "Duration [s]", moved)
                _number(wish, "cycles", "Cycles", moved)
            for key, channel in held.items():
                _number(wish["held"], key, f"{key}, held [{channel.unit}]", moved)
        with widgets.row():
            mark(widgets.button("Edit points", lambda: _edit(state), "table_rows"), "edit-points")
            with ui.element("div").style("display: none"):
                files = widgets.upload("", loaded, ".csv,.tsv,.txt,.parquet,.xlsx,.mat")
                mark(files, "reference-file")
            widgets.button("From a file", lambda: files.run_method("pickFiles"), "upload_file")
    _compensator(state, name)


def _number(values: dict[str, Any], key: str, label: str, changed: Callable[[], None]) -> None:
    field = ui.number(label, format="%.6g").bind_value(values, key)
    field.props("dense outlined debounce=400").classes("number")
    mark(field, f"field-{key}").on_value_change(lambda _: changed())


def _edit(state: State) -> None:
    """Edit the points of the channel at hand as a table."""
    wish = _wish(state)
    name, own = wish["now"], wish["channels"][wish["now"]]
    if len(own["points"]) > ROWS:
        problem = f"these are {len(own['points'])} points, and a table has {ROWS} at most"
        raise DataError(problem, remedy="choose another shape first, or change the file")
    points = [{"time": t, "value": y} for t, y in own["points"]]

    def cell(point: dict[str, Any], key: str, label: str) -> None:
        field = ui.number(format="%.6g").bind_value(point, key).props("dense borderless")
        widgets.labelled(field, label)

    with widgets.dialog(f"Points of {name}") as window:

        @ui.refreshable
        def rows() -> None:
            cells = [
                [partial(cell, point, "time", f"time of point {at}"),
                 partial(cell, point, "value", f"{name} of point {at}"),
                 partial(widgets.icon_button, "close", f"Remove point {at}", partial(remove, at - 1))]
                for at, point in enumerate(points, 1)
            ]  # fmt: skip
            widgets.table(["time [s]", name, ""], cells)

        def remove(at: int) -> None:
            del points[at]
            rows.refresh()

        def add() -> None:
            last = points[-1] if points else {"time": -1.0, "value": 0.0}
            points.append({"time": last["time"] + 1.0, "value": last["value"]})
            rows.refresh()

        def use() -> None:
            if any(None in point.values() for point in points):
                raise DataError("a number is missing", remedy="fill it in, or remove the point")
            given = [(float(point["time"]), float(point["value"])) for point in points]
            following.reference({name: given}, {}, wish["step"], {})
            own.update(kind="points", points=given)
            wish["stored"] = ""
            window.close()
            page.refresh()

        rows()
        with widgets.row(classes="spread"):
            mark(widgets.button("Add a point", add, "add"), "add-point")
            mark(widgets.primary("Use these", use), "use-points")


# -- compensator, plant, run --------------------------------------------------------------------------


def _compensator(state: State, name: str) -> None:
    workspace, uses = state.workspace, following.uses(state.workspace, name)
    kinds = {kind: words for kind, words in following.KINDS.items() if kind in uses}
    with widgets.card("Compensator"):
        with widgets.row(classes="fields"):
            trying.select_model(state, following.having(workspace, "inverse"))
            form = trying.select(state, "form", kinds, "As", page.refresh)
        if asked := following.SETTINGS.get(form):
            title = "How it learns" if form == "adaptive" else "Limits and horizon"
            with widgets.details(title), widgets.row():
                forms.fields(InvertOptions, asked, _values(state, form))
        plants = following.plants(workspace, name)
        plant = trying.select(state, "plant", plants, "Tried on", page.refresh)
        if plant:
            fitting = following.laws(workspace, name, plant)
            chosen = [x for x in state.chosen.get("compensate.laws", USUAL) if x in fitting]
            state.chosen["compensate.laws"] = chosen or [*fitting][:1]
            laws = ui.select(fitting, multiple=True, label="Controllers")
            laws.bind_value(state.chosen, "compensate.laws").props("dense outlined use-chips")
            mark(laws, "laws")
            with widgets.details("Imperfections of the loop"), widgets.row(classes="fields"):
                forms.fields(TrackOptions, LOOP, _values(state, "loop"))
        with widgets.row(classes="spread"):
            ui.label("Compared with no compensation." if plant else "").classes("muted")
            text = "Run" if plant else "Show commands"
            mark(widgets.primary(text, lambda: _start(state, name), "play_arrow"), "run")


def _values(state: State, of: str) -> dict[str, Any]:
    values: dict[str, Any] = state.chosen.setdefault(f"compensate.values-{of}", {})
    return values


async def _start(state: State, name: str) -> None:
    """Run the compensator with every controller that is chosen, each as a job."""
    chosen, wish = state.chosen, _wish(state)
    form, plant = chosen["compensate.form"], chosen["compensate.plant"]
    values = {key: _values(state, form).get(key) for key in following.SETTINGS.get(form, ())}
    given: dict[str, Any] = {"model": name, "form": form}
    given["settings"] = forms.given(InvertOptions, values)
    options = forms.given(TrackOptions, _values(state, "loop"))
    if plant and not chosen["compensate.laws"]:
        raise DataError("there is no controller", remedy="choose one, such as Compensator alone")
    if not wish["stored"]:
        reference = _reference(state)
        wish["stored"] = await run.io_bound(following.stored, state.workspace, reference)
    given["reference"] = wish["stored"]
    if not plant:
        trying.submit(state, following.commands, "runs", f"{name} commands", given)
    for law in chosen["compensate.laws"] if plant else ():
        loop = given | {"plant": plant, "options": options, "controller": law}
        title = " ".join([name, *([form] if form != "inverse" else []), law])
        trying.submit(state, following.loop, "runs", title, loop)


# -- what came of it ----------------------------------------------------------------------------------


def _followed(state: State) -> None:
    wish, runs, reference = _wish(state), _ran(state), _reference(state)
    reach = following.reach(state.workspace, _able(state))
    of_it = [run for run, one in runs.items() if one["reference"] == wish["stored"]]
    chosen = state.chosen.get("compensate.run")
    chosen = chosen if chosen in of_it else next(iter(of_it), "")
    with widgets.card("What is wanted, and what came of it" if chosen else "What is wanted"):
        drawn = dict.fromkeys([*filter(None, [chosen]), *of_it])
        _motion_plot(state, reference, reach, {run: runs[run] for run in [*drawn][:DRAWN]})
        if why := _doubt(state):
            widgets.error_box(why)
        together = "; each channel by itself, all at once less" if len(reach) > 1 else ""
        ui.label(f"Shaded: what the model reaches{together}.").classes("muted")
        for channel, (low, high) in reach.items():
            margin, values = 1e-6 * (high - low), reference[channel]
            if (out := (values < low - margin) | (values > high + margin)).any():
                share = f"{100 * out.mean():.0f} % of {channel} is out of reach"
                mark(ui.label(f"{share}: {low:.3g} to {high:.3g}."), "out-of-reach")
        trying.going(state, ("loop", "commands"))
        if runs:
            _errors(state, runs, chosen)
            if chosen:
                with widgets.details(f"More of {_title(runs[chosen])}"):
                    widgets.items(following.shown(runs[chosen]))
        else:
            text = "Run shows the errors beside no compensation, and the commands, here."
            mark(ui.label(text).classes("muted"), "nothing-yet")


def _doubt(state: State) -> str:
    """Return why no model of these channels is recommended; empty where one is."""
    return modelling.against(modelling.comparable(state.workspace, state.sides))


def _title(one: Mapping[str, Any]) -> str:
    form = "" if one.get("form", "inverse") == "inverse" else f" ({one['form']})"
    where = str(one.get("plant") or one.get("rig") or "").rpartition(" ")[2]
    law = following.titled(str(one.get("controller", "")))
    return f"{law}{form} on {where}" if where else f"{law}{form}"


def _scored(state: State, name: str) -> Recording | None:
    """Return the recording of a run without its approach; None where it is gone."""
    with suppress(MckibbenError):
        one = following.read_run(state.workspace, f"{name}.csv")
        before = round(-one.start_time / (one.sample_time or 1.0))
        return one.slice(before, len(one)) if before > 0 else one
    return None


def _motion_plot(
    state: State,
    reference: Recording,
    reach: Mapping[str, following.Ends],
    runs: Mapping[str, Mapping[str, Any]],
) -> None:
    """Draw what is wanted over time, and what came of it; shade what can be reached.

    Below are the commands of the first run, which is the one that is chosen.
    """
    panels = []
    ran = {name: one for name in runs if (one := _scored(state, name)) is not None}
    for channel in reach:
        courses: list[trying.Course] = [
            (reference.time, reference[channel], "wanted", "measured", "line")
        ]
        key = f"uncompensated_{channel}"
        for one in [one for one in ran.values() if key in one][:1]:
            courses.append((_due(one), one[key], "no compensation", "muted", "fine"))
        for place, (name, one) in enumerate(ran.items()):
            if channel in one:
                look = _title(runs[name]), series_colour(place), "line"
                courses.append((_due(one), one[channel], *look))
        panels.append((axis_label(channel, reference.units.get(channel, "")), courses))
    for name, one in [*ran.items()][:1]:
        found = _commanded(one, {*runs[name].get("rmse", {}), *_wish(state)["held"]})
        courses = [
            (one.time, one[key], key, series_colour(place), "line")
            for place, key in enumerate(found)
        ]
        if found:
            panels.append((axis_label("command", one.units.get(found[0], "")), courses))
    (figure,) = interactive.plots(trying.drawing(panels))
    for row, (low, high) in enumerate(reach.values()):
        axis = str(row + 1) if row else ""
        shade = {"type": "rect", "xref": f"x{axis} domain", "yref": f"y{axis}", "x0": 0, "x1": 1}
        shade |= {"y0": low, "y1": high, "fillcolor": "--accent", "opacity": 0.08}
        figure["layout"]["shapes"].append(shade | {"line": {"width": 0}, "layer": "below"})
    height = 300 if len(panels) == 1 else 60 + 170 * len(panels)
    mark(widgets.plot_of(figure, height=height), "motion-plot")


def _due(one: Recording) -> Any:
    """Return times at which what is measured was due: a step before it is recorded."""
    return one.time - (one.sample_time or 0.0)


def _errors(state: State, runs: Mapping[str, Mapping[str, Any]], chosen: str) -> None:
    """Show the errors of all runs of the model; one that is chosen brings its motion back."""
    names, rows = [*runs], []
    for name, one in runs.items():
        plain = one.get("uncompensated") or {}
        errors = one.get("rmse"), plain.get("rmse", plain), one.get("largest")
        units = one.get("units", {})
        texts = [
            ", ".join(f"{number(x, 3)} {units.get(key, '')}" for key, x in (of or {}).items())
            or "–"
            for of in errors
        ]
        motion = one["reference"].removesuffix(".csv")
        limited = str(one.get("clipped", "–"))
        rows.append([_title(one), motion, *texts, limited, partial(_acts, state, name)])

    def choose(at: int) -> None:
        state.chosen["compensate.run"], file = names[at], runs[names[at]]["reference"]
        if file == _wish(state)["stored"]:
            results.refresh()
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

    with ui.element("div").classes("acts").on("click.stop", js_handler="() => {}"):
        widgets.icon_button("download", f"Download {name}", partial(widgets.download, path))
        widgets.icon_button("delete_outline", f"Delete {name}", away)


def _commanded(one: Recording, known: set[str]) -> list[str]:
    """Return the channels of what was commanded in a run, or else of what drove the plant."""
    kinds = ("pressure", "voltage", "force", "command")
    found = [key for key in one.channels if key.partition("_")[0] in kinds and key not in known]
    found = [key for key in found if np.ptp(one[key]) > 0]
    return [key for key in found if key.startswith("command_")] or found
