"""Valve and air: exact lags, limits of pressure, and dead time."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.signal import cont2discrete, lfilter

from mckibben import ModelWarning, Series
from mckibben.blocks.dynamics.air import Air
from mckibben.blocks.memoryless import Affine
from mckibben.exporting import export_c
from tests.blocks.strategies import numbers, paths
from tests.refusals import mentions

Array = NDArray[np.float64]

STEP = 0.01
EXAMPLE = Air.example()
RIGHT_AWAY = replace(EXAMPLE, dead_time=0.0)


@st.composite
def airs(draw: st.DrawFn) -> Air:
    """Draw a regulator, with or without hysteresis, lags, dead time and limits."""
    lag = st.one_of(st.just(0.0), numbers(0.002, 0.3))
    return Air(
        draw(numbers(0.1, 2.0)),
        draw(numbers(-1.0, 1.0)),
        draw(st.one_of(st.just(0.0), numbers(0.0, 0.3))),
        draw(lag),
        draw(lag),
        STEP * draw(st.integers(0, 12)),
        draw(st.sampled_from([None, 0.0, 0.3])),
        draw(st.sampled_from([None, 5.0, 2.0])),
        (0.0, 10.0),
    )


@given(numbers(0.01, 1.0), st.integers(0, 5), paths(0.5, 9.5))
def test_equal_lags_are_scipys(tau: float, late: int, u: Array) -> None:
    air = Air(0.6, 0.1, 0.0, tau, tau, late * STEP, None)
    (top,), bottom, _ = cont2discrete((np.array([0.6]), np.array([tau, 1.0])), STEP)[:3]
    expected = lfilter(
        np.ravel(top), bottom, np.append(u - u[0], 0.0)
    )  # of the hold, one sample later
    expected = np.append(np.zeros(late), expected[1:])[: len(u)] + 0.6 * (u[0] - 0.1)
    np.testing.assert_allclose(air.simulate(u, sample_time=STEP), expected, atol=1e-12)


@given(airs(), paths(0.0, 10.0), st.integers(2, 7))
def test_a_finer_grid_gives_the_same_pressures(air: Air, u: Array, times: int) -> None:
    coarse = air.simulate(u, sample_time=STEP)
    fine = air.simulate(np.repeat(u, times), sample_time=STEP / times)
    np.testing.assert_allclose(fine[times - 1 :: times], coarse, atol=1e-11)


def test_a_dead_time_between_samples_is_rounded_with_a_warning(tmp_path: Path) -> None:
    u = np.linspace(0.0, 9.0, 50)
    between = replace(EXAMPLE, dead_time=0.023)
    with pytest.warns(ModelWarning) as caught:
        pressure = between.simulate(u, sample_time=STEP)
    assert mentions(str(caught[0].message), (0.023, 0.02))
    np.testing.assert_array_equal(pressure, EXAMPLE.simulate(u, sample_time=STEP))
    with pytest.warns(ModelWarning, match=r"0\.023"):
        Series((between, Affine(2.0, 0.0))).stream(STEP)
    with pytest.warns(ModelWarning):
        export_c(between, tmp_path, sample_time=STEP)
    between.inverse().stream(STEP)  # which has no use for it
