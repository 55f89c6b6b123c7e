"""Uses of models, desired motions, and the jobs that run loops and review logs.

A motion is points of time and value for every reference channel. Results are in ``runs`` and
``reviews``: numbers as JSON, samples as CSV.
"""

from __future__ import annotations

import math
import re
import zlib
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import numpy as np

from mckibben import registry
from mckibben.app.formulas import values
from mckibben.app.jobs import Tell
from mckibben.app.modelling import Json, stored_items
from mckibben.app.workspace import Workspace
from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.fields import Channel, drives
from mckibben.blocks.ranges import known_ranges
from mckibben.errors import DataError, MckibbenError, ModelError
from mckibben.numerals import number
from mckibben.recording import COMMAND, REFERENCE, Recording

if TYPE_CHECKING:
    from mckibben.simulation import Simulation

Points = list[tuple[float, float]]
"""Time [s] and value, times rising."""

MOTIONS = {"sine": "Sine", "triangle": "Triangle", "steps": "Staircase", "random": "Random"}

KINDS = {
    "inverse": "Inverse, exact for this model",
    "adaptive": "Inverse that learns while it runs",
    "predictive": "Looks ahead, for limits and slow valves",
    "learned": "Network, trained on the recordings",
}
"""Compensators, in words."""

USES = {
    "model": "The model itself, as fitted",
    **KINDS,
    "force": "Its estimate of force",
}
"""All that a model can be used as, in words."""

SETTINGS = {
    "adaptive": ("time", "noise"),
    "predictive": ("horizon", "rate_limit", "pressures"),
}
"""Fields of `InvertOptions`, by the compensator that they are of."""

MOST_SAMPLES = 1_000_000
"""Of a reference."""

DRAWN = 2000
"""Most points of a curve of a review."""


# -- uses of a model ------------------------------------------------------------------------


def made(workspace: Workspace, name: str, use: str, settings: Mapping[str, Any]) -> Block:
    """Return a model of the folder as one of `USES`; `ModelError` if it cannot be that."""
    from mckibben.workflow import invert

    if use == "model":
        return workspace.model(name)
    block, given = workspace.model(name), dict(settings)
    if use == "force":
        given = {"wanted": "force"}
    elif drives(block.outputs[0]) or (block.inverts and not drives(block.inputs[0])):
        raise ModelError("it is a compensator already", remedy="choose the model that it undoes")
    elif use == "learned":
        names = [channel.name for channel in (*block.inputs, *block.outputs)]
        given = {"learned": tuple(run.select(names) for run in workspace.with_role("train"))}
    elif use != "inverse":
        given[use] = True
    return invert(block, **given).model


def of_model(workspace: Workspace, name: str, key: str, make: Callable[[], Any]) -> Any:
    """Return what is made of a model, once."""
    return workspace.cached(workspace.path("models", f"{name}.json"), key, make)


def uses(workspace: Workspace, name: str) -> dict[str, str]:
    """Return what a model can be used as, in words; the first time takes a moment."""
    from mckibben.blocks.coupled.fuzzy_network import FuzzyNetwork

    def able(use: str) -> bool:
        with suppress(MckibbenError):
            block = workspace.model(name)
            if use == "learned":  # training takes minutes
                return any(type(part) is FuzzyNetwork for part in getattr(block, "parts", ()))
            return bool(made(workspace, name, use, {}))
        return use == "model"

    known = of_model(workspace, name, "uses", lambda: [*filter(able, USES)])
    return {use: words for use, words in USES.items() if use in known}


def is_balance(workspace: Workspace, name: str) -> bool:
    """Return whether a model is a balance, which MJCF can carry."""
    from mckibben.blocks.coupled.balance import balance_in

    return balance_in(workspace.model(name)) is not None


def having(workspace: Workspace, use: str) -> list[str]:
    """Return the models that can be used so; those not recommended, or on other data, are last.

    Those on other data whose channels no recording has are left out.
    """
    rows, known = {row["name"]: row for row in workspace.results()}, {*workspace.channels()}

    def recorded_here(name: str) -> bool:
        block = workspace.model(name)
        return {channel.name for channel in (*block.inputs, *block.outputs)} <= known

    stale = {name for name, row in rows.items() if not row["current"]}
    names = [name for name in workspace.models() if use in uses(workspace, name)]
    names = [name for name in names if name not in stale or recorded_here(name)]
    last = stale | {name for name, row in rows.items() if row.get("not_recommended")}
    return sorted(names, key=lambda name: name in last)


