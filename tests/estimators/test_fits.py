"""What estimators of loops do on data of their own making; what all must do is among laws."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest

from mckibben import (
    GPI,
    PI,
    PIEstimator,
    Recording,
    load,
)
from mckibben.blocks.base import Block
from mckibben.papers.paper import printed
from tests.estimators.examples import quick

TIME = np.linspace(0, 1, 1500)
PRESSURE = 2.5 * (1 - 0.7 * np.floor(6 * TIME).clip(0, 5) / 5) * (1 - np.cos(12 * np.pi * TIME))


def recorded(block: Block, noise: float = 0.0, seed: int = 0) -> Recording:
    """Return a recording of a block under decaying cycles from 0 bar."""
    rng = np.random.default_rng(seed)
    y = block.simulate(PRESSURE, sample_time=0.01)
    return Recording(
        {"pressure": PRESSURE, "displacement": y + noise * rng.standard_normal(y.size)}, 0.01
    )


@pytest.fixture(scope="module")
def loop() -> Recording:
    """A saturating loop with noise."""
    return recorded(GPI.example(), 0.02)


def test_pi_recovers_its_own_weights_with_intervals() -> None:
    truth = PI((0.0, 0.5, 1.0, 1.5), (3.0, 1.5, 1.0, 0.5), 2.0, (0.0, 5.0))
    inside = []
    for seed in range(40):
        fit = PIEstimator(thresholds=truth.thresholds).fit(recorded(truth, 0.05, seed))
        errors = np.array(fit.diagnostics_.standard_errors)
        inside.append(np.abs(fit.model_.pack() - truth.pack()) < 1.96 * errors)
    assert np.abs(fit.model_.pack() - truth.pack()).max() < 0.1
    assert 0.88 < np.mean(inside) <= 1.0


@pytest.mark.parametrize(
    ("initial", "start", "stop"),
    [("virgin", 0, 402), ("first_sample", 400, 803), ("virgin", 801, 1203)],
)
def test_slope_rule_recovers_the_weights_of_every_kind_of_branch(
    initial: Literal["virgin", "first_sample"], start: int, stop: int
) -> None:
    """Operators begin after r on the rise from rest, after 2 r on the fall and the rise that follow."""
    truth = PI((0.0, 0.5, 1.0, 1.5), (3.0, 1.5, 1.0, 0.5), 2.0, (0.0, 5.0), initial=initial)
    t = np.concatenate([np.linspace(0, 5, 401), np.linspace(5, 0, 401), np.linspace(0, 5, 401)])
    loop = Recording({"pressure": t, "displacement": truth.simulate(t)}, 0.01)
    one_branch = np.zeros(t.size, dtype=bool)
    one_branch[start:stop] = True
    estimator = PIEstimator(thresholds=truth.thresholds, method="slopes", initial=initial)
    fit = estimator.fit(loop, rows=[one_branch])
    assert isinstance(fit.model_, PI)
    np.testing.assert_allclose(fit.model_.pack()[:-1], truth.pack()[:-1], rtol=1e-6)
    assert fit.model_.offset == pytest.approx(truth.offset, rel=1e-6)


@pytest.mark.parametrize("envelope", ["tanh", "piecewise-linear"])
def test_gpi_envelopes_stay_in_order(envelope: str, loop: Recording) -> None:
    model = quick("gpi", envelope=envelope).fit(loop).model_
    low, high = model.input_range
    u = np.linspace(low, high, 5000)
    assert np.all(model.falling(u) >= model.rising(u))
    assert np.all(np.diff(model.rising(u)) > 0)
    assert np.all(np.diff(model.falling(u)) > 0)


PRINTED = {
    "output_map": "free-polynomial",
    "map_size": 9,
    "nonnegative": False,
    "initial": "virgin",
}
"""Settings of the model of Table 1, beside its thresholds."""


def test_thresholds_are_identified_with_the_rest_as_table_1_has_them(tmp_path: Path) -> None:
    phase = np.linspace(0, 6 * np.pi, 3000)
    u = 5.05 - 4.95 * np.cos(phase)
    y = printed("mpi-narmax-mpi").simulate(u, sample_time=0.01)
    run = Recording({"voltage": u, "displacement": y}, 0.01, {"voltage": "V"})
    search: dict[str, Any] = {"n_operators": 10, "n_starts": 8, "n_refined": 3, "input": "voltage"}
    fits = [
        quick("rdpi", "muscle", thresholds=thresholds, **PRINTED | search).fit(run)
        for thresholds in ("identified", "spread")
    ]
    errors = [fit.diagnostics_.rmse / np.ptp(y) for fit in fits]
    assert errors[0] < 1e-3 < errors[1]
    assert [fit.diagnostics_.n_free for fit in fits] == [40, 30]
    model = fits[0].model_
    assert fits[0].fit(run).model_ == model
    model.save(tmp_path / "model.json")
    assert load(tmp_path / "model.json").simulate(run) == model.simulate(run)
    found = np.array(model.parts[0].thresholds)
    assert found.min() >= 0
    assert found.max() < 4.951
    assert (np.diff(found) > 0).all()
    assert np.abs(found - np.linspace(0, 4.455, 10)).max() > 0.1


def test_derivatives_by_thresholds_agree_with_differences() -> None:
    run = recorded(GPI.example())
    for settings in (PRINTED, {"nonnegative": True, "initial": "first_sample"}):
        how = {"thresholds": "identified", "n_operators": 4, "rate_time_constant": 0.0}
        estimator = quick("rdpi", "muscle", **settings | how)
        data = estimator.data([run])
        theta = np.array([0.9, 0.4, 0.3, 0.2, 0.1, -0.2, 0.05, 0.02, 0.05, 0.22, 0.41, 0.77])
        matrix = estimator.design_matrix(theta, data)
        linear, _ = estimator.solve(matrix, data)
        slopes = estimator.output_jacobian(theta, linear, data)
        for place in range(theta.size):
            steps = 1e-6 * (np.arange(theta.size) == place)
            apart = estimator.design_matrix(theta + steps, data) - estimator.design_matrix(
                theta - steps, data
            )
            error = np.abs(apart @ linear / 2e-6 - slopes[:, place])
            assert np.quantile(error, 0.98) < 1e-3 * np.abs(slopes).max()  # where no operator turns
