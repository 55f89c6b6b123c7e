"""Compensate: a motion that is wanted, what undoes the hysteresis, and how well the two are followed."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from nicegui import events, run, ui

from mckibben.app import following, forms, widgets
from mckibben.app.following import Ends
from mckibben.app.pages import trying
from mckibben.app.state import State, view
from mckibben.app.terms import said
from mckibben.app.widgets import mark
from mckibben.errors import DataError, MckibbenError
from mckibben.numerals import number
from mckibben.options import InvertOptions, TrackOptions
from mckibben.recording import Recording
from mckibben.report import interactive
from mckibben.report.drawing import Curve, Drawing, Panel, axis_label, over_time, series_colour

TITLE = "Compensate"
ICON = "moving"

TABS = {"motion": "Follow a motion", "force": "Estimate a force", "log": "Review a log"}

LAWS = {
    "feedforward": "Compensator alone",
    "feedforward-pid": "Compensator and PID",
    "observer": "Compensator and disturbance observer",
    "pid": "PID alone",
}

LOOP = ("approach", "settle", "noise", "delay", "slew", "preview", "pressure_loop", "seed")
"""Fields of `TrackOptions` that are asked for."""

COMMANDS_ONLY = ""
"""In place of a plant: the commands alone, for a rig that is elsewhere."""

DRAWN = 4
"""Most runs in a plot."""

ROWS = 100
"""Most points that are edited in a table."""

NOTABLE = 0.7
"""Share of the RMSE above which an offset, or what the plant's band drew, is most of it."""


async def build(state: State) -> None:
    """Build the page."""
    with mark(ui.element("div").classes("page"), "page-compensate"):
        explanation = (
            "Inverses of models: what to command for a wanted motion, and how well it works."
        )
        widgets.heading("Compensate", explanation)
        spinner = ui.spinner()
        await run.io_bound(following.prepare, state.workspace)  # so that clicks find it ready
        spinner.delete()
        page(state)
        watch(state)
        widgets.next_step("Right on your model? Take it to your rig.", "Take away", "/takeaway")


@ui.refreshable
def page(state: State) -> None:
    """Show the tab that is chosen; fields in it outlive what happens to jobs."""
    able = following.having(state.workspace, following.compensator)
    forces = following.having(state.workspace, following.force_estimate)
    chosen = state.chosen.setdefault("compensate.tab", "force" if forces and not able else "motion")
    names = forces if chosen == "force" else able
    if able or forces:
        with ui.tabs(value=chosen).props("dense no-caps align=left inline-label") as tabs:
            for name, title in TABS.items():
                mark(ui.tab(name, title), f"tab-{name}")
        tabs.on_value_change(lambda event: _choose(state, "compensate.tab", str(event.value)))
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
    fitting = ", ".join(job.title for job in state.jobs.active() if job.kind == "fit")
    if fitting:
        title, text = (
            "Models are being fitted",
            f"Their inverses can be tried here then: {fitting}.",
        )
    elif tab == "force":
        title = "No model here gives a force"
        text = "Fit balance-force with the force as output, or balance on recordings with a force."
    elif state.workspace.models():
        title = "None of these models has an inverse"
        text = "Fit another kind, such as gpi for one muscle, or balance or sdchm for several."
    else:
        title = "A compensator is the inverse of a model"
        text = (
            "Fit a model first. Its inverse says what to command so that the muscle moves as wanted; "
            "it is tried here on another model, or on a virtual rig, before it goes to yours."
        )
    with widgets.card(), widgets.empty("moving", title, text):
        ui.link("Models →", "/models")


# -- the motion -------------------------------------------------------------------------------------


def _choose(state: State, key: str, value: Any) -> None:
    """Take a choice on which it depends what is asked for."""
    if state.chosen.get(key) != value:
        state.chosen[key] = value
        page.refresh()


def _able(state: State) -> str:
    """Return the model that is inverted: the one that is chosen, or the best that can be."""
    return trying.model_of(state, following.having(state.workspace, following.compensator))


