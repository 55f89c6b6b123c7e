"""Compensate: a wished-for motion, what can be reached, the pressures, and a closed loop on a plant."""

from __future__ import annotations

import asyncio
from inspect import getdoc
from typing import Any

import numpy as np
from nicegui import ui
from nicegui.events import MouseEventArguments, UploadEventArguments

from mckibben.app import plots
from mckibben.app.desk import Desk, guarded, kept, named, on_event, tell
from mckibben.app.guard import LARGEST_UPLOAD, TOO_LARGE
from mckibben.app.reading import read_upload
from mckibben.app.work import compensated, reference_recording
from mckibben.arrays import Array
from mckibben.errors import DataError, MckibbenError
from mckibben.files import read, write
from mckibben.recording import Recording
from mckibben.report import wording

OWN = "model "
"""Before the names of models among those of plants."""

UNCOMPENSATED = "uncompensated_displacement"
"""What a run's recording calls what no compensation gave."""

WIDTH, HEIGHT = 600, 220
"""Of the place to draw in [px]."""


def build(desk: Desk) -> None:
    """Build the page."""
    selects: list[ui.select] = []

    def found() -> list[str]:
        return [name for name in desk.workspace.models() if desk.workspace.invertible(name)]

    @ui.refreshable
    def shown() -> None:
        names = found()
        if not names:
            ui.label(
                "Fit a model that can be inverted first, under Models: pi, gpi, mpi, cpi, preisach."
            )
            return
        with ui.row().classes("w-full items-end gap-3"):
            model = named(
                ui.select(names, value=names[0], label="Model to invert").classes("min-w-52"),
                "invert",
            )
            step = ui.number("Time between steps [s]", value=0.02, min=1e-4, max=10.0).classes(
                "w-44"
            )
        selects[:] = [model]
        Editor(desk, model, step)

    def more() -> None:
        # what is being drawn must not vanish because a fit has ended
        if selects:
            selects[0].set_options(found())
        else:
            shown.refresh()

    desk.when("results", more)
    shown()


def _reach(desk: Desk, model: str) -> tuple[float, float]:
    try:
        low, high = desk.workspace.model(model).reachable()
    except MckibbenError:
        low = high = np.array([np.nan])
    if not (np.isfinite(low[0]) and np.isfinite(high[0])):
        seen = [r[desk.output] for r in desk.workspace.with_role("train")] or [np.array([0.0, 1.0])]
        least, most = min(float(y.min()) for y in seen), max(float(y.max()) for y in seen)
    else:
        least, most = float(low[0]), float(high[0])
    return (least, most) if least < most else (least - 0.5, least + 0.5)