def estimate(workspace: Workspace, name: str, recording: str) -> Simulation:
    """Return what a model estimates of a force over a recording."""
    from mckibben.studying.simulating import simulated

    block, run = made(workspace, name, "force", {}), workspace.recording(recording)
    return simulated(block, lambda names: [run.select(names)])


def asked_for(workspace: Workspace, name: str) -> tuple[dict[str, Channel], dict[str, Channel]]:
    """Return the channels of a reference, and those that are held meanwhile, such as a load."""

    def make() -> Any:
        block = made(workspace, name, "inverse", {})
        channels = {channel.name: channel for channel in block.inputs}
        held = {key: channels.pop(key) for key in block.scheduling if key in channels}
        return channels, held

    channels, held = of_model(workspace, name, "asked", make)
    return channels, held


# -- ranges and pace of the recordings --------------------------------------------------------------


def pace(workspace: Workspace, name: str) -> tuple[float, float]:
    """Return time between steps, and of a cycle over the range at the speed of the recordings [s].

    Where these have no whole cycle, that is the time of the longest.

    Raises
    ------
    DataError
        If neither the model nor a recording in use has a sample time.
    """
    from mckibben.signals import cycles

    block = workspace.model(name)
    steps: list[float] = []
    seconds: list[float] = []
    strokes: list[float] = []
    ranges = {c.name: np.ptp(levels(workspace, block, c.name)) for c in block.outputs}
    longest = 0.0
    for run in workspace.used().values():
        if run.sample_time:
            longest = max(longest, run.sample_time * len(run))
            steps.append(run.sample_time)
            for key in ranges.keys() & run.channels:
                with suppress(DataError):
                    for cycle in cycles(run[key]):
                        seconds.append(run.sample_time * (cycle.stop - cycle.start - 1))
                        strokes.append(float(np.ptp(run[key][cycle]) / ranges[key]))
    if not steps and block.sample_time is None:
        remedy = "import one with time, or choose it among the data in use"
        raise DataError("no recording in use has a time", remedy=remedy)
    step = block.sample_time or float(f"{np.median(steps):.3g}")
    return step, sum(seconds) / sum(strokes) if seconds else longest


def recorded(workspace: Workspace, name: str) -> Array:
    """Return a channel of all recordings in use, one after the other; empty where none has it."""
    runs = [run[name] for run in workspace.used().values() if name in run]
    return np.concatenate(runs) if runs else np.empty(0)


def levels(workspace: Workspace, block: Block, name: str) -> Array:
    """Return a channel as recorded, or the ends of what a model was identified for.

    Raises
    ------
    DataError
        If neither is known.
    """
    values = recorded(workspace, name)
    if values.size:
        return values
    known = known_ranges(block.inputs, block.known_inputs)
    known |= known_ranges(block.outputs, block.known_outputs)
    if name not in known:
        raise DataError(
            "neither a recording in use nor the model has a range of it",
            channel=name,
            remedy="import a recording of it, or choose one among the data in use",
        )
    return np.array(known[name])


def reach(
    workspace: Workspace, name: str, held: Mapping[str, float]
) -> dict[str, tuple[float, float]]:
    """Return what of every channel of a reference can be reached again and again.

    It takes into account what is held meanwhile, hysteresis, and what creeps in cycles of the usual
    pace; it is within what was recorded.
    """
    from mckibben.studying.recorded_inputs import RecordedInputs

    def make() -> dict[str, tuple[float, float]]:
        block, runs = workspace.model(name), list(workspace.used().values())
        driven = [channel.name for channel in made(workspace, name, "inverse", {}).outputs]
        others = {c.name: held[c.name] for c in block.inputs if c.name not in driven}
        found: dict[str, tuple[float, float]] = {}
        with suppress(MckibbenError):
            if runs:
                inputs = RecordedInputs.of(runs, driven)
                found = inputs.reached(block, others, pace(workspace, name)[1])
        for channel in asked_for(workspace, name)[0]:
            values = levels(workspace, block, channel)
            low, high = found.get(channel, (-np.inf, np.inf))
            low, high = max(low, float(values.min())), min(high, float(values.max()))
            found[channel] = low, high if high > low else low + 1.0
        return found

    return dict(of_model(workspace, name, f"reach {workspace.digest()} {held}", make))


