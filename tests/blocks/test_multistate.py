"""Multistate friction against a stiff integrator, its energy, and the feedforward that undoes it."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from mckibben import Parallel, Recording
from mckibben.blocks.force.feedforward import ForceFeedforward
from mckibben.blocks.force.multistate_friction import EIGHTEEN, ELEVEN, MultistateFriction
from mckibben.papers.multistate_friction.published import multistate_friction, static_force

Array = NDArray[np.float64]
STEP = 0.01
STIFF = MultistateFriction(
    EIGHTEEN,
    (
        *(18.0, 5e-3, 60.0, 12.0, 4e-3, 50.0),
        *(30.0, 1e-3, 20.0, 25.0, 2e-3, 15.0),
        *(8.0, 2e-2, 40.0, 9.0, 1e-2, 55.0),
    ),
)


def lengths(seed: int, n: int = 12, pace: int = 25) -> Array:
    turns = np.random.default_rng(seed).uniform(185.0, 200.0, n)
    return np.concatenate([np.linspace(a, b, pace)[:-1] for a, b in pairwise(turns)])


def force(model: MultistateFriction, length: Array, pressure: float = 4.0) -> Array:
    table = np.column_stack([length, np.full(length.size, pressure)])
    return model.simulate(table, initial="virgin", sample_time=STEP)[:, 0]


@given(st.lists(st.floats(185.0, 200.0), min_size=3, max_size=12), st.integers(0, 1))
@settings(max_examples=40, deadline=None)
def test_friction_takes_energy_and_never_gives_more_than_it_stored(
    turns: list[float], which: int
) -> None:
    model = (STIFF, multistate_friction())[which]
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
    model = multistate_friction()
    slow = np.concatenate([np.linspace(180, 200, 4001), np.linspace(200, 180, 4001)])
    f = force(model, slow)
    assert f.max() == pytest.approx(128.795, rel=1e-6)
    assert f.min() == pytest.approx(-103.096 - 13.431 - 1.256, abs=1.3)
    assert model.n_parameters == 11
    assert STIFF.n_parameters == 18
    assert model.elements == ELEVEN


@pytest.mark.parametrize("gain", [0.0, 0.2])
def test_feedforward_is_exact(gain: float) -> None:
    from dataclasses import replace

    friction = replace(multistate_friction(), pressure_gain=gain, initial="virgin")
    law = static_force()
    length = lengths(2) * 0.5 + 97.0
    wanted = 300.0 + 60.0 * np.sin(np.linspace(0, 20, length.size))
    recording = Recording({"force": wanted, "length": length}, STEP)
    pressure = ForceFeedforward(law, friction).simulate(recording)["pressure"]
    given = Recording({"length": length, "pressure": pressure}, STEP)
    reached = Parallel((law, friction)).simulate(given)["force"]
    np.testing.assert_allclose(reached, wanted, atol=1e-9)


def test_printed_static_force_at_some_points() -> None:
    per_bar, rest = static_force().terms(np.array([190.0]))
    assert float(rest[0] + 4.0 * per_bar[0]) == pytest.approx(
        7596 - 136.6 * 4 - 93.14 * 190 + 1.176 * 190 * 4 + 0.2758 * 190**2
    )
