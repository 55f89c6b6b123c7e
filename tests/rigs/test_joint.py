"""The antagonistic joint: laws of its physics, and its protocol on joints of other sizes."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from mckibben import DataError, Recording
from mckibben.arrays import Array
from mckibben.rigs import Rig, load_rig, record
from mckibben.rigs.setups.joint import Joint
from mckibben.signals import irregular_triangle
from mckibben.signals.protocol import protocol, scaling
from tests.refusals import refused

STEP, GRAVITY = 0.01, 9.81
JOINT = load_rig("antagonistic-joint")


def joint(**fields: Any) -> Joint:
    """Return the published joint with load cells in its tendons, and other fields."""
    known = JOINT.model_dump()
    sensors = known["sensor"] | {"force": {}}
    return Joint.model_validate(known | {"sensor": sensors} | fields)


def waves(seconds: float = 12.0) -> Recording:
    """Return two pressures and a torque that all move, from rest on."""
    time = np.arange(0.0, seconds, STEP)
    first, second = (irregular_triangle(time, 6, 5.5, seed=seed) for seed in (1, 2))
    torque = 3.0 * np.sin(time) ** 2
    return Recording({"pressure_1": first, "pressure_2": second, "torque": torque}, STEP)


def held(first: float, second: float, seconds: float, **channels: Array) -> Recording:
    """Return constant pressures, at which the rig starts too, beside other commands."""
    time = np.arange(0.0, seconds, STEP)
    pressures = {"pressure_1": np.full(time.size, first), "pressure_2": np.full(time.size, second)}
    return Recording(pressures | channels, STEP)


@pytest.mark.parametrize("pressure", [0.0, 1.0, 3.0, 6.0])
def test_equal_pressures_hold_equal_muscles_at_zero_without_gravity(pressure: float) -> None:
    start = {"pressure_1": pressure, "pressure_2": pressure, "torque": 0.0}
    twin = joint(muscle_2=JOINT.model_dump()["muscle_1"], slack=(15, 15), vertical=False)
    run = twin.changed({"start": start}).run(held(pressure, pressure, 3.0), ideal=True)
    assert np.abs(run["angle"]).max() < 1e-9


def test_a_joint_and_its_mirror_image_move_as_mirror_images() -> None:
    known = JOINT.model_dump()
    mirror = joint(
        muscle_1=known["muscle_2"],
        muscle_2=known["muscle_1"],
        slack=known["slack"][::-1],
        hanging=-known["hanging"],
        payload=1.0,
    )
    given = waves()
    swapped = Recording(
        {
            "pressure_1": given["pressure_2"],
            "pressure_2": given["pressure_1"],
            "torque": -given["torque"],
        },
        STEP,
    )
    one, other = joint(payload=1.0).run(given, ideal=True), mirror.run(swapped, ideal=True)
    assert np.ptp(one["angle"]) > 0.5
    for name, image in (("angle", "angle"), ("torque", "torque")):
        np.testing.assert_allclose(other[image], -one[name], atol=1e-6)
    np.testing.assert_allclose(other["force_2"], one["force_1"], atol=1e-4)


def test_a_tendon_only_pulls_and_carries_nothing_while_slack() -> None:
    run = joint().run(waves(), ideal=True)
    for name in ("force_1", "force_2"):
        assert run[name].min() == 0.0
        assert run[name].max() > 100.0
    start = {"pressure_1": 3.0, "pressure_2": 0.0, "torque": 0.0}
    # the muscle without pressure is longer than its ends are apart
    slack = joint(slack=(19.0, 30.0), start=start).run(held(3.0, 0.0, 3.0), ideal=True)
    shortened = 30.0 - 28.0 * slack["angle"]
    assert shortened.min() > 5.0
    assert (slack["force_2"] == 0.0).all()
    assert (slack["force_1"] > 20.0).all()


def test_slack_tendons_leave_a_pendulum() -> None:
    """With no pressure and long tendons the arm swings as the textbook's equation says."""
    settled = {"start": {"torque": 2.0}, "settling_time": 100.0}
    limp = joint(slack=(60.0, 60.0), friction=0.0, damping=30.0, payload=0.5, **settled)
    time = np.arange(0.0, 5.0, STEP)
    torque = np.where(time < STEP / 2, 2.0, 0.0)  # let go within the first step
    run = limp.run(held(0.0, 0.0, 5.0, torque=torque), ideal=True)
    hanging, inertia = math.radians(limp.hanging), limp.arm_inertia + 0.5 * 0.25**2
    moment = GRAVITY * (0.8 * 0.12 + 0.5 * 0.25)

    def rates(t: float, state: Array) -> list[float]:
        pulled = 2.0 * max(1.0 - t / STEP, 0.0)
        weight = moment * math.sin(state[0] - hanging)
        return [state[1], -(weight + 0.03 * state[1] + pulled) / inertia]

    first = [hanging - math.asin(2.0 / moment), 0.0]
    solved = solve_ivp(rates, (0, time[-1]), first, t_eval=time, rtol=1e-9, max_step=STEP / 4)
    assert np.ptp(run["angle"]) > 1.0
    np.testing.assert_allclose(run["angle"], solved.y[0], atol=5e-4)


