"""An arm of two sections: its limits, its statics, and what scales with the rig."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from mckibben.arrays import Array
from mckibben.recording import Recording
from mckibben.rigs import load_rig, record
from mckibben.rigs.physics.compiled import GRAVITY
from mckibben.rigs.setups.arm import Arm, Hanging
from mckibben.rigs.setups.two_sections import TwoSections
from mckibben.signals import random_wave, sine
from mckibben.signals.protocol import protocol, scaling

TIME = np.arange(0.0, 30.0, 0.05)
WEIGHTLESS = 1e-6
"""Mass of a disc that weighs nothing [kg]."""

SYMMETRIC = {"radius": [35.0] * 3, "angle": [0.0, 120.0, 240.0]} | {
    f"spread.{name}": [1.0] * 3 for name in ("diameter", "bladder", "friction")
}


def arm(**changes: object) -> TwoSections:
    rig = load_rig("two-section-arm").changed(changes)
    assert isinstance(rig, TwoSections)
    return rig


def both(settings: Mapping[str, object]) -> dict[str, object]:
    """Return settings of a section, for both."""
    return {f"{name}.{key}": x for name in ("proximal", "distal") for key, x in settings.items()}


def driven(rig: Hanging, only: str = "12345678") -> Recording:
    """Return random pressures in some of the muscles, numbered along the rig's inputs."""
    waves = {
        name: random_wave(TIME, 0.1, 2.4, seed=k) * (str(k + 1) in only)
        for k, name in enumerate(rig.inputs)
    }
    return Recording(waves, 0.05)


def moved(rig: Hanging, given: Recording) -> Array:
    names = [name for name in rig.outputs if name.startswith("displacement")]
    return rig.run(given, ideal=True).matrix(names)


def test_with_nothing_below_the_proximal_section_is_the_arm_of_one() -> None:
    rig = arm(**{"distal.disc_mass": WEIGHTLESS, "payload": 0.0})
    alone = load_rig("soft-arm")
    assert isinstance(alone, Arm)
    assert rig.proximal == rig.proximal.model_validate(
        alone.model_dump(include={*type(rig.proximal).model_fields})
    )
    given = driven(rig, "1237")
    single = Recording(
        {name: given[name] for name in alone.inputs[:-1]}
        | {"pressure_extensor": given["pressure_extensor_1"]},
        0.05,
    )
    assert moved(rig, given)[:, :3] == pytest.approx(moved(alone, single), abs=0.01)


def test_weight_below_and_the_pose_above_load_the_other_section() -> None:
    """What a section does under its own pressures depends on the other's, the more the more hangs."""
    change = {}
    for payload in (0.0, 1.0, 2.0):
        rig = arm(payload=payload)
        still, other = driven(rig, "1237"), driven(rig)
        change[payload] = float(np.ptp(moved(rig, other)[:, :3] - moved(rig, still)[:, :3]))
    assert 0.5 < change[0.0] < change[1.0] < change[2.0]
    rig = arm()
    change[1.0] = float(
        np.ptp(moved(rig, driven(rig))[:, 3:] - moved(rig, driven(rig, "4568"))[:, 3:])
    )
    assert change[1.0] > 0.5


def test_equal_pressures_leave_symmetric_sections_straight() -> None:
    rig = arm(**both(SYMMETRIC))
    wave = sine(TIME, 15.0, 2.0)
    found = moved(rig, Recording(dict.fromkeys(rig.inputs[:6], wave), 0.05))
    for section in (found[:, :3], found[:, 3:]):
        assert np.ptp(section[:, 0]) > 10.0
        assert section == pytest.approx(np.tile(section[:, :1], 3), abs=1e-6)


def curved(pose: Array, lengths: tuple[float, float], n: int = 2000) -> Array:
    """Return the heights of both discs [mm] by integrating along two arcs, tilts small.

    ``pose`` has shortening, tilt and tilt across of each section.
    """
    heights, top = [], np.zeros(2)
    height = 0.0
    for (short, *tilts), length in zip(pose.reshape(2, 3), lengths, strict=True):
        along = (np.arange(n) + 0.5) / n
        direction = top + along[:, np.newaxis] * tilts
        height += short + length * float(np.mean(0.5 * (direction**2).sum(axis=1)))
        top = top + tilts
        heights.append(height)
    return np.array(heights)


