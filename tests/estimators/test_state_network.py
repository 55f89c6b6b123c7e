"""State-space networks identified: derivatives are exact, and free runs stay bounded."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mckibben.arrays import Array
from mckibben.blocks.derivatives import derivatives
from mckibben.blocks.dynamics.state_network import StateNetwork
from mckibben.comparison.planning import plan_of
from mckibben.estimators.dynamics.network_kernel import simulate_network
from mckibben.estimators.dynamics.state_network import NetworkErrors, StateNetworkEstimator
from mckibben.recording import Recording
from tests.golden.models import network

STEP = 0.01

NETWORK = network()


def recording(model: StateNetwork, n: int = 60, seed: int = 0, **meta: Any) -> Recording:
    """Return a smooth motion of a model's inputs, and its outputs in free run."""
    t, rng = np.arange(n)[:, np.newaxis] / n, np.random.default_rng(seed)
    waves = [np.sin(2 * np.pi * (k * t + rng.random(len(model.inputs)))) for k in (1, 2, 5)]
    inputs = np.array(model.input_offset) + np.array(model.input_scale) * sum(waves)
    columns = {channel.name: inputs[:, j] for j, channel in enumerate(model.inputs)}
    units = {channel.name: channel.unit for channel in model.inputs}
    given = Recording(columns, STEP, units, meta=meta)
    if given.periodic:
        return model.steady_state(given)
    outputs = model.simulate(inputs, sample_time=STEP)
    named = dict(zip([c.name for c in model.outputs], outputs.T, strict=True))
    return given.with_channels({c.name: c.unit for c in model.outputs}, **named)


def search(model: StateNetwork, run: Recording) -> NetworkErrors:
    names: dict[str, Any] = {
        "input": ("pressure",),
        "output": ("displacement", "force"),
        "scheduling": ("length",),
    }
    data = StateNetworkEstimator(**names).data(run)
    return NetworkErrors(model, data, [~one.counts for one in data.runs], 2000)


@pytest.mark.kernel
@pytest.mark.parametrize("initial", ["first_sample", "virgin"])
def test_runs_with_derivatives_are_those_of_the_block_and_exact(initial: Any) -> None:
    model = replace(NETWORK, initial=initial)
    run = recording(model)
    errors, slopes = search(model, run).errors(model.pack())
    n = 2 * len(run)
    np.testing.assert_allclose(errors[:n], 0.0, atol=1e-12)
    inputs = run.matrix(["pressure", "length"])
    exact: Array = derivatives(model, inputs, STEP) / np.array(model.output_scale)[:, np.newaxis]
    missed = np.abs(slopes()[:n] - exact.reshape(n, -1)).max(axis=0)
    assert (missed <= 1e-9 * np.abs(exact).max()).all()


@pytest.mark.kernel
def test_runs_of_a_period_are_those_of_the_steady_state() -> None:
    run = recording(NETWORK, 100, periodic=True)
    errors, _ = search(NETWORK, run).errors(NETWORK.pack())
    np.testing.assert_allclose(errors, 0.0, atol=1e-7)


@pytest.mark.kernel
def test_a_linear_part_that_does_not_decay_is_refused() -> None:
    one = search(NETWORK, recording(NETWORK))
    grown = replace(NETWORK, linear=((0.1, *NETWORK.linear[0][1:]), *NETWORK.linear[1:]))
    grown = replace(
        grown, linear=(grown.linear[0], (0.5, 0.4, *grown.linear[1][2:]), *grown.linear[2:])
    )
    assert one.bounded(NETWORK.pack())
    assert not one.bounded(grown.pack())
    assert not np.isfinite(one.errors(grown.pack())[0]).any()


@pytest.mark.kernel
def test_a_run_that_leaves_all_bounds_ends() -> None:
    linear, hidden, readout = np.array([[5.0, 0, 1], [1, 0, 0]]), np.zeros((1, 3)), np.zeros((2, 1))
    found, state = np.empty((50, 1, 1)), np.ones((1, 1))
    given = np.zeros((51, 1)), 1, 0, np.ones(50, dtype=bool), found
    assert not simulate_network(linear, hidden, readout, 1.0, state, *given)


def test_several_outputs_are_learned_and_a_seed_gives_the_same_again() -> None:
    runs = [recording(NETWORK, 300, seed) for seed in range(4)]
    settings: dict[str, Any] = {
        "input": ("pressure",),
        "scheduling": ("length",),
        "output": ("displacement", "force"),
        "n_states": 3,
        "n_units": 3,
        "n_steps": 40,
    }
    one = StateNetworkEstimator(**settings).fit(runs[:3])
    assert one.score(runs[3:]) > 0.98
    again = StateNetworkEstimator(**settings).fit(runs[:3])
    assert one.model_ == again.model_
    far = one.model_.simulate(np.tile([50.0, -400.0], (2000, 1)), sample_time=STEP)
    assert np.isfinite(far).all()


def test_recordings_of_several_sample_times_share_a_model() -> None:
    runs = [recording(NETWORK, 240, seed) for seed in range(2)]
    coarse = replace(
        runs[1],
        channels={name: values[::2] for name, values in runs[1].channels.items()},
        sample_time=2 * STEP,
    )
    settings: dict[str, Any] = {"output": ("displacement",), "n_states": 3, "n_units": 2}
    channels: dict[str, Any] = {"input": ("pressure",), "scheduling": ("length",)}
    one = StateNetworkEstimator(**settings, **channels, n_steps=30, n_starts=2)
    found = one.fit([runs[0], coarse])
    assert found.score([coarse]) > 0.95
    assert found.score([recording(NETWORK, 240, 2)]) > 0.9


def test_comparisons_of_all_models_leave_it_out_where_it_is_not_named() -> None:
    run = recording(NETWORK, 240)
    channels: dict[str, Any] = {"input": "pressure", "output": "displacement"}
    assert "state-network" in plan_of(run, models="all", **channels).empty.left_out
    assert [*plan_of(run, models="state-network", **channels).items] == ["state-network"]
