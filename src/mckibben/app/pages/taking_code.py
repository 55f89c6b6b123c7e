"""A model to take away, as what it is to be used as: JSON, C99, an FMU, a package of ROS 2."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from nicegui import ui

from mckibben.app import forms
from mckibben.app.desk import Desk, caution, guarded, named, on_event
from mckibben.app.recorded import pace
from mckibben.app.workspace import Workspace
from mckibben.blocks.base import Block
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
        usual = {"form": "inverse" if desk.workspace.invertible(str(model.value)) else "model"}
        first = usual["form"]
        form = named(
            ui.select({first: forms.FORMS[first]}, value=first, label="Used as").classes("w-full"),
            "take-form",
        )
        lacking = named(caution(""), "take-no-inverse")
        fields = {
            key: ui.number(label, value=forms.DEFAULTS[key], min=0).classes("w-full")
            for own in forms.SETTINGS.values()
            for key, label in own.items()
        }
        step = ui.number("Time between steps [s]", value=forms.STEP, min=1e-6).classes("w-full")
        single = ui.switch("single precision (C)", value=False)

        def chosen() -> tuple[str, str, dict[str, Any]]:
            kind = str(form.value)
            return (
                str(model.value),
                kind,
                {key: fields[key].value for key in forms.SETTINGS.get(kind, ())},
            )

        def between() -> float:
            return float(step.value or forms.STEP)

        def taken() -> Taken:
            """Return what is chosen at a click: it may change while that is written."""
            return Taken(desk.workspace, *chosen(), between())

        async def as_json() -> None:
            one = taken()
            path = desk.workspace.new_path("takeaway", f"{one.stem}.json")
            block, _ = await asyncio.to_thread(one.block_and_options)
            await asyncio.to_thread(block.save, path)
            hand_over(desk, path, one.written)

        async def as_c() -> None:
            from mckibben.export import export_c
            from mckibben.export.naming import name_from

            one, only = taken(), bool(single.value)
            name = name_from(Path(f"{one.stem}.json"))
            folder = desk.workspace.new_path("takeaway", f"{name}-c")

            def write() -> str:
                block, options = one.block_and_options()
                export_c(block, folder, name=name, single=only, force=True, **options)
                return one.exported("c", folder.name, options, " --float32" if only else "")

            await _zipped(desk, folder, await asyncio.to_thread(write))

        async def as_fmu() -> None:
            from mckibben.export import export_fmu
            from mckibben.export.naming import name_from

            one = taken()
            name = name_from(Path(f"{one.stem}.json"))
            path = desk.workspace.new_path("takeaway", f"{name}.fmu")

            def write() -> str:
                block, options = one.block_and_options()
                export_fmu(block, path, name=name, force=True, **options)
                return one.exported("fmu", path.name, options)

            hand_over(desk, path, await asyncio.to_thread(write))

        async def as_ros2() -> None:
            from mckibben.export import export_ros2
            from mckibben.export.naming import name_from

            one = taken()
            name = name_from(Path(f"{one.stem}.json"))
            folder = desk.workspace.new_path("takeaway", f"{name}-ros2")

            def write() -> str:
                block, options = one.block_and_options()
                export_ros2(block, folder, name=name, force=True, **options)
                return one.exported("ros2", folder.name, options)

            await _zipped(desk, folder, await asyncio.to_thread(write))

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
            lacks = not desk.workspace.invertible(str(model.value))
            lacking.set_visibility(lacks)
            lacking.set_text(f"{model.value} has no inverse: it compensates nothing." * lacks)

        async def offer() -> None:
            name, before = str(model.value), (form.value, step.value)
            found = await asyncio.to_thread(forms.possible, desk.workspace, name)
            known = await asyncio.to_thread(pace, desk.workspace, name) if found else None
            offered = {key: forms.FORMS[key] for key in found}
            if offered and name == str(model.value):
                chosen = form.value in offered and form.value != usual["form"]
                usual["form"] = next(
                    (use for use in forms.COMPENSATORS if use in offered), found[0]
                )
                value = form.value if chosen else usual["form"]
                shown, use, settings, own = desk.compensator or ("", "", {}, forms.STEP)
                if before != (form.value, step.value):  # what was chosen meanwhile stays
                    pass
                elif shown == name and use in offered:
                    value = use
                    step.set_value(own)
                    for key, number in settings.items():
                        fields[key].set_value(number)
                elif known:
                    step.set_value(known.step)
                form.set_options(offered, value=value)
                fitted()

        form.on_value_change(fitted)
        model.on_value_change(on_event(lambda _: offer()))
        desk.when("compensator", offer)
        fitted()
        ui.timer(0.05, guarded(offer, "Looking what it can be used as"), once=True)


@dataclass(frozen=True)
class Taken:
    """A model as it is to be taken away: its use, the settings of that, and its steps [s]."""

    workspace: Workspace
    model: str
    form: str
    settings: dict[str, Any]
    step: float

    @property
    def stem(self) -> str:
        """What its files are called."""
        return self.model if self.form == "model" else f"{self.model}-{self.form}"

    @property
    def written(self) -> str:
        """The Python that makes it."""
        return forms.written(self.workspace, self.model, self.form, self.settings)

    def block_and_options(self) -> tuple[Block, dict[str, Any]]:
        """Return what runs, and what its export is to be told."""
        block = forms.made(self.workspace, self.model, self.form, self.settings)
        return block, {"sample_time": self.step} if block.rate_dependent else {}

    def exported(self, kind: str, target: str, options: Mapping[str, Any], flags: str = "") -> str:
        """Return the command that exports it."""
        told = f" --sample-time {self.step:g}" if "sample_time" in options else ""
        return f"mckibben export {kind} {self.stem}.json -o {target}{told}{flags}"


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
