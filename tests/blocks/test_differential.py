"""Bouc-Wen, generalised Bouc-Wen and Duhem against SciPy's adaptive integrator, and their laws."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Literal

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from mckibben.blocks.differential.bouc_wen import BoucWen
from mckibben.blocks.differential.duhem import Duhem
from mckibben.blocks.differential.generalized_bouc_wen import GeneralizedBoucWen

Array = NDArray[np.float64]
Slope = Callable[[float, float, float], float]


def turning(seed: int, n: int = 12) -> Array:
    return np.random.default_rng(seed).uniform(0.0, 5.0, n)


def _rate(slope: Slope, way: float, u: float, z: Array) -> list[float]:
    return [slope(u, z[0], way)]


def integrated(slope: Slope, start: float, turns: Array, kinks: tuple[float, ...] = ()) -> Array:
    """Return the state at every turning point, stepping anew at each kink of the input."""
    state, found = start, []
    for begin, end in zip(np.concatenate([turns[:1], turns[:-1]]), turns, strict=True):
        way = float(np.sign(end - begin))
        inside = sorted((k for k in kinks if (k - begin) * (k - end) < 0), reverse=bool(way < 0))
        for first, last in zip([begin, *inside], [*inside, end], strict=True):
            if first != last:
                solved = solve_ivp(
                    partial(_rate, slope, way),
                    (first, last),
                    [state],
                    rtol=1e-9,
                    atol=1e-11,
                    max_step=0.01,
                )
                state = float(solved.y[0, -1])
        found.append(state)
    return np.array(found)


@pytest.mark.parametrize("exponent", [1, 2])
@pytest.mark.parametrize("sigma", [0.5, 0.9, 3.0])
def test_bouc_wen_agrees_with_scipy(exponent: Literal[1, 2], sigma: float) -> None:
    model = replace(
        BoucWen.example(), polynomial=(0.0,), weight=1.0, sigma=sigma, exponent=exponent
    )

    def slope(u: float, z: float, way: float) -> float:
        psi = sigma * np.sign(z) * way + 1 - sigma
        return float(model.rate * (1 - abs(z) ** exponent * psi))

    turns = turning(1)
    expected = integrated(slope, 1.0, turns)
    np.testing.assert_allclose(model.simulate(turns), expected, atol=2e-5)


@pytest.mark.parametrize("exponent", [1, 2])
def test_generalized_bouc_wen_agrees_with_scipy(exponent: Literal[1, 2]) -> None:
    model = replace(GeneralizedBoucWen.example(), polynomial=(0.0,), weight=1.0, exponent=exponent)
    b = model.shape

    def slope(u: float, z: float, way: float) -> float:
        x, s = np.sign(u - model.centre), np.sign(z)
        psi = s * way + b[0] * x * way + b[1] * x * s + b[2] * way + b[3] * s + b[4] * x
        return float(model.rate * (1 - abs(z) ** exponent * psi))

    turns = turning(2)
    expected = integrated(slope, 1.0, turns, (model.centre,))
    np.testing.assert_allclose(model.simulate(turns), expected, atol=2e-5)


def test_duhem_agrees_with_scipy() -> None:
    model = Duhem.example()

    def slope(u: float, y: float, way: float) -> float:
        x = (u - model.centre) / model.scale
        f = np.polynomial.polynomial.polyval(x, model.target)
        g = np.polynomial.polynomial.polyval(x, model.slope)
        return float((model.alpha * way * (f - y) + g) / model.scale)

    turns = turning(3)
    start = float(model.initial_state(turns[:1])[0])
    expected = integrated(slope, start, turns)
    np.testing.assert_allclose(model.simulate(turns), expected, atol=1e-6)


@given(st.lists(st.floats(0.0, 5.0), min_size=2, max_size=40), st.floats(0.5, 5.0))
@settings(max_examples=60, deadline=None)
def test_z_stays_within_its_bounds(turns: list[float], sigma: float) -> None:
    model = replace(BoucWen.example(), polynomial=(0.0,), weight=1.0, sigma=sigma)
    assert np.abs(model.simulate(turns)).max() <= 1 + 1e-12
    wide = replace(GeneralizedBoucWen.example(), polynomial=(0.0,), weight=1.0)
    assert np.abs(wide.simulate(turns)).max() <= wide.bound + 1e-12
