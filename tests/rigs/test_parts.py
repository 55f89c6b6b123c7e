"""The parts of the physics: each against a law or an independent reference."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq

from mckibben.rigs.physics.air import (
    AIR,
    LAMINAR_RATIO,
    flow,
    through,
    valve_flow,
)
from mckibben.rigs.physics.compiled import ATMOSPHERE
from mckibben.rigs.physics.friction import slip


def naive_slip(force: float, k: float, up: float, down: float, moved: float) -> float:
    """Draw an element in a thousand small moves."""
    for _ in range(1000):
        force = min(max(force + k * moved / 1000, -down), up)
    return force


@given(st.floats(-20, 20), st.floats(0.1, 50), st.floats(0, 20), st.floats(0, 20), st.floats(-5, 5))
def test_slip_is_exact_for_a_straight_move(
    force: float, k: float, up: float, down: float, moved: float
) -> None:
    expected = naive_slip(min(max(force, -down), up), k, up, down, moved)
    found, slope = slip(min(max(force, -down), up), k, up, down, moved)
    assert found == pytest.approx(expected, abs=1e-9 * (1 + k))
    assert slope in (0.0, k)


@given(st.floats(0.01, 5.0), st.floats(1.0, 9.0), st.floats(0.0, 1.0), st.floats(0.1, 0.6))
def test_flow_is_that_of_iso_6358(c: float, up: float, ratio: float, critical: float) -> None:
    found = flow(c, up, ratio * up, critical)
    if ratio <= critical:
        assert found == pytest.approx(c * up)
    elif ratio < LAMINAR_RATIO:
        off = (ratio - critical) / (1 - critical)
        assert found == pytest.approx(c * up * math.sqrt(1 - off**2))
    assert 0 <= found <= c * up * (1 + 1e-12)
    assert flow(c, up, up, critical) == 0.0
    assert found >= flow(c, up, min(ratio + 0.01, 1.0) * up, critical) - 1e-12


def regulator(**changes: float) -> np.void:
    made = np.zeros(1, AIR)
    numbers = {
        "supply": 6.0,
        "fill": 2.0,
        "vent": 1.0,
        "critical_ratio": 0.3,
        "gain": 0.5,
        "dead_band": 0.1,
    }
    for name, value in (numbers | changes).items():
        made[name] = value
    return made[0]


@pytest.mark.parametrize("opening", [1.0, 0.3, 0.01, 0.0, -0.01, -0.3, -1.0])
@pytest.mark.parametrize("pressure", [0.0, 0.3, 2.0, 5.9, 6.5])
def test_what_goes_through_the_valve_goes_through_the_line(opening: float, pressure: float) -> None:
    air = regulator(line=0.9)

    def excess(outlet: float) -> float:
        near, far = outlet + ATMOSPHERE, pressure + ATMOSPHERE
        root = math.sqrt(abs(near**2 - far**2)) / 0.9
        return valve_flow(air, opening, outlet) - math.copysign(root, near - far)

    found, outlet = through(air, opening, pressure)
    expected = brentq(excess, 0.0, 8.0) if opening else pressure
    assert found == pytest.approx(valve_flow(air, opening, outlet), abs=2e-6)
    # Nearly equal pressures: the flow is laminar there, and takes less pressure.
    if abs(math.log((outlet + ATMOSPHERE) / (pressure + ATMOSPHERE))) > 0.03:
        assert outlet == pytest.approx(expected, abs=1e-4)
    assert through(regulator(), opening, pressure) == (
        valve_flow(air, opening, pressure),
        pressure,
    )
