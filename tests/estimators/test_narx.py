"""NARX: term selection against brute force, stability, and memory."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from mckibben import Recording
from mckibben.blocks.derivatives import derivatives
from mckibben.blocks.hysteresis.gpi import GPI
from mckibben.diagnosis.branch_gaps import hold_test
from mckibben.estimators.core.data import training_data
from mckibben.estimators.dynamics.narx import (
    FreeRuns,
    NarxEstimator,
    feed_back,
    select,
    stretches,
)
from mckibben.estimators.optimisers.tracker import Tracker
from mckibben.registry import load
from tests.twins import fed_back

TIME = np.arange(1500) * 0.02
PRESSURE = 2.5 + 2.3 * np.sin(0.6 * TIME) * np.exp(-0.02 * TIME)


def loop(noise: float = 0.02) -> Recording:
    rng = np.random.default_rng(0)
    y = GPI.example().simulate(PRESSURE) + noise * rng.standard_normal(TIME.size)
    return Recording({"pressure": PRESSURE, "displacement": y}, 0.02)


def test_first_choices_are_those_of_brute_force() -> None:
    rng = np.random.default_rng(2)
    columns = rng.standard_normal((60, 6))
    target = rng.standard_normal(60)

    def left(chosen: tuple[int, ...]) -> float:
        part = columns[:, chosen]
        return float(np.linalg.lstsq(part, target, rcond=None)[1][0])

    order = select(columns, target, 3)
    assert left(tuple(order[:1])) == pytest.approx(min(left(c) for c in combinations(range(6), 1)))
    best_second = min(left((order[0], k)) for k in range(6) if k != order[0])
    assert left(tuple(order[:2])) == pytest.approx(best_second)
    with_all = select(columns, target, 10)
    assert sorted(with_all) == list(range(6))


@pytest.mark.parametrize("horizon", [None, 20])
@pytest.mark.parametrize("kind", ["narx-polynomial", "tanh"])
def test_slopes_of_free_runs_are_those_of_complex_step(kind: str, horizon: int | None) -> None:
    data = training_data(loop(), "pressure", "displacement")
    scales = {"sample_time": 0.02, "output_scale": (0.0, 3.0), "delay": 2, "thresholds": (0.1, 0.4)}
    hidden = np.random.default_rng(0).normal(0, 0.2, 14).tolist()
    network = {"linear": (0.8, 0.1, 0.1, 0.05, 0.0), "hidden": hidden, "activation": kind}
    terms = {"terms": ((), (0,), (3, 0), (1, 2)), "weights": (0.02, 0.9, 0.05, -0.04)}
    polynomial = kind == "narx-polynomial"
    block = load("blocks", kind if polynomial else "narx-network").example()
    model = replace(block, **scales, **(terms if polynomial else network))
    runs = FreeRuns(model, stretches(model, data, horizon), Tracker())
    slopes = runs.slopes(model.pack())
    exact = np.concatenate(
        [
            derivatives(model, piece.inputs, model.sample_time, piece.state)[piece.counts, 0]
            for piece in runs.stretches
        ]
    )
    exact /= model.output_scale[1]
    assert (np.abs(slopes - exact) <= 1e-10 * np.abs(exact).max(axis=0)).all()


@pytest.mark.kernel
def test_feeding_back_agrees_with_its_twin() -> None:
    rng = np.random.default_rng(4)
    slopes, by_past = rng.standard_normal((50, 3)), rng.uniform(-0.5, 0.5, (50, 2))
    expected = fed_back(slopes.tolist(), by_past.tolist())
    feed_back(slopes, by_past)
    np.testing.assert_allclose(slopes, expected, rtol=1e-12)


def test_no_short_stretch_starts_where_nothing_before_it_is_measured() -> None:
    rows = [np.arange(TIME.size) % 2 == 0]
    data = training_data(loop(), "pressure", "displacement", rows)
    model = load("blocks", "narx-polynomial").example()
    sparse = replace(model, sample_time=0.02, output_lags=2, terms=((0,), (1,)), weights=(0.5, 0.2))
    assert not stretches(sparse, data, 20)
    assert len(stretches(sparse, data, None)) == 1
    assert NarxEstimator()._refined(sparse, 20, data, Tracker()) == []


def test_refining_on_free_runs_lowers_the_free_run_error() -> None:
    rough = NarxEstimator(refine=False, allow_unstable=True, n_terms=6).fit(loop())
    fine = NarxEstimator().fit(loop())
    assert fine.diagnostics_.rmse < rough.diagnostics_.rmse


def test_play_operators_keep_the_branch_that_plain_narx_forgets() -> None:
    recording = loop()
    plain, kept = (
        hold_test(estimator.fit(recording).model_, recording, "pressure", "displacement")
        for estimator in (NarxEstimator(), load("estimators", "narx-play")())
    )
    assert plain is not None
    assert kept is not None
    assert abs(plain) < 0.1
    assert kept > 0.5
