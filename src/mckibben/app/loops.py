"""Closed loops of the page Compensate: plants, controllers, and the jobs that run and review a loop.

Results are in ``runs`` and ``reviews`` of the folder: numbers as JSON, samples as CSV.
"""

from __future__ import annotations

import zlib
from contextlib import suppress
from typing import Any

import numpy as np

from mckibben import registry
from mckibben.app.compensators import block_for_use, cached_of_model
from mckibben.app.jobs import Tell
from mckibben.app.modelling import Json, stored_items
from mckibben.app.motions import recorded_values
from mckibben.app.workspace import Workspace
from mckibben.blocks.base import Block
from mckibben.blocks.fields import Channel, drives
from mckibben.blocks.ranges import known_ranges
from mckibben.errors import MckibbenError
from mckibben.numerals import number
from mckibben.recording import COMMAND, Recording

MOST_CURVE_POINTS = 2000
"""Most points of a curve of a review."""


def store_reference(workspace: Workspace, recording: Recording) -> str:
    """Write a reference among the runs, and return the name of its file."""
    from mckibben.files import write

    file = f"{workspace.new_name('runs', 'reference', '.csv')}.csv"
    write(recording, workspace.path("runs", file))
    return file


def read_run(workspace: Workspace, file: str) -> Recording:
    """Return a reference, or the recording of a loop."""
    from mckibben.files import read

    path = workspace.path("runs", file)
    recording: Recording = workspace.cached(path, "", lambda: read(path, informative=False)[0])
    return recording


# -- plants -----------------------------------------------------------------------------------------


def plant_of(workspace: Workspace, plant: str) -> Any:
    """Return ``rig NAME``, or ``model NAME``; unknown limits are those recorded."""
    from mckibben.control import Twin
    from mckibben.rigs import load_rig

    kind, _, name = plant.partition(" ")
    if kind == "rig":
        return load_rig(name)
    model, limits = workspace.model(name), {}
    ranges = known_ranges(model.inputs, model.known_inputs)
    for channel in {channel.name for channel in model.inputs}.difference(ranges):
        values = recorded_values(workspace, channel)
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
            candidate = plant_of(workspace, plant)
            other_inputs = {*candidate.inputs} - inputs
            units = getattr(candidate, "units", {})  # channels of rigs have standard names
            driven = any(drives(Channel(model, units.get(model, ""))) for model in other_inputs)
            return inputs <= {*candidate.inputs} and outputs <= {*candidate.outputs} and not driven
        return False

    rows = {row["name"]: row for row in workspace.results()}
    unstable = {model for model, row in rows.items() if diverged(row)}
    stale = workspace.on_other_data()
    models = [model for model in workspace.models() if model not in unstable]

    def described(model: str) -> str:
        test, unit = rows.get(model, {}).get("test"), rows.get(model, {}).get("unit", "")
        own_error = f", itself off by {number(test['rmse'], 3)} {unit}".rstrip() if test else ""
        return f"{model} (another model{own_error}{', of other data' if model in stale else ''})"

    titles = {f"model {x}": described(x) for x in models if x not in (name, *stale)}
    titles[f"model {name}"] = f"{name} (the same model: exact by construction)"
    titles |= {f"rig {rig}": f"{rig} (virtual rig, another muscle)" for rig in rig_names()}
    titles |= {f"model {x}": described(x) for x in models if x in stale and x != name}
    key = f"plants {models} {workspace.channels()}"
    fitting = cached_of_model(workspace, name, key, lambda: [*filter(fits, titles)])
    return {plant: words for plant, words in titles.items() if plant in fitting}


def laws(workspace: Workspace, name: str, plant: str) -> dict[str, str]:
    """Return the controllers that close a loop on a plant, in words."""
    from mckibben.control.laws import refusal

    def make() -> list[str]:
        candidate, block = plant_of(workspace, plant), block_for_use(workspace, name, "inverse", {})
        return [law for law in registry.names("controllers") if not refusal(law, block, candidate)]

    return {
        law: controller_title(law)
        for law in cached_of_model(workspace, name, f"laws {plant}", make)
    }


def controller_title(law: str) -> str:
    """Return what a controller is called to a person: the first line of what it says of itself."""
    if law not in registry.names("controllers"):
        return law or "Commands"
    return str(registry.load("controllers", law).__doc__ or law).splitlines()[0].rstrip(".")


# -- jobs -------------------------------------------------------------------------------------------


def result_name(title: str, asked: Json) -> str:
    """Return the name of a result, which is the same where the same is asked for again."""
    return f"{title[:60]}-{zlib.crc32(repr(asked).encode()):08x}"


def loop(workspace: Workspace, tell: Tell, *, name: str, asked: Json) -> str:
    """Let a controller follow a reference on a model or a virtual rig, beside no compensation."""
    from mckibben.files import write
    from mckibben.report import results
    from mckibben.workflow import track

    block = block_for_use(workspace, asked["model"], asked["form"], asked["settings"])
    plant: Any = "rig" if asked["plant"].startswith("rig ") else "plant"
    settings = {plant: plant_of(workspace, asked["plant"])} | asked["options"]
    desired = read_run(workspace, asked["reference"])
    run = track(block, desired, controller=asked["controller"], progress=tell, **settings)
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
    from mckibben.workflow import review as review_log

    runs = list(read(workspace.path("uploads", asked["log"]), informative=False))
    compensator = block_for_use(workspace, asked["model"], asked["form"], {})
    result = review_log(
        runs, model=workspace.model(asked["model"]), compensator=compensator, refit=False
    )
    items = stored_items(results.review(result, MOST_CURVE_POINTS))
    workspace.write("reviews", name, result.to_dict() | asked | {"items": items})
    return words.reviewed(result)[0]


def newest(workspace: Workspace, kind: str) -> dict[str, Json]:
    """Return runs or reviews by name, the newest first."""
    times = {n: workspace.path(kind, f"{n}.json").stat().st_mtime_ns for n in workspace.names(kind)}
    contents = {name: workspace.read(kind, name) for name in sorted(times, key=lambda n: -times[n])}
    return {
        name: content
        for name, content in contents.items()
        if content and {"log", "reference"} & {*content}
    }
