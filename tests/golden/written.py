"""What commands write: every channel of a recording, every column of a table, every model run."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Collection, Iterable
from pathlib import Path

import numpy as np

import mckibben
from mckibben import Block, DataError
from tests.golden.case import Tree
from tests.golden.models import between
from tests.golden.rounding import rounded_list
from tests.golden.running import simulated

RANGES = {"pressure": (0.0, 5.0), "displacement": (3.0, 33.0)}
"""Beginning of an input's name -> the range that a model is run over; 0 to 1 where nothing is said."""


def written(paths: Iterable[Path], folder: Path, left_out: Collection[str]) -> dict[str, Tree]:
    """Return what is compared of files in a folder, but for columns of names that are left out."""
    found: dict[str, Tree] = {}
    for path in sorted(paths):
        name = str(path.relative_to(folder))
        if path.suffix == ".csv":
            found[name] = _channels(path, left_out)
        elif path.suffix == ".json":
            held = json.loads(path.read_text(encoding="utf-8"))
            if isinstance(held, dict) and held.get("format") == "mckibben-model":
                found[name] = {"kind": held["kind"], "run": _run(mckibben.load(path))}
    return found


def summary(values: np.ndarray) -> dict[str, Tree]:
    """Return the number of values, their RMS, the first and the last; 0 for rounding, None for none."""
    finite = values[np.isfinite(values)]
    rms = float(np.sqrt(np.mean(finite**2))) if finite.size else 0.0
    whole = rounded_list([rms, *(float(one) for one in values[[0, -1]])])
    numbers = [None if isinstance(one, float) and math.isnan(one) else one for one in whole]
    return {"n_values": len(values), **dict(zip(("rms", "first", "last"), numbers, strict=True))}


def _channels(path: Path, left_out: Collection[str]) -> Tree:
    try:
        (recording,) = mckibben.read(path)
    except DataError:
        return _columns(path, left_out)
    return {
        f"{name} [{recording.units[name]}]": summary(np.asarray(recording[name]))
        for name in recording.channels
    } | {"start_time": recording.start_time, "sample_time": recording.sample_time}


def _columns(path: Path, left_out: Collection[str]) -> Tree:
    """Return the columns of numbers of a table that is no recording."""
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    found: dict[str, Tree] = {}
    for name in rows[0]:
        try:
            values = np.array([float(row[name] or "nan") for row in rows])
        except ValueError:
            continue
        if name not in left_out and np.isfinite(values).any():
            found[name] = summary(values)
    return found


def _run(model: Block) -> Tree:
    """Return a free run over a path within fixed ranges."""
    ranges = [
        next((ends for stem, ends in RANGES.items() if c.name.startswith(stem)), (0.0, 1.0))
        for c in model.inputs
    ]
    outputs = simulated(model, between(ranges, n=90))
    return {
        f"{c.name} [{c.unit}]": summary(column)
        for c, column in zip(model.outputs, outputs.T, strict=True)
    }