def _wish(state: State) -> dict[str, Any]:
    """Return the motion that is wanted of the chosen model: made by default, or the newest that ran."""
    workspace, name = state.workspace, _able(state)
    channels, held = following.asked_for(workspace, name)
    wish: dict[str, Any] = state.chosen.get("compensate.wish", {})
    if [*wish.get("channels", {})] == [*channels] and [*wish["held"]] == [*held]:
        return wish
    step, cycle = following.pace(workspace, name)
    wish = {"seconds": float(f"{2 * cycle:.2g}"), "cycles": 2, "step": step}
    wish |= {"held": following.held_at(workspace, name), "channels": {}, "stored": ""}
    wish["now"] = next(iter(channels))
    reach = following.reach(workspace, name, wish["held"])
    for channel in channels:
        resting = following.rest(workspace, channel)
        first, other = following.span(reach[channel], resting)
        kind = "sine" if channel == wish["now"] else "hold"
        wish["channels"][channel] = {"kind": kind, "first": first, "other": other, "points": []}
    state.chosen["compensate.wish"] = wish
    _make(wish)
    ran = [one for one in following.newest(workspace, "runs").values() if one["model"] == name]
    if ran:
        _take(wish, _earlier(state, str(ran[0].get("reference", ""))))
    return wish


def _earlier(state: State, file: str) -> tuple[str, Recording | None]:
    """Return the name and the recording of a reference among the runs, None where it is gone."""
    try:
        return file.removesuffix(".csv"), following.read_run(
            state.workspace, file.removesuffix(".csv")
        )
    except MckibbenError:
        return "", None


def _take(wish: dict[str, Any], found: tuple[str, Recording | None]) -> None:
    """Take the motion of a recording; a stored one keeps its name, so that its runs are shown."""
    stored, recording = found
    if recording is None:
        return
    for channel, points in following.of_file(recording, wish["channels"]).items():
        wish["channels"][channel] |= {"kind": "points", "points": points}
    for channel in {*wish["held"]} & {*recording.channels}:
        wish["held"][channel] = float(recording[channel][0])
    wish["stored"] = stored


def _make(wish: dict[str, Any]) -> None:
    """Make the points of all motions that are ready-made and filled in."""
    seconds, cycles = wish["seconds"], wish["cycles"]
    for own in wish["channels"].values():
        first, other = own["first"], own["other"]
        if own["kind"] == "hold" and None not in (seconds, first):
            own["points"] = [(0.0, first), (seconds, first)]
        elif own["kind"] in following.MOTIONS and None not in (seconds, cycles, first, other):
            own["points"] = following.motion(own["kind"], seconds, first, other, int(cycles))


def _reference(state: State) -> Recording:
    wish, (channels, held) = _wish(state), following.asked_for(state.workspace, _able(state))
    units = {name: channel.unit for name, channel in (channels | held).items()}
    points = {name: own["points"] for name, own in wish["channels"].items()}
    return following.reference(points, wish["held"], wish["step"], units)


def _motion(state: State, names: list[str]) -> None:
    name = trying.model_of(state, names)
    wish = _wish(state)
    channels, held = following.asked_for(state.workspace, name)

    def moved() -> None:
        wish["stored"] = ""
        try:
            _make(wish)
        except DataError:  # while it is being filled in
            return
        results.refresh()

    def reshaped() -> None:
        moved()
        page.refresh()

    with widgets.card("Motion"):
        if len(channels) > 1:
            toggle = (
                ui.toggle([*channels]).bind_value(wish, "now").props("dense no-caps unelevated")
            )
            mark(toggle, "channel").on_value_change(lambda _: page.refresh())
        own, unit = wish["channels"][wish["now"]], channels[wish["now"]].unit
        kinds = {
            **following.MOTIONS,
            "hold": "Stay at one value",
            "points": "Points, or from a file",
        }
        with widgets.row(classes="fields"):
            kind = ui.select(kinds, label="Shape").bind_value(own, "kind").props("dense outlined")
            mark(kind, "shape").on_value_change(lambda _: reshaped())
            if own["kind"] != "points":
                one = own["kind"] == "hold"
                ends = {"first": "At" if one else "From"} | ({} if one else {"other": "To"})
                for key, label in ends.items():
                    _number(own, key, f"{label} [{unit}]", moved)
        with widgets.row(classes="fields" if own["kind"] != "points" or held else "hidden"):
            if own["kind"] != "points":
                _number(wish, "seconds", "Duration [s]", moved)
                _number(wish, "cycles", "Cycles", moved)
            for key, channel in held.items():
                _number(wish["held"], key, f"{key}, held [{channel.unit}]", moved)
        with widgets.row():
            mark(widgets.button("Edit points", lambda: _edit(state), "table_rows"), "edit-points")
            with ui.element("div").style("display: none"):
                endings = ".csv,.tsv,.txt,.parquet,.xlsx,.mat"
                files = widgets.upload("", lambda event: _loaded(state, event), endings)
                mark(files, "reference-file")
            widgets.button("From a file", lambda: files.run_method("pickFiles"), "upload_file")
            if earlier := following.references(state.workspace):

                def again(event: events.ValueChangeEventArguments[Any]) -> None:
                    _take(wish, _earlier(state, str(event.value)))
                    page.refresh()

                value = wish["stored"] if wish["stored"] in earlier else None
                field = ui.select(
                    earlier, value=value, label="Earlier", on_change=widgets.guarded(again)
                )
                mark(field.props("dense outlined"), "earlier")
    _compensator(state, name)