def potential(rig: Joint, run: Recording) -> Array:
    """Return the energy of weight, bladders and compressed braids at constant pressures [J]."""
    angle = run["angle"]
    moment = rig.arm_mass * rig.arm_centre + rig.payload * rig.reach
    total = -1e-3 * GRAVITY * moment * np.cos(angle - math.radians(rig.hanging))
    for k, sign in ((1, 1.0), (2, -1.0)):
        muscle = getattr(rig, f"muscle_{k}")
        x = rig.slack[k - 1] + sign * rig.radius[k - 1] * angle
        share, tilt = 1 - x / muscle.length, math.radians(muscle.braid_angle)
        s = share**2
        q = (1 - s * math.cos(tilt) ** 2) / math.sin(tilt) ** 2
        rubber = math.pi * (muscle.diameter - muscle.wall) * muscle.wall * muscle.length
        stretched = muscle.c10 * (s + q + 1 / (s * q)) + muscle.c01 * (1 / s + 1 / q + s * q)
        radius = muscle.diameter / 2
        a, b = 3 / math.tan(tilt) ** 2, 1 / math.sin(tilt) ** 2
        w = 1 - muscle.end_cap * x / muscle.length
        volume = a * muscle.length * (1 - w**3) / (3 * muscle.end_cap) - b * x
        pushed = 0.1 * run[f"pressure_{k}"].mean() * math.pi * radius**2 * volume
        total += 1e-3 * (rubber * stretched - pushed)
    return total


def test_energy_falls_from_turn_to_turn_at_constant_pressures() -> None:
    """The arm is let go: at every turn, where it rests for a moment, less energy is left."""
    start = {"pressure_1": 3.0, "pressure_2": 3.0, "torque": 5.0}
    air = JOINT.air.model_dump() | {"dead_volume": 1e4, "polytropic": 1.0}
    known = JOINT.model_dump()
    parts = {
        f"muscle_{k}": known[f"muscle_{k}"]
        | {
            "contact_pressure": 0.0,
            "creep": {"stiffness": (1e-9,), "time": (1.0,)},
            "friction": {
                "stiffness": (1e-9,),
                "contracting": (0.0,),
                "extending": (0.0,),
                "preload": 0.0,
                "viscosity": 0.01,
            },
        }
        for k in (1, 2)
    }
    rig = joint(start=start, air=air, payload=1.0, friction=0.0, **parts)
    run = rig.run(held(3.0, 3.0, 4.0, torque=np.zeros(400)), ideal=True)
    angle = run["angle"]
    turns = 1 + np.flatnonzero(np.diff(np.sign(np.diff(angle))))
    assert turns.size > 6
    assert all(np.ptp(run[f"pressure_{k}"]) < 0.05 for k in (1, 2))
    left = potential(rig, run)[turns]
    assert (np.diff(left) < 1e-4 * np.ptp(left)).all()
    assert left[0] - left[-1] > 0.1


