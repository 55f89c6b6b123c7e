"""Files as a rig writes them, of virtual muscles, and folders with the example."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from mckibben import Recording, example, workflow
from mckibben.app.steps import Role
from mckibben.app.workspace import Workspace
from mckibben.arrays import Array
from mckibben.rigs import load_rig

STEP = 0.05
"""Time between rows [s]."""


def with_example(folder: Path, *models: str) -> Workspace:
    """Return a workspace with one recording to train on and one to test on, and models of it."""
    workspace = Workspace(folder)
    roles: dict[Role, Any] = {"train": example.TRAIN, "test": example.TEST}
    for role, source in roles.items():
        file = Path(str(source))
        with workspace.receiving(file.name, file.stat().st_size) as (part, path):
            part.write_bytes(file.read_bytes())
        workspace.add(path.name, role=role)
    for model in models:
        found = workflow.fit(model, workspace.with_role("train"))
        row = {"status": "ok", "model": model, "data": workspace.digest()}
        workspace.save_model(model, found.model, row)
    return workspace


def wave(seconds: float, seed: int, low: float, high: float) -> Array:
    """Return straight lines between random levels, slow enough for a muscle."""
    rng = np.random.default_rng(seed)
    turns = np.arange(0.0, seconds + 3.0, 3.0)
    levels = rng.uniform(low, high, turns.size)
    levels[0] = low
    return np.interp(np.arange(0.0, seconds, STEP), turns, levels)


def text(recording: Recording) -> bytes:
    """Return a recording as CSV with units in its header."""
    columns = {"time_s": recording.time}
    columns |= {f"{name}_{recording.units[name]}": y for name, y in recording.channels.items()}
    rows = zip(*columns.values(), strict=True)
    lines = [",".join(columns), *(",".join(f"{value:.6g}" for value in row) for row in rows)]
    return "\n".join(lines).encode()


def arm() -> Iterator[bytes]:
    """Yield two runs of an arm of three muscles round an extensor."""
    rig = load_rig("soft-arm")
    for run in range(2):
        given = {
            name: wave(60.0, 10 * run + place, 0.2, 2.5) for place, name in enumerate(rig.inputs)
        }
        yield text(rig.run(Recording(given, STEP), run))


def hanging() -> Iterator[bytes]:
    """Yield three runs of a muscle, each under another force."""
    rig = load_rig("mckibben-530")
    for run, force in enumerate((50.0, 150.0, 250.0)):
        pressure = wave(60.0, run, 0.5, 5.0)
        given = {"pressure": pressure, "force": np.full(pressure.size, force)}
        yield text(rig.run(Recording(given, STEP), run))