# -- motions ----------------------------------------------------------------------------------------


def wish(workspace: Workspace, name: str) -> Json:
    """Return a motion of the first channel that a model is asked for, through its reach and back.

    It begins at the end that is nearer to the first sample; other channels stay at their median. It is
    made smaller, down to a fifth of the reach, until the inverse clips nothing of it.
    """
    step, cycle = pace(workspace, name)
    channels, held = asked_for(workspace, name)
    block = workspace.model(name)
    found: Json = {"seconds": float(f"{max(2 * cycle, 40 * step):.2g}"), "cycles": 2, "step": step}
    found |= {"stored": "", "now": next(iter(channels)), "channels": {}}
    found["held"] = {key: float(f"{np.median(levels(workspace, block, key)):.4g}") for key in held}
    inverse, units = made(workspace, name, "inverse", {}), units_of(channels | held)
    for margin in (0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4):
        for channel, (low, high) in reach(workspace, name, found["held"]).items():
            seen, digits = levels(workspace, block, channel), 2 - math.floor(math.log10(high - low))
            lower, upper = low + margin * (high - low), high - margin * (high - low)
            near, far = (lower, upper) if seen[0] - lower < upper - seen[0] else (upper, lower)
            first, kind = near, "sine"
            if channel != found["now"]:
                first, kind = min(max(float(np.median(seen)), lower), upper), "hold"
            ends = {"first": round(first, digits) + 0.0, "other": round(far, digits) + 0.0}
            found["channels"][channel] = {"kind": kind, **ends, "points": []}
        shape(found)
        asked = reference(points_of(found), found["held"], step, units)
        if not inverse.n_clipped(inverse.final_state(asked)):
            break
    return found


def units_of(channels: Mapping[str, Channel]) -> dict[str, str]:
    """Return units by name."""
    return {name: channel.unit for name, channel in channels.items()}


def points_of(found: Json) -> dict[str, Points]:
    """Return the points of a motion by channel."""
    return {name: own["points"] for name, own in found["channels"].items()}


def shape(found: Json) -> None:
    """Make the points of all motions that are ready-made and filled in."""
    seconds, cycles = found["seconds"], found["cycles"]
    for own in found["channels"].values():
        first, other = own["first"], own["other"]
        if own["kind"] == "hold" and None not in (seconds, first):
            own["points"] = [(0.0, first), (seconds, first)]
        elif own["kind"] == "formula" and seconds and own.get("text"):
            times = np.linspace(0.0, seconds, max(round(seconds / found["step"]), 1) + 1)
            own["points"] = [*zip(times.tolist(), values(own["text"], times).tolist(), strict=True)]
        elif own["kind"] == "drawn" and own.get("text"):
            own["points"] = drawn(own["text"])
        elif own["kind"] in MOTIONS and None not in (seconds, cycles, first, other):
            own["points"] = motion(own["kind"], seconds, first, other, int(cycles))


def drawn(text: str) -> Points:
    """Return points from a text, such as ``0 5; 2 10; 4 5``: times [s] and values.

    >>> drawn("0 5; 2 10")
    [(0.0, 5.0), (2.0, 10.0)]
    """
    try:
        pairs = [tuple(map(float, re.split(r"[\s,:]+", one.strip()))) for one in text.split(";")]
        return [(time, value) for time, value in pairs]
    except ValueError:
        problem = f"{text!r:.60} is no list of points"
        raise DataError(problem, remedy="write times and values, such as 0 5; 2 10; 4 5") from None


