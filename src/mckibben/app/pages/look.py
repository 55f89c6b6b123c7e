"""Look: what the muscle does, as loops, over time and in numbers; and what to record next."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from nicegui import events, ui

from mckibben.app import widgets
from mckibben.app.later import later
from mckibben.app.modelling import last_plan, plan, sides_of
from mckibben.app.state import State, view
from mckibben.app.terms import said
from mckibben.app.widgets import mark
from mckibben.comparison.channels import Channels
from mckibben.numerals import number, typeset_within
from mckibben.recording import Recording

TITLE = "Look"
ICON = "insights"

DRAWN = 3
"""Recordings that are drawn at first."""

GAPS = 3
"""Data gaps that are shown before a fold-out."""

VIEWS = {"loop": "Loop", "time": "Over time"}

Pair = tuple[str, str]


def build(state: State) -> None:
    """Build the page."""
    with mark(ui.element("div").classes("page"), "page-look"):
        with widgets.row(classes="spread"):
            widgets.heading(
                "Look", "What the muscle does, and what the recordings do not show yet."
            )
            action = widgets.primary(
                "Choose models", lambda: ui.navigate.to("/models"), "leaderboard"
            )
            mark(action, "choose-models")
        content(state)


@view
def content(state: State) -> None:
    """Show the recordings that are chosen, and what all of them tell."""
    used = state.workspace.used()
    known = [name for name in (*state.inputs, *state.outputs) if name in state.workspace.channels()]
    if not used or not known:
        with (
            widgets.card(),
            widgets.empty(
                "insights",
                "Nothing to look at yet",
                "Add recordings with an input, such as pressure, and an output, such as displacement. "
                "You then see how wide the loop is, whether speed matters, and what is missing.",
            ),
        ):
            ui.link("Add recordings →", "/")
        return
    sides = sides_of(state.workspace, state.inputs, state.outputs, state.load)
    pairs = _pairs(list(used.values()), sides)
    pair = state.chosen.get("look.pair")
    if pair is None or pair[1] not in sides.outputs or pair[0] not in (*sides.inputs, *dict(pairs)):
        pair = pairs[0]
    several = len(sides.inputs) > 1 or len(sides.outputs) > 1
    shown = [name for name in state.chosen.get("look.shown", []) if name in used]
    shown = shown or list(used)[:DRAWN]
    with ui.element("div").classes("columns"):
        with ui.element("div").classes("stack"):
            _recordings(state, used, shown)
            _words(state, sides, pair)
        with ui.element("div").classes("stack"):
            if several:
                _coupling(state, list(used.values()), sides, pair)
            _figure(state, [used[name] for name in shown], sides, pair)
            _gaps(state, sides, pair)
    widgets.next_step("Seen enough? Fit models to it, and compare them.", "Models", "/models")


def _pairs(recordings: list[Recording], sides: Channels) -> list[Pair]:
    """Return what every output is drawn over, and the output."""
    from mckibben.diagnosis.coupling import coupling

    return list(coupling(recordings, sides.inputs, sides.outputs).pairs(recordings))


def _recordings(state: State, used: dict[str, Recording], shown: list[str]) -> None:
    roles = {entry.name: entry.role for entry in state.workspace.entries()}

    def tick(name: str, on: bool) -> None:
        state.chosen["look.shown"] = [
            n for n in used if (n in shown and n != name) or (n == name and on)
        ]
        state.changed()

    def box(name: str) -> None:
        found = ui.checkbox(name, value=name in shown, on_change=lambda e: tick(name, e.value))
        mark(found.props("dense"), f"show-{name}")

    def chip(role: str) -> None:
        ui.label(role).classes(f"chip {role}")

    def row(name: str, run: Recording) -> list[Any]:
        long = f"{run.duration:.4g} s" if run.sample_time else f"{len(run)} samples"
        return [partial(box, name), partial(chip, roles[name]), long]

    with widgets.card("Recordings"):
        widgets.table(["Shown", "Role", "Length"], [row(*one) for one in used.items()])


def _coupling(state: State, used: list[Recording], sides: Channels, pair: Pair) -> None:
    """Show how far every input moves every output; a click shows their loop."""
    from mckibben.diagnosis.coupling import coupling

    found = coupling(used, sides.inputs, sides.outputs)

    def choose(given: str, wanted: str) -> None:
        state.chosen["look.pair"] = (given, wanted)
        state.changed()

    def cell(given: str, wanted: str, effect: float, unit: str) -> None:
        text = f"{number(effect, 2)}\xa0{unit}" if np.isfinite(effect) else "loop"
        button = widgets.button(text, partial(choose, given, wanted))
        chosen = "unelevated" if (given, wanted) == pair else "flat"
        widgets.labelled(button, f"{wanted} over {given}").props(chosen, remove="flat")
        mark(button, f"pair-{given}-{wanted}")

    with widgets.card("What moves what"):
        rows: list[list[Any]] = [
            [wanted]
            + [
                partial(cell, given, wanted, float(found.effects[place, at]), found.units[place])
                for at, given in enumerate(found.inputs)
            ]
            + [f"{100 * max(found.explained[place], 0):.0f} %"]
            for place, wanted in enumerate(found.outputs)
        ]
        mark(widgets.table(["", *found.inputs, "Explained"], rows), "coupling")
        ui.label(
            "What each input over its whole range does to an output, by one straight line through all "
            "inputs. The rest, up to 100 %, is bent, remembers, or takes time. Choose a number to see "
            "its loop."
        ).classes("muted")


def _figure(state: State, recordings: list[Recording], sides: Channels, pair: Pair) -> None:
    from mckibben.report.figures import draw
    from mckibben.report.subjects import loop_by

    given, wanted = pair
    shared = [n for n in recordings[0].channels if all(n in run for run in recordings)]
    values = {n: np.concatenate([run[n] for run in recordings]) for n in shared if n not in pair}
    free = [name for name, all_of_it in values.items() if np.ptp(all_of_it) > 0]
    by = state.chosen.get("look.by", "")
    by = by if by in free else ""
    kind = state.chosen.get("look.view", "loop")

    def choose(key: str, event: events.ValueChangeEventArguments[Any]) -> None:
        state.chosen[key] = event.value
        state.changed()

    with widgets.card():
        with widgets.row(classes="spread"):
            ui.label(
                f"{wanted} over {given}" if kind == "loop" else f"{wanted} and {given}"
            ).classes("subtitle")
            with widgets.row():
                if kind == "loop" and free:
                    options = {"": "Colour by recording or time"} | {
                        n: f"Colour by {n}" for n in free
                    }
                    colour = ui.select(options, value=by, on_change=partial(choose, "look.by"))
                    mark(colour.props('dense outlined aria-label="Colour"'), "colour")
                toggle = ui.toggle(VIEWS, value=kind, on_change=partial(choose, "look.view"))
                mark(toggle.props("no-caps unelevated dense"), "look-view")
        channels = [given, wanted, *([by] if by else [])]
        if kind == "loop" and by:
            drawing = loop_by(recordings, given, wanted, by)
        elif kind == "loop":
            drawing = draw(recordings, "loop", input=given, output=wanted)
        else:
            several = [*sides.inputs, *sides.outputs, *(sides.scheduling or ())]
            named = [name for name in several if all(name in each for each in recordings)]
            channels = named if len(several) <= 6 else channels
            drawing = draw(recordings, "time", channels=list(dict.fromkeys([*channels, given])))
        for plot in widgets.plot(
            drawing, height=360 if kind == "loop" else 130 + 90 * len(channels)
        ):
            mark(plot, f"look-{kind}")
        if drawing.note:
            ui.label(said(drawing.note)).classes("muted")


def _words(state: State, sides: Channels, pair: Pair) -> None:
    """Show what the muscle does: a few sentences, and all numbers behind a fold-out."""
    from mckibben.diagnosis.characterization import Characterization, characterize
    from mckibben.report.results import characterization

    used, (given, wanted) = list(state.workspace.used().values()), pair
    beside = [name for name in (*sides.inputs, *(sides.scheduling or ())) if name != given]

    def show(found: Characterization) -> None:
        widgets.items(characterization(found))

    what = f": {wanted}" if len(sides.outputs) > 1 else ""
    with widgets.card(f"What the muscle does{what}") as card:
        mark(card, "words")
        key = "characterization", state.workspace.digest(), pair, tuple(beside)
        later(key, partial(characterize, used, given, wanted, beside=beside), show, height=120)


def _gaps(state: State, sides: Channels, pair: Pair) -> None:
    """Show what the recordings cannot identify, and plan what to record next."""
    from mckibben.diagnosis.data_gaps import Gap, data_gaps
    from mckibben.report.words import gap_run, gap_sentence

    train, test = state.workspace.with_role("train"), state.workspace.with_role("test")
    inputs = sides.inputs if len(sides.inputs) > 1 else (pair[0],)

    def one(gap: Gap) -> None:
        with ui.element("div"):
            ui.label(typeset_within(gap_sentence(gap)))
            ui.label(typeset_within(gap_run(gap))).classes("muted")

    def show(found: tuple[Gap, ...]) -> None:
        if not found:
            ui.label("Nothing is missing: the recordings show all that models ask for.")
        for gap in found[:GAPS]:
            one(gap)
        if found[GAPS:]:
            with widgets.details(f"{len(found[GAPS:])} more"):
                for gap in found[GAPS:]:
                    one(gap)

    with widgets.card("What to record next") as card:
        mark(card, "gaps")
        key = "gaps", state.workspace.digest(), inputs, sides.outputs
        make = partial(data_gaps, train or test, inputs, sides.outputs, tests=test if train else ())
        later(key, make, show)
        _planned(state, inputs)


def _planned(state: State, inputs: tuple[str, ...]) -> None:
    jobs = [job for job in state.jobs.jobs.values() if job.kind == "plan"]
    if running := next((job for job in jobs if job.active), None):

        def cancel() -> None:
            state.jobs.cancel(running.name)
            state.changed()

        with widgets.row():
            ui.spinner(size="20px")
            ui.label("Planning the next recording …").classes("muted")
            widgets.button("Cancel", cancel)
        return
    made = last_plan(state.workspace)
    if jobs and jobs[-1].state == "failed":
        widgets.error_box(jobs[-1].message)
    elif made:
        text = " ".join(typeset_within(said(one)) for one in made[0]["sentences"])
        mark(ui.label(f"Planned: {text}").classes("muted"), "planned")
    with widgets.row():
        text = "Plan another" if made else "Plan the next recording"
        mark(widgets.button(text, partial(_ask, state, inputs), "edit_calendar"), "plan")
        if made:
            path = made[1]

            def download() -> None:
                ui.download.content(path.read_bytes(), path.name, "text/csv")

            mark(widgets.button("Download its commands (CSV)", download, "download"), "commands")


def _ask(state: State, inputs: tuple[str, ...]) -> None:
    used = list(state.workspace.used().values())
    fields: dict[str, list[Any]] = {}

    def submit() -> None:
        limits = {name: [one.value for one in two] for name, two in fields.items()}
        limits = {name: two for name, two in limits.items() if two != [None, None]}
        for job in [j for j in state.jobs.jobs.values() if j.kind == "plan"]:
            state.jobs.forget(job.name)
        minutes = float(field.value or 3)
        state.jobs.submit(plan, "next recording", minutes=minutes, limits=limits)
        dialog.close()
        state.changed()

    with widgets.dialog("Plan the next recording") as dialog:
        ui.label("Random motion within limits, and what closes the gaps.").classes("muted")
        field = mark(ui.number("Minutes", value=3, min=0.5, max=60), "minutes")
        with widgets.details("Limits, where they are not those recorded"):
            for name in inputs:
                ends = min(run[name].min() for run in used), max(run[name].max() for run in used)
                with widgets.row():
                    fields[name] = [
                        ui.number(
                            f"{which} {name} [{used[0].units[name]}]", placeholder=f"{end:.3g}"
                        )
                        for which, end in zip(("Lowest", "Highest"), ends, strict=True)
                    ]
        mark(widgets.primary("Plan it", submit), "plan-it")
