"""The parts of the physics: each against a law or an independent reference."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from mckibben.rigs import load_rig
from mckibben.rigs.parameters import Muscle
from mckibben.rigs.physics.air import (
    AIR,
    LAMINAR_RATIO,
    flow,
    line_flow,
    through,
    valve_flow,
    valve_target,
)
from mckibben.rigs.physics.bladder import bladder_force
from mckibben.rigs.physics.braid import NEUTRAL_ANGLE, braid_area, braid_constants, braid_volume
from mckibben.rigs.physics.compiled import ATMOSPHERE, NEWTON_PER_BAR_MM2
from mckibben.rigs.physics.friction import slip
from mckibben.rigs.physics.muscle import MUSCLE_STATE, chamber, longest, prepare, relax, tension
from mckibben.rigs.setups.moving_end import MovingEnd
from tests.rigs.energy import bladder_energy

ANGLES = st.floats(15.0, 80.0)
SHARES = st.floats(-0.03, 0.3)


def bare(**changes: object) -> Muscle:
    """Return a muscle without friction, creep or viscosity."""
    rig = load_rig("mas20-hanging")
    assert isinstance(rig, MovingEnd)
    still = rig.changed(
        {
            "muscle.friction.stiffness": (1e-9,) * 6,
            "muscle.friction.contracting": (0.0,) * 6,
            "muscle.friction.extending": (0.0,) * 6,
            "muscle.friction.viscosity": 0.0,
            "muscle.creep.stiffness": (1e-9, 1e-9),
            **{f"muscle.{name}": value for name, value in changes.items()},
        }
    )
    return still.muscle


def pull_at(muscle: Muscle, x: float, pressure: float) -> float:
    record, state = muscle.record()[0], np.zeros(1, MUSCLE_STATE)[0]
    state["x"], state["pressure"] = x, pressure
    prepare(record, state, 0.0, 1e-3)
    return float(tension(record, state, x, 1e-3)[0])


@given(ANGLES, st.floats(0.8, 1.6), SHARES)
def test_braid_area_is_the_slope_of_the_volume(angle: float, end_cap: float, share: float) -> None:
    a, b = braid_constants(angle)
    shape = (300.0, a, b, end_cap, 200.0)
    x, h = share * 200.0, 1e-3
    slope = (braid_volume(*shape, x + h) - braid_volume(*shape, x - h)) / (2 * h)
    area, area_slope = braid_area(*shape, x)
    assert area == pytest.approx(slope, rel=1e-6, abs=1e-4)
    steeper = (braid_area(*shape, x + h)[0] - braid_area(*shape, x - h)[0]) / (2 * h)
    assert area_slope == pytest.approx(steeper, rel=1e-6, abs=1e-6)


@given(ANGLES, st.floats(0.0, 0.25))
def test_a_cylinder_pulls_as_chou_and_hannaford_say(angle: float, contraction: float) -> None:
    # F = p b² (3 cos² - 1) / (4 pi n²), with thread length b and n turns; D = b sin / (n pi).
    turns = 1.5
    thread = 200.0 / math.cos(math.radians(angle))
    cosine = (1 - contraction) * math.cos(math.radians(angle))
    expected = 0.1 * thread**2 * (3 * cosine**2 - 1) / (4 * math.pi * turns**2)
    diameter = thread * math.sin(math.radians(angle)) / (turns * math.pi)
    a, b = braid_constants(angle)
    area, _ = braid_area(math.pi * diameter**2 / 4, a, b, 1.0, 200.0, 200.0 * contraction)
    assert NEWTON_PER_BAR_MM2 * area == pytest.approx(expected, rel=1e-9, abs=1e-9)


def test_at_the_neutral_angle_nothing_pulls() -> None:
    a, b = braid_constants(NEUTRAL_ANGLE)
    assert pytest.approx(54.7356, abs=1e-4) == NEUTRAL_ANGLE
    assert braid_area(300.0, a, b, 1.0, 200.0, 0.0)[0] == pytest.approx(0.0, abs=1e-9)


@given(st.floats(18.0, 70.0), SHARES, st.floats(0.0, 2.0), st.floats(0.0, 2.0))
def test_bladder_force_is_the_slope_of_its_energy(
    angle: float, share: float, c10: float, c01: float
) -> None:
    cos2, sin2 = math.cos(math.radians(angle)) ** 2, math.sin(math.radians(angle)) ** 2
    x, h = 200.0 * share, 1e-3
    if (1 - share) ** 2 * cos2 > 0.97:
        return  # the threads lie along the axis
    rubber = (1e4 * c10, 1e4 * c01, cos2, sin2, 200.0)
    slope = (bladder_energy(*rubber, x + h) - bladder_energy(*rubber, x - h)) / (2 * h)
    force, force_slope = bladder_force(*rubber, x)
    assert force == pytest.approx(slope, rel=1e-4, abs=1e-2)
    steeper = (bladder_force(*rubber, x + h)[0] - bladder_force(*rubber, x - h)[0]) / (2 * h)
    assert force_slope == pytest.approx(steeper, rel=1e-4, abs=1e-2)


def test_a_bladder_at_rest_is_at_ease_and_locks_when_stretched() -> None:
    cos2, sin2 = math.cos(math.radians(25.0)) ** 2, math.sin(math.radians(25.0)) ** 2
    rubber = (2000.0, 500.0, cos2, sin2, 200.0)
    assert bladder_force(*rubber, 0.0)[0] == pytest.approx(0.0, abs=1e-9)
    longer = [bladder_force(*rubber, -200.0 * share)[0] for share in (0.02, 0.05, 0.09, 0.1)]
    steps = np.diff([0.0, *longer])
    assert (np.diff(steps[:3]) < 0).all()
    assert longer[-1] < 10 * longer[0] < 0


@settings(max_examples=60)
@given(st.floats(-0.04, 0.25), st.floats(0.05, 5.0), st.floats(0.01, 1.0))
def test_pull_and_room_come_from_one_potential(
    share: float, pressure: float, contact: float
) -> None:
    # Maxwell's relation: the pull's change with pressure is the room's change with length.
    muscle = bare(contact_pressure=contact)
    x, h = 200.0 * share, 1e-4
    by_pressure = (pull_at(muscle, x, pressure + h) - pull_at(muscle, x, pressure - h)) / (2 * h)
    record = muscle.record()[0]
    rooms = [chamber(record, x + d, pressure)[0] for d in (-1e-3, 1e-3)]
    by_length = (rooms[1] - rooms[0]) / 2e-3
    assert by_pressure == pytest.approx(NEWTON_PER_BAR_MM2 * by_length, rel=1e-4, abs=1e-3)
    room, area, give = chamber(record, x, pressure)
    assert area == pytest.approx(by_length, rel=1e-4, abs=1e-2)
    pressed = (chamber(record, x, pressure + h)[0] - chamber(record, x, pressure - h)[0]) / (2 * h)
    assert give == pytest.approx(pressed, rel=1e-3, abs=1.0)
    assert room > 0


@given(st.floats(-0.05, 0.3), st.floats(0.0, 6.0))
def test_the_slope_of_the_pull_is_its_slope(share: float, pressure: float) -> None:
    muscle = bare()
    x, h = 200.0 * share, 1e-4
    if x - h < longest(muscle.record()[0]):
        return
    record, state = muscle.record()[0], np.zeros(1, MUSCLE_STATE)[0]
    state["x"], state["pressure"] = x, pressure
    prepare(record, state, 0.0, 1e-3)
    rise = tension(record, state, x + h, 1e-3)[0] - tension(record, state, x - h, 1e-3)[0]
    assert tension(record, state, x, 1e-3)[1] == pytest.approx(rise / (2 * h), rel=1e-4, abs=1e-3)


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


def test_elements_remember_an_unfinished_excursion() -> None:
    # Wiping-out: a small cycle within a large one leaves no trace once it is closed.
    elements = [(8.0, 2.0, 1.5), (4.0, 3.0, 2.0), (1.0, 4.0, 3.0)]

    def forces(path: list[float]) -> list[float]:
        held = [0.0] * len(elements)
        for moved in np.diff([0.0, *path]):
            held = [
                slip(f, k, up, down, moved)[0]
                for f, (k, up, down) in zip(held, elements, strict=True)
            ]
        return held

    assert forces([3.0, 1.0, 2.0, 1.0, 0.5]) == pytest.approx(forces([3.0, 0.5]))
    assert forces([3.0, 1.0]) != pytest.approx(forces([1.0]))


def test_relax_is_the_solution_of_its_equation() -> None:
    stiffness, time, speed, step = 2.0, 0.7, 3.0, 0.5
    kept = math.exp(-step / time)
    found = relax(5.0, kept, stiffness * time * (1 - kept) / step, speed * step)
    solved = solve_ivp(
        lambda _, f: stiffness * speed - f / time, (0, step), [5.0], rtol=1e-10, atol=1e-12
    )
    assert found == pytest.approx(solved.y[0, -1], rel=1e-8)


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


def test_flow_is_continuous_where_it_becomes_laminar() -> None:
    below, above = (flow(1.0, 5.0, 5.0 * (LAMINAR_RATIO + d), 0.3) for d in (-1e-9, 1e-9))
    assert below == pytest.approx(above, rel=1e-6)


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


def test_an_opening_fills_or_vents() -> None:
    air = regulator()
    assert valve_flow(air, 1.0, 0.0) == pytest.approx(2.0 * (6.0 + ATMOSPHERE))
    assert valve_flow(air, -1.0, 5.0) == pytest.approx(-1.0 * (5.0 + ATMOSPHERE))
    assert valve_flow(air, 0.0, 3.0) == 0.0
    assert valve_flow(air, 1.0, 6.0) == 0.0
    assert valve_flow(air, 1.0, 8.0) < 0.0
    assert valve_flow(air, -1.0, 0.0) == 0.0
    assert valve_flow(air, -1.0, -0.2) > 0.0


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


def test_a_line_takes_pressure_with_the_square_of_the_flow() -> None:
    air = regulator(line=0.5)
    squares = [(outlet + ATMOSPHERE) ** 2 - (2.0 + ATMOSPHERE) ** 2 for outlet in (2.2, 3.0, 5.0)]
    flows = [line_flow(air, outlet, 2.0) for outlet in (2.2, 3.0, 5.0)]
    assert np.square(flows) * 0.5**2 == pytest.approx(squares)
    assert line_flow(air, 2.0, 5.0) == pytest.approx(-flows[-1])


def test_a_regulator_has_a_dead_band_and_limits() -> None:
    air = regulator()
    assert valve_target(air, 2.0, 1.95) == 0.0
    assert valve_target(air, 2.0, 1.5) == pytest.approx(0.5 * 0.4)
    assert valve_target(air, 2.0, 2.5) == pytest.approx(-0.5 * 0.4)
    assert valve_target(air, 6.0, 0.0) == 1.0
    assert valve_target(air, 0.0, 6.0) == -1.0