def motion(kind: str, seconds: float, first: float, other: float, cycles: int) -> Points:
    """Return a ready-made motion of `MOTIONS` between two ends.

    A staircase goes there and back by quarters; random ones go in straight lines between levels.
    """
    if not (seconds > 0 and first != other and 1 <= cycles <= 50):
        problem = f"there is no motion of {seconds:g} s between {first:g} and {other:g}"
        raise DataError(problem, remedy="give a time, two ends, and 1 to 50 cycles")
    shares: Array = np.linspace(0.0, 1.0, {"sine": 40, "random": 4}.get(kind, 2) * cycles + 1)
    if kind == "sine":
        levels: Array = np.asarray(0.5 - 0.5 * np.cos(2 * np.pi * cycles * shares))
    elif kind == "random":
        levels = np.append(0.0, np.random.default_rng(0).uniform(0.0, 1.0, shares.size - 1))
    elif kind == "triangle":
        levels = np.asarray(np.arange(shares.size) % 2.0)
    else:
        stairs = np.append(np.tile([0.0, 0.25, 0.5, 0.75, 1.0, 0.75, 0.5, 0.25], cycles), 0.0)
        begin = np.arange(stairs.size) / stairs.size
        shares = np.append(np.column_stack([begin, begin + 0.999 / stairs.size]).ravel()[:-1], 1.0)
        levels = np.repeat(stairs, 2)
    values = first + (other - first) * levels
    pairs = zip(seconds * shares, values, strict=True)
    return [(float(f"{t:.6g}"), float(f"{y:.6g}")) for t, y in pairs]


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
    end = max((float(times[-1]) for times, _ in arrays.values()), default=0.0)
    if not step > 0 or not 0 < end / step <= MOST_SAMPLES:
        raise DataError("the reference is too long", remedy="shorten it, or take longer steps")
    grid = np.arange(0.0, end + 0.5 * step, step)
    channels = {name: np.interp(grid, *own) for name, own in arrays.items()}
    channels |= {name: np.full(grid.size, value) for name, value in held.items()}
    return Recording(channels, step, {name: units[name] for name in channels if name in units})


def of_file(run: Recording, wanted: Collection[str]) -> dict[str, Points]:
    """Return a recording as points for channels that are asked for."""
    if run.sample_time is None:
        raise DataError("it has no time", remedy="add a column time_s")
    found, times = {}, (run.time - run.time[0]).tolist()
    for name in wanted:
        column = next((own for own in (REFERENCE + name, name) if own in run), None)
        if column is None:
            problem = "the compensator is asked for it, and the file has no such column"
            raise DataError(problem, channel=name, remedy=f"name a column {name}")
        found[name] = [*zip(times, run[column].tolist(), strict=True)]
    return found


def stored(workspace: Workspace, recording: Recording) -> str:
    """Write a reference among the runs, and return the name of its file."""
    from mckibben.files import write

    file = f"{workspace.new_name('runs', 'reference', '.csv')}.csv"
    write(recording, workspace.path("runs", file))
    return file


def read_run(workspace: Workspace, file: str) -> Recording:
    """Return a reference, or the recording of a loop."""
    from mckibben.files import read

    path = workspace.path("runs", file)
    found: Recording = workspace.cached(path, "", lambda: read(path, informative=False)[0])
    return found


# -- plants -----------------------------------------------------------------------------------------


def plant_of(workspace: Workspace, plant: str) -> Any:
    """Return ``rig NAME``, or ``model NAME``; unknown limits are those recorded."""
    from mckibben.control import Twin
    from mckibben.rigs import load_rig

    kind, _, name = plant.partition(" ")
    if kind == "rig":
        return load_rig(name)
    model, limits = workspace.model(name), {}
    known = known_ranges(model.inputs, model.known_inputs)
    for channel in {channel.name for channel in model.inputs}.difference(known):
        values = recorded(workspace, channel)
        if values.size and np.ptp(values):
            limits[channel] = float(values.min()), float(values.max())
    return Twin(model, limits=limits, name=name)


