"""A closed loop, tried on another model of the muscle or on a virtual rig of like size."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from contextlib import suppress
from inspect import getdoc
from typing import Any

from nicegui import ui

from mckibben import registry
from mckibben.app import fields, forms, scripts
from mckibben.app.desk import Desk, caution, guarded, named, on_event, tell
from mckibben.app.following import fitting_rigs
from mckibben.errors import MckibbenError

OWN = "model "
"""Before the names of models among those of plants."""

RIG = "rig "
"""Before the names of virtual rigs."""

ITSELF = "the model that is inverted; proves nothing"
"""Of a plant."""

IDLE = "no better than the mean of the output"
"""Of a plant that predicts nothing."""

LIKE = "a virtual rig, another muscle of like size"
"""Of a rig that fits."""

USUAL = ("feedforward", "pid", "feedforward-pid")
"""Controllers that are compared where they can be."""


def build(desk: Desk, model: str, form: str, settings: dict[str, Any], reference: str) -> None:
    """Offer loops with a compensator.

    Parameters
    ----------
    desk : Desk
    model, form : str
        What is inverted, and as what.
    settings : dict
        Of that.
    reference : str
        File of the reference, among the runs.
    """
    ui.label("Closed loop").classes("text-lg")
    place = ui.column().classes("w-full gap-1")
    with ui.row().classes("items-center") as looking:
        ui.spinner()
        ui.label("Looking for virtual rigs that fit")

    async def ready() -> None:
        offered = await asyncio.to_thread(_plants, desk, model, [])
        first = next(iter(offered), "")
        reasons = await asyncio.to_thread(_refused, desk, model, form, settings, first)
        if place.is_deleted:
            return
        with place:
            more = _offer(desk, model, form, settings, reference, offered, reasons)
        rigs = await asyncio.to_thread(
            desk.workspace.cached_rigs, model, lambda: fitting_rigs(desk.workspace, model)
        )
        offered = await asyncio.to_thread(_plants, desk, model, rigs)
        if not place.is_deleted:
            looking.delete()
            more(offered)
            with place:
                _lacking(desk, model, offered)

    ui.timer(0.05, guarded(ready, "Looking for plants"), once=True)


def _plants(desk: Desk, model: str, known: list[str]) -> dict[str, str]:
    """Return what the compensator can be tried on, and what each is, in the order of the choice.

    Models of the user's own muscle come first; after the rigs known, which are other muscles, come
    those that tell nothing: the one that is inverted, and models that do not predict.
    """
    twins: dict[str, str] = {}
    itself: dict[str, str] = {}
    last: dict[str, str] = {}
    step = desk.compensator[3] if desk.compensator else forms.STEP
    errors, idle = desk.workspace.test_errors(), desk.workspace.idle()
    for name in desk.workspace.plants(model):
        if desk.workspace.same(model, name):
            itself[f"{OWN}{name}"] = f"{name}: {ITSELF}"
        else:
            kind, doubt = (last, f"{IDLE}, ") if name in idle else (twins, "")
            tested = errors.get(name, "not tested")
            kind[f"{OWN}{name}"] = f"{name}: another model of your muscle, {doubt}{tested}"
    rigs = {f"{RIG}{name}": f"{name}: {LIKE}" for name in known if _runs(name, step)}
    return twins | rigs | itself | last


def _runs(rig: str, step: float) -> bool:
    """Tell whether a rig takes steps of a length [s]."""
    from mckibben.rigs import load_rig

    with suppress(MckibbenError):
        return bool(load_rig(rig).changed({"sample_time": step}))
    return False


def _lacking(desk: Desk, model: str, offered: dict[str, str]) -> None:
    """Say what to do where no plant tells anything."""
    if not offered:
        said = "No plant fits: fit a second model of another kind under Models, and try it on that."
        try:
            desk.workspace.twin(model)
        except MckibbenError as error:
            said = fields.said(error)
        named(ui.label(said), "no-plant")
    elif all(text.endswith(ITSELF) for text in offered.values()):
        caution(
            "On the model that is inverted, its inverse is right by construction. Fit a model of "
            "another kind under Models to try it on."
        )


def _offer(
    desk: Desk,
    model: str,
    form: str,
    settings: dict[str, Any],
    reference: str,
    offered: dict[str, str],
    reasons: dict[str, str],
) -> Callable[[dict[str, str]], None]:
    """Offer plants and controllers; return what offers others, and leaves a plant that was chosen."""
    laws = {name: registry.load("controllers", name) for name in registry.names("controllers")}
    titles = {name: (getdoc(law) or name).rstrip(".") for name, law in laws.items()}
    with ui.row().classes("items-end w-full gap-3") as row:
        plant = named(
            ui.select(offered, value=next(iter(offered), None), label="Plant").classes("min-w-72"),
            "loop-plant",
        )
        kinds = named(
            ui.select({}, value=[], multiple=True, label="Controllers").classes(
                "min-w-64 max-w-full"
            ),
            "controllers",
        )

        async def start() -> None:
            if not plant.value or not kinds.value:
                tell("Choose a plant and a controller.")
                return
            own = str(plant.value).startswith(OWN)
            name = str(plant.value).removeprefix(OWN).removeprefix(RIG)
            there = {"plant": name} if own else {"rig": name}
            plant_call = (
                scripts.twin_call(desk.workspace, name) if own else f"mckibben.load_rig({name!r})"
            )
            compensator = forms.written(desk.workspace, model, form, settings)
            for kind in kinds.value:
                given = {"model": model, "controller": kind, "reference": reference} | there
                given |= {"form": form, "settings": settings}
                if any(
                    all(job.given.get(key) == value for key, value in given.items())
                    for job in desk.jobs.active()
                ):
                    continue
                call = scripts.track_call(kind, compensator, plant_call, f"runs/{reference}")
                wish = "-".join([model, *([] if form == "inverse" else [form]), kind])
                desk.jobs.submit("loop", given | {"name": wish, "call": call})
                desk.did(f"closed the loop: {wish}", call)
            desk.changed("jobs")

        named(ui.button("Run", on_click=guarded(start)), "run-loop")
    row.set_visibility(bool(offered))
    doubt = named(caution(""), "weaker-plant")
    against = ui.column().classes("gap-1")

    def suit(reasons: dict[str, str]) -> None:
        # as their runs are called
        fits = {law: f"{title} ({law})" for law, title in titles.items() if not reasons.get(law)}
        kinds.set_options(fits, value=[law for law in kinds.value or USUAL if law in fits])
        why = desk.workspace.weaker(model).get(str(plant.value).removeprefix(OWN), "")
        doubt.set_text(why)
        doubt.set_visibility(bool(why))
        against.clear()
        with against:
            for reason in dict.fromkeys(filter(None, reasons.values())):
                out = "; ".join(titles[law] for law in titles if reasons[law] == reason)
                named(
                    ui.label(f"Not here: {out}. {fields.said(reason)}").classes("text-xs"),
                    "law-refused",
                )

    async def turned() -> None:
        chosen = str(plant.value or "")
        reasons = await asyncio.to_thread(_refused, desk, model, form, settings, chosen)
        if chosen == (plant.value or "") and not against.is_deleted:
            suit(reasons)

    def more(wider: dict[str, str]) -> None:
        untouched = plant.value == next(iter(offered), None)
        plant.set_options(wider, value=next(iter(wider), None) if untouched else plant.value)
        row.set_visibility(bool(wider))

    plant.on_value_change(on_event(lambda _: turned()))
    suit(reasons)
    return more


def _refused(
    desk: Desk, model: str, form: str, settings: dict[str, Any], plant: str
) -> dict[str, str]:
    """Return of every control law why it cannot run on a plant, or an empty string; no plant, none."""
    from mckibben.control.laws import refusal
    from mckibben.rigs import load_rig

    if not plant:
        return {}
    compensator = forms.made(desk.workspace, model, form, settings)
    own = plant.startswith(OWN)
    name = plant.removeprefix(OWN).removeprefix(RIG)
    there = desk.workspace.twin(name) if own else load_rig(name)
    return {law: refusal(law, compensator, there) for law in registry.names("controllers")}
