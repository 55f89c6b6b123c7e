"""Ridge regression on play operators, against features written out and least squares of NumPy."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations_with_replacement
from typing import Any

import numpy as np
import pytest

from mckibben import Recording
from mckibben.arrays import Array
from mckibben.estimators.coupled.play_ridge import N_BLOCKS, PENALTIES, SMALLEST_PENALTY
from mckibben.registry import load
from tests.golden.plants import STEP, lag, noise, play, runs

INPUTS, OUTPUTS = ("pressure_1", "pressure_2"), ("displacement_1", "displacement_2")
CHANNELS = {"input": INPUTS, "output": OUTPUTS, "scheduling": ("pressure_extensor",)}
THRESHOLDS = (0.04, 0.23)


def written_out(run: Recording, spans: Array, lags: tuple[float, ...], degree: int) -> Array:
    """Return a constant, lags, plays and all products, a column each."""
    inputs = run.matrix([*INPUTS, "pressure_extensor"])
    step = run.sample_time or 1.0
    lagged, plays = [], []
    for tau in lags:
        for u, span in zip(inputs.T, spans, strict=True):
            x = lag(u, tau, step=step) if tau else u
            lagged.append(x)
            for share in THRESHOLDS:
                r = share * span
                late = play(np.concatenate([[0.0], x]), r)[1:]
                plays.append(late)
    products = [
        np.prod([lagged[k] for k in chosen], axis=0)
        for power in range(2, degree + 1)
        for chosen in combinations_with_replacement(range(3), power)
    ]
    crossed = [lagged[k] * other for k in range(3) for other in (*lagged[3:], *plays)]
    return np.column_stack([np.ones(len(run)), *lagged, *plays, *products, *crossed])


def ridge(x: Array, y: Array, penalty: float, size: Array) -> Array:
    """Return weights by least squares, with a row below for every weight but the first."""
    damping = np.sqrt(
        np.append(SMALLEST_PENALTY, np.full(x.shape[1] - 1, penalty + SMALLEST_PENALTY))
    )
    below = np.diag(damping * size)
    found: Array = np.linalg.lstsq(np.vstack([x, below]), np.append(y, np.zeros(len(below))))[0]
    return found


@pytest.mark.parametrize("penalty", [1e-4, None])
def test_it_is_ridge_regression_with_the_penalty_that_predicts_blocks_left_out(
    penalty: float | None,
) -> None:
    recordings, lags, degree = runs("arm"), (0.0, 0.5), 2
    made: Any = load("estimators", "play-ridge")(
        **CHANNELS, thresholds=THRESHOLDS, lags=lags, degree=degree, ridge=penalty
    )
    fitted = made.fit(recordings)
    every = np.concatenate([run.matrix([*INPUTS, "pressure_extensor"]) for run in recordings])
    columns = [written_out(run, np.ptp(every, axis=0), lags, degree) for run in recordings]
    x = np.vstack(columns)
    size = np.linalg.norm(x, axis=0)
    per = -(-N_BLOCKS // len(recordings))
    blocks = np.split(
        np.arange(len(x)), np.cumsum([len(b) for c in columns for b in np.array_split(c, per)])[:-1]
    )
    for place, output in enumerate(OUTPUTS):
        y = np.concatenate([run[output] for run in recordings])
        chosen = penalty
        if chosen is None:
            errors = np.empty((len(blocks), len(PENALTIES)))
            for row, block in enumerate(blocks):
                rest = np.setdiff1d(np.arange(len(x)), block)
                for column, one in enumerate(PENALTIES):
                    left = y[block] - x[block] @ ridge(x[rest], y[rest], one, size)
                    errors[row, column] = left @ left
            more = errors - errors[:, [errors.sum(axis=0).argmin()]]
            spread = more.std(axis=0, ddof=1) * np.sqrt(len(blocks))
            chosen = float(PENALTIES[more.sum(axis=0) <= spread].max())
        assert fitted.penalties_[place] == pytest.approx(chosen)
        expected = x @ ridge(x, y, chosen, size)
        found = np.concatenate([run[:, place] for run in fitted.predict(recordings)])
        np.testing.assert_allclose(found, expected, atol=1e-6 * np.ptp(y))


def test_inputs_in_another_unit_give_the_same_output() -> None:
    recordings = runs("muscle")
    tiny = [one.with_channels(pressure=1e-6 * one["pressure"]) for one in recordings]
    made = load("estimators", "play-ridge")
    found, same = (made().fit(given).predict(given) for given in (recordings, tiny))
    np.testing.assert_allclose(np.concatenate(found), np.concatenate(same), rtol=1e-6)


def test_without_time_it_is_of_the_inputs_themselves() -> None:
    timeless = [replace(one, sample_time=None) for one in runs("muscle")]
    model = load("estimators", "play-ridge")().fit(timeless).model_
    assert model.lags == (0.0,)
    assert not model.rate_dependent


def test_one_play_operator_and_a_lag_are_found_again() -> None:
    u = np.abs(np.cumsum(noise(1, 0.3, 2000)))
    y = 2.0 * u + 3.0 * play(u, 0.11 * float(np.ptp(u))) + 0.5 * lag(u, 0.6) + noise(2, 1e-3, 2000)
    run = Recording({"pressure": u, "displacement": y}, STEP)
    found = load("estimators", "play-ridge")().fit(run.slice(0, 1000))
    modelled = found.predict(run)
    assert np.std((modelled - y)[1000:]) < 0.02 * np.std(y[1000:])
