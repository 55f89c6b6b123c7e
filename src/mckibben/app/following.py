"""Compensators of a folder's models: what they are asked for, what they are tried on, and the jobs.

A motion is given by points of time and value for every channel that a compensator is asked for; a job
makes them a recording. What loops, reviews of logs and estimates of force gave is in ``runs``,
``reviews`` and ``forces``, in the form of earlier versions.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import suppress
from typing import Any

import numpy as np

from mckibben.app.jobs import Tell
from mckibben.app.workspace import Workspace
from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.fields import Channel
from mckibben.errors import DataError, DataWarning, MckibbenError, ModelError, ModelWarning
from mckibben.recording import Recording
from mckibben.report.drawing import over_time

Points = list[tuple[float, float]]
"""Time [s] and value, times rising."""

Ends = tuple[float, float]
"""Lowest and highest."""

MOTIONS = {"sine": "Sine", "triangle": "Triangle", "steps": "Staircase", "random": "Random"}

KINDS = {
    "inverse": "Inverse, exact for this model",
    "adaptive": "Inverse that learns while it runs",
    "predictive": "Looks ahead, for limits and slow valves",
    "learned": "Network, trained on the recordings",
}
"""Compensators, in words."""

SETTINGS = {
    "adaptive": ("time", "noise"),
    "predictive": ("horizon", "rate_limit", "pressures", "total_limit", "flow_limit"),
}
"""Fields of `InvertOptions`, by the compensator that they are of."""

STEP = 0.02
"""Time between steps, where neither a model nor a recording has one [s]."""

A_CYCLE = 40
"""Points of a cycle of a sine."""

MOST_SAMPLES = 1_000_000
"""Of a reference."""

CURVE = 2000
"""Most points of a curve that is stored to be drawn."""

SLOWLY = 400
"""Samples of a slow way up and down."""


# -- what a model is used as ------------------------------------------------------------------------


def compensator(workspace: Workspace, name: str) -> Block:
    """Return the compensator of a model; `ModelError` if it has none, or is one."""
    from mckibben.blocks.force.feedforward import compensator as of
    from mckibben.blocks.inverse import drives

    def make() -> Block:
        block = workspace.model(name)
        if drives(block.outputs[0]) or (block.undoing and not drives(block.inputs[0])):
            raise ModelError(
                "it is a compensator already", remedy="choose the model that it undoes"
            )
        return of(block)

    found: Block = workspace.cached(workspace.path("models", f"{name}.json"), "compensator", make)
    return found


def force_estimate(workspace: Workspace, name: str) -> Block:
    """Return what gives a force by what is measured; `ModelError` if the model gives none."""
    from mckibben.workflow import invert

    block = workspace.model(name)
    if all(channel.name.startswith("force") for channel in block.outputs):
        return block
    return invert(block, wanted="force").block


def having(workspace: Workspace, make: Callable[[Workspace, str], Block]) -> list[str]:
    """Return the models from which something can be made; those not recommended come last."""

    def able(name: str) -> bool:
        with suppress(MckibbenError):
            make(workspace, name)
            return True
        return False

    def known(name: str) -> bool:
        path = workspace.path("models", f"{name}.json")
        return bool(workspace.cached(path, f"able {make.__name__}", lambda: able(name)))

    refused = {row["name"] for row in workspace.results() if row.get("not_recommended")}
    names = [name for name in workspace.models() if known(name)]
    return sorted(names, key=lambda name: name in refused)


def prepare(workspace: Workspace) -> None:
    """Find what models can be used as, which takes a moment; it is then known."""
    for name in having(workspace, compensator):
        kinds(workspace, name)
    having(workspace, force_estimate)


def made(workspace: Workspace, name: str, kind: str, settings: Mapping[str, Any]) -> Block:
    """Return a model of the folder as itself (``model``, ``banded``), one of `KINDS`, or ``force``."""
    from mckibben.workflow import invert

    if kind in ("model", "banded"):
        return workspace.model(name, "models" if kind == "model" else "banded")
    if kind == "force":
        return force_estimate(workspace, name)
    if kind == "inverse":
        return compensator(workspace, name)
    block = workspace.model(name)
    if kind == "learned":
        names = [channel.name for channel in (*block.inputs, *block.outputs)]
        runs = [run.select(names) for run in workspace.with_role("train")]
        return invert(block, learned=tuple(runs)).block
    given: dict[str, Any] = {key: settings.get(key) for key in SETTINGS.get(kind, ())}
    return invert(
        block, adaptive=kind == "adaptive", predictive=kind == "predictive", **given
    ).block


def kinds(workspace: Workspace, name: str) -> dict[str, str]:
    """Return the compensators that a model has, in words."""
    from mckibben.blocks.compose import Series
    from mckibben.blocks.coupled.fuzzy_network import FuzzyNetwork

    def able(kind: str) -> bool:
        if kind == "learned":
            block = workspace.model(name)
            parts = block.parts if isinstance(block, Series) else ()
            return len(parts) > 2 and isinstance(parts[2], FuzzyNetwork)
        with suppress(MckibbenError):
            made(workspace, name, kind, {})
            return True
        return False

    def make() -> dict[str, str]:
        return {kind: words for kind, words in KINDS.items() if able(kind)}

    return dict(workspace.cached(workspace.path("models", f"{name}.json"), "kinds", make))


def asked_for(workspace: Workspace, name: str) -> tuple[dict[str, Channel], dict[str, Channel]]:
    """Return the channels of a reference, and those that are held meanwhile, such as a load."""
    block = compensator(workspace, name)
    channels = {channel.name: channel for channel in block.inputs}
    held = {key: channels[key] for key in block.scheduling if key in channels}
    return {key: one for key, one in channels.items() if key not in held}, held


# -- what the recordings say of a motion --------------------------------------------------------------


def pace(workspace: Workspace, name: str) -> tuple[float, float]:
    """Return time between steps, and of a usual cycle of the recordings that a model is of [s]."""
    block = workspace.model(name)
    runs = [run for run in workspace.used().values() if run.sample_time]
    found = [cycles(run, c.name) for run in runs for c in block.outputs if c.name in run]
    if not found:
        return block.sample_time or STEP, 10.0
    step = float(f"{np.median([run.sample_time or STEP for run in runs]):.3g}")
    return block.sample_time or step, float(np.median(np.concatenate(found)))


def cycles(run: Recording, name: str) -> Array:
    """Return how long cycles take [s], between the outer thirds of the range; all, if there are none."""
    values, step = run[name], run.sample_time or 0.0
    share = (values - values.min()) / (np.ptp(values) or 1.0)
    way = 1 * (share > 2 / 3) - (share < 1 / 3)
    seen = np.flatnonzero(way)
    turns = seen[1:][np.diff(way[seen]) != 0]
    return 2 * step * np.diff(turns) if len(turns) > 1 else np.array([step * len(run)])


def _recorded(workspace: Workspace, name: str) -> Array:
    runs = [run[name] for run in workspace.used().values() if name in run]
    return np.concatenate(runs) if runs else np.zeros(0)


def held_at(workspace: Workspace, name: str) -> dict[str, float]:
    """Return what is held while a compensator runs, at the middle of what was recorded."""
    values = {key: _recorded(workspace, key) for key in asked_for(workspace, name)[1]}
    return {
        key: float(f"{np.median(found):.4g}") if found.size else 0.0
        for key, found in values.items()
    }


def reach(workspace: Workspace, name: str, held: Mapping[str, float]) -> dict[str, Ends]:
    """Return what of every channel of a reference can be reached; what is not known was recorded."""
    key = f"reach {workspace.digest()} {sorted(held.items())}"
    path = workspace.path("models", f"{name}.json")
    return dict(workspace.cached(path, key, lambda: _reach(workspace, name, held)))


def _reach(workspace: Workspace, name: str, held: Mapping[str, float]) -> dict[str, Ends]:
    block = workspace.model(name)
    found: dict[str, Ends] = {}
    with suppress(MckibbenError):
        names = [channel.name for channel in block.outputs]
        found = dict(zip(names, zip(*map(np.ravel, block.reachable()), strict=True), strict=True))
    with suppress(MckibbenError):
        found |= _moved(workspace, name, held)
    for channel in asked_for(workspace, name)[0]:
        low, high = map(float, found.get(channel, (np.nan, np.nan)))
        if not np.isfinite([low, high]).all() or low >= high:
            values = _recorded(workspace, channel)
            low, high = (
                (float(values.min()), float(values.max()))
                if values.size and np.ptp(values)
                else (0.0, 1.0)
            )
        found[channel] = low, high
    return {channel: found[channel] for channel in asked_for(workspace, name)[0]}


def _moved(workspace: Workspace, name: str, held: Mapping[str, float]) -> dict[str, Ends]:
    """Return what a model of one muscle gives while its input goes slowly up and down, under a load."""
    block = workspace.model(name)
    driven = [channel.name for channel in block.inputs if channel.name not in block.scheduling]
    if len(driven) > 1 or len(block.outputs) > 1 or not {*block.scheduling} <= held.keys():
        return {}
    values = _recorded(workspace, driven[0])
    if not values.size or not np.ptp(values):
        return {}
    there = values.min() + np.ptp(values) * (1.0 - np.abs(np.linspace(-1.0, 1.0, SLOWLY)))
    channels = {driven[0]: there} | {key: np.full(SLOWLY, held[key]) for key in block.scheduling}
    step, cycle = pace(workspace, name)
    step = block.sample_time or max(step, 2.0 * cycle / SLOWLY)
    found, _ = heard(lambda: block.simulate(Recording(channels, step)))
    moved = found[block.outputs[0].name]
    return {block.outputs[0].name: (float(moved.min()), float(moved.max()))}


def rest(workspace: Workspace, channel: str) -> float | None:
    """Return where a channel begins in the recordings, or None: muscles are recorded from rest."""
    runs = [run for run in workspace.used().values() if channel in run]
    return float(runs[0][channel][0]) if runs else None


# -- motions ----------------------------------------------------------------------------------------


def span(ends: Ends, resting: float | None) -> Ends:
    """Return ends of a motion well within what can be reached; it begins at the end nearer to rest."""
    start = ends[0] if resting is None else resting
    first, other = sorted(ends, key=lambda end: abs(end - start))
    ten = 0.1 * (other - first)
    if min(ends) < start < max(ends) and abs(start - first) > abs(ten):
        return float(f"{start:.3g}"), float(f"{other - ten:.3g}")
    return float(f"{first + ten:.3g}"), float(f"{other - ten:.3g}")


def motion(kind: str, seconds: float, first: float, other: float, cycles: int) -> Points:
    """Return a ready-made motion of `MOTIONS` between two ends.

    A staircase goes there and back by quarters; random ones go in straight lines between levels.
    """
    if not (seconds > 0 and first != other and 1 <= cycles <= 50):
        problem = f"there is no motion of {seconds:g} s between {first:g} and {other:g}"
        raise DataError(problem, remedy="give a time, two ends, and 1 to 50 cycles")
    if kind == "sine":
        shares: Array = np.linspace(0.0, 1.0, A_CYCLE * cycles + 1)
        levels: Array = np.asarray(0.5 - 0.5 * np.cos(2 * np.pi * cycles * shares))
    elif kind == "triangle":
        shares = np.linspace(0.0, 1.0, 2 * cycles + 1)
        levels = np.asarray(np.arange(shares.size) % 2.0)
    elif kind == "random":
        shares = np.linspace(0.0, 1.0, 4 * cycles + 1)
        levels = np.append(0.0, np.random.default_rng(0).uniform(0.0, 1.0, shares.size - 1))
    else:
        stairs = np.append(np.tile([0.0, 0.25, 0.5, 0.75, 1.0, 0.75, 0.5, 0.25], cycles), 0.0)
        ends = np.arange(stairs.size + 1) / stairs.size
        shares = np.sort(np.concatenate([ends[:-1], ends[1:] - 1e-3 / stairs.size]))
        shares[-1], levels = 1.0, np.repeat(stairs, 2)
    values = first + (other - first) * levels
    return [
        (float(f"{seconds * t:.6g}"), float(f"{y:.6g}"))
        for t, y in zip(shares, values, strict=True)
    ]


def reference(
    points: Mapping[str, Sequence[Sequence[float]]],
    held: Mapping[str, float],
    step: float,
    units: Mapping[str, str],
) -> Recording:
    """Return straight lines through points beside what is held; channels that end early stay there."""
    arrays: dict[str, Array] = {}
    for name, own in points.items():
        arrays[name] = np.asarray(own, dtype=float).reshape(-1, 2).T
        if arrays[name].shape[1] < 2 or np.any(np.diff(arrays[name][0]) <= 0):
            problem = "a reference needs two points or more, with rising times"
            raise DataError(problem, channel=name, remedy="use a ready-made motion, or a file")
    ends = [float(times[-1]) for times, _ in arrays.values()]
    if not step > 0 or not 0 < max(ends, default=0.0) / step <= MOST_SAMPLES:
        raise DataError("the reference is too long", remedy="shorten it, or take longer steps")
    grid = np.arange(0.0, max(ends) + 0.5 * step, step)
    channels = {name: np.interp(grid, *own) for name, own in arrays.items()}
    channels |= {name: np.full(grid.size, value) for name, value in held.items()}
    return Recording(channels, step, {name: units[name] for name in channels if name in units})


def of_file(run: Recording, wanted: Collection[str]) -> dict[str, Points]:
    """Return a recording as points for channels that are asked for."""
    if run.sample_time is None:
        raise DataError("it has no time", remedy="add a column time_s")
    found = {}
    for name in wanted:
        column = next((own for own in (f"reference_{name}", name) if own in run), None)
        if column is None:
            problem = "the compensator is asked for it, and the file has no such column"
            raise DataError(problem, channel=name, remedy=f"name a column {name}")
        time = run.time - run.time[0]
        found[name] = [(float(t), float(y)) for t, y in zip(time, run[column], strict=True)]
    return found


def stored(workspace: Workspace, recording: Recording) -> str:
    """Write a reference among the runs, and return its name."""
    from mckibben.files import write

    name = workspace.new_name("runs", "reference", ".csv")
    write(recording, workspace.path("runs", f"{name}.csv"))
    return name


def references(workspace: Workspace) -> list[str]:
    """Return the references among the runs, newest first."""
    paths = [p for p in (workspace.folder / "runs").glob("reference*.csv") if p.stat().st_size]
    return [p.stem for p in sorted(paths, key=lambda path: -path.stat().st_mtime_ns)]


def read_run(workspace: Workspace, name: str) -> Recording:
    """Return a reference, or the recording of a loop."""
    from mckibben.files import read

    path = workspace.path("runs", f"{name}.csv")
    found: Recording = workspace.cached(path, "", lambda: read(path, informative=False)[0])
    return found


# -- plants -----------------------------------------------------------------------------------------


def twin(workspace: Workspace, name: str) -> Any:
    """Return a model as a plant, with its band where it has one; limits not known were recorded."""
    from mckibben.control import Twin
    from mckibben.control.identified import known_ranges

    banded = workspace.path("banded", f"{name}.json").is_file()
    model = workspace.model(name, "banded" if banded else "models")
    limits = {}
    for channel in model.inputs:
        values = _recorded(workspace, channel.name)
        if channel.name not in known_ranges(model) and values.size and np.ptp(values):
            limits[channel.name] = float(values.min()), float(values.max())
    return Twin(model, limits=limits, name=name)


def twins(workspace: Workspace, name: str) -> dict[str, str]:
    """Return the models that a compensator can be tried on, in words: others of the muscle first."""
    from mckibben.control.suiting import of_itself

    undone = workspace.model(name)
    sides = [{c.name for c in ends} for ends in (undone.inputs, undone.outputs)]
    found = {}
    for other in workspace.models():
        with suppress(MckibbenError):
            plant = twin(workspace, other)
            if [set(plant.inputs), set(plant.outputs)] != sides:
                continue
            for channel in sides[0].difference(undone.scheduling):
                plant.limits(channel)
            same = of_itself(undone, plant)
            timed = "" if plant.forward.rate_dependent else ", knows no time"
            words = "itself, proves nothing" if same else f"another model{timed}"
            found[other] = (same, bool(timed)), f"{other} ({words})"
    order = sorted(found, key=lambda other: found[other][0])
    return {other: found[other][1] for other in order}


def rigs(workspace: Workspace, name: str) -> list[str]:
    """Return the virtual rigs with a model's channels; a run on one says where the sizes differ."""
    from mckibben.rigs import load_rig, rig_names

    block = workspace.model(name)
    inputs, outputs = ({channel.name for channel in ends} for ends in (block.inputs, block.outputs))

    def fits(each: str) -> bool:
        rig = load_rig(each)
        more = {*rig.inputs} - inputs
        driven = any(one.startswith(("pressure", "voltage")) for one in more)
        return inputs <= {*rig.inputs} and outputs <= {*rig.outputs} and not driven

    return [each for each in rig_names() if fits(each)]