def _number(values: dict[str, Any], key: str, label: str, changed: Callable[[], None]) -> None:
    field = ui.number(label, format="%.6g").bind_value(values, key)
    field.props("dense outlined debounce=400").classes("number")
    mark(field, f"field-{key}").on_value_change(lambda _: changed())


async def _loaded(state: State, event: events.UploadEventArguments) -> None:
    from mckibben.files import read

    with state.workspace.receiving(event.file.name, event.file.size()) as (part, path):
        await event.file.save(part)
    found = await run.io_bound(lambda: read(path, informative=False))
    _take(_wish(state), ("", found[0] if found else None))
    page.refresh()


def _edit(state: State) -> None:
    """Edit the points of the channel at hand as a table."""
    wish = _wish(state)
    name, own = wish["now"], wish["channels"][wish["now"]]
    if len(own["points"]) > ROWS:
        raise DataError(
            f"these are {len(own['points'])} points, and a table has {ROWS} at most",
            remedy="choose another shape first, or change the file",
        )
    points = [{"time": t, "value": y} for t, y in own["points"]]
    with widgets.dialog(f"Points of {name}") as window:

        @ui.refreshable
        def rows() -> None:
            cells = [
                [partial(_cell, point, "time", f"time of point {at + 1}"),
                 partial(_cell, point, "value", f"{name} of point {at + 1}"),
                 partial(widgets.icon_button, "close", f"Remove point {at + 1}", partial(remove, at))]
                for at, point in enumerate(points)
            ]  # fmt: skip
            mark(widgets.table(["Time [s]", name, ""], cells), "points")

        def remove(at: int) -> None:
            del points[at]
            rows.refresh()

        def add() -> None:
            last = points[-1] if points else {"time": -1.0, "value": own["first"]}
            points.append({"time": last["time"] + 1.0, "value": last["value"]})
            rows.refresh()

        def use() -> None:
            given = sorted((p["time"], p["value"]) for p in points if None not in p.values())
            trial = {name: given}
            following.reference(trial, {}, wish["step"], {})
            own.update(kind="points", points=given)
            wish["stored"] = ""
            window.close()
            page.refresh()

        rows()
        with widgets.row(classes="spread"):
            mark(widgets.button("Add a point", add, "add"), "add-point")
            mark(widgets.primary("Use these", use), "use-points")


def _cell(values: dict[str, Any], key: str, label: str) -> None:
    field = ui.number(format="%.6g").bind_value(values, key).props("dense borderless")
    widgets.labelled(field, label)


# -- compensator, plant, run --------------------------------------------------------------------------


