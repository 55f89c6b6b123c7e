"""A model to take away, as what it is to be used as: JSON, C99, an FMU, a package of ROS 2."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

from nicegui import ui

from mckibben.app import forms
from mckibben.app.desk import Desk, guarded, named, on_event
from mckibben.blocks.core.block import Block
from mckibben.system.atomic import replacing
from mckibben.system.ordinary import read_bytes

LARGEST = 256 * 2**20
"""Bytes of a file that is handed over."""

CARD = "min-w-0 w-full sm:w-80 gap-2"
"""Of a card: as wide as a phone, and three in a row on a screen."""

KINDS = {
    "json": "The model as text that this library loads again: mckibben.load(file).",
    "c": "C99 that compiles as it is, with a self-test; for a microcontroller or a PC.",
    "fmu": "For Simulink and other tools; libraries are built here, which takes up to a minute.",
    "ros2": "A package for ros2_control, to be built by colcon; of compensators.",
}
"""What each file is."""


def build(desk: Desk, model: Any) -> None:
    """Build the card.

    Parameters
    ----------
    desk : Desk
    model : element
        Whose value is the model.
    """
    with ui.card().classes(CARD):
        ui.label("Model and code").classes("text-lg")
        form = named(
            ui.select({"model": forms.FORMS["model"]}, value="model", label="Used as").classes(
                "w-full"
            ),
            "take-form",
        )
        fields = {
            key: ui.number(label, value=forms.DEFAULTS[key], min=0).classes("w-full")
            for own in forms.SETTINGS.values()
            for key, label in own.items()
        }
        step = ui.number("Time between steps [s]", value=0.01, min=1e-6).classes("w-full")
        single = ui.switch("single precision (C)", value=False)
        with ui.row().classes("items-center gap-2"):
            ui.label("FMI").classes("text-sm")
            version = ui.toggle(["2.0", "3.0"], value="2.0").props("dense")

        def chosen() -> tuple[str, str, dict[str, Any]]:
            kind = str(form.value)
            return (
                str(model.value),
                kind,
                {key: fields[key].value for key in forms.SETTINGS.get(kind, ())},
            )

        def stem() -> str:
            name, kind, _ = chosen()
            return name if kind == "model" else f"{name}-{kind}"

        def block_and_options() -> tuple[Block, dict[str, Any]]:
            block = forms.made(desk.workspace, *chosen())
            timed = block.rate_dependent
            return block, {"sample_time": float(step.value or 0.01)} if timed else {}

        async def as_json() -> None:
            path = desk.workspace.new_path("takeaway", f"{stem()}.json")
            block, _ = await asyncio.to_thread(block_and_options)
            await asyncio.to_thread(block.save, path)
            hand_over(desk, path, forms.written(desk.workspace, *chosen()))

        async def as_c() -> None:
            from mckibben.export import export_c
            from mckibben.export.naming import name_from

            name = name_from(Path(f"{stem()}.json"))
            folder = desk.workspace.new_path("takeaway", f"{name}-c")

            def write() -> None:
                block, options = block_and_options()
                options |= {"name": name, "single": bool(single.value), "overwrite": True}
                export_c(block, folder, **options)

            await asyncio.to_thread(write)
            flag = " --float32" if single.value else ""
            call = f"mckibben export c {stem()}.json -o {folder.name}{flag}"
            await _zipped(desk, folder, call)

        async def as_fmu() -> None:
            from mckibben.export import export_fmu
            from mckibben.export.naming import name_from

            name = name_from(Path(f"{stem()}.json"))
            path = desk.workspace.new_path("takeaway", f"{name}.fmu")

            def write() -> None:
                block, options = block_and_options()
                options |= {"name": name, "version": version.value, "overwrite": True}
                export_fmu(block, path, **options)

            await asyncio.to_thread(write)
            hand_over(desk, path, f"mckibben export fmu {stem()}.json -o {path.name}")

        async def as_ros2() -> None:
            from mckibben.export import export_ros2
            from mckibben.export.naming import name_from

            name = name_from(Path(f"{stem()}.json"))
            folder = desk.workspace.new_path("takeaway", f"{name}-ros2")

            def write() -> None:
                block, options = block_and_options()
                export_ros2(block, folder, name=name, overwrite=True, **options)

            await asyncio.to_thread(write)
            await _zipped(desk, folder, f"mckibben export ros2 {stem()}.json -o {folder.name}")

        labels = {"json": "Model (JSON)", "c": "C99 (folder, zipped)", "fmu": "FMU"}
        labels["ros2"] = "ROS 2 (folder, zipped)"
        actions = {"json": as_json, "c": as_c, "fmu": as_fmu, "ros2": as_ros2}
        rows = {}
        for kind, action in actions.items():
            with ui.column().classes("w-full gap-0") as rows[kind]:
                named(ui.button(labels[kind], on_click=guarded(action)), f"take-{kind}").classes(
                    "w-full"
                )
                ui.label(KINDS[kind]).classes("text-xs opacity-80")

        def fitted() -> None:
            """Show what belongs to the use chosen."""
            kind = str(form.value)
            for key, field in fields.items():
                field.set_visibility(key in forms.SETTINGS.get(kind, ()))
            rows["ros2"].set_visibility(kind in forms.COMPENSATORS)

        async def offer() -> None:
            name = str(model.value)
            found = await asyncio.to_thread(forms.possible, desk.workspace, name)
            offered = {key: forms.FORMS[key] for key in found}
            if offered and name == str(model.value):
                value = form.value if form.value in offered else next(iter(offered))
                shown, use, settings = desk.compensator or ("", "", {})
                if shown == name and use in offered:
                    value = use
                    for key, number in settings.items():
                        fields[key].set_value(number)
                form.set_options(offered, value=value)
                fitted()

        form.on_value_change(fitted)
        model.on_value_change(on_event(lambda _: offer()))
        desk.when("compensator", offer)
        fitted()
        ui.timer(0.05, guarded(offer), once=True)


async def _zipped(desk: Desk, folder: Path, call: str) -> None:
    """Hand a folder over as a file."""
    from mckibben.export.folders import zipped

    path = desk.workspace.new_path("takeaway", f"{folder.name}.zip")
    content = await asyncio.to_thread(lambda: zipped(_contents(folder)))
    with replacing(path) as new:
        new.write_bytes(content)
    hand_over(desk, path, call)


def hand_over(desk: Desk, path: Path, call: str) -> None:
    """Give a file to the browser, and say where it is kept."""
    shown = forms.in_a_shell(call) if call.startswith("mckibben ") else call
    desk.did(f"wrote {path.name}", shown)
    ui.download(read_bytes(path, most=LARGEST), path.name)
    ui.notify(f"Also kept as {path}")


def _contents(folder: Path) -> dict[str, bytes]:
    """Return the files of a folder by their path, the folder's own name first."""
    return {
        path.relative_to(folder.parent).as_posix(): read_bytes(path, most=LARGEST)
        for path in folder.rglob("*")
        if path.is_file() and not path.is_symlink()
    }
