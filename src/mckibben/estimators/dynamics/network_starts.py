"""Linear models from which state-space networks are identified."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.dynamics.process_model import ProcessModel
from mckibben.blocks.runs import Run
from mckibben.errors import MckibbenError
from mckibben.estimators.core.data import TrainingData
from mckibben.estimators.dynamics.process_model import ProcessModelEstimator
from mckibben.numerics.tracker import Tracker

FASTEST_LAG, SLOWEST_LAG, N_LAGS = 0.7, 1 / 3, 9
"""Lags tried: from so many samples to such a share of the longest run, and how many."""

LARGEST_LAG_SUBSTEP = 0.8
"""Largest substep in units of the fastest lag."""

LARGEST_ANGLE = 1 / 3
"""Largest angle of the linear oscillator per substep [rad]."""

SPRING, DAMPING, LAG = 0.5, 0.1, 0.3
"""Initial values in units of the linear oscillator: stiffness with lags of the velocity, damping,
and decay rate of the first lag.
"""

OSCILLATOR_FORCED = 0.05 / 0.7
"""Scale of initial weights of units by the input of an oscillator, relative to those by states."""


@dataclass(frozen=True)
class LinearStart:
    """A linear model to begin from, in scaled inputs and outputs.

    Parameters
    ----------
    weights : array, shape (n + p, n + m + 1)
        Rows: rates of the states over ``rate``, then outputs; columns: states, inputs, constant.
    rate, decay : float
        Of time, and of the slowest motion [1/s].
    largest_substep : float
        In units of 1 / rate.
    forced : float
        Scale of the initial weights of units by inputs, relative to those by states.
    """

    weights: Array
    rate: float
    decay: float
    largest_substep: float
    forced: float


def of_lags(data: TrainingData, n: int) -> LinearStart:
    """Return n lags of the inputs with the time constants that are nearest to the outputs."""
    step, longest = data.timed(), max(len(run) for run in data.runs)
    lags = step * np.geomspace(FASTEST_LAG, max(SLOWEST_LAG * longest, 2 * FASTEST_LAG), N_LAGS)
    m = data.stacked("inputs").shape[1]

    lag_choice, readout = _best_lags(data, lags, n)
    rates = 1.0 / lags[lag_choice // m]
    rate = float(rates.max())

    dynamics = np.zeros((n, n + m + 1))
    dynamics[range(n), range(n)] = -rates / rate
    dynamics[range(n), n + lag_choice % m] = rates / rate
    weights = np.vstack([dynamics, readout])
    return LinearStart(weights, rate, float(rates.min()), LARGEST_LAG_SUBSTEP, 1.0)


def _best_lags(data: TrainingData, lags: Array, n: int) -> tuple[Array, Array]:
    """Return n lagged inputs from which the outputs are estimated best, and the weights of these.

    Lagged inputs are numbered lag by lag, shape (n,); weights are by them, by the inputs and by 1, shape
    (p, n + m + 1).
    """
    target = data.target.reshape(-1, len(data.outputs))
    target = (target - target.mean(axis=0)) / data.spread
    columns, m = _lagged_inputs(data, lags), data.stacked("inputs").shape[1]

    best: tuple[float, list[int], Array] | None = None
    n_chosen = -(-n // m)
    for combination in combinations(range(N_LAGS), min(n_chosen, N_LAGS)):
        numbers = [lag * m + j for lag in combination for j in range(m)][:n]
        regressors = np.hstack([columns[:, numbers], columns[:, N_LAGS * m :]])
        gram = regressors.T @ regressors
        gram[np.diag_indices_from(gram)] *= 1 + 1e-6
        readout = np.linalg.lstsq(gram, regressors.T @ target, rcond=1e-12)[0]
        error = float(np.sum((target - regressors @ readout) ** 2))
        if best is None or error < best[0]:
            best = error, numbers, readout.T
    assert best is not None
    return np.array(best[1]), best[2]


def _lagged_inputs(data: TrainingData, lags: Array) -> Array:
    """Return the scaled inputs through every lag, then unlagged, and 1, at scored samples."""
    from scipy.signal import lfilter

    step, inputs = data.timed(), data.stacked("inputs")
    mean, scale = inputs.mean(axis=0), inputs.std(axis=0)
    scale[scale == 0] = 1.0

    def features(run: Run) -> Array:
        u = (run.inputs - mean) / scale
        sample_time = run.sample_time or step
        lagged = []
        for lag in lags:
            a = np.exp(-sample_time / lag)
            lagged.append(lfilter([1 - a], [1, -a], u, axis=0, zi=a * u[:1])[0])
        return np.hstack([*lagged, u, np.ones((len(u), 1))])

    return data.scored(features)


def of_oscillator(data: TrainingData, n: int) -> LinearStart | None:
    """Return the linear oscillator nearest to one output of one input, with lags of its velocity.

    None where there are more of either, or nothing oscillates.
    """
    if len(data.inputs) != 1 or len(data.outputs) != 1 or data.scheduled or n < 2:
        return None
    estimator = ProcessModelEstimator(
        structure="P2U", input=data.inputs[0].name, output=data.outputs[0].name, n_refined=1
    )
    try:
        model = estimator.find(data, Tracker())
    except MckibbenError:
        return None
    assert isinstance(model, ProcessModel)
    damping = model.damping or 0.0
    if damping >= 1.0:
        return None

    # states: position, velocity, lags of the velocity; then the input and 1
    weights = np.zeros((n + 1, n + 2))
    weights[0, 1] = 1.0
    weights[1, : n + 1] = -SPRING if n > 2 else -1.0
    weights[1, 1] = -DAMPING
    weights[1, n] = data.stacked("inputs").std() * model.gain / data.spread[0]
    for lag in range(2, n):
        weights[1, lag] /= n - 2
        weights[lag, [1, lag]] = 1.0, -LAG * (lag - 1)
    weights[n, 0] = 1.0
    frequency = 1.0 / model.time_constants[0]
    return LinearStart(weights, frequency, frequency * damping, LARGEST_ANGLE, OSCILLATOR_FORCED)