def _compensator(state: State, name: str) -> None:
    chosen, workspace = state.chosen, state.workspace
    kinds = following.kinds(workspace, name)
    if chosen.get("compensate.form") not in kinds:
        chosen["compensate.form"] = next(iter(kinds))
    form = chosen["compensate.form"]
    with widgets.card("Compensator"):
        with widgets.row(classes="fields"):
            trying.select_model(state, following.having(workspace, following.compensator))
            field = ui.select(kinds, value=form, label="As").props("dense outlined")
            mark(field, "form").on_value_change(
                lambda event: _choose(state, "compensate.form", event.value)
            )
        if options := following.SETTINGS.get(form):
            title = "How it learns" if form == "adaptive" else "Limits and horizon"
            with widgets.details(title), widgets.row():
                forms.fields(InvertOptions, options, _values(state, form))
        plants = _plants(state, name)
        if chosen.get("compensate.plant") not in plants:
            chosen["compensate.plant"] = next(iter(plants))
        there = str(chosen["compensate.plant"])
        plant = ui.select(plants, value=there, label="Tried on").props("dense outlined")
        mark(plant, "plant").on_value_change(
            lambda event: _choose(state, "compensate.plant", event.value)
        )
        if there != COMMANDS_ONLY:
            _laws(state, name, there)
        with widgets.row(classes="spread"):
            ui.label("Beside no compensation" * (there != COMMANDS_ONLY)).classes("muted")
            text = "Run" if there != COMMANDS_ONLY else "Show commands"
            mark(widgets.primary(text, lambda: _start(state, name), "play_arrow"), "run")


def _laws(state: State, name: str, there: str) -> None:
    """Offer the controllers that close a loop on a plant."""
    refused = following.laws(state.workspace, name, **_place(there))
    fitting = {law: LAWS.get(law, law) for law, why in refused.items() if not why}
    chosen = state.chosen.setdefault("compensate.laws", ["feedforward", "feedforward-pid"])
    state.chosen["compensate.laws"] = [law for law in chosen if law in fitting] or [*fitting][:1]
    laws = ui.select(fitting, multiple=True, label="Controllers")
    laws.bind_value(state.chosen, "compensate.laws").props("dense outlined use-chips")
    mark(laws, "laws")
    with widgets.details("Imperfections of the loop"):
        with widgets.row(classes="fields"):
            forms.fields(TrackOptions, LOOP, _values(state, "loop"))
        for why in dict.fromkeys(filter(None, refused.values())):
            out = ", ".join(LAWS.get(law, law) for law in refused if refused[law] == why)
            ui.label(f"Not here: {out}. {said(why)}").classes("muted")


def _place(there: str) -> dict[str, str]:
    """Return a plant as `following.loop` is given it."""
    kind, _, name = there.partition(" ")
    return {"plant": name if kind == "model" else "", "rig": name if kind == "rig" else ""}


def _values(state: State, of: str) -> dict[str, Any]:
    values: dict[str, Any] = state.chosen.setdefault(f"compensate.values-{of}", {})
    return values


def _plants(state: State, name: str) -> dict[str, str]:
    """Return what the compensator can be tried on, in words; rigs are looked for in a process."""
    twins = {f"model {key}": words for key, words in following.twins(state.workspace, name).items()}
    rigs = following.rigs(state.workspace, name)
    found = {f"rig {rig}": f"{rig} (virtual rig, another muscle)" for rig in rigs}
    itself = {key: words for key, words in twins.items() if "proves nothing" in words}
    others = {key: words for key, words in twins.items() if key not in itself}
    return others | found | itself | {COMMANDS_ONLY: "nothing: the commands alone, for your rig"}


async def _start(state: State, name: str) -> None:
    """Run the compensator with every controller that is chosen, each as a job."""
    chosen, workspace = state.chosen, state.workspace
    form, plant = chosen["compensate.form"], str(chosen["compensate.plant"])
    values = {key: _values(state, form).get(key) for key in following.SETTINGS.get(form, ())}
    settings = forms.given(InvertOptions, values)
    wish = _wish(state)
    if not wish["stored"]:
        wish["stored"] = await run.io_bound(following.stored, workspace, _reference(state))
    given: dict[str, Any] = {"model": name, "form": form, "settings": settings}
    given |= {"reference": wish["stored"]}
    if plant == COMMANDS_ONLY:
        trying.submit(state, following.commands, f"{name} commands", given)
    else:
        given |= _place(plant) | {"options": forms.given(TrackOptions, _values(state, "loop"))}
        if not chosen["compensate.laws"]:
            raise DataError(
                "there is no controller", remedy="choose one, such as Compensator alone"
            )
        for law in chosen["compensate.laws"]:
            title = f"{name} {law}" if form == "inverse" else f"{name} {form} {law}"
            trying.submit(state, following.loop, title, given | {"controller": law})
    state.changed()


# -- what came of it ----------------------------------------------------------------------------------


