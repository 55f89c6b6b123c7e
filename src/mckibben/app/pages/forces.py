"""Estimates of force: a model's, over a recording, beside what was measured."""

from __future__ import annotations

import asyncio
from contextlib import suppress

from nicegui import ui

from mckibben.app import forms, scripts
from mckibben.app.desk import Desk, caution, guarded, named
from mckibben.app.kept import Estimated
from mckibben.app.pages.kept_curves import drawn, showing
from mckibben.app.pages.taking_code import hand_over
from mckibben.comparison.channels import FORCE
from mckibben.comparison.splits import tested_from
from mckibben.errors import DataError, MckibbenError
from mckibben.numerals import number, percent


def _tells(desk: Desk) -> dict[str, list[str]]:
    """Return models that tell a force, and what they tell it from."""
    found = {}
    for name in desk.workspace.ranked():
        try:
            block = forms.made(desk.workspace, name, "force", {})
        except MckibbenError:
            continue
        found[name] = [channel.name for channel in block.inputs]
    return found


def build(desk: Desk) -> None:
    """Build the section, which opens where a force is what is modelled."""
    known: dict[str, list[str]] = {}
    looks: list[None] = []
    with ui.expansion("Estimate a force").classes("w-full text-base") as section:
        none = ui.label(
            "No model here tells a force. Under Models, fit balance-force with the force as output, or "
            "balance on recordings with a measured force."
        ).classes("text-sm")
        with ui.row().classes("items-end gap-3") as choice:
            model = named(ui.select([], label="Model").classes("min-w-52"), "force-model")
            run = named(ui.select([], label="Recording").classes("min-w-52"), "force-recording")

            async def start() -> None:
                if not model.value or not run.value:
                    raise DataError(
                        "there is nothing to estimate from", remedy="choose a recording"
                    )
                given = {"model": model.value, "recording": run.value}
                if any(
                    job.kind == "force" and job.given.get("recording") == run.value
                    for job in desk.jobs.active()
                ):
                    return
                written = forms.written(desk.workspace, model.value, "force", {})
                source = desk.workspace.entry(run.value).path.name
                call = scripts.simulate_call(written, f"recordings/{source}")
                name = f"{model.value}-{run.value}"
                desk.jobs.submit("force", given | {"name": name, "call": call})
                desk.did(f"estimated the force of {run.value}", call)
                desk.changed("jobs")

            async def take() -> None:
                name = str(model.value)
                block = forms.made(desk.workspace, name, "force", {})
                path = desk.workspace.new_path("takeaway", f"{name}-force.json")
                await asyncio.to_thread(block.save, path)
                hand_over(desk, path, forms.written(desk.workspace, name, "force", {}))

            named(ui.button("Estimate", on_click=guarded(start)), "estimate-force")
            named(
                ui.button("Take the estimator (JSON)", on_click=guarded(take)), "take-force"
            ).props("outline")
        error = named(ui.label("").classes("text-sm"), "force-error")
        doubt = named(caution(""), "force-doubt")
        doubt.set_visibility(False)
        ui.label("As C or FMU: under Take away.").classes("text-xs opacity-70")
        showing(desk, "force", lambda: desk.workspace.estimates(), lambda *one: _shown(desk, *one))
    named(section, "forces")

    def runs() -> None:
        wanted = known.get(str(model.value), [])
        used = desk.workspace.used() if wanted else {}
        trained = _trained(desk) if wanted else {}
        fit = [name for name, one in used.items() if all(key in one for key in wanted)]
        fit.sort(key=lambda name: ("force" not in used[name], name in trained))
        names = {name: f"{name}{trained.get(name, '')}" for name in fit}
        run.set_options(names, value=run.value if run.value in names else next(iter(names), None))
        known_error = desk.workspace.test_errors().get(str(model.value))
        error.set_text(f"{model.value}: {known_error}." if known_error else "")
        doubt.set_text(_width_reproduced(desk, str(model.value)))
        doubt.set_visibility(bool(doubt.text))

    async def look() -> None:
        looks.append(None)
        now = len(looks)
        found = await asyncio.to_thread(_tells, desk)
        if now != len(looks) or section.is_deleted:  # a later look knows better
            return
        if found and not known and FORCE in desk.outputs:
            section.open()
        known.clear()
        known.update(found)
        none.set_visibility(not found)
        choice.set_visibility(bool(found))
        names = list(found)
        value = desk.model_to_show(str(model.value), names) if names else None
        model.set_options(names, value=value)
        runs()

    def again() -> None:
        with section:
            ui.timer(0.05, guarded(look, "Looking for forces"), once=True)

    model.on_value_change(runs)
    for topic in ("results", "recordings"):
        desk.when(topic, again)
    again()


def _trained(desk: Desk) -> dict[str, str]:
    """Return the recordings that models are fitted to, and whether as a whole."""
    with suppress(MckibbenError):
        split = desk.split()
        parts = zip(split.test, split.test_rows, strict=True)
        partly = {run.name for run, rows in parts if tested_from(rows) is not None}
        return {
            run.name: f" ({'in part ' * (run.name in partly)}trained on)" for run in split.train
        }
    return {}


def _width_reproduced(desk: Desk, model: str) -> str:
    """Return how much of the measured hysteresis width a model has; empty where it is not known."""
    memory = next((row["memory"] for row in desk.results() if row["name"] == model), None) or {}
    ratio = memory.get("gap_ratio")
    return "" if ratio is None else f"Hysteresis width reproduced by {model}: {percent(ratio)}."


def _shown(desk: Desk, name: str, one: Estimated) -> None:
    """Show an estimate beside what was measured."""
    ui.label(f"{one.output} of {one.recording} by {one.model}").classes("text-base mt-2")
    if one.rmse is not None:
        share = f", {100 * one.rmse / one.span:.1f} % of the measured range" if one.span else ""
        said = (
            f"RMSE {number(one.rmse, 3)} {one.unit}{share}; "
            f"largest {number(one.largest, 3)} {one.unit}."
        )
    else:
        said = "The recording has no measured force to compare with."
    named(ui.label(said).classes("text-sm"), f"force-{name}")
    for note in one.notes:
        caution(note)
    drawn(desk, one.curves, f"{one.output} [{one.unit}]", f"error [{one.unit}]", "force-plot")
