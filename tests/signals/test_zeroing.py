"""One zero for recordings of several: only of those that rest, with all inputs and loads."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mckibben import GPI, DataError, Recording
from mckibben.arrays import Array
from mckibben.signals import zeroed
from mckibben.signals.zeroing import rest
from tests.refusals import refused

T = np.arange(2000) * 0.01
MOVING = 2.5 - 2.5 * np.cos(T)
RESTING = np.where(4 * np.pi > T, MOVING, 0.0)


def run(zero: float, pressure: Array = RESTING, noise: float = 0.0, **loads: Array) -> Recording:
    rng = np.random.default_rng(0)
    y = GPI.example().simulate(pressure) + zero + noise * rng.standard_normal(T.size)
    seen = pressure + noise * rng.standard_normal(T.size)
    return Recording({"pressure": seen, "displacement": y, **loads}, 0.01)


@given(st.floats(-100, 100))
def test_any_zero_is_taken_out(zero: float) -> None:
    one = zeroed(run(zero), ["displacement"], "pressure")
    assert rest(one, "displacement", "pressure") == pytest.approx(0.0, abs=1e-12)
    plain = zeroed(run(0.0), ["displacement"], "pressure")
    assert np.allclose(one["displacement"], plain["displacement"])
    assert np.array_equal(one["pressure"], RESTING)


def test_noise_hardly_moves_the_zero() -> None:
    assert rest(run(40.0, noise=0.02), "displacement", "pressure") == pytest.approx(
        rest(run(40.0), "displacement", "pressure"), abs=0.05
    )


@pytest.mark.parametrize("pressure", [MOVING, np.where(T < 9, MOVING, MOVING[900])])
def test_without_a_rest_at_the_lowest_pressure_nothing_is_found_or_shifted(pressure: Array) -> None:
    moving = run(40.0, pressure)
    assert rest(moving, "displacement", "pressure") is None
    with refused(DataError, channel="displacement"):
        zeroed(moving, ["displacement"], "pressure")


def test_loads_are_constant_at_rest() -> None:
    swinging = 10 + 5 * np.sin(9 * T)
    assert rest(run(0.0, force=swinging), "displacement", "pressure") is None
    assert rest(run(0.0, force=np.full(T.size, 5.0)), "displacement", "pressure") is not None


def test_what_is_not_there_has_no_zero() -> None:
    with refused(DataError, channel="length"):
        zeroed(run(0.0), ["length"], "pressure")
    with refused(DataError, channel="voltage"):
        zeroed(run(0.0), ["displacement"], "voltage")