def _followed(state: State) -> None:
    name, wish, workspace = _able(state), _wish(state), state.workspace
    reach = following.reach(workspace, name, wish["held"])
    every = following.newest(workspace, "runs")
    mine = {
        run: one for run, one in every.items()
        if one["model"] == name and wish["stored"] and one.get("reference") == f"{wish['stored']}.csv"
    }  # fmt: skip
    shown = state.chosen.get("compensate.run")
    shown = shown if shown in mine else next(iter(mine), "")
    drawn = list(dict.fromkeys([*([shown] if shown else []), *mine]))[:DRAWN]
    loops = {run: one for run, one in mine.items() if one.get("rmse")}
    with widgets.card("What is wanted, and what came of it" if loops else "What is wanted"):
        try:
            recording = _reference(state)
        except DataError as error:
            widgets.error_box(error)
            return
        _motion_plot(state, recording, reach, {run: mine[run] for run in drawn if run in loops})
        together = "; each channel by itself, all at once less" if len(reach) > 1 else ""
        ui.label(f"Shaded: what the model reaches{together}.").classes("muted")
        _outside(recording, reach)
        trying.going(state, ("loop", "commands"))
        if loops:
            _errors(state, mine, loops, shown)
        elif not mine:
            text = "Run shows the errors beside no compensation, and the commands, here."
            mark(ui.label(text).classes("muted"), "nothing-yet")
    if shown:
        _commands(state, shown, mine[shown])


def _outside(recording: Recording, reach: Mapping[str, Ends]) -> None:
    for channel, (low, high) in reach.items():
        values = recording[channel]
        out = (values < low - 1e-6 * abs(low)) | (values > high + 1e-6 * abs(high))
        if out.any():
            share = f"{100 * out.mean():.0f} % of {channel} is out of reach"
            mark(ui.label(f"{share}: {low:.3g} to {high:.3g}."), "out-of-reach")


def _title(one: Mapping[str, Any]) -> str:
    form = "" if one.get("form", "inverse") == "inverse" else f" ({one['form']})"
    where = one.get("plant") or one.get("rig")
    law = LAWS.get(str(one.get("controller", "")), one.get("controller") or "Commands")
    return f"{law}{form} on {where}" if where else f"{law}{form}"


def _motion_plot(
    state: State,
    recording: Recording,
    reach: Mapping[str, Ends],
    runs: Mapping[str, Mapping[str, Any]],
) -> None:
    """Draw what is wanted over time, what came of it, and shade what can be reached."""
    panels: list[Panel] = []
    ran = {name: _scored(state, name) for name in runs}
    for channel in reach:
        curves = [Curve(*over_time(recording.time, recording[channel]), "wanted")]
        plain = next(
            (one for one in ran.values() if one and f"uncompensated_{channel}" in one), None
        )
        if plain is not None:
            values = plain[f"uncompensated_{channel}"]
            curves.append(
                Curve(*over_time(_due(plain), values), "no compensation", "muted", "fine")
            )
        for place, (name, one) in enumerate(ran.items()):
            if one is not None and channel in one:
                line = over_time(_due(one), one[channel])
                curves.append(Curve(*line, _title(runs[name]), series_colour(place)))
        if panels:
            curves = [replace(curve, name="") for curve in curves]
        unit = recording.units.get(channel, "")
        panels.append(Panel("time [s]", axis_label(channel, unit), tuple(curves)))
    (figure,) = interactive.plots(Drawing(tuple(panels), stacked=True))
    for row, (low, high) in enumerate(reach.values()):
        axis = str(row + 1) if row else ""
        figure["layout"]["shapes"].append(
            {"type": "rect", "xref": f"x{axis} domain", "yref": f"y{axis}", "x0": 0, "x1": 1}
            | {
                "y0": low,
                "y1": high,
                "fillcolor": "--accent",
                "opacity": 0.08,
                "line": {"width": 0},
            }
            | {"layer": "below"}
        )
    height = 300 if len(panels) == 1 else 60 + 170 * len(panels)
    mark(widgets.plot_of(figure, height=height), "motion-plot")


def _scored(state: State, name: str) -> Recording | None:
    """Return the recording of a run without its approach; None where it is gone."""
    try:
        one = following.read_run(state.workspace, name)
    except MckibbenError:
        return None
    before = round(-one.start_time / (one.sample_time or 1.0))
    return one.slice(before, len(one)) if before > 0 else one


