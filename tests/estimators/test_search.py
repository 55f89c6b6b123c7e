"""Derivatives of fits by variable projection."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from mckibben import Recording
from mckibben.blocks.compose import Series
from mckibben.blocks.dynamics.creep import Creep
from mckibben.blocks.hysteresis.pi import PI
from mckibben.estimators.core.data import training_data
from mckibben.estimators.core.separable import SeparableEstimator
from mckibben.numerics.tracker import Tracker
from mckibben.registry import load
from tests.estimators.examples import CASES, quick, recorded

SEPARABLE = [case for case in CASES if issubclass(load("estimators", case[0]), SeparableEstimator)]
CPI = Series((PI.example(), Creep.example()))


@pytest.mark.parametrize("name", ["mpi", "cpi"])
def test_moves_in_closed_form_are_those_of_finite_differences(name: str) -> None:
    time = np.arange(800) * 0.05
    pressure = 2.5 + 2.3 * np.sin(0.6 * time) * np.exp(-0.02 * time)
    y = CPI.simulate(pressure, sample_time=0.05)
    recording = Recording({"pressure": pressure, "displacement": y}, 0.05)
    data = training_data(recording, "pressure", "displacement")
    estimator = load("estimators", name)()
    lower, upper = estimator.bounds(data)
    theta = 0.999 * np.clip(estimator.guesses(data)[0], lower, upper) + 0.0005 * (lower + upper)
    linear, _ = estimator.solve(estimator.design_matrix(theta, data), data)
    moves = estimator.output_jacobian(theta, linear, data)
    differences = SeparableEstimator.output_jacobian(estimator, theta, linear, data)
    np.testing.assert_allclose(moves, differences, atol=2e-4 * np.abs(moves).max())


@pytest.mark.filterwarnings("ignore::mckibben.errors.ModelWarning")
@pytest.mark.parametrize(("name", "kind"), SEPARABLE)
def test_the_seed_decides_where_a_search_begins(
    name: str, kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun: list[np.ndarray] = []

    def first(errors: Any, starts: Any, bounds: Any, *_: object, **__: object) -> np.ndarray:
        begun.append(np.clip(starts, *bounds))
        return begun[-1][0]

    monkeypatch.setattr("mckibben.estimators.core.separable.multi_start", first)

    def starts(seed: int) -> list[np.ndarray]:
        begun.clear()
        estimator = quick(name, kind, seed=seed)
        estimator.find(estimator.data(recorded(kind)), Tracker())
        return [each for each in begun if len(each) > 1]  # one is followed on from a search

    known, again, other = starts(1), starts(1), starts(2)
    np.testing.assert_equal(known, again)
    for one, different in zip(known, other, strict=True):
        assert not np.array_equal(one, different)
