"""Compensate: a desired motion, what can be reached, the pressures, and whether that is right."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from typing import Any

import numpy as np
from nicegui import ui

from mckibben.app import fields, forms, motions, plots, scripts
from mckibben.app.desk import Desk, against, caution, guarded, labelled, named, on_event
from mckibben.app.drawn import picture
from mckibben.app.following import compensated, kept_motion
from mckibben.app.jobs import ENDED
from mckibben.app.pages import closing, forces, leaderboard, logs, loops
from mckibben.app.pages.drawing_reference import Sketch
from mckibben.app.recorded import at_rest, held_for, pace, reached
from mckibben.blocks.fields import Channel
from mckibben.blocks.inverse import COMMANDS
from mckibben.comparison.channels import FORCE
from mckibben.errors import MckibbenError
from mckibben.files import read
from mckibben.recording import Recording

NONE_PREDICTS = "No model that predicts these data has an inverse: fit others under Models. "

FORCED = (
    "What is modelled is a force: it is estimated while the muscle is held, below, and no motion is "
    "asked for. For a compensator, add recordings in which the muscle moves."
)


def build(desk: Desk) -> None:
    """Build the page."""
    editors: list[Editor] = []

    @ui.refreshable
    def shown() -> None:
        names = desk.workspace.to_invert()
        if not names:
            ui.label(FORCED if FORCE in desk.outputs else _none_yet(desk))
            return
        leaderboard.doubts(desk, all_refused=False)
        editors[:] = [Editor(desk, names)]

    def more() -> None:
        # what is being drawn must not vanish because a fit has ended
        if editors:
            editors[0].offer(desk.workspace.to_invert())
        else:
            shown.refresh()

    desk.when("results", more)
    shown()
    logs.build(desk)
    forces.build(desk)


def _none_yet(desk: Desk) -> str:
    """Return that nothing can be inverted: what is being fitted, or what is to be."""
    jobs = [job for job in desk.jobs.jobs.values() if job.kind == "fit" and job.state not in ENDED]
    if jobs:
        under_way = ", ".join(job.title for job in jobs)
        return f"Nothing that can be inverted is fitted yet. Under way: {under_way}."
    return "Fit a model that can be inverted first, under Models."


def _reach(desk: Desk, model: str) -> dict[str, tuple[float, float]]:
    """Return what a model can reach of every output, or else what was recorded."""
    block = desk.workspace.model(model)
    low, high = block.reachable()
    found = {}
    for channel, least, most in zip(block.outputs, low, high, strict=True):
        if not np.isfinite([least, most]).all():
            runs = [run[channel.name] for run in desk.workspace.readable() if channel.name in run]
            ends = [(float(y.min()), float(y.max())) for y in runs] or [(0.0, 1.0)]
            least, most = min(a for a, _ in ends), max(b for _, b in ends)
        found[channel.name] = (
            (float(least), float(most)) if least < most else (least - 0.5, least + 0.5)
        )
    return found


def _quantity(commands: Sequence[Channel]) -> str:
    """Return what is commanded: pressure, voltage, force."""
    return next((one for one in (*COMMANDS, FORCE) if one in commands[0].name), "command")


class Editor:
    """A model, what it is used as, a reference, and what comes of it.

    Parameters
    ----------
    desk : Desk
    names : list of str
        Models that can be inverted, the best first.
    """

    def __init__(self, desk: Desk, names: list[str]) -> None:
        self.desk = desk
        self.sketch: Sketch
        self.ticks = loops.Ticks()
        self._asked: tuple[Any, ...] | None = None  # what is shown, or being worked out
        self._told: dict[str, float] | None = None  # under which it is shown what can be reached
        with ui.row().classes("w-full items-end gap-3"):
            self.model = named(
                ui.select(self._titles(names), value=names[0], label="Model to invert").classes(
                    "min-w-52"
                ),
                "invert",
            )
            self.form = named(
                ui.select(
                    {"inverse": forms.FORMS["inverse"]}, value="inverse", label="Compensator"
                ).classes("min-w-64"),
                "compensator",
            )
            self.fields = {
                key: ui.number(
                    label, value=forms.DEFAULTS[key], min=0, on_change=self._changed
                ).classes("w-56")
                for own in forms.SETTINGS.values()
                for key, label in own.items()
            }
            self.step = ui.number("Time between steps [s]", min=1e-6, max=10.0)
            self.step.classes("w-44").on_value_change(self._changed)
        self.form.on_value_change(self._fields)
        self.form.on_value_change(self._changed)
        self._fields()
        self.doubt = named(caution(""), "not-recommended")
        self._say()
        desk.when("channels", self._say)
        desk.when("jobs", self._title)
        with ui.row().classes("w-full items-start gap-4"):
            self.left = ui.column().classes("min-w-0 w-full lg:w-[34rem] gap-2")
            with ui.column().classes("min-w-0 flex-1 basis-80 gap-2"):
                self.shown, self.runs = (ui.column().classes("w-full gap-2") for _ in range(2))
        self._blank()
        self.model.on_value_change(on_event(lambda _: self._turned()))
        self._sketch()
        self._loops()
        self._offer_again()
        ui.timer(0.05, guarded(self._forms, "Looking what it can be used as"), once=True)

    def _say(self) -> None:
        """Say what speaks against the model chosen, or why it is not the first of the leaderboard."""
        refused, names = against(self.desk.results()), list(self.model.options)
        first = next((row["name"] for row in self.desk.results()), self.name)
        text = ""
        if self.name in refused:
            text = NONE_PREDICTS * all(name in refused for name in names)
            text += f"{self.name} is not recommended: {refused[self.name]}."
        elif first not in names and self.name == names[0]:
            text = f"{first}, {self._first}, has no inverse; {self.name} is the next one."
            if none := self.desk.not_recommended:
                text = f"{none}. {text}"
        self.doubt.set_text(fields.said(text))
        self.doubt.set_visibility(bool(text))

    def _titles(self, names: list[str]) -> dict[str, str]:
        best = next((row["name"] for row in self.desk.results()), None)
        stale = self.desk.stale()
        words = {name: " (other data)" if name in stale else "" for name in names}
        words |= {best: f" ({self._first})"} if best in words else {}
        return {name: f"{name}{words[name]}" for name in names}

    @property
    def _first(self) -> str:
        """What the best model is: other fits may still find a better one."""
        fitting = any(job.kind == "fit" for job in self.desk.jobs.active())
        return f"first of the leaderboard{' so far' * fitting}"

    def _title(self) -> None:
        """Say anew what is first, where fits have begun or ended."""
        titles = self._titles(list(self.model.options))
        if titles != self.model.options:
            self.model.set_options(titles, value=self.name)
        self._say()

    def offer(self, names: list[str]) -> None:
        """Offer other models, without disturbing what is drawn; one of data that were is not kept."""
        if names:
            value = self.desk.model_to_show(self.name, names)
            self.model.set_options(self._titles(names), value=value)
        self._say()

    @property
    def name(self) -> str:
        """The model."""
        return str(self.model.value)

    @property
    def settings(self) -> dict[str, Any]:
        """Settings of the compensator."""
        own = forms.SETTINGS.get(str(self.form.value), {})
        return {key: self.fields[key].value for key in own}

    def _fields(self) -> None:
        """Show the settings of the compensator chosen."""
        for key, field in self.fields.items():
            field.set_visibility(key in forms.SETTINGS.get(str(self.form.value), ()))

    def _sketch(self) -> None:
        desk, name = self.desk, self.name
        block = desk.workspace.model(name)
        known = pace(desk.workspace, name)
        if block.sample_time or not self.step.value:
            self.step.set_value(known.step)
        timed = bool(block.sample_time or known.shortest)
        labelled(self.step, "hint", "" if timed else "assumed: no recording has a time")
        inverse = forms.inverse_of(block)
        outputs = [c for c in inverse.inputs if c.name not in inverse.scheduling]
        units = {channel.name: channel.unit for channel in inverse.inputs}
        try:
            reach = _reach(desk, name)
        except MckibbenError:
            reach = {}
        reach = {c.name: reach.get(c.name, (0.0, 1.0)) for c in outputs}
        held, rest = held_for(desk.workspace, name), at_rest(desk.workspace, name)
        self._told = None
        self.left.clear()
        with self.left:
            self.sketch = Sketch(
                desk, outputs, reach, rest, held, units, known.usual, self._changed
            )
        self._look_under()
        with self.sketch.actions:
            text = f"Show {_quantity(inverse.outputs)}s"
            named(ui.button(text, on_click=guarded(self._show)), "show-pressures")

    async def _turned(self) -> None:
        self._asked = None
        self._say()
        before = self.sketch
        self._sketch()
        self.sketch.resume(before)
        self._blank()
        self._loops()
        await self._forms()

    def _look_under(self) -> None:
        with self.left:
            ui.timer(0.02, guarded(self._under, "Looking what can be reached"), once=True)

    async def _under(self) -> None:
        """Show what can be reached under the load that is held: another one than under any."""
        sketch, self._told = self.sketch, self.sketch.told
        found = await asyncio.to_thread(reached, self.desk.workspace, self.name, sketch.told)
        if found and sketch is self.sketch and sketch.told == self._told:
            sketch.reaches(found)

    def _blank(self) -> None:
        self.shown.clear()
        with self.shown:
            ui.label("What the motion needs, and a closed loop, come here.").classes("opacity-70")

    def _loops(self, file: str = "") -> None:
        """Show loops with the model, also those of before the page was loaded."""
        asked = self._asked
        self.runs.clear()
        with self.runs:
            loops.build(
                self.desk, self.name, lambda: file if self._asked is asked else "", self.ticks
            )

    def _offer_again(self) -> None:
        """Offer the newest motion that is kept: whoever loads the page again has drawn it."""
        folder = self.desk.workspace.path("runs", "reference.csv").parent
        paths = sorted(folder.glob("reference*.csv"), key=lambda path: path.stat().st_mtime_ns)
        if not paths:
            return

        async def again() -> None:
            found = await asyncio.to_thread(read, paths[-1], informative=False)
            sketch = self.sketch
            names = sketch.units, sketch.channels, sketch.held
            sketch.take(motions.of_file(paths[-1], found, *names))
            await self._show()

        with self.shown:
            text = f"Show {paths[-1].stem} again, the newest motion kept"
            named(ui.button(text, on_click=guarded(again)).props("outline no-caps"), "motion-again")

    async def _forms(self) -> None:
        """Offer what the model can be used as."""
        name = self.name
        possible = await asyncio.to_thread(forms.possible, self.desk.workspace, name)
        offered = {form: forms.FORMS[form] for form in forms.COMPENSATORS if form in possible}
        if offered and name == self.name:
            value = self.form.value if self.form.value in offered else next(iter(offered))
            self.form.set_options(offered, value=value)

    @property
    def wish(self) -> tuple[Any, ...]:
        """All that pressures come from."""
        return self.name, self.form.value, self.settings, self.step.value, *self.sketch.wish

    def _changed(self) -> None:
        """Take pressures away that are of another wish than what is drawn, and what would run it."""
        if self._told is not None and self.sketch.told != self._told:
            self._look_under()
        if self._asked is None or self._asked == self.wish:
            return
        self._asked = None
        self.shown.clear()
        with self.shown:
            text = "The motion or its compensator has changed: press Show again."
            named(ui.label(text), "wish-changed")
        self.desk.news.changed("runs")

    async def _show(self) -> None:
        desk, sketch, asked = self.desk, self.sketch, self.wish
        name, form, settings = self.name, str(self.form.value), self.settings
        step = float(self.step.value or forms.STEP)
        reference = sketch.reference(step)
        self._asked = asked
        given, notes = await asyncio.to_thread(
            compensated, desk.workspace, name, reference, form, settings
        )
        under_way = [str(job.given.get("reference", "")) for job in desk.jobs.active()]
        file = await asyncio.to_thread(kept_motion, desk.workspace, name, reference, under_way)
        if self._asked is not asked or self.wish != asked:  # a later click shows what is now wished
            return
        call = forms.written(desk.workspace, name, form, settings)
        if form == "inverse":
            call = scripts.simulate_call(call, f"runs/{file}")
        desk.did(f"inverted {name}", call)
        desk.compensator = name, form, settings, step
        desk.changed("compensator")
        self.shown.clear()
        with self.shown:
            self._pressures(name, reference, given, notes)
            closing.build(desk, name, form, settings, file)
        self._loops(file)

    def _figures(self, model: str, reference: Recording, given: Recording) -> None:
        desk, sketch = self.desk, self.sketch
        together = "" if len(sketch.channels) == 1 else "; each by itself, all at once less"
        ui.label(f"Shaded: what the model reaches over all that was recorded{together}").classes(
            "text-xs opacity-70"
        )
        for place, (name, channel) in enumerate(sketch.channels.items()):
            figure = plots.lines(
                [("reference", reference.time, reference[name], "series-1")],
                x="time [s]",
                y=f"{name} [{channel.unit}]",
                height=240,
                bands=(sketch.reach[name],),
            )
            mark = "reference-plot" if place == 0 else f"reference-plot-{place + 1}"
            picture(desk, figure, mark)
        pressures = self._commands(model, given)
        figure = plots.lines(
            [
                (channel.name, given.time, given[channel.name], f"series-{place % 6 + 1}")
                for place, channel in enumerate(pressures)
            ],
            x="time [s]",
            y=f"{_quantity(pressures)} [{pressures[0].unit}]",
            height=260,
        )
        picture(desk, figure, "pressure-plot")

    def _commands(self, model: str, given: Recording) -> list[Channel]:
        block = forms.inverse_of(self.desk.workspace.model(model))
        return [channel for channel in block.outputs if channel.name in given]

    def _pressures(
        self, model: str, reference: Recording, given: Recording, notes: list[str]
    ) -> None:
        self._figures(model, reference, given)
        pressures = self._commands(model, given)
        for note in notes:
            caution(note)
        header = ",".join(["time_s", *(f"{c.name}_{c.unit}" for c in pressures)])
        columns = zip(given.time, *(given[c.name] for c in pressures), strict=True)
        rows = [",".join(f"{number:.9g}" for number in row) for row in columns]
        content = "\n".join([header, *rows])
        asked = f"{_quantity(pressures)}s"
        button = ui.button(
            f"{asked.capitalize()} as CSV",
            on_click=lambda: ui.download(content.encode(), f"{model}-{asked}.csv"),
        )
        named(button.props("outline"), "take-pressures")
