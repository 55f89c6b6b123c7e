"""What recordings tell of how a model is used: its pace, its rest, what is held, what it reaches."""

from __future__ import annotations

import warnings
from contextlib import suppress
from typing import NamedTuple

import numpy as np

from mckibben.app import forms
from mckibben.app.workspace import Workspace
from mckibben.arrays import Array
from mckibben.errors import MckibbenError, ModelWarning
from mckibben.recording import Recording

SLOWLY = 400
"""Samples of a slow way up and down, of two usual cycles at least."""


class Pace(NamedTuple):
    """Time between steps of a model, or else of what trained it, and cycles of that [s]."""

    step: float
    usual: float
    shortest: float


def pace(workspace: Workspace, model: str) -> Pace:
    """Return how fast a model was trained; without recordings, what is usual, and any cycle."""
    runs, block = list[Recording](), workspace.model(model)
    with suppress(MckibbenError):
        runs = [run for run in workspace.with_role("train") if run.sample_time]
    found = [cycles(run, c.name) for run in runs for c in block.outputs if c.name in run]
    if not found:
        return Pace(block.sample_time or forms.STEP, 10.0, 0.0)
    step = float(f"{np.median([run.sample_time or 0.0 for run in runs]):.3g}")
    return Pace(
        block.sample_time or step, float(np.median(np.concatenate(found))), min(map(np.min, found))
    )


def cycles(run: Recording, name: str) -> Array:
    """Return how long cycles take [s], told by the outer thirds of what is covered; all, if none."""
    values, step = run[name], run.sample_time or 0.0
    share = (values - values.min()) / (np.ptp(values) or 1.0)
    way = 1 * (share > 2 / 3) - (share < 1 / 3)
    seen = np.flatnonzero(way)
    turns = seen[1:][np.diff(way[seen]) != 0]
    return 2 * step * np.diff(turns) if len(turns) > 1 else np.array([step * len(run)])


def held_for(workspace: Workspace, model: str) -> dict[str, float]:
    """Return what a compensator needs beside references, at the middle of what was recorded."""
    block = forms.inverse_of(workspace.model(model))
    found = {}
    for name in block.scheduling:
        runs = [run[name] for run in workspace.readable() if name in run]
        found[name] = float(np.median(np.concatenate(runs))) if runs else 0.0
    return found


def at_rest(workspace: Workspace, model: str) -> dict[str, float]:
    """Return a model's outputs as recorded where what drives it, all together, is least."""
    block = workspace.model(model)
    driving = [c.name for c in block.inputs if c.name not in block.scheduling]
    names = [*driving, *(c.name for c in block.outputs)]
    runs = [run for run in workspace.readable() if all(name in run for name in names)]
    if not runs:
        return {}
    given = np.concatenate([run.matrix(driving).sum(axis=1) for run in runs])
    least = given <= given.min() + 0.02 * np.ptp(given)
    return {
        c.name: float(np.median(np.concatenate([run[c.name] for run in runs])[least]))
        for c in block.outputs
    }


def reached(
    workspace: Workspace, model: str, held: dict[str, float]
) -> dict[str, tuple[float, float]]:
    """Return what a model of one muscle gives over all inputs recorded, up and down, under a load."""
    block = workspace.model(model)
    driven = [channel for channel in block.inputs if channel.name not in block.scheduling]
    if len(driven) > 1 or len(block.outputs) > 1:
        return {}
    (given,), (wanted,) = driven, block.outputs
    runs = [run[given.name] for run in workspace.readable() if given.name in run]
    if not runs:
        return {}
    low, high = min(float(u.min()) for u in runs), max(float(u.max()) for u in runs)
    known = pace(workspace, model)
    there = low + (high - low) * (1.0 - np.abs(np.linspace(-1.0, 1.0, SLOWLY)))
    channels = {given.name: there} | {name: np.full(SLOWLY, x) for name, x in held.items()}
    step = block.sample_time or max(known.step, 2.0 * known.usual / SLOWLY)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ModelWarning)
        found = block.simulate(Recording(channels, step))[wanted.name]
    ends = float(found.min()), float(found.max())
    return {wanted.name: ends} if ends[0] < ends[1] else {}
