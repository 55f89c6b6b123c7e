"""The march through time: against an independent integrator, and laws of conservation."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from mckibben.recording import Recording
from mckibben.rigs import load_rig
from mckibben.rigs.setups.moving_end import MovingEnd
from mckibben.signals import sine

ATMOSPHERE = 1.013


def frictionless(viscosity: float = 0.3) -> MovingEnd:
    """Return the hanging muscle with viscosity and creep, but nothing that switches."""
    rig = load_rig("mas20-hanging")
    assert isinstance(rig, MovingEnd)
    return rig.changed(
        {
            "muscle.friction.stiffness": (1e-9,) * 6,
            "muscle.friction.contracting": (0.0,) * 6,
            "muscle.friction.extending": (0.0,) * 6,
            "muscle.friction.viscosity": viscosity,
            "air.dead_band": 0.0,
            "tare": False,
        }
    )


def rates_by_hand(rig: MovingEnd, command: Callable[[float], float]) -> Callable[..., list[float]]:
    """Write the equations of a hanging muscle down once more, from the text books.

    State: shortening [mm], speed, pressure [bar], valve, forces of the two creep branches [N].
    """
    muscle, air = rig.muscle, rig.air
    mass = rig.moved_mass + rig.payload
    length, radius = muscle.length, muscle.diameter / 2
    angle = math.radians(muscle.braid_angle)
    a, b = 3 / math.tan(angle) ** 2, 1 / math.sin(angle) ** 2
    inner = radius - muscle.wall
    rubber = math.pi * (radius**2 - inner**2) * length
    rest_room, c = math.pi * inner**2 * length, muscle.contact_pressure
    fold = c * rest_room

    def energy(x: float) -> float:
        s = (1 - x / length) ** 2
        q = (1 - s * math.cos(angle) ** 2) / math.sin(angle) ** 2
        return rubber * (
            muscle.c10 * (s + q + 1 / (s * q) - 3) + muscle.c01 * (1 / s + 1 / q + s * q - 3)
        )

    def gained(x: float) -> float:
        w = 1 - muscle.end_cap * x / length
        return math.pi * radius**2 * (a * length * (1 - w**3) / (3 * muscle.end_cap) - b * x)

    def out(x: float) -> float:
        v = gained(x)
        return 0.5 * (v + math.sqrt(v * v + fold * fold) - fold)

    def potential(x: float, p: float) -> float:
        acting = p - c * (1 - math.exp(-p / c))
        return 0.1 * (acting * out(x) + p * (gained(x) - out(x)))

    def room(x: float, p: float) -> float:
        share = 1 - math.exp(-p / c)
        return rest_room + gained(x) - out(x) + share * out(x) + 1e3 * air.dead_volume

    def iso_flow(conductance: float, up: float, down: float) -> float:
        r, critical = down / up, air.critical_ratio
        if r >= 1:
            return 0.0
        off = max((min(r, 0.98) - critical) / (1 - critical), 0.0)
        straight = min((1 - r) / 0.02, 1.0)
        return float(conductance * up * math.sqrt(1 - off**2) * straight)

    def rates(t: float, state: np.ndarray) -> list[float]:
        x, speed, p, valve, *creep = state
        h = 1e-4
        pull = (potential(x + h, p) - potential(x - h, p) - energy(x + h) + energy(x - h)) / (2 * h)
        pull -= muscle.friction.viscosity * speed + sum(creep)
        acceleration = (pull - mass * 9.81) / mass * 1e3
        target = min(max(air.gain * (command(t) - p), -1.0), 1.0)
        inside, supply = p + ATMOSPHERE, air.supply + ATMOSPHERE
        flow = (
            iso_flow(air.fill * valve, supply, inside)
            if valve > 0
            else -iso_flow(-air.vent * valve, inside, ATMOSPHERE)
        )
        by_x = (room(x + h, p) - room(x - h, p)) / (2 * h)
        by_p = (room(x, p + h) - room(x, p - h)) / (2 * h)
        filling = 1e6 * flow - inside * by_x * speed
        return [
            speed,
            acceleration,
            filling / (room(x, p) / air.polytropic + inside * by_p),
            (target - valve) / air.valve_time,
            *(
                k * speed - f / time
                for k, time, f in zip(muscle.creep.stiffness, muscle.creep.time, creep, strict=True)
            ),
        ]

    return rates


def test_a_smooth_rig_agrees_with_an_independent_integrator() -> None:
    rig = frictionless()
    step = 0.01
    time = np.arange(0, 6.0, step)
    wave = sine(time, 2.0, 4.5, 1.0)
    run = rig.run(Recording({"pressure": wave}, step), ideal=True)
    states, motion = rig._at_rest()
    first = [
        states["x"][0],
        motion["speed"][0, 0],
        states["pressure"][0],
        states["valve"][0],
        *states["creep"][0, :2],
    ]
    solved = solve_ivp(
        rates_by_hand(rig, lambda t: float(np.interp(t, time, wave))),
        (0, time[-1]),
        first,
        method="LSODA",
        t_eval=time,
        rtol=1e-7,
        atol=1e-8,
        max_step=0.01,
    )
    assert run["displacement"] == pytest.approx(solved.y[0], abs=0.03)
    assert run["pressure"] == pytest.approx(solved.y[2], abs=0.003)
    assert np.ptp(run["displacement"]) > 25


def works(run: Recording, first: int) -> tuple[float, float]:
    """Return the work that air does in a run [N mm], and the work done on what is pulled."""
    volume = 1e3 * run["volume"][first:]
    mean = 0.5 * (run["pressure"][first + 1 :] + run["pressure"][first:-1])
    moved = np.diff(run["displacement"][first:])
    force = 0.5 * (run["force"][first + 1 :] + run["force"][first:-1])
    return float(0.1 * mean @ np.diff(volume)), float(force @ moved)


@pytest.mark.parametrize("seed", range(2))
def test_closed_cycles_of_pressure_and_load_make_no_energy(seed: int) -> None:
    rig = load_rig("rail").changed(
        {"return_force": 0.0, "guide_friction": 0.0, "start.force": 20.0, "moved_mass": 0.05}
    )
    step, period = 0.002, 10.0
    time = np.arange(0, 3 * period + step / 2, step)
    rng = np.random.default_rng(seed)
    phases = rng.uniform(0, 2 * np.pi, 2)
    volt = 5.0 + 3.0 * np.sin(2 * np.pi * time / period + phases[0])
    volt += np.sin(4 * np.pi * time / period)
    pull = 80.0 + 50.0 * np.sin(2 * np.pi * time / period + phases[1])
    run = rig.run(Recording({"voltage": volt, "force": pull}, step), ideal=True)
    given, done = works(run, 2 * round(period / step))
    lost = given - done
    assert lost > 0
    assert lost > 0.02 * abs(given)