@pytest.mark.parametrize(("first", "second"), [(4.0, 2.0), (3.0, 3.0), (6.0, 0.0), (1.0, 2.0)])
def test_at_rest_torques_balance(first: float, second: float) -> None:
    rig = joint(payload=1.0, friction=0.0, damping=0.0)
    time = np.arange(0.0, 60.0, STEP)
    rise = np.minimum(time / 2.0, 1.0)
    given = Recording({"pressure_1": first * rise, "pressure_2": second * rise}, STEP)
    last = rig.run(given, ideal=True).slice(5900, 6000)
    sine = np.sin(last["angle"] - math.radians(rig.hanging))
    reach, arm = 1e-3 * rig.reach, 1e-3 * rig.arm_mass * rig.arm_centre
    pulls = 1e-3 * (rig.radius[0] * last["force_1"] - rig.radius[1] * last["force_2"])
    # what is left is inertia: the regulators' dead band lets pressures swing by a thousandth of a bar
    acceleration = (last["torque"] - GRAVITY * rig.payload * reach * sine) / rig.payload / reach**2
    assert np.abs(acceleration).max() < 1e-3
    weight = GRAVITY * (arm + rig.payload * reach) * sine
    slowed = (rig.arm_inertia + rig.payload * reach**2) * acceleration
    np.testing.assert_allclose(pulls, weight + slowed, rtol=0, atol=1e-6)


def test_a_seed_determines_a_record() -> None:
    runs = ["random-3"]
    ((_, one),), ((_, again),) = (list(record("antagonistic-joint", runs=runs)) for _ in "12")
    ((_, other),) = record("antagonistic-joint", runs=runs, seed=1)
    assert one == again
    assert one != other
    assert one.meta["role"] == "test"


OTHERS: dict[str, dict[str, Any]] = {
    "half the pressure": {"range.pressure.high": 3.0, "range.torque.high": 2.0},
    "from half a bar on": {"range.pressure.low": 0.5, "range.torque.low": 0.0},
    "longer muscles": {"muscle_1.length": 350.0, "muscle_2.length": 330.0, "slack": (35.0, 30.0)},
    "a smaller pulley": {"radius": (15.0, 18.0), "slack": (19.0, 17.0)},
}


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("changes", OTHERS.values(), ids=OTHERS)
def test_the_protocol_fits_other_joints(changes: dict[str, Any]) -> None:
    rig = JOINT.changed(changes)
    plan = protocol("antagonistic-joint", rig)
    for run in plan.runs:
        for name, samples in run.inputs.channels.items():
            limits = rig.limits(name)
            assert limits.low <= samples.min() <= samples.max() <= limits.high, (run.name, name)
    names = ["loops-3bar", "random-5-1.5kg", "let-go-3bar"]
    for run, recording in record(plan, rig, runs=names):
        assert "saturated" not in recording.meta
        assert np.ptp(recording["angle"]) > (0.03 if run.name.startswith("let") else 0.4)
    factors = {one.what: one.factor for one in scaling("antagonistic-joint", rig)}
    share = rig.limits("pressure_1").high / 6.0
    assert factors["payload [kg]"] == pytest.approx(share)
    assert factors["pressure_2 [bar]"] == pytest.approx(share)


def test_a_joint_that_no_torque_can_load_is_recorded_without() -> None:
    known = JOINT.model_dump()
    ranges, sensors = {"pressure": known["range"]["pressure"]}, dict(known["sensor"])
    del sensors["torque"]
    bare: Rig = Joint.model_validate(known | {"range": ranges, "sensor": sensors, "start": {}})
    assert bare.inputs == ("pressure_1", "pressure_2")
    plan = protocol("antagonistic-joint", bare)
    assert {channel for run in plan.runs for channel in run.inputs.channels} == {*bare.inputs}
    ((_, recording),) = record(plan, bare, runs=["loops-3bar-1kg"])
    assert {*recording.channels} == {"pressure_1", "pressure_2", "angle"}


def test_a_muscle_that_pushes_is_refused() -> None:
    with refused(DataError, names="muscle_2"):
        JOINT.changed({"muscle_2.kind": "extensor", "muscle_2.braid_angle": 60.0})
