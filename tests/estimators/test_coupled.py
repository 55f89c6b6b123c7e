"""Identification of several muscles, on data of known models."""

from __future__ import annotations

import numpy as np
import pytest

from mckibben import DataError, ModelError, registry
from mckibben.channels import channels_of
from mckibben.estimators.coupled.fuzzy import (
    Consequents,
    Problem,
    Search,
    Sets,
    printed_swarm,
    sensitivities,
)
from mckibben.estimators.coupled.sdchm import learned_inverse
from tests.estimators.examples import quick, recorded
from tests.refusals import refused
from tests.slopes import smooth_slopes

STEP = 0.05


def test_projected_derivatives_agree_with_differences() -> None:
    rng = np.random.default_rng(1)
    x = rng.uniform(0, 1, (300, 2))
    y = np.column_stack([np.sin(3 * x[:, 0]) * x[:, 1], x[:, 0] ** 2])
    y += 0.2 * rng.standard_normal(y.shape)
    sets = Sets.even(np.zeros(2), np.ones(2), 2)
    problem = Problem(x, y, Consequents(True, 1e-10))
    jacobian, residual = sensitivities(problem, sets), problem.errors(sets).ravel()
    gradient = jacobian.T @ residual
    exact = smooth_slopes(lambda moved: problem.cost(sets.replaced(moved)) ** 2, sets.vector)
    exact *= residual.size / 2
    # but for the ridge of the consequents
    np.testing.assert_allclose(gradient, exact, rtol=0, atol=1e-4 * np.abs(exact).max())


def test_muscles_that_never_move_alone_and_those_that_are_lost_are_refused() -> None:
    runs = recorded("two muscles")
    both, whole = runs[2::3], runs[0]
    for model in ("sdchm", "sdchm-published", "coupled-pi"):
        objection = registry.load("estimators", model).objection
        assert "pressure_1" in str(objection(both, channels_of(both)))
        assert objection(runs, channels_of(runs)) is None
        with refused(DataError, channel="pressure_1"):
            registry.load("estimators", model)().fit(both)
    for lost in ("pressure_2", "displacement_2", "pressure_extensor"):
        less = whole.select([name for name in whole.channels if name != lost])
        for given in ([less, whole], [whole, less]):
            with refused(DataError, channel=lost):
                registry.load("estimators", "balance")().fit(given)
    with refused(ModelError, parameter="degree"):
        registry.load("estimators", "balance")(degree=9).fit(runs)


@pytest.mark.filterwarnings("ignore:.* clipped")
@pytest.mark.parametrize("name", ["sdchm", "sdchm-published"])
def test_a_network_learned_the_other_way_round_gives_recorded_pressures(name: str) -> None:
    runs = recorded("two muscles")
    model = quick(name).fit(runs).model_
    inverse = learned_inverse(model, runs, search=Search("pso", 600, printed_swarm(6, 6), 0))
    driven = ["pressure_1", "pressure_2"]
    assert [channel.name for channel in inverse.outputs] == driven
    missed = np.concatenate(
        [inverse.simulate(run).matrix(driven) - run.matrix(driven) for run in runs]
    )
    assert np.sqrt(np.mean(missed**2)) < 0.05  # bar, of 2
    assert inverse != model.inverse()
    with refused(ModelError, names="sdchm"):
        learned_inverse(model.inverse(), runs)