def plants(workspace: Workspace, name: str) -> dict[str, str]:
    """Return what a compensator can be tried on, in words; other muscles come last."""
    from mckibben.report.columns import diverged
    from mckibben.rigs import rig_names

    block = workspace.model(name)
    # a plant is driven by what a recording has as a command
    inputs = {channel.name.removeprefix(COMMAND) for channel in block.inputs}
    outputs = {channel.name for channel in block.outputs}

    def fits(plant: str) -> bool:
        with suppress(MckibbenError):
            there = plant_of(workspace, plant)
            more = {*there.inputs} - inputs
            units = getattr(there, "units", {})  # channels of rigs have standard names
            driven = any(drives(Channel(one, units.get(one, ""))) for one in more)
            return inputs <= {*there.inputs} and outputs <= {*there.outputs} and not driven
        return False

    rows = {row["name"]: row for row in workspace.results()}
    unstable = {one for one, row in rows.items() if diverged(row)}
    stale = workspace.on_other_data()
    models = [one for one in workspace.models() if one not in unstable]

    def another(one: str) -> str:
        test, unit = rows.get(one, {}).get("test"), rows.get(one, {}).get("unit", "")
        own = f", itself off by {number(test['rmse'], 3)} {unit}".rstrip() if test else ""
        return f"{one} (another model{own}{', of other data' if one in stale else ''})"

    found = {f"model {x}": another(x) for x in models if x not in (name, *stale)}
    found[f"model {name}"] = f"{name} (the same model: exact by construction)"
    found |= {f"rig {rig}": f"{rig} (virtual rig, another muscle)" for rig in rig_names()}
    found |= {f"model {x}": another(x) for x in models if x in stale and x != name}
    key = f"plants {models} {workspace.channels()}"
    fitting = of_model(workspace, name, key, lambda: [*filter(fits, found)])
    return {plant: words for plant, words in found.items() if plant in fitting}


def laws(workspace: Workspace, name: str, plant: str) -> dict[str, str]:
    """Return the controllers that close a loop on a plant, in words."""
    from mckibben.control.laws import refusal

    def make() -> list[str]:
        there, block = plant_of(workspace, plant), made(workspace, name, "inverse", {})
        return [law for law in registry.names("controllers") if not refusal(law, block, there)]

    return {law: titled(law) for law in of_model(workspace, name, f"laws {plant}", make)}


def titled(law: str) -> str:
    """Return what a controller is called to a person: the first line of what it says of itself."""
    if law not in registry.names("controllers"):
        return law or "Commands"
    return str(registry.load("controllers", law).__doc__ or law).splitlines()[0].rstrip(".")


# -- jobs -------------------------------------------------------------------------------------------


def named(title: str, asked: Json) -> str:
    """Return the name of a result, which is the same where the same is asked for again."""
    return f"{title[:60]}-{zlib.crc32(repr(asked).encode()):08x}"


def loop(workspace: Workspace, tell: Tell, *, name: str, asked: Json) -> str:
    """Let a controller follow a reference on a model or a virtual rig, beside no compensation."""
    from mckibben.files import write
    from mckibben.report import results
    from mckibben.workflow import track

    block = made(workspace, asked["model"], asked["form"], asked["settings"])
    plant: Any = "rig" if asked["plant"].startswith("rig ") else "plant"
    there = {plant: plant_of(workspace, asked["plant"])} | asked["options"]
    wanted = read_run(workspace, asked["reference"])
    run = track(block, wanted, controller=asked["controller"], progress=tell, **there)
    recording = run.uncompensated.beside(run.tracked.recording).with_meta(name=name)
    write(recording, workspace.path("runs", f"{name}.csv"))
    content = run.to_dict() | asked | {"items": stored_items(results.tracking(run))}
    content["units"] = {key: recording.units[key] for key in run.tracked.rmse}
    workspace.write("runs", name, content)
    if isinstance(run.controller, Block):
        run.controller.save(workspace.path("takeaway", f"{name}-controller.json"))
    return "It is done"


def review(workspace: Workspace, tell: Tell, *, name: str, asked: Json) -> str:
    """Say how far a logged loop was off its reference, and why."""
    from mckibben.files import read
    from mckibben.report import results, words
    from mckibben.workflow import review as find

    runs = list(read(workspace.path("uploads", asked["log"]), informative=False))
    ran = made(workspace, asked["model"], asked["form"], {})
    found = find(runs, model=workspace.model(asked["model"]), compensator=ran, refit=False)
    items = stored_items(results.review(found, DRAWN))
    workspace.write("reviews", name, found.to_dict() | asked | {"items": items})
    return words.reviewed(found)[0]


def newest(workspace: Workspace, kind: str) -> dict[str, Json]:
    """Return runs or reviews by name, the newest first."""
    written = {
        n: workspace.path(kind, f"{n}.json").stat().st_mtime_ns for n in workspace.names(kind)
    }
    every = {
        name: workspace.read(kind, name) for name in sorted(written, key=lambda n: -written[n])
    }
    return {name: one for name, one in every.items() if one and {"log", "reference"} & {*one}}