def test_forces_balance_at_rest() -> None:
    """Pull of the muscles stands against bending and gravity, whose energy is integrated along arcs."""
    rig = arm(tare=False, **both({"bending_presliding": 1e-6}))
    pressures = np.array([1.8, 0.2, 0.6, 0.3, 1.9, 1.1, 0.7, 1.2])
    rise = np.minimum(TIME / 5.0, 1.0)
    commands = np.vstack([rise[:, np.newaxis] * pressures, np.tile(pressures, (1000, 1))])
    system = rig.build()
    state = rig._at_rest().copy()
    traces = system.run(state, rig.demands(commands), 0.05, rig.integration_step, held=False)
    pose, tension = traces.place[-1], traces.tension[-1]
    assert np.abs(pose[[1, 2, 4, 5]]).min() > 0.01
    lengths = rig.proximal.muscle.length, rig.distal.muscle.length
    weights = GRAVITY * np.array([rig.proximal.disc_mass, rig.distal.disc_mass + rig.payload])
    steps = 1e-3 * np.eye(6)
    lift = [
        float(weights @ (curved(pose + step, lengths) - curved(pose - step, lengths))) / 2e-3
        for step in steps
    ]
    bent = np.zeros(6)
    for i, section in enumerate(rig.sections):
        inside = max(float(state.muscles["pressure"][6 + i]), 0.0)
        stiffness = section.bending_stiffness + section.bending_stiffening * inside
        bent[3 * i + 1 : 3 * i + 3] = stiffness * pose[3 * i + 1 : 3 * i + 3]
    pull = system.muscles["levers"].T @ tension
    scale = np.abs(system.muscles["levers"]).T @ np.abs(tension)
    assert np.abs(pull - bent - lift) == pytest.approx(np.zeros(6), abs=2e-3 * scale.max())
    assert (np.abs(pull - bent - lift) < 2e-3 * scale).all()


def test_poses_are_read_as_shortenings() -> None:
    rig = arm()
    pose = np.array([[5.0, 0.0, 0.0, 3.0, 0.1, 0.0]])
    found = rig.shortened(pose)[0]
    assert found[:3] == pytest.approx([5.0] * 3)
    angles = np.radians(rig.distal.angle)
    assert found[3:] == pytest.approx(3.0 + 0.1 * np.array(rig.distal.radius) * np.cos(angles))


def test_a_seed_makes_a_record() -> None:
    rig = arm()
    given = driven(rig)
    assert rig.run(given, seed=1) == rig.run(given, seed=1) != rig.run(given, seed=2)


def test_ageing_reaches_the_muscles_of_both_sections() -> None:
    rig = arm()
    old = rig.aged({"stiffness": 1.5, "friction": 2.0})
    for now, before in zip(old.sections, rig.sections, strict=True):
        for muscle in ("muscle", "extensor"):
            assert getattr(now, muscle).c10 == pytest.approx(1.5 * getattr(before, muscle).c10)


@pytest.mark.filterwarnings("error")
def test_its_protocol_scales_with_the_arm() -> None:
    smaller = arm(
        **{
            "range.pressure.high": 1.25,
            "distal.muscle.length": 250.0,
            "distal.extensor.length": 250.0,
        }
    )
    assert {row.factor for row in scaling("two-sections", smaller)} == {0.5, 1.0}
    plan = protocol("two-sections", smaller)
    names = [next(run.name for run in plan.select(role)) for role in ("train", "test")]
    for run, recording in record(plan, smaller, runs=[*names, plan.runs[-1].name]):
        assert "saturated" not in recording.meta, run.name
        assert recording["pressure_extensor_1"][0] == pytest.approx(
            run.inputs["pressure_extensor_1"][0], abs=0.05
        )