class Editor:
    """A reference, drawn by clicks, written as points, or loaded; and what comes of it.

    Parameters
    ----------
    desk : Desk
    model, step : element
        Whose values are the model to invert and the time between steps [s].
    """

    def __init__(self, desk: Desk, model: ui.select, step: ui.number) -> None:
        self.desk, self.model, self.step = desk, model, step
        self.low, self.high = _reach(desk, str(model.value))
        self.file: Recording | None = None
        with ui.row().classes("w-full items-start gap-4"):
            with ui.column().classes("min-w-80 flex-1"):
                self._inputs()
            self.results = ui.column().classes("min-w-96 flex-[2]")
        model.on_value_change(self._other_model)

    def _inputs(self) -> None:
        ui.label("Reference").classes("text-lg")
        ui.label("Click in the frame from left to right, write points, or load a file.")
        self.duration = ui.number("Duration [s]", value=20.0, min=0.1).classes("w-32")
        self.frame = named(
            ui.interactive_image(size=(WIDTH, HEIGHT), cross=True, on_mouse=self._clicked)
            .classes("w-full border")
            .style(f"aspect-ratio: {WIDTH} / {HEIGHT}"),
            "draw",
        )
        self.text = named(
            ui.textarea("Points: time [s] and displacement [mm], one pair a line").classes(
                "w-full"
            ),
            "points",
        )
        self.text.on_value_change(self._drawn)
        with ui.row():
            ui.button("Clear", on_click=lambda: self.text.set_value("")).props("outline")
            named(ui.button("A wave", on_click=self._wave).props("outline"), "wave")
            named(ui.button("Show pressures", on_click=guarded(self._show)), "show-pressures")
        ui.upload(
            label="or a file with displacement over time",
            auto_upload=True,
            max_file_size=LARGEST_UPLOAD,
            on_rejected=lambda: tell(TOO_LARGE),
            on_upload=on_event(self._loaded),
        ).classes("w-full")

    @property
    def _seconds(self) -> float:
        return float(self.duration.value or 20.0)

    def _other_model(self) -> None:
        self.low, self.high = _reach(self.desk, str(self.model.value))
        self.results.clear()
        self._drawn()

    def _wave(self) -> None:
        a, b = (self.low + share * (self.high - self.low) for share in (0.2, 0.8))
        times = np.linspace(0.0, self._seconds, 41)
        values = 0.5 * (a + b) - 0.5 * (b - a) * np.cos(4 * np.pi * times / times[-1])
        pairs = zip(times, values, strict=True)
        self.text.set_value("\n".join(f"{time:.6g} {value:.6g}" for time, value in pairs))

    def _clicked(self, event: MouseEventArguments) -> None:
        time = self._seconds * event.image_x / WIDTH
        value = self.high - (self.high - self.low) * event.image_y / HEIGHT
        self.text.set_value(f"{self.text.value or ''}\n{time:.4g} {value:.4g}".strip())

    def _drawn(self) -> None:
        """Draw the points into the frame; lines that are none yet are passed over."""
        self.file = None
        try:
            points = _points(self.text.value or "")
        except DataError:
            points = []
        places = [
            (WIDTH * t / self._seconds, HEIGHT * (self.high - v) / (self.high - self.low))
            for t, v in points
        ]
        line = " ".join(f"{x:.1f},{y:.1f}" for x, y in places)
        dots = "".join(
            f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3" fill="#0072b2" />' for x, y in places[:200]
        )
        self.frame.set_content(
            f'<polyline points="{line}" fill="none" stroke="#0072b2" stroke-width="2" />{dots}'
        )

    async def _loaded(self, event: UploadEventArguments) -> None:
        path = await kept(self.desk, event.file)
        found = await asyncio.to_thread(read_upload, path)
        if len(found) != 1:
            raise DataError("it holds several recordings", file=path, remedy="give a file of one")
        self.file = found[0]
        await self._show()

    def _wished(self) -> Recording:
        channel = self.desk.workspace.model(str(self.model.value)).outputs[0].name
        if self.file is not None:
            return self.file.select([channel])
        step = float(self.step.value or 0.02)
        return reference_recording(_points(self.text.value or ""), step, channel)

    async def _show(self) -> None:
        desk, reference, name = self.desk, self._wished(), str(self.model.value)
        given, notes = await asyncio.to_thread(compensated, desk.workspace, name, reference)
        file = f"{desk.workspace.new_name('runs', 'reference', '.csv')}.csv"
        await asyncio.to_thread(write, reference, desk.workspace.new_path("runs", file))
        call = f"mckibben.load('models/{name}.json').inverse().simulate(reference)"
        desk.did(f"inverted {name}", call)
        self.results.clear()
        with self.results:
            _pressures(desk, name, reference, given, notes)
            _loops(desk, name, file)


def _points(text: str) -> list[tuple[float, float]]:
    """Return pairs of numbers, one a line.

    Raises
    ------
    DataError
        On a line that is not two numbers.
    """
    points = []
    for row, line in enumerate(filter(None, (part.strip() for part in text.splitlines())), start=1):
        words = line.replace(",", " ").replace(";", " ").split()
        try:
            time, value = map(float, words)
        except ValueError:
            raise DataError(
                f"{line!r:.40} is not a time and a displacement",
                row=row,
                remedy="write two numbers a line",
            ) from None
        points.append((time, value))
    return points


def _pressures(
    desk: Desk, name: str, reference: Recording, given: Recording, notes: list[str]
) -> None:
    block = desk.workspace.model(name)
    wanted, pressure = block.outputs[0], block.inputs[0]
    ui.label("Shaded: what can be reached whatever happened before").classes("text-xs opacity-70")
    named(
        ui.plotly(
            plots.lines(
                [("reference", reference.time, reference[wanted.name], "series-1")],
                x="time [s]",
                y=f"{wanted.name} [{wanted.unit}]",
                dark=desk.dark,
                bands=(_reach(desk, name),),
            )
        ).classes("w-full"),
        "reference-plot",
    )
    named(
        ui.plotly(
            plots.lines(
                [(pressure.name, given.time, given[pressure.name], "series-2")],
                x="time [s]",
                y=f"{pressure.name} [{pressure.unit}]",
                dark=desk.dark,
            )
        ).classes("w-full"),
        "pressure-plot",
    )
    for note in notes:
        ui.label(note).classes("text-warning")
    content = "time_s,pressure_bar\n" + "\n".join(
        f"{t:.9g},{p:.9g}" for t, p in zip(given.time, given[pressure.name], strict=True)
    )
    ui.button(
        "Pressures as CSV", on_click=lambda: ui.download(content.encode(), f"{name}-pressures.csv")
    ).props("outline")