def laws(workspace: Workspace, name: str, plant: str, rig: str) -> dict[str, str]:
    """Return the controllers, and why one closes no loop on a plant; empty where it does."""
    from mckibben import registry
    from mckibben.control.laws import refusal
    from mckibben.rigs import load_rig

    there = load_rig(rig) if rig else twin(workspace, plant)
    block = compensator(workspace, name)
    return {law: refusal(law, block, there) for law in registry.names("controllers")}


# -- jobs -------------------------------------------------------------------------------------------


def loop(
    workspace: Workspace,
    tell: Tell,
    *,
    name: str,
    model: str,
    form: str,
    settings: dict[str, Any],
    reference: str,
    controller: str,
    plant: str = "",
    rig: str = "",
    options: dict[str, Any],
) -> str:
    """Let a controller follow a reference on a model or a virtual rig, beside no compensation."""
    from mckibben import workflow
    from mckibben.files import write

    block = made(workspace, model, form, settings)
    run = workflow.track(
        block,
        read_run(workspace, reference),
        rig=rig or None,
        plant=twin(workspace, plant) if plant else None,
        controller=controller,
        progress=tell,
        **options,
    )
    found, without = run.tracked, run.uncompensated
    recording = without.beside(found.recording).with_meta(name=name)
    write(recording, workspace.path("runs", f"{name}.csv"))
    beside = [channel for channel in run.reference.channels if channel not in found.rmse]
    scored = recording.time >= 0.0
    off = {key: recording[key] - recording[f"reference_{key}"] for key in found.rmse}
    units = {key: recording.units[key] for key in found.rmse}
    units |= {key: run.reference.units[key] for key in beside}
    held = {key: run.reference[key] for key in beside}
    content: dict[str, Any] = {
        "model": model,
        "rig": rig,
        "plant": plant,
        "controller": controller,
        "form": form,
    }
    content |= {"settings": settings, "options": options, "reference": f"{reference}.csv"}
    content |= {"rmse": dict(found.rmse), "largest": dict(found.largest), "units": units}
    content |= {"offset": {key: float(error[scored].mean()) for key, error in off.items()}}
    content |= {"scatter": dict(found.scatter), "clipped": int(found.clipped)}
    content |= {"notes": list(run.notes)}
    content |= {"uncompensated": dict(without.tracked.rmse) if without.tracked else {}}
    content |= {"held": {k: None if np.ptp(y) else float(y[0]) for k, y in held.items()}}
    content |= {"step_us": 1e6 * float(found.step_time[0])}
    workspace.write("runs", name, content)
    if isinstance(run.controller, Block):
        run.controller.save(workspace.path("takeaway", f"{name}-controller.json"))
    return ", ".join(f"{key} RMSE {rmse:.3g} {units[key]}" for key, rmse in found.rmse.items())


