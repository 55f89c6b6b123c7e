"""Jobs of compensators and estimates of force: loops, looks back on logs, runs over recordings."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Collection
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from mckibben.app import forms
from mckibben.app.recorded import cycles, held_for, pace
from mckibben.app.workspace import Workspace
from mckibben.arrays import Array
from mckibben.errors import DataError, DataWarning, MckibbenError, ModelWarning
from mckibben.recording import Recording

Tell = Callable[[float, float], None]
"""Told the share of the work that is done, and the least cost so far."""

CURVE = 2000
"""Most points of a curve that is kept to be drawn."""

MUCH = 3.0
"""Times that steps are finer, or motions faster, than what a model knows of, and it is said."""


def too_fast(workspace: Workspace, model: str, reference: Recording) -> list[str]:
    """Say what of a reference is faster than a model that depends on rates was trained on."""
    known, block, step = pace(workspace, model), workspace.model(model), reference.sample_time
    if not block.rate_dependent or not step:
        return []
    own = [np.median(cycles(reference, c.name)) for c in block.outputs if c.name in reference]
    cycle, trained = min(own, default=np.inf), known.step if known.shortest else 0.0
    pairs = {"steps": (step, trained), "cycles": (cycle, known.shortest)}
    return [
        f"The {what} take {now:.3g} s, and those of the training recordings {least:.3g} s or more: "
        "how the model behaves so fast is not known."
        for what, (now, least) in pairs.items()
        if MUCH * now < least
    ]


def loop(workspace: Workspace, given: dict[str, Any], tell: Tell) -> str:
    """Let a controller follow a reference on a model or a virtual rig, and keep the recording."""
    from mckibben import workflow
    from mckibben.blocks.base import Block
    from mckibben.files import write

    own, form = given.get("plant"), given.get("form", "inverse")
    compensator = forms.made(workspace, given["model"], form, given.get("settings") or {})
    kind = given["controller"]
    run = workflow.track(
        compensator,
        workspace.path("runs", given["reference"]),
        rig=None if own else given["rig"],
        plant=workspace.twin(own) if own else None,
        controller=kind,
        progress=lambda share, _: tell(share, float("nan")),
    )
    found, without, reference, controller = (
        run.tracked,
        run.uncompensated,
        run.reference,
        run.controller,
    )
    name = str(given["name"])
    recording = without.beside(found.recording).with_meta(name=name)
    write(recording, workspace.path("runs", f"{name}.csv"))
    errors = {channel: float(value) for channel, value in found.rmse.items()}
    beside = [channel for channel in reference.channels if channel not in errors]
    units = {channel: recording.units[channel] for channel in errors}
    units |= {channel: reference.units[channel] for channel in beside}
    workspace.write_json(
        "runs",
        name,
        {
            "model": given["model"],
            "rig": given.get("rig") or "",
            "plant": own or "",
            "controller": kind,
            "form": form,
            "reference": str(given["reference"]),
            "rmse": errors,
            "largest": {channel: float(value) for channel, value in found.largest.items()},
            "offset": {channel: _offset(recording, channel) for channel in errors},
            "scatter": {channel: float(value) for channel, value in found.scatter.items()},
            "uncompensated": {} if without.tracked is None else dict(without.tracked.rmse),
            "units": units,
            "held": {c: None if np.ptp(reference[c]) else float(reference[c][0]) for c in beside},
            "notes": list(run.notes),
            "clipped": int(found.clipped),
            "step_us": 1e6 * float(found.step_time[0]),
            "call": given.get("call", ""),
        },
    )
    if isinstance(controller, Block):
        controller.save(workspace.path("models", f"{name}-controller.json"))
    return ", ".join(
        f"{channel} RMSE {value:.3g} {units[channel]}" for channel, value in errors.items()
    )


def _offset(recording: Recording, channel: str) -> float:
    """Return by how much a channel is off its reference on average, without the approach."""
    scored = recording.time >= 0.0
    return float((recording[channel] - recording[f"reference_{channel}"])[scored].mean())


def compensated(
    workspace: Workspace, model: str, reference: Recording, form: str, settings: dict[str, Any]
) -> tuple[Recording, list[str]]:
    """Return the pressures that a compensator gives for a reference, and what it says of them.

    Of one that learns they are those that it begins with: what it learns from is measured.
    """
    notes = too_fast(workspace, model, reference)
    if form == "adaptive":
        forms.made(workspace, model, form, settings)
        notes.append("It begins with these pressures, and learns from what is measured.")
        form = "inverse"
    block = forms.made(workspace, model, form, settings)
    reference = reference.select([channel.name for channel in block.inputs])
    ahead = block.samples_ahead
    if ahead:
        last = {name: np.full(ahead, reference[name][-1]) for name in reference.channels}
        longer = {name: np.append(reference[name], last[name]) for name in reference.channels}
        given_early = Recording(longer, reference.sample_time, dict(reference.units))
    else:
        given_early = reference
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        found = block.simulate(given_early, sample_time=None)
    notes += [str(one.message) for one in caught if issubclass(one.category, ModelWarning)]
    if ahead:  # each is due when its reference is
        found = replace(found.slice(ahead, len(found)), start_time=reference.start_time)
    return found, list(dict.fromkeys(notes))


def kept_motion(
    workspace: Workspace, model: str, reference: Recording, others: Collection[str] = ()
) -> str:
    """Return the file of a reference among the runs, written where no run of a model has that motion.

    Parameters
    ----------
    workspace : Workspace
    model : str
    reference : Recording
    others : collection of str
        Files of loops that have not ended.
    """
    from mckibben.files import read, write

    for file in {*others, *(run.reference for run in workspace.runs(model).values())} - {""}:
        with suppress(MckibbenError):
            (known,) = read(workspace.path("runs", file), informative=False)
            if known == reference:
                return file
    file = f"{workspace.new_name('runs', 'reference', '.csv')}.csv"
    write(reference, workspace.new_path("runs", file))
    return file


def look_back(workspace: Workspace, given: dict[str, Any], tell: Tell) -> str:
    """Say how far a log of the real rig was off its reference, and why; keep it, and the refit."""
    from mckibben.diagnosis.refit import Refit
    from mckibben.files import read
    from mckibben.report import words
    from mckibben.workflow import review

    name, settings = str(given["name"]), given.get("settings") or {}
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        log = read(workspace.path("uploads", given["log"]), informative=False)
    notes = [str(one.message) for one in caught if issubclass(one.category, DataWarning)]
    model = workspace.model(given["model"])
    form = given.get("form", "inverse")
    compensator = forms.made(workspace, given["model"], form, settings)
    older = workspace.with_role("train") if given.get("refit") else []
    names = [channel.name for channel in (*model.inputs, *model.outputs)]
    older = [run for run in older if all(name in run for name in names)]
    older = [run for run in older if not any(c.startswith("reference_") for c in run.channels)]
    tell(0.1, float("nan"))
    found = review(
        [*log, *older],
        model=model,
        compensator=compensator,
        refit=bool(given.get("refit")),
        seed=int(given.get("seed", 0)),
    )
    tell(0.9, float("nan"))
    refit = found.refit if isinstance(found.refit, Refit) else None
    if refit is not None:
        refit.model.save(workspace.path("reviews", f"{name}-refit.json"))
    for place, one in enumerate(found.outputs):
        time, error = one.time, one.measured - one.reference
        curves = [
            curve("reference", time, one.reference, "measured"),
            curve("measured", time, one.measured, "series-1"),
            curve("error", time, error, "measured", below=True),
            *(
                curve(kind, time, part, f"series-{k + 1}", below=True)
                for k, (kind, part) in enumerate(one.parts.items())
            ),
        ]
        workspace.write_json(
            "reviews",
            name if place == 0 else f"{name}-{one.output}",
            {
                "log": str(given["log"]),
                "model": str(given["model"]),
                "form": form,
                "output": one.output,
                "unit": one.unit,
                "achieved": one.achieved,
                "predicted": one.predicted,
                "pressure": one.pressure,
                "residual": one.residual,
                "sentences": [*words.reviewed(found), *notes],
                "refitted": refit is not None,
                "curves": curves,
            },
        )
    return words.reviewed(found)[0]


def estimate(workspace: Workspace, given: dict[str, Any], tell: Tell) -> str:
    """Estimate a force over a recording that has it measured, and keep both."""
    name = str(given["name"])
    block = forms.made(workspace, given["model"], "force", {})
    recording = workspace.recording(str(given["recording"]))
    missing = [channel.name for channel in block.inputs if channel.name not in recording]
    if missing:
        raise DataError(
            "the estimate is made from it, and the recording has no such channel",
            channel=missing[0],
            remedy="choose a recording that has it",
        )
    tell(0.1, float("nan"))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        found = block.simulate(recording.select([c.name for c in block.inputs]))
    notes = list(
        dict.fromkeys(str(w.message) for w in caught if issubclass(w.category, ModelWarning))
    )
    said = []
    time = recording.time
    for place, channel in enumerate(block.outputs):
        curves = [curve("estimated", time, found[channel.name], "series-1")]
        figures: dict[str, float] = {}
        useless = []
        if channel.name in recording:
            measured = recording[channel.name]
            error = measured - found[channel.name]
            curves.insert(0, curve("measured", time, measured, "measured"))
            curves.append(curve("measured − estimated", time, error, "series-2", below=True))
            figures = {
                "rmse": float(np.sqrt(np.mean(error**2))),
                "largest": float(np.abs(error).max()),
                "span": float(np.ptp(measured)),
            }
            said.append(f"{channel.name} RMSE {figures['rmse']:.3g} {channel.unit}")
            size = float(np.sqrt(np.mean(measured**2)))
            if figures["rmse"] > size:
                useless = [
                    f"{given['model']} is of no use for {channel.name} here: it is off by more than "
                    f"what was measured, {size:.3g} {channel.unit} RMS"
                ]
        workspace.write_json(
            "forces",
            name if place == 0 else f"{name}-{channel.name}",
            {
                "model": str(given["model"]),
                "recording": str(given["recording"]),
                "output": channel.name,
                "unit": channel.unit,
                **figures,
                "notes": [*useless, *notes],
                "curves": curves,
            },
        )
    return ", ".join(said) or "estimated; the recording has no measured force to compare with"


def curve(
    name: str, time: Array, values: Array, colour: str, *, below: bool = False
) -> dict[str, Any]:
    """Return a curve to draw, thinned."""
    from mckibben.report.drawing import over_time

    x, y = over_time(np.asarray(time, float), np.asarray(values, float), CURVE)
    return {"name": name, "colour": colour, "below": below} | {
        "x": [float(f"{v:.7g}") for v in x],
        "y": [None if np.isnan(v) else float(f"{v:.7g}") for v in y],
    }


def fitting_rigs(workspace: Workspace, model: str) -> list[str]:
    """Return the virtual rigs that are of a model's size: same channels, limits and stroke."""
    from mckibben.control import slow_rise
    from mckibben.control.suiting import doubts
    from mckibben.rigs import load_rig, rig_names

    block = workspace.model(model)
    try:
        inverse = forms.inverse_of(block)
        held = held_for(workspace, model)
    except MckibbenError:
        return []
    inputs = tuple(channel.name for channel in block.inputs)
    outputs = [channel.name for channel in block.outputs]
    found = []
    for name in rig_names():
        rig = load_rig(name)
        if not (set(inputs) <= set(rig.inputs) and set(outputs) <= set(rig.outputs)):
            continue
        driven = [one for one in rig.inputs if one not in inputs]
        if any(one.startswith(("pressure", "voltage")) for one in driven):
            continue
        channels = {one: np.zeros(2) for one in outputs}
        channels |= {one: np.full(2, value) for one, value in held.items()}
        channels |= {one: np.zeros(2) for one in driven if one not in channels}
        try:
            rise = slow_rise(rig, Recording(channels, 0.05))
            if not doubts(inverse, rig, rise):
                found.append(name)
        except MckibbenError:
            continue
    return found
