"""A closed loop, tried on another model of the muscle or on a virtual rig of its size."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from contextlib import suppress
from inspect import getdoc
from typing import Any

from nicegui import ui

from mckibben import registry
from mckibben.app import fields, forms, plots, scripts
from mckibben.app.desk import Desk, caution, guarded, named, on_event, tell
from mckibben.app.drawn import picture
from mckibben.app.following import fitting_rigs
from mckibben.app.kept import Followed
from mckibben.app.pages.kept_curves import going
from mckibben.arrays import Array
from mckibben.errors import MckibbenError
from mckibben.files import read
from mckibben.report import wording

OWN = "model "
"""Before the names of models among those of plants."""

RIG = "rig "
"""Before the names of virtual rigs."""

USUAL = ("feedforward", "pid", "feedforward-pid")
"""Controllers that are compared where they can be."""

DRAWN = 4
"""Most runs in a picture."""


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
    """Return what the compensator can be tried on: other models of the muscle, rigs, then its own.

    Models that predict worse come after the rigs known.
    """
    others: dict[str, str] = {}
    weaker: dict[str, str] = {}
    own: dict[str, str] = {}
    step = desk.compensator[3] if desk.compensator else forms.STEP
    weak = desk.workspace.weaker(model)
    for name in desk.workspace.plants(model):
        if desk.workspace.same(model, name):
            own[f"{OWN}{name}"] = f"{name}: the model that is inverted; proves nothing"
        else:
            kind = weaker if name in weak else others
            kind[f"{OWN}{name}"] = f"{name}: another model of your muscle"
    rigs = {
        f"{RIG}{name}": f"{name}: a virtual rig of its size" for name in known if _runs(name, step)
    }
    return others | rigs | weaker | own


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
    elif not any(text.endswith(("of your muscle", "of its size")) for text in offered.values()):
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


def runs(desk: Desk, model: str, drawn: Callable[[], str]) -> None:
    """Show what came of loops with a model, as they end.

    Parameters
    ----------
    desk : Desk
    model : str
        What was inverted.
    drawn : callable
        Returns the file of the motion that is drawn now, empty where none is known.
    """

    @ui.refreshable
    def waiting() -> None:
        loops = [job for job in desk.jobs.jobs.values() if job.kind == "loop"]
        going(desk, [job for job in loops if job.given.get("model") == model])

    @ui.refreshable
    def shown() -> None:
        found = desk.workspace.runs(model)
        if not found:
            return
        motions = {run.reference: _motion(run, drawn()) for run in found.values()}
        pictured = drawn() if drawn() in motions else _latest(desk, found)
        _table(found, motions)
        if len(motions) > 1 or drawn() not in ("", pictured):
            text = f"Errors compare only within a motion. In the picture: {motions[pictured]}."
            named(ui.label(text).classes("text-sm"), "motions")
        for text, names in _remarks(desk, found).items():
            if names:
                named(caution(f"{', '.join(names)}: {text}"), "runs-remark")
        for note in dict.fromkeys(note for run in found.values() for note in run.notes):
            named(caution(note), "loop-note")
        alike = {name: run for name, run in found.items() if run.reference == pictured}
        _pictures(desk, dict(list(alike.items())[-DRAWN:]))

    desk.when("jobs", waiting.refresh)
    desk.when("runs", shown.refresh)
    waiting()
    shown()


def _remarks(desk: Desk, runs: dict[str, Followed]) -> dict[str, list[str]]:
    """Return what the figures of runs do not say, and of which."""
    no_better, scattering = [], []
    for name, run in runs.items():
        plain = run.uncompensated
        pairs = [(run.rmse[key], plain.get(key)) for key in run.rmse]
        if any(own is not None and other is not None and own >= other for own, other in pairs):
            no_better.append(name)
        if run.plant and desk.workspace.path("banded", f"{run.plant}.json").exists():
            scattering.append(name)
    return {
        "no better than without compensation.": no_better,
        "the plant scatters as its band says, which no compensator foresees.": scattering,
    }


def _motion(run: Followed, drawn: str) -> str:
    """Return what a motion is called: its file, and whether it is the one that is drawn."""
    name = run.reference.removesuffix(".csv") or "unknown"
    if not drawn:
        return name
    return f"{name}, as drawn" if run.reference == drawn else f"{name}, another"


def _latest(desk: Desk, runs: dict[str, Followed]) -> str:
    """Return the motion of the latest run."""
    paths = {name: desk.workspace.path("runs", f"{name}.csv") for name in runs}
    ended = {name: path.stat().st_mtime_ns for name, path in paths.items() if path.is_file()}
    return runs[max(ended or runs, key=lambda name: ended.get(name, 0))].reference


def _table(runs: dict[str, Followed], motions: dict[str, str]) -> None:
    """Show runs, those of the same motion together."""
    labels = {
        "name": "Run",
        "motion": "Motion",
        "plant": "Plant",
        "rmse": "RMSE",
        "without": "RMSE without compensation",
        "largest": "Largest error",
        "clipped": "Steps at a limit or out of reach",
        "step": "Step [µs]",
    }
    rows: list[dict[str, Any]] = [
        {"name": name, "motion": motions[run.reference], "plant": run.plant or run.rig}
        | {"rmse": _listed(run.rmse, run.units), "without": _listed(run.uncompensated, run.units)}
        | {"largest": _listed(run.largest, run.units), "clipped": run.clipped}
        | {"step": wording.number(run.step_us, 2)}
        for name, run in sorted(runs.items(), key=lambda one: one[1].reference)
    ]
    columns = [
        {"name": key, "field": key, "label": label, "align": "left"}
        for key, label in labels.items()
    ]
    named(
        ui.table(rows=rows, columns=columns, row_key="name")
        .props("dense flat wrap-cells")
        .classes("w-full"),
        "runs",
    )


def _listed(values: dict[str, float | None], units: dict[str, str]) -> str:
    known = [
        f"{wording.number(value, 3)}\xa0{units.get(name, '')}" for name, value in values.items()
    ]
    return ", ".join(text.strip() for text in known) or "none"


def _pictures(desk: Desk, runs: dict[str, Followed]) -> None:
    """Draw runs of one motion, and what no compensation did, for every coordinate."""
    curves: dict[str, list[tuple[str, Array, Array, str]]] = {}
    units: dict[str, str] = {}
    for place, name in enumerate(runs):
        try:
            (run,) = read(desk.workspace.path("runs", f"{name}.csv"), informative=False)
        except (MckibbenError, ValueError):
            continue
        if run.duration is not None and run.start_time < 0:  # the approach is not scored
            run = run.slice(round(-run.start_time / (run.sample_time or 1.0)), len(run))
        for channel in runs[name].rmse:
            wished, plain = f"reference_{channel}", f"uncompensated_{channel}"
            if channel not in run or wished not in run:
                continue
            units[channel] = run.units[channel]
            own = curves.setdefault(channel, [("reference", run.time, run[wished], "measured")])
            if plain in run and not any(curve[0] == "no compensation" for curve in own):
                own.append(("no compensation", run.time, run[plain], "input"))
            own.append((name, run.time, run[channel], f"series-{place + 1}"))
    for place, (channel, own) in enumerate(curves.items()):
        figure = plots.lines(own, x="time [s]", y=f"{channel} [{units[channel]}]")
        picture(desk, figure, "loop-runs" if not place else f"loop-runs-{place + 1}")
