"""One zero for recordings of several: only of those that rest, with all inputs and loads."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mckibben import GPI, DataError, Recording
from mckibben.arrays import Array
from mckibben.signals import zeroed
from mckibben.signals.zeroing import apart, rests

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
    assert rests([one], "displacement", "pressure") == pytest.approx([0.0], abs=1e-12)
    plain = zeroed(run(0.0), ["displacement"], "pressure")
    assert np.allclose(one["displacement"], plain["displacement"])
    assert np.array_equal(one["pressure"], RESTING)


@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_recordings_of_several_zeros_are_found(noise: float) -> None:
    runs = [run(zero, noise=noise) for zero in (0.0, 0.5, 40.0)]
    found = apart(runs, "displacement", "pressure")
    assert found is not None
    assert found[1] - found[0] == pytest.approx(40.0, abs=0.1)
    level = [zeroed(one, ["displacement"], "pressure") for one in runs]
    assert apart(level, "displacement", "pressure") is None
    assert apart(runs[:2], "displacement", "pressure") is None  # within a quarter of travel
    assert apart(runs[:1], "displacement", "pressure") is None


@pytest.mark.parametrize("pressure", [MOVING, np.where(T < 9, MOVING, MOVING[900])])
def test_without_a_rest_at_the_lowest_pressure_nothing_is_found_or_shifted(pressure: Array) -> None:
    runs = [run(0.0, pressure), run(40.0, pressure)]
    assert rests(runs, "displacement", "pressure") is None
    assert apart(runs, "displacement", "pressure") is None
    with pytest.raises(DataError, match="rest"):
        zeroed(runs[0], ["displacement"], "pressure")


def test_loads_stand_still_and_are_alike_where_recordings_rest() -> None:
    swinging = 10 + 5 * np.sin(9 * T)
    assert rests([run(0.0, force=swinging)], "displacement", "pressure") is None
    light, heavy = (run(zero, force=np.full(T.size, zero)) for zero in (5.0, 40.0))
    assert apart([light, heavy], "displacement", "pressure") is None
    assert apart([light, run(40.0, force=light["force"])], "displacement", "pressure") is not None
    begun = run(0.0, np.maximum(RESTING, 1.0))  # whose pressure rests elsewhere
    assert apart([run(40.0), begun], "displacement", "pressure") is None


def test_what_is_not_there_has_no_zero() -> None:
    with pytest.raises(DataError, match="length"):
        zeroed(run(0.0), ["length"], "pressure")
    with pytest.raises(DataError, match="voltage"):
        zeroed(run(0.0), ["displacement"], "voltage")