def _due(one: Recording) -> Any:
    """Return times at which what is measured was due: a step before it is recorded."""
    return one.time - (one.sample_time or 0.0)


def _errors(
    state: State, mine: dict[str, dict[str, Any]], loops: dict[str, dict[str, Any]], shown: str
) -> None:
    """Show the errors of all runs of the motion; the commands are of the one that is chosen."""
    names, rows = [*mine], []
    for name, one in mine.items():
        errors = [_listed(one, key) for key in ("rmse", "uncompensated", "largest")]
        limited = str(one.get("clipped", "–"))
        rows.append([_title(one), *errors, limited, partial(_acts, state, name)])

    def choose(at: int) -> None:
        state.chosen["compensate.run"] = names[at]
        results.refresh()

    columns = ["Run", "RMSE", "No compensation", "Largest", "Steps at a limit", ""]
    at = names.index(shown) if shown in names else None
    mark(widgets.table(columns, rows, chosen=at, on_choose=choose), "runs")
    for text in dict.fromkeys(text for one in loops.values() for text in _remarks(one)):
        mark(ui.label(said(text[:1].upper() + text[1:])).classes("muted"), "remark")


def _listed(one: Mapping[str, Any], key: str) -> str:
    """Return errors with their units, one for each channel."""
    units, found = one.get("units", {}), one.get(key) or {}
    texts = [f"{number(x, 3)} {units.get(name, '')}" for name, x in found.items() if x is not None]
    return ", ".join(texts) or "–"


def _remarks(one: Mapping[str, Any]) -> list[str]:
    """Return what the errors of a run do not say."""
    found = list(one.get("notes") or [])
    plain = one.get("uncompensated") or {}
    for channel, rmse in one["rmse"].items():
        offset, drew = ((one.get(key) or {}).get(channel) for key in ("offset", "scatter"))
        if rmse and plain.get(channel) is not None and rmse >= plain[channel]:
            found.append(f"{_title(one)}: no better than no compensation.")
        if rmse and offset is not None and abs(offset) > NOTABLE * rmse:
            found.append(
                f"{_title(one)}: most of the error is one offset of {number(offset, 3)} "
                f"{one['units'].get(channel, '')}. Zero the rig first, or add feedback."
            )
        elif rmse and drew is not None and drew > NOTABLE * rmse:
            text = (
                "most of the error is scatter of the plant, as its band says: nothing foresees it."
            )
            found.append(f"{_title(one)}: {text}")
    return found


def _acts(state: State, name: str) -> None:
    path = state.workspace.path("runs", f"{name}.csv")

    def away() -> None:
        state.workspace.delete("runs", name)
        path.unlink(missing_ok=True)
        state.changed()

    with ui.element("div").classes("acts"):
        widgets.icon_button("download", f"Download {name}", partial(widgets.download, path))
        widgets.icon_button("delete_outline", f"Delete {name}", away)


def _commands(state: State, name: str, one: Mapping[str, Any]) -> None:
    """Draw what was commanded in a run."""
    recording = _scored(state, name)
    if recording is None:
        return
    known = {*one.get("rmse", {}), *one.get("held", {})}
    kinds = ("pressure", "voltage", "force", "command")
    found = [
        key for key in recording.channels
        if key.partition("_")[0] in kinds and key not in known and np.ptp(recording[key]) > 0
    ]  # fmt: skip
    asked = [key for key in found if key.startswith("command_")] or found
    if not asked:
        return
    curves = [
        Curve(*over_time(recording.time, recording[key]), key, series_colour(place), "line")
        for place, key in enumerate(asked)
    ]
    unit = recording.units.get(asked[0], "")
    with widgets.card(f"Commands: {_title(one)}"):
        panel = Panel("time [s]", axis_label("command", unit), tuple(curves))
        (figure,) = interactive.plots(Drawing((panel,)))
        mark(widgets.plot_of(figure, height=200), "commands-plot")
        if not one.get("rmse"):
            for note in one.get("notes") or []:
                ui.label(said(str(note))).classes("muted")
            with widgets.row():
                path = state.workspace.path("runs", f"{name}.csv")
                take = mark(
                    widgets.button("Download commands", partial(widgets.download, path)), "take"
                )
                take.props("icon=download")