def commands(
    workspace: Workspace,
    tell: Tell,
    *,
    name: str,
    model: str,
    form: str,
    settings: dict[str, Any],
    reference: str,
) -> str:
    """Write what a compensator commands for a reference, for a rig that is elsewhere."""
    from mckibben.files import write

    tell(0.1)
    whole = read_run(workspace, reference)
    notes = []
    if form == "adaptive":
        notes.append("These are the commands that it begins with: it learns from measurements.")
    block = made(workspace, model, "inverse" if form == "adaptive" else form, settings)
    given = whole.select([channel.name for channel in block.inputs])
    if ahead := block.samples_ahead:  # it is given what is wanted so many samples early
        longer = {
            key: np.append(given[key], np.repeat(given[key][-1], ahead)) for key in given.channels
        }
        given = Recording(longer, given.sample_time, dict(given.units))
    found, said = heard(lambda: block.simulate(given))
    notes += said
    shown = {f"reference_{key}": whole[key] for key in whole.channels}
    units = {f"reference_{key}": unit for key, unit in whole.units.items()} | dict(found.units)
    channels = shown | {key: found[key][ahead:] for key in found.channels}
    run = Recording(channels, whole.sample_time, units, meta={"name": name})
    write(run, workspace.path("runs", f"{name}.csv"))
    content = {"model": model, "form": form, "settings": settings, "reference": f"{reference}.csv"}
    content |= {"units": units, "notes": list(dict.fromkeys(notes))}
    workspace.write("runs", name, content)
    ranges = [(key, float(found[key].min()), float(found[key].max())) for key in found.channels]
    return ", ".join(f"{key} {low:.3g} to {high:.3g} {units[key]}" for key, low, high in ranges)


