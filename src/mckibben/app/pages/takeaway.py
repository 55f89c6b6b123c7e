"""Take away: report, figures, model, C99, FMU, and the script that does it all again."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

from nicegui import ui

from mckibben.app import scripts
from mckibben.app.desk import Desk, code, guarded, named
from mckibben.blocks.core.block import Block
from mckibben.errors import DataError
from mckibben.system.atomic import replacing
from mckibben.system.ordinary import read_bytes

LARGEST = 256 * 2**20
"""Bytes of a file that is handed over."""

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
        names = desk.workspace.models()
        if not names:
            ui.label("Fit a model first, under Models.")
            return
        ranked = [row["name"] for row in desk.results()]
        first = next((name for name in ranked if name in names), names[0])
        with ui.row().classes("items-end gap-3"):
            model = named(
                ui.select(names, value=first, label="Model").classes("min-w-52"), "take-model"
            )
            inverse = named(ui.switch("its inverse", value=False), "take-inverse")
            step = ui.number("Time between steps [s]", value=0.01, min=1e-6).classes("w-44")
        selects[:] = [model]
        with ui.row().classes("w-full gap-4 items-start"):
            _code(desk, model, inverse, step)
            _figures(desk, model)
            _report(desk)
        _script(desk)

    def more() -> None:
        if selects:
            selects[0].set_options(desk.workspace.models())
        else:
            shown.refresh()

    desk.when("results", more)
    shown()


def _block(desk: Desk, model: Any, inverse: Any) -> Block:
    block = desk.workspace.model(str(model.value))
    return block.inverse() if inverse.value else block


def _code(desk: Desk, model: Any, inverse: Any, step: Any) -> None:
    from mckibben.export.naming import name_from

    with ui.card().classes("min-w-72"):
        ui.label("Model and code").classes("text-lg")
        single = ui.switch("single precision", value=False)
        version = ui.toggle(["2.0", "3.0"], value="2.0").props("dense")

        def options() -> dict[str, Any]:
            block = _block(desk, model, inverse)
            return {"sample_time": float(step.value)} if block.rate_dependent else {}

        async def as_json() -> None:
            path = desk.workspace.new_path("takeaway", f"{_stem(model, inverse)}.json")
            _block(desk, model, inverse).save(path)
            _hand_over(desk, path, "Block.save(path)")

        async def as_c() -> None:
            from mckibben.export import export_c
            from mckibben.export.folders import zipped

            name = name_from(Path(f"{_stem(model, inverse)}.json"))
            folder = desk.workspace.new_path("takeaway", f"{name}-c")
            await asyncio.to_thread(
                lambda: export_c(
                    _block(desk, model, inverse),
                    folder,
                    name=name,
                    single=bool(single.value),
                    overwrite=True,
                    **options(),
                )
            )
            path = desk.workspace.new_path("takeaway", f"{name}-c.zip")
            with replacing(path) as new:
                new.write_bytes(await asyncio.to_thread(lambda: zipped(_contents(folder))))
            flag = " --float32" if single.value else ""
            _hand_over(desk, path, f"mckibben export c {model.value}.json -o {folder.name}{flag}")

        async def as_fmu() -> None:
            from mckibben.export import export_fmu

            name = name_from(Path(f"{_stem(model, inverse)}.json"))
            path = desk.workspace.new_path("takeaway", f"{name}.fmu")
            await asyncio.to_thread(
                lambda: export_fmu(
                    _block(desk, model, inverse),
                    path,
                    name=name,
                    version=version.value,
                    overwrite=True,
                    **options(),
                )
            )
            _hand_over(desk, path, f"mckibben export fmu {model.value}.json -o {path.name}")

        named(ui.button("Model (JSON)", on_click=guarded(as_json)), "take-json")
        named(ui.button("C99 (folder, zipped)", on_click=guarded(as_c)), "take-c")
        named(ui.button("FMU", on_click=guarded(as_fmu)), "take-fmu")


def _stem(model: Any, inverse: Any) -> str:
    return f"{model.value}-inverse" if inverse.value else str(model.value)


def _figures(desk: Desk, model: Any) -> None:
    with ui.card().classes("min-w-72"):
        ui.label("Figures for print").classes("text-lg")
        kind = ui.select(FIGURES, value="loops", label="Figure").classes("w-full")
        form = ui.toggle(["png", "svg", "pdf"], value="pdf").props("dense")

        async def draw() -> None:
            from mckibben.report.figures import plot_model, plot_recording

            recordings = desk.workspace.with_role("test") or desk.workspace.with_role("train")
            if not recordings:
                raise DataError("there is no recording to draw", remedy="add one under Data")
            stem = (
                f"{model.value}-{kind.value}" if kind.value not in ("time", "loop") else kind.value
            )
            path = desk.workspace.new_path("takeaway", f"{stem}.{form.value}")

            def save() -> None:
                if kind.value in ("time", "loop"):
                    plot_recording(recordings, desk.input, desk.output, str(kind.value), path)
                else:
                    block = desk.workspace.model(str(model.value))
                    plot_model(block, recordings, str(kind.value), path)

            await asyncio.to_thread(save)
            _hand_over(desk, path, f"mckibben plot ... --kind {kind.value} -o {path.name}")

        named(ui.button("Draw it", on_click=guarded(draw)), "take-figure")


def _report(desk: Desk) -> None:
    with ui.card().classes("min-w-72"):
        ui.label("Report").classes("text-lg")
        ui.label(
            "What the muscle does, the model chosen, its test and inverse: one page, opens anywhere."
        )

        async def start() -> None:
            models, settings = [], {}
            for row in desk.results():
                if row["model"] not in models:
                    models.append(row["model"])
                    settings[row["model"]] = row["settings"]
            call = f"write_report(mckibben.study(train, test, models={models!r}), 'report.html')"
            desk.jobs.submit(
                "report",
                {"models": models, "settings": settings, **desk.channels}
                | {"call": call, "title": "report", "seed": 0, "allow_shared": desk.allow_shared},
            )
            desk.did("started the report", call)
            desk.changed("jobs")

        named(ui.button("Write it", on_click=guarded(start)), "take-report")

        @ui.refreshable
        def ready() -> None:
            for job in desk.jobs.active():
                if job.kind == "report":
                    ui.label("Being written.").classes("text-xs")
            path = desk.workspace.path("takeaway", "report.html")
            if path.is_file():

                async def get() -> None:
                    ui.download(read_bytes(path, most=LARGEST), "report.html")

                button = ui.button("Download report.html", on_click=guarded(get)).props("outline")
                named(button, "get-report")

        desk.when("jobs", ready.refresh)
        ready()


def _script(desk: Desk) -> None:
    def text() -> str:
        models = [row["name"] for row in desk.results()]
        return scripts.script(desk.workspace, models, desk.channels)

    with ui.card().classes("w-full"):
        ui.label("The same as a script").classes("text-lg")

        @ui.refreshable
        def shown() -> None:
            named(code(text()), "script")

        for topic in ("results", "recordings", "channels"):
            desk.when(topic, shown.refresh)
        shown()
        named(
            ui.button(
                "Download script.py", on_click=lambda: ui.download(text().encode(), "script.py")
            ).props("outline"),
            "take-script",
        )


def _hand_over(desk: Desk, path: Path, call: str) -> None:
    desk.did(f"wrote {path.name}", call)
    ui.download(read_bytes(path, most=LARGEST), path.name)
    ui.notify(f"Also kept as {path}")


def _contents(folder: Path) -> dict[str, bytes]:
    """Return the files of a folder by their path, the folder's own name first."""
    return {
        path.relative_to(folder.parent).as_posix(): read_bytes(path, most=LARGEST)
        for path in folder.rglob("*")
        if path.is_file() and not path.is_symlink()
    }
