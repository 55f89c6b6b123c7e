"""Identification of several muscles, on data of known models."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pytest

from mckibben import GPI, DataError, ModelError, Recording, registry
from mckibben.blocks.compose import PerChannel, Series
from mckibben.blocks.core.fields import Channel
from mckibben.blocks.coupled.coupling import Coupling
from mckibben.blocks.coupled.force_balance import ForceBalance
from mckibben.estimators.coupled.fuzzy import Consequents, Problem, Sets
from mckibben.estimators.coupled.fuzzy_projection import sensitivities
from mckibben.estimators.coupled.sdchm import coupled, softest

STEP = 0.05


def waves(n: int = 800) -> np.ndarray:
    t = np.linspace(0, 1, n)
    return (1.0 + (t > 0.5)) * 0.6 * (1 - np.cos(4 * np.pi * t))


def runs(model: Any, noise: float = 0.01) -> list[Recording]:
    """Runs of two muscles at three stiffnesses: each alone, and both."""
    rng = np.random.default_rng(0)
    found = []
    for p0, pattern in product((0.0, 1.0, 2.0), ((1, 0), (0, 1), (1, 1))):
        wave = waves()
        inputs = np.column_stack([*(wave * on for on in pattern), np.full(wave.size, p0)])
        y = model.simulate(inputs[:, : len(model.inputs)])
        y = y + noise * rng.standard_normal(y.shape)
        channels = {f"pressure_{k + 1}": inputs[:, k] for k in range(2)}
        channels["pressure_extensor"] = inputs[:, 2]
        channels |= {f"displacement_{k + 1}": y[:, k] for k in range(2)}
        found.append(Recording(channels, STEP))
    return found


@pytest.fixture(scope="module")
def balance_runs() -> list[Recording]:
    return runs(ForceBalance.example().inverse())


def rmse(estimator: Any) -> float:
    return float(max(estimator.diagnostics_.rmse_by_output))


def test_a_balance_follows_an_arm_of_another_form(balance_runs: list[Recording]) -> None:
    estimator = registry.load("estimators", "balance")(n_lags=0, steps=4).fit(balance_runs)
    assert rmse(estimator) < 0.35
    model = estimator.model_
    low, high = model.inverse().pressure_range
    assert low <= 0 < high


@pytest.mark.parametrize("name", ["sdchm", "tsfnn", "coupled-pi", "sdchm-published"])
def test_every_model_fits_and_its_inverse_undoes_it(
    name: str, balance_runs: list[Recording]
) -> None:
    estimator_class = registry.load("estimators", name)
    fast = {"n_sets": 2, "method": "ls"} if name != "coupled-pi" else {}
    if name == "sdchm":
        fast["memory_settings"] = {"n_starts": 1, "n_refined": 1}
    first = estimator_class(**fast).fit(balance_runs, validation=balance_runs[:2])
    span = max(np.ptp(run["displacement_1"]) for run in balance_runs)
    assert (
        rmse(first)
        < {"coupled-pi": 0.3, "tsfnn": 0.1, "sdchm-published": 0.15}.get(name, 0.05) * span
    )
    if name == "sdchm":
        model, run = first.model_, balance_runs[-1]
        y = model.simulate(run)
        wanted = y.with_channels({}, **{c.name: y[c.name] for c in model.outputs})
        back = model.inverse().simulate(wanted)
        again_y = model.simulate(back)
        for channel in model.outputs:
            error = np.abs(again_y[channel.name] - y[channel.name]).max()
            assert error <= 1e-6 * np.ptp(y[channel.name])


def test_coupling_is_found_by_least_squares() -> None:
    channels = [Channel(f"displacement_{k}", "mm") for k in (1, 2)]
    pressures = [Channel(f"pressure_{k}", "bar") for k in (1, 2)]
    plays = [GPI.example() for _ in range(2)]
    memories = tuple(
        replace(block, input=p, output=y)
        for block, p, y in zip(plays, pressures, channels, strict=True)
    )
    truth = Coupling(((1.0, 0.3), (0.1, 1.0)), tuple(channels), tuple(channels))
    model = Series((PerChannel(memories), truth))
    alone = []
    for k in range(2):
        inputs = np.zeros((800, 2))
        inputs[:, k] = waves()
        y = model.simulate(inputs) - model.simulate(np.zeros((800, 2)))
        v = memories[k].simulate(inputs[:, k])
        y[:, 1 - k] = truth.gains[k][1 - k] * v
        alone.append(
            Recording(
                {f"pressure_{i + 1}": inputs[:, i] for i in range(2)}
                | {f"displacement_{i + 1}": y[:, i] for i in range(2)},
                STEP,
            )
        )
    data = registry.load("estimators", "coupled-pi")().data(alone)
    found = coupled(list(memories), [softest(data, 0), softest(data, 1)], data)
    np.testing.assert_allclose(found.matrix, truth.matrix, atol=1e-9)


def test_projected_derivatives_agree_with_differences() -> None:
    rng = np.random.default_rng(1)
    x = rng.uniform(0, 1, (300, 2))
    y = np.column_stack([np.sin(3 * x[:, 0]) * x[:, 1], x[:, 0] ** 2])
    y += 0.2 * rng.standard_normal(y.shape)
    sets = Sets.even(np.zeros(2), np.ones(2), 2)
    problem = Problem(x, y, Consequents(True, 1e-10))
    jacobian, residual = sensitivities(problem, sets)
    gradient = jacobian.T @ residual
    for k in range(sets.vector.size):
        moved = sets.vector
        moved[k] += 1e-5
        up = problem.cost(sets.replaced(moved)) ** 2
        moved[k] -= 2e-5
        down = problem.cost(sets.replaced(moved)) ** 2
        slope = (up - down) / 2e-5 * residual.size / 2
        assert gradient[k] == pytest.approx(slope, rel=0.02, abs=1e-3 * np.abs(gradient).max())


def test_muscles_that_never_move_alone_and_those_that_are_lost_are_refused(
    balance_runs: list[Recording],
) -> None:
    both, whole = balance_runs[2::3], balance_runs[0]
    names = ["pressure_1", "pressure_2"], ["displacement_1", "displacement_2"]
    for model in ("sdchm", "sdchm-published", "coupled-pi"):
        objection = registry.load("estimators", model).objection
        assert "pressure_1" in str(objection(both, *names))
        assert objection(balance_runs, *names) is None
        with pytest.raises(DataError, match="pressure_1"):
            registry.load("estimators", model)().fit(both)
    for lost in ("pressure_2", "displacement_2", "pressure_extensor"):
        less = whole.select([name for name in whole.channels if name != lost])
        for given in ([less, whole], [whole, less]):
            with pytest.raises(DataError, match=lost):
                registry.load("estimators", "balance")().fit(given)
    with pytest.raises(ModelError, match="degree"):
        registry.load("estimators", "balance")(degree=9).fit(balance_runs)
