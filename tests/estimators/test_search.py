"""Derivatives of fits by variable projection."""

from __future__ import annotations

import numpy as np
import pytest

from mckibben import Recording
from mckibben.blocks.compose import Series
from mckibben.blocks.dynamics.creep import Creep
from mckibben.blocks.hysteresis.pi import PI
from mckibben.estimators.core.data import training_data
from mckibben.estimators.core.separable import SeparableEstimator
from mckibben.registry import load

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
