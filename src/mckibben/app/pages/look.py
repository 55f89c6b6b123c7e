"""Look: what the muscle does, as loops, over time and in numbers; and what to record next."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from nicegui import ui

from mckibben.app import forms, widgets
from mckibben.app.background import later
from mckibben.app.modelling import last_plan, plan, restored
from mckibben.app.pages import parts
from mckibben.app.state import State, view
from mckibben.app.terms import message_of
from mckibben.app.widgets import mark
from mckibben.channels import Channels, by_name
from mckibben.diagnosis.characterization import characterize
from mckibben.diagnosis.coupling import Coupling, coupling, unexplained
from mckibben.diagnosis.data_gaps import data_gaps
from mckibben.numerals import number
from mckibben.options import PlanOptions
from mckibben.recording import Recording
from mckibben.report import results
from mckibben.report.builder import Text
from mckibben.report.figures import draw

TITLE = "Look"
ICON = "insights"

RECORDINGS_DRAWN = 3
"""Recordings that are drawn at first."""

MOST_CHANNELS = 6
"""Channels that are drawn over time together."""

VIEWS = {"loop": "Loop", "time": "Over time", "spectrum": "Spectrum"}

Pair = tuple[str, str]


def build(state: State) -> None:
    """Build the page."""
    with mark(ui.element("div").classes("page"), "page-look"):
        with widgets.row(classes="spread"):
            text = "Characterization of the muscle, and data gaps of the recordings."
            widgets.heading("Look", text)
            if state.workspace.names("recordings"):
                choose = partial(ui.navigate.to, "/models")
                mark(widgets.primary("Choose models", choose, "leaderboard"), "choose-models")
        content(state)


@view
def content(state: State) -> None:
    """Show the recordings that are chosen, and what all of them tell."""
    used = state.workspace.used()
    if not (state.inputs and state.outputs):
        text = (
            "Recordings need an input, such as pressure, and an output, such as displacement. "
            "You then see how wide the loop is, whether speed matters, and what is missing."
        )
        with widgets.card(), widgets.empty("insights", "Nothing to look at yet", text):
            ui.link("Add recordings, or choose their inputs and outputs →", "/")
        return
    sides, runs = state.sides, [*used.values()]
    effects = coupling(runs, sides.inputs, sides.outputs)
    all_pairs = [(driving, driven) for driving in sides.inputs for driven in sides.outputs]
    pair, pairs = state.chosen.get("look.pair"), effects.pairs(runs)
    pair = pair if pair in [*all_pairs, *pairs] else pairs[0]
    shown = [name for name in state.chosen.get("look.shown", []) if name in used]
    shown = shown or [*used][:RECORDINGS_DRAWN]
    with ui.element("div").classes("columns"):
        with ui.element("div").classes("stack"):
            with widgets.card("Recordings"):
                _recordings(state, used, shown)
                for name in unexplained(runs, effects):
                    text = f"The inputs explain hardly any of {name}: are these its inputs?"
                    mark(ui.label(text).classes("error"), "unexplained")
            with widgets.card("Characterization" + f": {pair[1]}" * (len(sides.outputs) > 1)):
                _words(state, runs, sides, pair)
        with ui.element("div").classes("stack"):
            if len(all_pairs) > 1:
                with widgets.card("Effects of inputs on outputs"):
                    _coupling(state, effects, pair)
            with widgets.card():
                _figure(state, [used[name] for name in shown], sides, pair)
            with widgets.card("What to record next"):
                _gaps(state, sides, pair)
                _planned(state)
    widgets.next_step("Seen enough? Fit models to it, and compare them.", "Models", "/models")


def _choose(state: State, key: str, value: Any) -> None:
    state.chosen[key] = value
    content.refresh()


def _recordings(state: State, used: dict[str, Recording], shown: list[str]) -> None:
    roles = {entry.name: entry.role for entry in state.workspace.entries()}

    def tick(name: str, event: Any) -> None:
        names = [n for n in used if (event.value if n == name else n in shown)]
        _choose(state, "look.shown", names)

    def box(name: str) -> None:
        element = ui.checkbox(name, value=name in shown, on_change=partial(tick, name))
        mark(element.props("dense"), f"show-{name}")

    def chip(role: str) -> None:
        ui.label(role.capitalize()).classes(f"chip {role}")

    lengths = [
        f"{run.duration:.4g} s" if run.sample_time else f"{len(run)} samples"
        for run in used.values()
    ]
    rows = [
        [partial(box, name), partial(chip, roles[name]), length]
        for name, length in zip(used, lengths, strict=True)
    ]
    widgets.table(["Shown", "Role", "Length"], rows)


def _coupling(state: State, coupled: Coupling, pair: Pair) -> None:
    """Show how far every input moves every output; a click shows their loop."""

    def cell(driving: str, driven: str, effect: float, unit: str) -> None:
        text = f"{number(effect, 2)}\xa0{unit}" if np.isfinite(effect) else "loop"
        button = widgets.button(text, partial(_choose, state, "look.pair", (driving, driven)))
        chosen = "unelevated" if (driving, driven) == pair else "flat"
        widgets.labelled(button, f"{driven} over {driving}").props(chosen, remove="flat")
        mark(button, f"pair-{driving}-{driven}")

    rows: list[list[Any]] = []
    effect_rows = zip(
        coupled.outputs,
        coupled.effects.tolist(),
        coupled.units,
        coupled.explained,
        strict=True,
    )
    for driven, effects, unit, share in effect_rows:
        cells = [
            partial(cell, driving, driven, effect, unit)
            for driving, effect in zip(coupled.inputs, effects, strict=True)
        ]
        rows.append([driven, *cells, f"{100 * max(share, 0):.0f} %"])
    mark(widgets.table(["", *coupled.inputs, "Explained"], rows), "coupling")
    ui.label(
        "Effect of each input over its whole range on an output, by linear regression on all inputs. "
        "The rest, up to 100 %, is nonlinear, hysteretic or dynamic. Choose a cell to see its loop."
    ).classes("muted")


def _figure(state: State, runs: list[Recording], sides: Channels, pair: Pair) -> None:
    (driving, driven), kind = pair, state.chosen.get("look.view", "loop")
    common = [name for name in runs[0].channels if all(name in run for run in runs)]
    modelled = [n for n in (*sides.inputs, *sides.outputs, *sides.further) if n in common]
    channels = [
        *dict.fromkeys([driving, driven, *(modelled if len(modelled) <= MOST_CHANNELS else ())])
    ]
    with widgets.row(classes="spread"):
        ui.label(f"{driven} over {driving}").classes("subtitle")
        toggle = ui.toggle(VIEWS, value=kind).props("no-caps unelevated dense")
        toggle.on_value_change(lambda event: _choose(state, "look.view", event.value))
    if kind != "loop":
        drawing = draw(runs, kind, channels=channels)
    else:
        drawing = draw(runs, "loop", input=driving, output=driven)
    for plot in widgets.plot(drawing, height=360 if kind == "loop" else 130 + 90 * len(channels)):
        mark(plot, f"look-{kind}")
    if drawing.note:
        ui.label(message_of(drawing.note)).classes("muted")


def _words(state: State, runs: list[Recording], sides: Channels, pair: Pair) -> None:
    """Show the characterization: a few sentences, and all numbers behind a fold-out."""
    scheduling = tuple(n for n in (*sides.inputs, *sides.further) if n != pair[0])
    modelled = {*sides.inputs, *sides.outputs, *sides.further}
    dropped = {*by_name(runs)[0]} - modelled  # no inputs, as was chosen
    runs = [run.select([name for name in run if name not in dropped]) for run in runs]
    key = "characterization", state.workspace.digest(), pair, scheduling, tuple(sorted(dropped))
    make = partial(characterize, runs, *pair, scheduling=scheduling)
    with mark(ui.element("div"), "words"):
        later(key, make, lambda result: widgets.items(results.characterization(result)), height=120)


def _gaps(state: State, sides: Channels, pair: Pair) -> None:
    """Show what the recordings cannot identify."""
    train, test = state.workspace.train_and_test()
    inputs = sides.inputs if len(sides.inputs) > 1 else (pair[0],)
    no_gaps = [Text(["The recordings have no data gaps."])]
    key = "gaps", state.workspace.digest(), inputs, sides.outputs
    make = partial(data_gaps, train or test, inputs, sides.outputs, tests=test if train else ())
    with mark(ui.element("div"), "gaps"):
        later(key, make, lambda gaps: widgets.items(results.data_gaps(gaps) or no_gaps))


def _planned(state: State) -> None:
    """Offer to plan the next recording, and show the plan."""
    last, jobs = last_plan(state.workspace), parts.jobs_of(state, ["plan"])
    for job in jobs:
        parts.show_job(state, job)
    if any(job.active for job in jobs):
        return
    if last:
        items = restored(last[0])
        with mark(ui.element("div").classes("stack"), "planned"):
            ui.label("Planned").classes("subtitle")
            widgets.items([item for item in items if isinstance(item, Text)])
            with widgets.details("Its steps, and the gaps they close"):
                widgets.items([item for item in items if not isinstance(item, Text)])
    with widgets.row():
        text = "Plan another" if last else "Plan the next recording"
        mark(widgets.button(text, partial(_ask, state), "edit_calendar"), "plan")
        if last:
            download = partial(widgets.download, last[1])
            mark(widgets.button("Download its commands (CSV)", download, "download"), "commands")


def _ask(state: State) -> None:
    values: dict[str, Any] = {}

    def submit() -> None:
        state.jobs.forget_ended("plan")
        state.jobs.submit(plan, "next recording", **forms.given(PlanOptions, values))
        dialog.close()
        state.changed()

    with widgets.dialog("Plan the next recording") as dialog:
        ui.label(
            "Random motion within the limits recorded, and what closes the gaps. "
            f"Other limits are written as {state.inputs[0]}=1:5."
        ).classes("muted")
        with widgets.row(classes="fields"):
            forms.fields(PlanOptions, ("minutes", "limits"), values)
        mark(widgets.primary("Plan it", submit), "plan-it")
