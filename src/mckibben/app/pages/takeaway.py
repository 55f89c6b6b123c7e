"""Take away: report, figures, model, C99, FMU, ROS 2, and the script that does it all again."""

from __future__ import annotations

import asyncio
from typing import Any

from nicegui import ui

from mckibben.app import fields, forms, scripts
from mckibben.app.desk import Desk, against, caution, code, guarded, named
from mckibben.app.jobs import RUNNING
from mckibben.app.pages import leaderboard, taking_code
from mckibben.app.pages.taking_code import CARD, LARGEST, hand_over
from mckibben.app.recordings import Role
from mckibben.errors import DataError
from mckibben.system.ordinary import read_bytes

FIGURES = {
    "time": "recordings over time",
    "loop": "loops of the recordings",
    "fit": "measured and modelled over time",
    "loops": "measured and modelled loops",
    "residuals": "residuals",
    "weights": "weights over thresholds",
}


def build(desk: Desk) -> None:
    """Build the page."""
    selects: list[ui.select] = []

    @ui.refreshable
    def shown() -> None:
        names = _offered(desk)
        if not names:
            ui.label("Fit a model first, under Models.")
            return
        leaderboard.doubts(desk)
        model = named(
            ui.select(names, value=names[0], label="Model").classes("w-full max-w-xs"),
            "take-model",
        )
        selects[:] = [model]
        doubt = named(caution(""), "take-doubt")

        def say() -> None:
            why = against(desk.results()).get(str(model.value), "")
            doubt.set_text(f"{model.value} is not recommended: {fields.said(why)}." if why else "")
            doubt.set_visibility(bool(why) and not desk.not_recommended)

        model.on_value_change(say)
        desk.when("results", say)
        say()
        come()
        with ui.row().classes("w-full gap-4 items-stretch"):
            taking_code.build(desk, model)
            _figures(desk, model)
            _report(desk)
        _script(desk, model)

    def more() -> None:
        if selects:
            names = _offered(desk) or [selects[0].value]
            selects[0].set_options(names, value=desk.model_to_show(selects[0].value, names))
        else:
            shown.refresh()

    def come() -> None:
        """Choose the model whose compensator was shown last."""
        if selects and desk.compensator is not None and desk.compensator[0] in selects[0].options:
            selects[0].set_value(desk.compensator[0])

    desk.when("results", more)
    desk.when("compensator", come)
    shown()


def _offered(desk: Desk) -> list[str]:
    """Return the models, those that have a compensator first: one of them is what is taken away."""
    able = desk.workspace.to_invert()
    return [*able, *(name for name in desk.workspace.ranked() if name not in able)]


def _figures(desk: Desk, model: Any) -> None:
    with ui.card().classes(CARD):
        ui.label("Figures for print").classes("text-lg")
        kind = ui.select(FIGURES, value="loops", label="Figure").classes("w-full")
        form = ui.toggle(["png", "svg", "pdf"], value="pdf").props("dense")
        output = ui.select(list(desk.outputs), value=desk.output, label="Output").classes("w-full")
        output.set_visibility(len(desk.outputs) > 1)

        async def draw() -> None:
            from mckibben.report.figures import write_figure

            role: Role = "test" if desk.workspace.with_role("test") else "train"
            recordings = desk.workspace.with_role(role)
            if not recordings:
                raise DataError("there is no recording to draw", remedy="add one under Data")
            # as it is at the click
            what, name, place = str(kind.value), str(model.value), desk.outputs.index(output.value)
            stem = what if what in ("time", "loop") else f"{name}-{what}"
            path = desk.workspace.new_path("takeaway", f"{stem}.{form.value}")
            sides = desk.looked_at(recordings)[place] if what in ("time", "loop") else ()
            call = scripts.plot_call(desk.workspace, role, name, what, sides, path.name)

            def save() -> None:
                if sides:
                    write_figure(recordings, path, what, input=sides[0], output=sides[1])
                else:
                    write_figure(desk.workspace.model(name), path, what, recording=recordings)

            await asyncio.to_thread(save)
            hand_over(desk, path, call)

        named(ui.button("Draw it", on_click=guarded(draw)), "take-figure")


def _report(desk: Desk) -> None:
    with ui.card().classes(CARD):
        ui.label("Report").classes("text-lg")
        ui.label(
            "What the muscle does, the model chosen, its test and inverse: one page, opens anywhere."
        ).classes("text-sm")

        async def start() -> None:
            if any(job.kind == "report" for job in desk.jobs.active()):
                return
            models, settings = [], {}
            for row in desk.results():
                if row["model"] not in models:
                    models.append(row["model"])
                    settings[row["model"]] = row["settings"]
            call = scripts.report_call(models, desk.channels, settings, desk.allow_shared)
            desk.jobs.submit(
                "report",
                {"models": models, "settings": settings, **desk.channels}
                | {"call": call, "title": "report", "seed": 0, "allow_shared": desk.allow_shared},
            )
            desk.did("started the report", call)
            desk.changed("jobs")

        named(ui.button("Write it", on_click=guarded(start)), "take-report")

        @ui.refreshable
        def writing() -> None:
            for job in desk.jobs.active():
                if job.kind == "report":
                    told = desk.jobs.progress(job.name)
                    share = told[-1][1] if told and job.state == RUNNING else 0.0
                    with ui.row().classes("items-center gap-2 w-full no-wrap"):
                        ui.spinner()
                        ui.linear_progress(round(share, 2), show_value=False).classes("flex-1")
                    ui.label(f"Being written: {100 * share:.0f} %").classes("text-xs")
            path = desk.workspace.path("takeaway", "report.html")
            if path.is_file():

                async def get() -> None:
                    content = await asyncio.to_thread(read_bytes, path, most=LARGEST)
                    ui.download(content, "report.html")

                button = ui.button("Download report.html", on_click=guarded(get)).props("outline")
                named(button, "get-report")

        desk.when("jobs", writing.refresh)
        writing()


def _script(desk: Desk, model: Any) -> None:
    def text() -> str:
        name, shown = str(model.value), desk.compensator
        if (shown is None or shown[0] != name) and desk.workspace.invertible(name):
            shown = name, "inverse", {}, forms.STEP
        return scripts.script(desk.workspace, desk.results(), desk.channels, shown)

    with ui.card().classes("w-full"):
        ui.label("The same as a script").classes("text-lg")

        @ui.refreshable
        def shown() -> None:
            named(code(text()).classes("min-w-0"), "script")

        for topic in ("results", "recordings", "channels", "compensator"):
            desk.when(topic, shown.refresh)
        model.on_value_change(shown.refresh)
        shown()
        named(
            ui.button(
                "Download script.py", on_click=lambda: ui.download(text().encode(), "script.py")
            ).props("outline"),
            "take-script",
        )