def review(
    workspace: Workspace,
    tell: Tell,
    *,
    name: str,
    log: str,
    model: str,
    form: str,
    settings: dict[str, Any],
    refit: bool,
) -> str:
    """Say how far a logged loop was off its reference, and why; with a refit, save that too."""
    from mckibben.diagnosis.refit import Refit
    from mckibben.files import read
    from mckibben.report import words
    from mckibben.workflow import review as find

    read_log, notes = heard(lambda: read(workspace.path("uploads", log), informative=False))
    runs = list(read_log)
    block = workspace.model(model)
    if refit:
        needed = {channel.name for channel in (*block.inputs, *block.outputs)}
        older = [run for run in workspace.with_role("train") if needed <= {*run.channels}]
        runs += [r for r in older if not any(c.startswith("reference_") for c in r.channels)]
    tell(0.1)
    used = made(workspace, model, form, settings)
    found = find(runs, model=block, compensator=used, refit=refit)
    tell(0.9)
    if isinstance(found.refit, Refit):
        found.refit.model.save(workspace.path("reviews", f"{name}-refit.json"))
    for place, one in enumerate(found.outputs):
        error = one.measured - one.reference
        curves = [
            curve("reference", one.time, one.reference, "measured"),
            curve("measured", one.time, one.measured, "series-1"),
            curve("error", one.time, error, "measured", below=True),
        ]
        for k, (part, values) in enumerate(one.parts.items(), start=1):
            curves.append(curve(part, one.time, values, f"series-{k}", below=True))
        copied = ("output", "unit", "achieved", "predicted", "pressure", "residual")
        content: dict[str, Any] = {"log": log, "model": model, "form": form, "settings": settings}
        content |= {key: getattr(one, key) for key in copied}
        content |= {"sentences": [*words.reviewed(found), *notes], "curves": curves}
        content |= {"refitted": isinstance(found.refit, Refit)}
        workspace.write("reviews", name if place == 0 else f"{name}-{one.output}", content)
    return words.reviewed(found)[0]


