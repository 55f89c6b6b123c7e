"""Hysteresis as differential equations: bounds, energy, oscillators solved by others.

Kernels agree with their twins in `tests.contracts.test_twins`.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from mckibben import ModelError, Parallel, Recording
from mckibben.blocks.dynamics.state_network import StateNetwork
from mckibben.blocks.force.feedforward import ForceFeedforward
from mckibben.blocks.force.multistate_friction import EIGHTEEN, MultistateFriction
from mckibben.blocks.hysteresis.differential import BoucWen, GeneralizedBoucWen
from mckibben.blocks.hysteresis.oscillators import BoucWenOscillator, DuhemOscillator
from mckibben.papers.paper import printed

Array = NDArray[np.float64]


@given(st.lists(st.floats(0.0, 5.0), min_size=2, max_size=40), st.floats(0.5, 5.0))
@settings(max_examples=60)
def test_hysteretic_states_stay_within_their_bounds(turns: list[float], sigma: float) -> None:
    model = replace(BoucWen.example(), polynomial=(0.0,), weight=1.0, sigma=sigma)
    assert np.abs(model.simulate(turns)).max() <= 1 + 1e-12
    wide = replace(GeneralizedBoucWen.example(), polynomial=(0.0,), weight=1.0)
    bound = (1.0 - np.abs(wide.shape).sum()) ** (-1.0 / wide.exponent)
    assert np.abs(wide.simulate(turns)).max() <= bound + 1e-12


STEP = 1 / 750
HARD = BoucWenOscillator(2.0, 0.01, 50.0, 50.0, 0.8, -1.1)
"""Whose loops harden, of 35 Hz."""


@pytest.mark.parametrize("model", [HARD, DuhemOscillator.example()])
@pytest.mark.parametrize("force", [-3.0, 2.0])
def test_it_rests_where_a_slow_force_leads(model: Any, force: float) -> None:
    held = model.simulate(np.full(200, force), sample_time=STEP)
    np.testing.assert_allclose(held, held[0], rtol=1e-12)
    ramp = np.interp(np.arange(40_000), [0, 30_000], [0.0, force])
    slow = replace(model, damping=2.0).simulate(ramp, sample_time=0.002, initial="virgin")
    assert slow[-1] == pytest.approx(held[0], rel=2e-3)


def test_steady_state_is_what_a_force_that_repeats_leads_to() -> None:
    """A band-limited period gives the response of the same one sampled more finely."""
    model = replace(StateNetwork.example(), rate=200.0, substeps=10)
    rng, n, ratio = np.random.default_rng(0), 300, 5
    lines = np.zeros(n // 2 + 1, dtype=complex)
    lines[4:30] = np.exp(2j * np.pi * rng.random(26))
    u = np.fft.irfft(lines, n) * 30.0
    steady = model.steady_state(Recording({"force": u}, STEP))["displacement"]
    fine = np.fft.irfft(np.append(lines, np.zeros((20 * ratio - 1) * n // 2)), 20 * ratio * n)
    fine *= 30.0 * 20 * ratio
    finely = replace(model, substeps=1)
    long = finely.simulate(np.tile(fine, 8), sample_time=STEP / (20 * ratio))
    late = long[-fine.size :: 20 * ratio]
    np.testing.assert_allclose(steady, late, atol=2e-4 * np.ptp(late))
    from_rest = model.simulate(u, sample_time=STEP)
    assert np.abs(from_rest - late).max() > 0.05 * np.ptp(late)


def test_a_response_that_never_repeats_is_refused() -> None:
    undamped = replace(
        StateNetwork.example(),
        linear=((0.0, 1.0, 0.0, 0.0), (-1.0, 0.0, 1.0, 0.0), (1.0, 0.0, 0.0, 0.0)),
        readout=((0.0, 0.0),) * 3,
    )
    shaken = Recording({"force": np.sin(np.arange(40.0))}, STEP)
    with pytest.raises(ModelError):
        undamped.steady_state(shaken)


# -- friction of several elements ----------------------------------------------------------------

STIFF = MultistateFriction(
    EIGHTEEN,
    (
        *(18.0, 5e-3, 60.0, 12.0, 4e-3, 50.0),
        *(30.0, 1e-3, 20.0, 25.0, 2e-3, 15.0),
        *(8.0, 2e-2, 40.0, 9.0, 1e-2, 55.0),
    ),
)


def force(model: MultistateFriction, length: Array) -> Array:
    table = np.column_stack([length, np.full(length.size, 4.0)])
    return model.simulate(table, initial="virgin", sample_time=0.01)[:, 0]


@given(st.lists(st.floats(185.0, 200.0), min_size=3, max_size=12), st.integers(0, 1))
@settings(max_examples=40)
def test_friction_takes_energy_and_never_gives_more_than_it_stored(
    turns: list[float], which: int
) -> None:
    model = (STIFF, printed("multistate-friction"))[which]
    way = np.concatenate([np.linspace(a, b, 40)[:-1] for a, b in pairwise(turns)])
    # the work done on the friction, each step at the force that it ends with, less what that misses
    f = force(model, way)
    work = np.cumsum(f[1:] * np.diff(way))
    slack = np.cumsum(np.abs(np.diff(f)) * np.abs(np.diff(way)))
    table = model.table()
    # springs that go on with another stiffness at a reversal keep at most what they held
    stored = (table[:, [2, 5]] ** 2 / (2 * np.minimum(table[:, [0]], table[:, [3]]))).sum()
    assert np.all(work + slack >= -stored - 1e-9)


def test_printed_limits_are_reached_both_ways() -> None:
    slow = np.concatenate([np.linspace(180, 200, 4001), np.linspace(200, 180, 4001)])
    f = force(printed("multistate-friction"), slow)
    assert f.max() == pytest.approx(128.795, rel=1e-6)
    assert f.min() == pytest.approx(-103.096 - 13.431 - 1.256, abs=1.3)


@pytest.mark.parametrize("gain", [0.0, 0.2])
def test_feedforward_is_exact(gain: float) -> None:
    friction = replace(printed("multistate-friction"), pressure_gain=gain, initial="virgin")
    length = np.interp(np.arange(264), np.arange(0, 288, 24), 192.5 + 3.5 * (-0.9) ** np.arange(12))
    wanted = 300.0 + 60.0 * np.sin(np.linspace(0, 20, length.size))
    recording = Recording({"force": wanted, "length": length}, 0.01)
    law = printed("multistate-static-force")
    pressure = ForceFeedforward(law, friction).simulate(recording)["pressure"]
    driven = Recording({"length": length, "pressure": pressure}, 0.01)
    reached = Parallel((law, friction)).simulate(driven)["force"]
    np.testing.assert_allclose(reached, wanted, atol=1e-9)
