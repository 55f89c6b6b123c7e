"""Drift of models' errors: said where it is, not where it is not, and taken out as is advised."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from mckibben import PI, Recording, compare
from mckibben.comparison.drift import Drift, Stretch, drift_of

STEP = 4.0
SEEDS = 30


def stretch(errors: np.ndarray, inputs: np.ndarray) -> Stretch:
    return Stretch(errors, inputs[:, np.newaxis], np.ones(errors.size, dtype=bool))


def noise(n: int, alike: float, seed: int) -> np.ndarray:
    """Return stationary noise of unit deviation whose neighbours are so much alike."""
    white = np.random.default_rng(seed).standard_normal(n + 500)
    return np.asarray(lfilter([np.sqrt(1 - alike**2)], [1, -alike], white))[500:]


def found(errors: np.ndarray, inputs: np.ndarray, n: int) -> Drift:
    """Return the drift of errors of which the first n are in training, where their mean is none."""
    errors = errors - errors[:n].mean()
    drift = drift_of(
        [stretch(errors[:n], inputs[:n])], [stretch(errors[n:], inputs[n:])], STEP, "y", "mm"
    )
    assert drift is not None
    return drift


@pytest.mark.parametrize("alike", [0.0, 0.8])
@pytest.mark.parametrize(("n", "n_test"), [(600, 200)])
def test_stationary_noise_is_no_drift_and_an_injected_one_is(
    n: int, n_test: int, alike: float
) -> None:
    alarms, seen, offsets, changes = 0, 0, 0, 0
    ramp = np.concatenate([np.zeros(n), np.linspace(2.0, 4.0, n_test)])
    for seed in range(SEEDS):
        inputs = np.random.default_rng(seed + 1000).uniform(0, 5, n + n_test)
        errors = noise(n + n_test, alike, seed)
        alarms += found(errors, inputs, n).certain
        drift = found(errors + ramp, inputs, n)
        seen += drift.certain
        offsets += drift.offset_interval[0] <= 3.0 <= drift.offset_interval[1]
        changes += drift.change_interval[0] <= 2.0 <= drift.change_interval[1]
    assert alarms <= 0.1 * SEEDS
    assert seen >= 0.7 * SEEDS
    assert min(offsets, changes) >= 0.8 * SEEDS


def test_a_model_that_is_wrong_at_high_inputs_does_not_drift_where_these_fade() -> None:
    time = np.arange(900)
    peak = np.where(time < 600, 5.0 - 3.0 * (time % 300) / 300, 5.0 - 4.0 * (time - 600) / 300)
    inputs = 0.5 * peak * (1 - np.cos(0.9 * time))
    errors = 0.2 * inputs**2 + 0.1 * noise(900, 0.3, 0)
    raw = errors[600:] - errors[:600].mean()
    assert abs(raw[200:].mean() - raw[:100].mean()) > 1.0
    assert not found(errors, inputs, 600).certain


def levels(n: int) -> np.ndarray:
    return np.random.default_rng(3).uniform(0.5, 5.5, n)


def run(drift: np.ndarray) -> Recording:
    """Return what a play model gives, with noise and what drifts."""
    pressure = levels(drift.size)
    y = PI.example().simulate(pressure) + drift
    y += 0.05 * np.random.default_rng(4).standard_normal(y.size)
    return Recording({"pressure": pressure, "displacement": y}, STEP)


def test_a_leaderboard_has_the_drift_that_there_is_and_none_else() -> None:
    none = np.zeros(320)
    board = compare(run(none).slice(0, 240), run(none).slice(240, 320), models=["pi", "gpi"])
    assert board.drift == ""
    assert all(row.drift is not None and not row.drift.certain for row in board.rows)
    off = run(np.where(np.arange(320) < 240, 0.0, 0.5))
    board = compare(off.slice(0, 240), off.slice(240, 320), models=["pi", "gpi"])
    assert board.drift
    (row,) = [row for row in board.rows if row.model == board.to_dict()["chosen"]]
    assert row.drift is not None
    assert row.drift.certain
    assert row.to_dict()["drift"]["offset"] == pytest.approx(0.5, abs=0.05)
    assert row.drift.adapted < 0.7 * row.drift.rmse