def estimate(workspace: Workspace, tell: Tell, *, name: str, model: str, recording: str) -> str:
    """Estimate a force over a recording, beside the measured one where there is one."""
    block, run = force_estimate(workspace, model), workspace.recording(recording)
    if missing := [channel.name for channel in block.inputs if channel.name not in run]:
        problem = "the estimate is made from it, and the recording has no such channel"
        raise DataError(problem, channel=missing[0], remedy="choose a recording that has it")
    tell(0.1)
    given = run.select([channel.name for channel in block.inputs])
    found, notes = heard(lambda: block.simulate(given))
    said = []
    for place, channel in enumerate(block.outputs):
        values = found[channel.name]
        curves = [curve("estimated", run.time, values, "series-1")]
        content: dict[str, Any] = {"model": model, "recording": recording}
        content |= {"output": channel.name, "unit": channel.unit}
        if channel.name in run:
            measured = run[channel.name]
            error = measured - values
            curves.insert(0, curve("measured", run.time, measured, "measured"))
            curves.append(curve("error", run.time, error, "series-2", below=True))
            rmse, size = (float(np.sqrt(np.mean(x**2))) for x in (error, measured))
            content |= {"rmse": rmse, "largest": float(np.abs(error).max())}
            content |= {"span": float(np.ptp(measured))}
            said.append(f"{channel.name} RMSE {rmse:.3g} {channel.unit}")
            if rmse > size:
                notes.insert(0, f"Of no use here: the measured {channel.name} is {size:.3g} RMS")
        content |= {"notes": list(dict.fromkeys(notes)), "curves": curves}
        workspace.write("forces", name if place == 0 else f"{name}-{channel.name}", content)
    return ", ".join(said) or "estimated; the recording has no measured force to compare with"


def curve(
    name: str, time: Array, values: Array, colour: str, *, below: bool = False
) -> dict[str, Any]:
    """Return a curve to draw, thinned, for JSON."""
    x, y = over_time(np.asarray(time, float), np.asarray(values, float), CURVE)
    return {"name": name, "colour": colour, "below": below} | {
        "x": [float(f"{v:.7g}") for v in x],
        "y": [None if np.isnan(v) else float(f"{v:.7g}") for v in y],
    }


def heard(work: Callable[[], Any]) -> tuple[Any, list[str]]:
    """Return what work gives, and the package's warnings meanwhile."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        found = work()
    notes = [str(w.message) for w in caught if issubclass(w.category, (DataWarning, ModelWarning))]
    return found, list(dict.fromkeys(notes))


def newest(workspace: Workspace, kind: str) -> dict[str, dict[str, Any]]:
    """Return runs, reviews or estimates of force by name, the newest first."""
    names = sorted(
        workspace.names(kind),
        key=lambda name: -workspace.path(kind, f"{name}.json").stat().st_mtime_ns,
    )
    found = {name: workspace.read(kind, name) for name in names}
    return {name: one for name, one in found.items() if one and "model" in one}
