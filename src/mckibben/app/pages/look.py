"""Look: what the muscle does, over time, as loops, in numbers and in words."""

from __future__ import annotations

import asyncio

import numpy as np
from nicegui import ui

from mckibben.app import plots
from mckibben.app.desk import Desk, guarded, named
from mckibben.app.pages.cutting import time_plot
from mckibben.errors import MckibbenError
from mckibben.recording import Recording
from mckibben.report import subjects, wording


def build(desk: Desk) -> None:
    """Build the page."""

    @ui.refreshable
    def shown() -> None:
        entries = [entry.name for entry in desk.workspace.entries() if entry.role != "unused"]
        known = desk.workspace.channels()
        if not entries or desk.input not in known or desk.output not in known:
            ui.label("Add recordings with an input and an output first, under Data.")
            return
        chosen = named(
            ui.select(entries, value=entries[0], label="Recording").classes("w-80"),
            "look-recording",
        )
        with ui.row().classes("w-full items-start gap-4"):
            with ui.column().classes("min-w-80 flex-[3]"):
                _plots(desk, chosen)
            with ui.column().classes("min-w-72 flex-[2]"):
                _words(desk)
                _untold(desk)

    desk.when("recordings", shown.refresh)
    desk.when("channels", shown.refresh)
    desk.when("theme", shown.refresh)
    shown()


def _plots(desk: Desk, chosen: ui.select) -> None:
    from mckibben.signals import cycles

    @ui.refreshable
    def drawn() -> None:
        try:
            recording = desk.workspace.recording(str(chosen.value))
        except MckibbenError as error:
            ui.label(str(error)).classes("text-negative")
            return
        found = cycles(recording[desk.input])
        with ui.row().classes("items-center w-full"):
            colour = named(
                ui.toggle({"time": "Colour by time", "rate": "Colour by rate"}, value="time"),
                "loop-colour",
            )
            cycle = named(
                ui.number(
                    f"Cycle, of {len(found)}; 0 for all", value=0, min=0, max=len(found), step=1
                ).classes("w-52"),
                "cycle",
            )

        @ui.refreshable
        def loop() -> None:
            number = int(cycle.value or 0)
            part = recording
            if 1 <= number <= len(found):
                part = recording.slice(found[number - 1].start, found[number - 1].stop)
            figure = (
                _by_rate(desk, part)
                if colour.value == "rate"
                else plots.figures(
                    subjects.loop([part], desk.input, desk.output), dark=desk.dark, height=440
                )[0]
            )
            named(ui.plotly(figure).classes("w-full"), "loop-plot")

        colour.on_value_change(loop.refresh)
        cycle.on_value_change(loop.refresh)
        loop()
        time_plot(desk, recording, [desk.input, desk.output], "time-plot")

    chosen.on_value_change(drawn.refresh)
    drawn()


def _by_rate(desk: Desk, recording: Recording) -> plots.Json:
    """Return the loop with its points coloured by how fast the input moves."""
    from mckibben.report.drawing import along

    places, x, y = along(recording[desk.input], recording[desk.output], plots.POINTS)
    step = recording.sample_time or 1.0
    rate = np.abs(np.gradient(recording[desk.input]) / step)[places.astype(int)]
    figure = plots.lines(
        [],
        x=f"{desk.input} [{recording.units[desk.input]}]",
        y=f"{desk.output} [{recording.units[desk.output]}]",
        dark=desk.dark,
        height=440,
    )
    bar = {"title": {"text": f"{recording.units[desk.input]}/s"}}
    marker = {"color": rate.tolist(), "colorscale": "Viridis", "size": 4, "showscale": True}
    figure["data"] = [
        {"type": "scatter", "mode": "markers", "x": x.tolist(), "y": y.tolist()}
        | {"marker": marker | {"colorbar": bar}}
    ]
    return figure


def _words(desk: Desk) -> None:
    from mckibben.characterization import characterize

    ui.label("What the muscle does").classes("text-lg")
    place = named(ui.column().classes("w-full"), "characterization")

    async def find() -> None:
        recordings = desk.workspace.with_role("train") + desk.workspace.with_role("test")
        try:
            found = await asyncio.to_thread(characterize, recordings, desk.input, desk.output)
        except MckibbenError as error:
            with place:
                ui.label(str(error)).classes("text-negative")
            return
        with place:
            for sentence in found.sentences:
                ui.label(sentence)
            rows = [
                {
                    "what": name,
                    "value": wording.number(value) if isinstance(value, float) else value,
                    "unit": unit,
                    "note": note,
                }
                for name, value, unit, note in found.table()
                if value is not None
            ]
            columns = [
                {"name": key, "label": label, "field": key, "align": align}
                for key, label, align in (
                    ("what", "Quantity", "left"),
                    ("value", "Value", "right"),
                    ("unit", "Unit", "left"),
                )
            ]
            ui.table(rows=rows, columns=columns, row_key="what").classes("w-full").props(
                "dense flat"
            )
            call = f"mckibben.characterize(recordings, {desk.input!r}, {desk.output!r})"
            desk.did("characterized the recordings", call)

    ui.timer(0.05, guarded(find), once=True)


def _untold(desk: Desk) -> None:
    from mckibben.excitation import untold

    ui.label("What these recordings cannot tell").classes("text-lg")
    place = named(ui.column().classes("w-full"), "untold")

    async def find() -> None:
        train, test = desk.workspace.with_role("train"), desk.workspace.with_role("test")
        try:
            gaps = await asyncio.to_thread(
                untold, train or test, desk.input, desk.output, tests=test if train else ()
            )
        except MckibbenError as error:
            with place:
                ui.label(str(error)).classes("text-negative")
            return
        with place:
            if not gaps:
                ui.label("Nothing that a model would need.")
            for gap in gaps:
                ui.label(gap.sentence)
                ui.label(gap.remedy).classes("text-caption pl-4")
            desk.did(
                "asked what the recordings cannot tell",
                f"mckibben.untold(train, {desk.input!r}, {desk.output!r}, tests=test)",
            )

    ui.timer(0.05, guarded(find), once=True)
