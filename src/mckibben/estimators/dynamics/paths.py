"""Inputs of runs in steps finer than their samples, for models in continuous time."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.dynamics.repeating import BETWEEN
from mckibben.estimators.core.data import Run, TrainingData
from mckibben.signals.periodic import band_limited


@dataclass(frozen=True)
class Path:
    """The input of a run in steps; steps from sample to sample; samples before the first that counts."""

    run: Run
    inputs: Array
    every: int
    skipped: int


def paths(data: TrainingData, substeps: int, warm: int | None, at_rest: bool) -> list[Path]:
    """Return the inputs of all runs in steps.

    Parameters
    ----------
    data : TrainingData
    substeps : int
        From sample to sample; `BETWEEN` times as many in periodic runs.
    warm : int or None
        Samples to be run before those of a period; None where runs are not periodic: then the input goes
        in straight lines from sample to sample.
    at_rest : bool
        Whether a run that is not periodic begins with its first input, instead of with none.
    """
    found = []
    for run in data.runs:
        n = run.u.size
        if warm is None:
            steps = np.arange(1 + substeps * n) / substeps
            before = run.u[0] if at_rest else 0.0
            u = np.interp(steps, np.arange(n + 1), np.append(before, run.u))
            found.append(Path(run, u, substeps, 0))
            continue
        ratio = BETWEEN * substeps
        places = np.arange(-(warm + 1) * ratio, (n - 1) * ratio + 1) % (n * ratio)
        found.append(Path(run, band_limited(run.u, ratio)[places], ratio, warm))
    return found


def averaged(data: TrainingData) -> TrainingData:
    """Return periodic runs of one input as one, with their mean output; others as they are.

    What runs free is the same in all, so their squared errors are that of the mean, but for a constant.
    """
    first, *others = data.runs
    if not all(np.array_equal(run.driven, first.driven) and run.counts.all() for run in data.runs):
        return data
    if not others:
        return data
    mean = np.mean([run.outputs for run in data.runs], axis=0)
    return replace(data, runs=(replace(first, outputs=mean),))
