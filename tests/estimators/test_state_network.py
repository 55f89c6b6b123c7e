"""State-space networks identified: derivatives are exact, and hysteresis in a loop is learned."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from mckibben.blocks.derivatives import derivatives
from mckibben.blocks.dynamics.state_network import StateNetwork
from mckibben.estimators.dynamics.state_network import follow_network

Array = NDArray[np.float64]


@pytest.mark.kernel
def test_runs_with_derivatives_are_those_of_the_block_and_exact() -> None:
    model, n = StateNetwork.example(), 30
    force = 3.0 * np.sin(0.3 * np.arange(1, n + 1))
    inputs = (np.append(0.0, force) - model.input_offset) / model.input_scale

    def run(model: Any, slopes: bool = False) -> Array:
        p = model.n_parameters if slopes else 0
        linear, hidden, readout = map(np.array, (model.linear, model.hidden, model.readout))
        found = np.empty((n, 1 + p))
        state = np.zeros((2, 1 + p))
        assert follow_network(linear, hidden, readout, 0.15, state, inputs, 1, 0, found)
        found *= model.output_scale
        found[:, 0] += model.output_offset
        return found

    found = run(model, True)
    outputs, slopes = found[:, 0], found[:, 1:]
    block = replace(model, substeps=1).simulate(force, sample_time=0.01, initial="virgin")
    np.testing.assert_allclose(outputs, block, rtol=1e-12)
    coarse = replace(model, substeps=1, initial="virgin")
    exact = derivatives(coarse, force[:, np.newaxis], 0.01)[:, 0]
    missed = np.abs(slopes - exact).max(axis=0)
    assert (missed <= 1e-10 * np.abs(exact).max(axis=0)).all()


@pytest.mark.kernel
def test_a_run_that_leaves_all_bounds_ends() -> None:
    linear, hidden, readout = np.array([[5.0, 0.0, 1.0]]), np.zeros((1, 3)), np.zeros((1, 1))
    found, state = np.empty((50, 1)), np.ones((1, 1))
    assert not follow_network(linear, hidden, readout, 1.0, state, np.zeros(51), 1, 0, found)
