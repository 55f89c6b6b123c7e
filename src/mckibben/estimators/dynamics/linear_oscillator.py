"""Shared parts of oscillator searches: a linear start, and inputs in fine steps."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.dynamics.process_model import ProcessModel
from mckibben.blocks.dynamics.repeating import BETWEEN
from mckibben.errors import DataError
from mckibben.estimators.core.data import Run, TrainingData
from mckibben.estimators.dynamics.process_model import ProcessModelEstimator
from mckibben.estimators.optimisers.tracker import Tracker
from mckibben.signals.periodic import band_limited

FORGOTTEN = 3 * np.log(1e8)
"""Number of decay times after which a start is forgotten: three times those of a decay to 1e-8, as
small motions decay more slowly with hysteresis.
"""

MOST_SUBSTEPS = 1000

MOST_PERIODS = 20
"""Limit of that number, in periods of the longest run."""


@dataclass(frozen=True)
class Linear:
    """An oscillator without hysteresis: mass [kg], damping [N s/mm] and stiffness [N/mm]."""

    mass: float
    damping: float
    stiffness: float

    @property
    def frequency(self) -> float:
        """Angular frequency without damping [rad/s]."""
        return float(np.sqrt(1e3 * self.stiffness / self.mass))

    @property
    def decay(self) -> float:
        """Decay rate of its free motion [1/s]: of the slower lag, if overdamped."""
        half = 500.0 * self.damping / self.mass
        return half - float(np.sqrt(max(half**2 - self.frequency**2, 0.0)))

    def forgets(self, data: TrainingData) -> int:
        """Return the number of samples after which the start state has no effect."""
        longest = MOST_PERIODS * max(run.u.size for run in data.runs)
        return int(min(np.ceil(FORGOTTEN / max(self.decay * data.timed(), 1e-9)), longest))

    def substeps(self, step: float, angle: float) -> int:
        """Return substeps per sample for a largest angle per substep [rad]."""
        return int(np.clip(np.ceil(self.frequency * step / angle), 1, MOST_SUBSTEPS))


def linear_oscillator(data: TrainingData, channels: dict[str, Any]) -> Linear:
    """Return the linear oscillator of least free-running error, with a start state per run.

    Raises
    ------
    DataError
        If the displacement falls while the force rises slowly.
    """
    estimator = ProcessModelEstimator(
        structure="P2U", input=channels["input"].name, output=channels["output"].name, n_refined=1
    )
    model, _ = estimator.find(data, Tracker())
    assert isinstance(model, ProcessModel)
    assert model.damping is not None
    if not model.gain > 0:
        raise DataError(
            "the displacement falls while the force rises slowly",
            channel=channels["output"].name,
            remedy="turn the sign of one of them",
        )
    (time,), stiffness = model.time_constants, 1.0 / model.gain
    return Linear(1e3 * stiffness * time**2, 2.0 * model.damping * time * stiffness, stiffness)


@dataclass(frozen=True)
class Path:
    """The input of a run in substeps; substeps per sample; samples before the first scored one."""

    run: Run
    inputs: Array
    every: int
    skipped: int


def paths(data: TrainingData, substeps: int, warm: int | None, at_rest: bool) -> list[Path]:
    """Return the inputs of all runs in substeps.

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
    """Return periodic runs of one input as one, with the mean output; other runs unchanged.

    What runs free is the same in all, so their squared errors are that of the mean, but for a constant.
    """
    first, *others = data.runs
    if not all(np.array_equal(run.driven, first.driven) and run.counts.all() for run in data.runs):
        return data
    if not others:
        return data
    mean = np.mean([run.outputs for run in data.runs], axis=0)
    return replace(data, runs=(replace(first, outputs=mean),))
