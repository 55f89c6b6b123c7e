"""The log of the real rig, dropped back in: predicted and achieved, why, and a refit."""

from __future__ import annotations

import asyncio
from pathlib import Path

from nicegui import ui
from nicegui.events import UploadEventArguments

from mckibben.app import forms
from mckibben.app.desk import Desk, guarded, kept, labelled, named, on_event
from mckibben.app.dropping import drop_zone
from mckibben.app.kept import Reviewed
from mckibben.app.pages.kept_curves import drawn, showing
from mckibben.app.reading import read_upload
from mckibben.errors import DataError
from mckibben.numerals import number
from mckibben.system.atomic import replacing
from mckibben.system.ordinary import read_bytes

LARGEST = 64 * 2**20
"""Bytes of a model."""


def build(desk: Desk) -> None:
    """Build the section."""
    with ui.expansion("Back from the rig: drop its log").classes("w-full text-base") as section:
        ui.label(
            "A table over time with what was wished for (reference_displacement), what was measured "
            "(displacement) and the measured pressure; command_pressure too, where there is one."
        ).classes("text-sm")
        with ui.row().classes("items-end gap-3"):
            names = desk.workspace.to_invert()
            model = named(
                ui.select(names, value=names[0] if names else None, label="Model that ran inverted")
                .classes("min-w-52")
                .props('hint="the one whose compensator was on the rig"'),
                "log-model",
            )
            form = ui.select(
                {form: forms.FORMS[form] for form in forms.COMPENSATORS},
                value="inverse",
                label="Compensator",
            ).classes("min-w-64")

        async def loaded(event: UploadEventArguments) -> None:
            if not model.value:
                raise DataError("there is no model to compare with", remedy="fit one under Models")
            name, use = str(model.value), str(form.value)
            path = await kept(desk, event.file)
            found = await asyncio.to_thread(read_upload, path)
            if not any(name.startswith("reference_") for run in found for name in run.channels):
                raise DataError(
                    "it does not say what was wished for",
                    file=path,
                    remedy="name a column reference_displacement_mm",
                )
            _look_back(desk, name, use, path.name, refit=False)

        upload = drop_zone("Drop the log here", on_upload=on_event(loaded))
        upload.classes("w-full max-w-2xl")
        named(upload.props("flat bordered"), "log-upload")
        showing(desk, "review", lambda: desk.workspace.reviews(), lambda *one: _shown(desk, *one))
    named(section, "logs")

    def more() -> None:
        names = desk.workspace.to_invert()
        value = desk.model_to_show(str(model.value), names) if names else None
        model.set_options(names, value=value)

    desk.when("results", more)


def _look_back(desk: Desk, model: str, form: str, log: str, *, refit: bool) -> None:
    """Start a look back on a log, unless it is under way."""
    given = {"model": model, "form": form, "log": log, "refit": refit}
    for job in desk.jobs.active():
        if job.kind == "review" and all(job.given.get(key) == given[key] for key in given):
            return
    command = forms.in_a_shell(f"mckibben study {log} --compensator inverse.json -o study")
    name = Path(log).stem + ("-with-refit" if refit else "")
    desk.jobs.submit("review", given | {"name": name, "call": command})
    desk.did(f"looked back on {log}", command)
    desk.changed("jobs")


def _shown(desk: Desk, name: str, one: Reviewed) -> None:
    """Show what a log said."""
    ui.label(f"{one.log}, with the compensator of {one.model}").classes("text-base mt-2")
    sizes = {
        "achieved": one.achieved,
        "predicted for the commands": one.predicted,
        "of measured pressures beside the commands": one.pressure,
        "residual of the model": one.residual,
    }
    rows = [
        {"what": what, "value": f"{number(size, 3)} {one.unit}"}
        for what, size in sizes.items()
        if size is not None
    ]
    columns = [
        {"name": key, "field": key, "label": label, "align": "left"}
        for key, label in (("what", "Error"), ("value", "RMS"))
    ]
    table = ui.table(rows=rows, columns=columns, row_key="what").props("dense flat wrap-cells")
    labelled(named(table, f"review-{name}"), "aria-label", "Where the error comes from")
    for sentence in one.sentences:
        ui.label(sentence).classes("text-sm")
    drawn(desk, one.curves, f"{one.output} [{one.unit}]", f"error [{one.unit}]", "review-plot")
    if not one.refitted:

        async def refit() -> None:
            _look_back(desk, one.model, one.form, one.log, refit=True)

        named(
            ui.button("Try a refit with the log", on_click=guarded(refit)), f"refit-{name}"
        ).props("outline")
    else:

        async def take() -> None:
            source = desk.workspace.path("reviews", f"{name}-refit.json")
            new = desk.workspace.new_name("models", f"{one.model}-refit")
            content = await asyncio.to_thread(read_bytes, source, most=LARGEST)
            with replacing(desk.workspace.new_path("models", f"{new}.json")) as path:
                path.write_bytes(content)
            desk.did(f"took the refit as model {new}", f"mckibben.load('models/{new}.json')")
            desk.changed("results")
            ui.notify(f"{new} is among the models now")

        named(ui.button("Take the refit as a model", on_click=guarded(take)), f"take-refit-{name}")
