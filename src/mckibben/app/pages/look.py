"""Look: what the muscle does, over time, as loops, in numbers and in words."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

import numpy as np
from nicegui import ui

from mckibben.app import plots
from mckibben.app.desk import Desk, guarded, named, refused
from mckibben.app.drawn import picture
from mckibben.app.fields import said
from mckibben.app.pages.cutting import time_plot
from mckibben.app.together import obstacle
from mckibben.comparison.channels import any_moves
from mckibben.diagnosis.coupling import Coupling, coupling
from mckibben.errors import MckibbenError
from mckibben.numerals import number, typeset_within
from mckibben.recording import Recording
from mckibben.report import subjects

SMALL_HEIGHT = 150
"""Of a small picture [px]."""

EXPLAINED = '<q-td :props="props" :title="props.row.note">{{ props.value }}</q-td>'
"""A quantity, with what it is where a pointer rests on it."""


def build(desk: Desk) -> None:
    """Build the page."""

    @ui.refreshable
    def shown() -> None:
        entries = [entry.name for entry in desk.workspace.entries() if entry.role != "unused"]
        known = desk.workspace.channels()
        if not entries or not {*desk.inputs, *desk.outputs} <= set(known):
            first = "Add recordings with an input and an output first, under Data."
            ui.label(obstacle(desk) or first)
            return
        chosen = named(
            ui.select(entries, value=entries[0], label="Recording").classes("w-80"),
            "look-recording",
        )
        with ui.row().classes("w-full items-start gap-4"):
            with ui.column().classes("min-w-80 flex-[3]"):
                _pictures(desk, chosen)
            pairs = desk.looked_at()
            with ui.column().classes("min-w-72 flex-[2]"):
                for given, wanted in pairs:
                    _words(desk, given, wanted)
                _gaps(desk, pairs[0][0])

    desk.when("recordings", shown.refresh)
    desk.when("channels", shown.refresh)
    shown()


def _pictures(desk: Desk, chosen: ui.select) -> None:
    """Show the loop of the recording chosen; of several channels one, below what moves what."""
    several = len(desk.sides.inputs) > 1 or len(desk.outputs) > 1
    clicked: list[str] = []

    @ui.refreshable
    def enlarged() -> None:
        try:
            recording = desk.workspace.recording(str(chosen.value))
            pairs = desk.looked_at([recording])
        except (MckibbenError, KeyError) as error:
            refused(error)
            return
        given, wanted = clicked or pairs[0]
        if clicked and not any_moves([recording], (given,)):  # over what is held, there is no loop
            given = pairs[desk.outputs.index(wanted)][0]
        if several:
            ui.label(f"{wanted} over {given}").classes("text-lg")
        _plots(desk, recording, given, wanted)

    def enlarge(given: str, wanted: str) -> None:
        clicked[:] = given, wanted
        enlarged.refresh()

    if several:
        _matrix(desk, chosen, enlarge)
    chosen.on_value_change(enlarged.refresh)
    enlarged()


def _matrix(desk: Desk, chosen: ui.select, enlarge: Callable[[str, str], None]) -> None:
    """Show every output over every input, small, with how far each moves each; a click enlarges."""
    at = named(ui.column().classes("w-full"), "coupling")

    @ui.refreshable
    def pictured() -> None:
        try:
            recording = desk.workspace.recording(str(chosen.value))
            used = list(desk.workspace.used().values())
            found = coupling(used, desk.sides.inputs, desk.outputs)
        except (MckibbenError, KeyError) as error:
            refused(error)
            return
        ui.label("What moves what: every output over every input").classes("text-lg")
        small = plots.figures(subjects.matrix(recording, found), height=SMALL_HEIGHT)
        most = subjects.MOST
        shown = [(o, i) for o in found.outputs[:most] for i in found.inputs[:most]]
        columns = min(len(found.inputs), most)
        grid = ui.element("div").classes("w-full overflow-x-auto grid gap-1")
        grid.style(f"grid-template-columns: repeat({columns}, minmax(7rem, 1fr))")
        with grid:
            for figure, (wanted, given) in zip(small, shown, strict=True):
                _small(desk, figure, found, given, wanted, enlarge)
        ui.label(
            "In colour: the input that "
            + (
                "belongs to the output."
                if found.paired
                else "moves the output most, of those that move here."
            )
            + " Numbers: what the input over its whole range does to the output, by one straight line "
            "through all inputs of all recordings. Click on a picture's name to enlarge it."
        ).classes("text-xs opacity-70")

    chosen.on_value_change(pictured.refresh)
    with at:
        pictured()


def _small(
    desk: Desk,
    figure: plots.Json,
    found: Coupling,
    given: str,
    wanted: str,
    enlarge: Callable[[str, str], None],
) -> None:
    figure["config"] = figure["config"] | {"staticPlot": True}
    figure["layout"] |= {"margin": {"l": 30, "r": 6, "t": 4, "b": 20}}
    figure["layout"]["font"] = figure["layout"]["font"] | {"size": 10}
    for axis in ("xaxis", "yaxis"):  # its name stands above
        few = {"title": "", "nticks": 3, "tickangle": 0}
        figure["layout"][axis] = figure["layout"][axis] | few
    row, column = found.outputs.index(wanted), found.inputs.index(given)
    effect = found.effects[row, column]
    told = f": {number(effect)}\xa0{found.units[row]}" if np.isfinite(effect) else ""
    with ui.column().classes("gap-0 min-w-0"):
        button = ui.button(f"{given} → {wanted}{told}", on_click=lambda: enlarge(given, wanted))
        named(button.props("flat dense no-caps").classes("text-xs"), f"pair-{given}-{wanted}")
        picture(desk, figure)


def _plots(desk: Desk, recording: Recording, given: str, wanted: str) -> None:
    from mckibben.diagnosis.tracks import MAJOR
    from mckibben.signals import cycles

    found = cycles(recording[given], MAJOR * float(np.ptp(recording[given])))
    used = (*desk.inputs, *desk.outputs, given)
    others = subjects.third_channels(recording, used)
    with ui.row().classes("items-center w-full"):
        colour = named(
            ui.toggle(
                {"time": "Colour by time"}
                | ({"rate": "Colour by rate"} if recording.sample_time is not None else {})
                | {f"by {name}": f"Colour by {name}" for name in others},
                value="time",
            ).props("no-caps"),
            "loop-colour",
        )
        cycle = named(
            ui.number(
                f"Cycle, of {len(found)}; 0 for all", value=0, min=0, max=len(found), step=1
            ).classes("w-52"),
            "cycle",
        )
        cycle.set_visibility(bool(found))

    @ui.refreshable
    def loop() -> None:
        number = int(cycle.value or 0)
        part = recording
        if 1 <= number <= len(found):
            part = recording.slice(found[number - 1].start, found[number - 1].stop)
        if colour.value == "rate":
            figure = _by_rate(part, given, wanted)
        else:
            by = str(colour.value).removeprefix("by ")
            drawing = (
                subjects.loop([part], given, wanted)
                if by == "time"
                else subjects.loop_by([part], given, wanted, by)
            )
            figure = plots.figures(drawing, height=440)[0]
        picture(desk, figure, "loop-plot")

    colour.on_value_change(loop.refresh)
    cycle.on_value_change(loop.refresh)
    loop()
    time_plot(desk, recording, [given, wanted], "time-plot")


def _by_rate(recording: Recording, given: str, wanted: str) -> plots.Json:
    """Return the loop with its points coloured by how fast the input moves."""
    from mckibben.report.drawing import along

    places, x, y = along(recording[given], recording[wanted], plots.POINTS)
    step = recording.sample_time or 1.0
    rate = np.abs(np.gradient(recording[given]) / step)[places.astype(int)]
    figure = plots.lines(
        [],
        x=f"{given} [{recording.units[given]}]",
        y=f"{wanted} [{recording.units[wanted]}]",
        height=440,
    )
    bar = {"title": {"text": f"{recording.units[given]}/s"}}
    marker = {"color": rate.tolist(), "colorscale": "Viridis", "size": 4, "showscale": True}
    figure["data"] = [
        {"type": "scatter", "mode": "markers", "x": x.tolist(), "y": y.tolist()}
        | {"marker": marker | {"colorbar": bar}}
    ]
    return figure


def _words(desk: Desk, given: str, wanted: str) -> None:
    from mckibben.diagnosis.characterization import characterize
    from mckibben.report import words

    what = f": {wanted}" if len(desk.outputs) > 1 else ""
    ui.label(f"What the muscle does{what}").classes("text-lg")
    place = named(ui.column().classes("w-full"), "characterization")
    with place:
        ui.spinner()

    async def find() -> None:
        recordings = desk.workspace.with_role("train") + desk.workspace.with_role("test")
        sides = desk.sides
        others = (*sides.inputs, *(sides.scheduling or ()))
        beside = [name for name in others if name != given]
        try:
            found = await asyncio.to_thread(characterize, recordings, given, wanted, beside=beside)
        except MckibbenError as error:
            if place.is_deleted:  # something else is looked at by now
                return
            place.clear()
            with place:
                refused(error)
            return
        if place.is_deleted:
            return
        place.clear()
        with place:
            for sentence in words.characterization_sentences(found):
                ui.label(typeset_within(said(sentence)))
            if len(recordings) > 1:
                ui.label(f"Over all {len(recordings)} recordings:").classes("text-sm opacity-70")
            rows = [
                {
                    "what": name,
                    "value": number(value) if isinstance(value, float) else value,
                    "limits": " to ".join(map(number, limits or ())),
                    "unit": unit,
                    "note": note,
                }
                for name, value, limits, unit, note in words.quantities(found)
                if value is not None
            ]
            columns = [
                {"name": key, "label": label, "field": key, "align": align}
                for key, label, align in (
                    ("what", "Quantity", "left"),
                    ("value", "Value", "right"),
                    ("limits", "95 % interval", "right"),
                    ("unit", "Unit", "left"),
                )
            ]
            table = ui.table(rows=rows, columns=columns, row_key="what").classes("w-full")
            table.props("dense flat").add_slot("body-cell-what", EXPLAINED)
            told = f", beside={beside!r}" if beside else ""
            call = f"mckibben.characterize(recordings, {given!r}, {wanted!r}{told})"
            desk.did("characterized the recordings", call)

    ui.timer(0.05, guarded(find, "Looking what the muscle does"), once=True)


def _gaps(desk: Desk, given: str) -> None:
    from mckibben.diagnosis.data_gaps import data_gaps
    from mckibben.report.words import gap_run, gap_sentence

    tested = any(entry.role == "test" for entry in desk.workspace.entries())
    which = "the recordings to train on" if tested else "these recordings"
    ui.label(f"Data gaps of {which}").classes("text-lg")
    place = named(ui.column().classes("w-full"), "data-gaps")
    inputs = (
        desk.sides.inputs if len(desk.sides.inputs) > 1 else (given,)
    )  # each moves every output

    async def find() -> None:
        train, test = desk.workspace.with_role("train"), desk.workspace.with_role("test")
        outputs = desk.outputs
        try:
            gaps = await asyncio.to_thread(
                data_gaps, train or test, inputs, outputs, tests=test if train else ()
            )
        except MckibbenError as error:
            if not place.is_deleted:
                with place:
                    refused(error)
            return
        if place.is_deleted:
            return
        with place:
            if not gaps:
                ui.label("None.")
            for gap in gaps:
                ui.label(typeset_within(gap_sentence(gap)))
                ui.label(typeset_within(gap_run(gap))).classes("text-caption pl-4")
            desk.did(
                "looked for data gaps",
                f"mckibben.data_gaps(train, {inputs!r}, {outputs!r}, tests=test)",
            )

    ui.timer(0.05, guarded(find, "Looking for data gaps"), once=True)