def _listed(values: dict[str, float | None]) -> str:
    return ", ".join(wording.number(value, 3) for value in values.values())


def _loops(desk: Desk, model: str, reference: str) -> None:
    from mckibben import registry
    from mckibben.rigs import load_rig, rig_names

    laws = {name: registry.load("controllers", name) for name in registry.names("controllers")}
    rigs = [
        rig.name
        for rig in map(load_rig, rig_names())
        if [c for c in rig.inputs if c.startswith("pressure")] == ["pressure"]
        and "displacement" in rig.outputs
    ]
    plants = desk.workspace.plants(model)
    offered = {f"{OWN}{name}": f"{name}, a model of yours" for name in plants}
    offered |= {name: f"{name}, a virtual rig" for name in rigs}
    ui.label("Closed loop").classes("text-lg")
    ui.label(
        "On another model of your muscle, fitted under Models; a rig is somebody else's muscle."
    ).classes("text-xs opacity-70")
    with ui.row().classes("items-end"):
        plant = named(
            ui.select(offered, value=next(iter(offered)), label="Plant").classes("min-w-64"),
            "loop-plant",
        )
        kinds = named(
            ui.select(
                {name: (getdoc(law) or name).rstrip(".") for name, law in laws.items()},
                value=["feedforward", "feedforward-pid"],
                multiple=True,
                label="Controllers",
            ).classes("min-w-64"),
            "controllers",
        )

        async def start() -> None:
            if not plant.value or not kinds.value:
                tell("Choose a plant and a controller.")
            own = str(plant.value).removeprefix(OWN) if str(plant.value).startswith(OWN) else None
            there = {"rig": plant.value} if own is None else {"plant": own}
            on = f"load_rig({plant.value!r})" if own is None else f"Twin(load('models/{own}.json'))"
            for kind in kinds.value:
                name = f"{model}-{kind}"
                call = f"track({kind} of {model!r}, {on}, reference)"
                desk.jobs.submit(
                    "loop",
                    {"model": model, "controller": kind, "reference": reference}
                    | there
                    | {"name": name, "call": call},
                )
                desk.did(f"closed the loop: {name}", call)
            desk.changed("jobs")

        named(ui.button("Run", on_click=guarded(start)), "run-loop")

    @ui.refreshable
    def shown() -> None:
        runs = desk.workspace.runs(model)
        rows: list[dict[str, Any]] = [
            {"name": name, "controller": run.controller, "plant": run.plant or run.rig}
            | {"rmse": _listed(run.rmse), "without": _listed(run.uncompensated)}
            | {"largest": _listed(run.largest), "clipped": run.clipped}
            | {"step": wording.number(run.step_us, 2)}
            for name, run in runs.items()
        ]
        if not rows:
            return
        labels = (
            *("Run", "Controller", "Plant", "RMSE [mm]", "RMSE without compensation [mm]"),
            *("Largest [mm]", "Clipped", "Step [µs]"),
        )
        columns = [
            {"name": key, "field": key, "label": label, "align": "left"}
            for key, label in zip(rows[0], labels, strict=True)
        ]
        named(ui.table(rows=rows, columns=columns, row_key="name").props("dense flat"), "runs")
        for note in dict.fromkeys(note for run in runs.values() for note in run.notes):
            named(ui.label(note).classes("text-warning"), "loop-note")
        curves: list[tuple[str, Array, Array, str]] = []
        for place, name in enumerate(list(runs)[-4:]):
            try:
                (run_,) = read(desk.workspace.path("runs", f"{name}.csv"), informative=False)
                wished, followed = run_["reference_displacement"], run_["displacement"]
            except (MckibbenError, ValueError, KeyError):
                continue
            if not curves:
                curves.append(("reference", run_.time, wished, "measured"))
                if UNCOMPENSATED in run_:
                    plain = run_[UNCOMPENSATED]
                    curves.append(("no compensation", run_.time, plain, "input"))
            curves.append((name, run_.time, followed, f"series-{place + 1}"))
        if curves:
            named(
                ui.plotly(
                    plots.lines(curves, x="time [s]", y="displacement [mm]", dark=desk.dark)
                ).classes("w-full"),
                "loop-runs",
            )

    desk.when("runs", shown.refresh)
    shown()
