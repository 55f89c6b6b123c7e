"""One zero for recordings of several: what a sensor's zero is does not matter behind it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mckibben import GPI, DataError, Recording
from mckibben.signals import zeroed
from mckibben.signals.zeroing import apart, rest

T = np.arange(2000) * 0.01
PRESSURE = 2.5 - 2.5 * np.cos(T)


def run(zero: float, pressure: np.ndarray = PRESSURE) -> Recording:
    samples = {"pressure": pressure, "displacement": GPI.example().simulate(pressure) + zero}
    return Recording(samples, 0.01)


@given(st.floats(-100, 100))
def test_any_zero_is_taken_out(zero: float) -> None:
    one = zeroed(run(zero), ["displacement"], "pressure")
    assert rest(one, "displacement", "pressure") == pytest.approx(0.0, abs=1e-12)
    assert np.allclose(
        one["displacement"], zeroed(run(0.0), ["displacement"], "pressure")["displacement"]
    )
    assert np.array_equal(one["pressure"], PRESSURE)


def test_recordings_of_several_zeros_are_told() -> None:
    runs = [run(0.0), run(0.5), run(40.0)]
    found = apart(runs, "displacement", "pressure")
    assert found is not None
    assert found[1] - found[0] == pytest.approx(40.0)
    level = [zeroed(one, ["displacement"], "pressure") for one in runs]
    assert apart(level, "displacement", "pressure") is None
    assert apart(runs[:2], "displacement", "pressure") is None  # within what a quarter of travel is
    assert apart(runs[:1], "displacement", "pressure") is None
    inner = run(0.0, 3.5 - 1.5 * np.cos(T))  # whose pressure begins elsewhere
    assert apart([run(0.0), inner], "displacement", "pressure") is None


def test_what_is_not_there_has_no_zero() -> None:
    with pytest.raises(DataError, match="length"):
        zeroed(run(0.0), ["length"], "pressure")
    with pytest.raises(DataError, match="voltage"):
        zeroed(run(0.0), ["displacement"], "voltage")
