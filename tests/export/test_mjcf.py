"""A muscle as MJCF: the forces of Python, in any model that has its sites, and nothing but MuJoCo."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from mckibben import workflow
from mckibben.blocks.coupled.load_estimate import LoadEstimate
from mckibben.blocks.hysteresis.pi import PI
from mckibben.errors import DataError, ModelError
from mckibben.exporting.mjcf import Sites, export_mjcf, mjcf
from mckibben.recording import Recording
from mckibben.rigs import load_rig
from mckibben.signals import random_wave
from tests.export.muscle import MUSCLE
from tests.refusals import refused

mujoco = pytest.importorskip("mujoco", minversion="4.0")
pytest.importorskip("gymnasium")

Array = NDArray[np.floating[Any]]

REST = 200.0
HEAVY = 1e7
"""A mass that goes where it is sent, whatever pulls [kg]."""


def compiled(text: str, step: float, mass: float | None = None) -> Any:
    spec = mujoco.MjSpec.from_string(text)
    spec.option.timestep = step
    if mass is not None:
        spec.option.gravity = [0.0, 0.0, 0.0]
        for geom in spec.geoms:
            geom.mass = mass
    return spec.compile()


def pulled(model: Any, shortening: Array, pressure: Array) -> Array:
    """Return shortening [mm], pressure [bar] and pull [N] of a muscle that is led along a path."""
    data = mujoco.MjData(model)
    data.qpos[0] = shortening[0] / 1000
    speed = np.diff(shortening, append=shortening[-1]) / 1000 / model.opt.timestep
    found = np.empty((shortening.size, 3))
    for row, p, v in zip(found, pressure, speed, strict=True):
        data.ctrl[0] = p
        mujoco.mj_step1(model, data)
        mujoco.mj_fwdActuation(model, data)
        row[:] = 1000 * data.qpos[0], p, data.qfrc_passive[0] + data.qfrc_actuator[0]
        data.qfrc_applied[0] = HEAVY * (v - data.qvel[0]) / model.opt.timestep
        mujoco.mj_step2(model, data)
    return found


def triangles(time: Array) -> Array:
    return 10.0 * np.exp(-0.1 * time) * (1.0 - 2.0 / np.pi * np.arcsin(np.cos(np.pi * time)))


def minor_loops(time: Array) -> Array:
    return 12.0 - 12.0 * np.cos(0.4 * np.pi * time) + 2.0 * np.sin(3.0 * np.pi * time) * (time > 1)


def random_motion(time: Array) -> Array:
    return random_wave(time, 1.0, 27.0, -2.0, 0.1, seed=4) * np.minimum(time, 1.0)


@pytest.mark.parametrize("step", [0.001, 0.002])
@pytest.mark.parametrize("motion", [triangles, minor_loops, random_motion])
def test_forces_are_those_of_python(step: float, motion: Callable[[Array], Array]) -> None:
    """All motions leave the shortenings known. MuJoCo damps by the velocity of one step."""
    muscle = replace(MUSCLE, hull=((2.0, 15.0),))
    (damping,) = muscle.damping
    undamped = replace(muscle, damping=(0.0,))
    time = np.arange(0.0, 8.0, step)
    pressure = 3.0 + 2.5 * np.sin(2.0 * time)
    found = pulled(compiled(mjcf(muscle, rest_length=REST), step, HEAVY), motion(time), pressure)
    expected = LoadEstimate(undamped).simulate(found[:, :2], sample_time=step)[:, 0]
    expected -= damping * np.diff(found[:, 0], prepend=found[0, 0]) / step
    later = time > 2.0  # once what the start remembers is wiped out
    assert np.ptp(found[later, 0]) > 10.0
    np.testing.assert_allclose(found[later, 2], expected[later], atol=1e-6 * np.ptp(expected))


def test_a_joint_moves_as_with_the_block_in_the_loop() -> None:
    """The joint's equation of motion, stepped here with two streams, and MuJoCo's."""
    step = 0.0005
    model = compiled(mjcf(MUSCLE, rest_length=REST, example="joint"), step)
    data = mujoco.MjData(model)
    start, end = (np.array(model.site_pos[model.site(f"muscle_1_{e}").id]) for e in ("from", "to"))
    body = model.body("forearm").id
    moment = model.body_mass[body] * 9.81 * -model.body_ipos[body][2]
    streams = [LoadEstimate(MUSCLE).stream(sample_time=step) for _ in range(2)]
    angle = speed = 0.0
    found = np.empty((8000, 2))
    for row in found:
        swing = 2.0 * np.sin(2 * np.pi * 0.5 * data.time)
        pressures = 3.0 + swing, 3.0 - swing
        torque = -moment * np.sin(angle)
        for side, p, stream in zip((1.0, -1.0), pressures, streams, strict=True):
            x, z = end[0] * side * np.cos(angle), -end[0] * side * np.sin(angle)
            to = np.array([x - start[0] * side, z - start[2]])
            length = float(np.hypot(*to))
            (pull,) = stream.step([REST - 1000 * length, p])
            torque -= pull * (to @ np.array([z, -x])) / length
        row[:] = angle, data.qpos[0]
        data.ctrl[:] = pressures
        mujoco.mj_step(model, data)
        speed += step * torque / model.dof_M0[0]
        angle += step * speed
    later = found[2000:]
    assert np.ptp(later[:, 0]) > 0.2
    assert np.abs(later[:, 1] - later[:, 0]).max() < 0.01 * np.ptp(later[:, 0])


def test_it_runs_where_there_is_mujoco_alone(tmp_path: Path) -> None:
    file = export_mjcf(MUSCLE, tmp_path / "muscle.xml", rest_length=REST)
    program = (
        "import sys, mujoco\n"
        "model = mujoco.MjModel.from_xml_path(sys.argv[1])\n"
        "data = mujoco.MjData(model); data.ctrl[0] = 4.0\n"
        "mujoco.mj_step(model, data, nstep=3000)\n"
        "assert model.nplugin == 0 and 'mckibben' not in sys.modules\n"
        "print(1000 * data.qpos[0])\n"
    )
    command = [sys.executable, "-I", "-c", program, str(file)]
    done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=tmp_path)
    data = mujoco.MjData(mujoco.MjModel.from_xml_path(str(file)))
    data.ctrl[0] = 4.0
    mujoco.mj_step(data.model, data, nstep=3000)
    assert float(done.stdout) == 1000 * data.qpos[0] > 1.0


def test_its_body_attaches_to_another_model_and_its_sites_are_anywhere(tmp_path: Path) -> None:
    """Attached, included between sites of another model, or alone: the same motion."""
    alone = mjcf(MUSCLE, rest_length=REST)
    parent = mujoco.MjSpec()
    parent.option.timestep, parent.option.integrator = (
        0.001,
        mujoco.mjtIntegrator.mjINT_IMPLICITFAST,
    )
    child = mujoco.MjSpec.from_string(alone)
    frame = parent.worldbody.add_frame(pos=[1.0, 0.0, 0.0])
    frame.attach_body(child.body("muscle"), "left_", "")
    export_mjcf(
        MUSCLE, tmp_path / "part.xml", rest_length=REST, sites=Sites("top", "bottom"), name="biceps"
    )
    mass = compiled(alone, 0.001).body("muscle_end").mass[0]
    (tmp_path / "mine.xml").write_text(
        '<mujoco><option timestep="0.001" integrator="implicitfast"/><include file="part.xml"/>'
        '<worldbody><site name="top" pos="0 0 0.4"/><body pos="0 0 0.2">'
        f'<joint type="slide" axis="0 0 1"/><geom size="0.02" mass="{mass}"/><site name="bottom"/>'
        "</body></worldbody></mujoco>"
    )
    included = mujoco.MjModel.from_xml_path(str(tmp_path / "mine.xml"))
    assert included.actuator("biceps").id == 0
    ends = []
    for model in (compiled(alone, 0.001), parent.compile(), included):
        data = mujoco.MjData(model)
        data.ctrl[0] = 4.0
        mujoco.mj_step(model, data, nstep=1000)
        ends.append(float(data.qpos[0]))
    np.testing.assert_allclose(ends, ends[0], rtol=1e-9)


@pytest.mark.parametrize("step", [0.0005, 0.004])
@pytest.mark.parametrize("example", ["hanging", "joint", "arm"])
def test_examples_stay_within_their_ranges(example: Any, step: float) -> None:
    model = compiled(mjcf(MUSCLE, rest_length=REST, example=example), step)
    data, random = mujoco.MjData(model), np.random.default_rng(0)
    low, high = model.jnt_range.T
    for _ in range(60):  # pressures jump, at random
        data.ctrl[:] = random.choice([0.0, 6.0], model.nu)
        mujoco.mj_step(model, data, nstep=round(0.1 / step))
        assert (np.abs(data.qpos - 0.5 * (low + high)) < 0.75 * (high - low)).all()


def test_the_regulator_lags() -> None:
    model = compiled(mjcf(MUSCLE, rest_length=REST, lag=0.1), 0.001)
    data = mujoco.MjData(model)
    data.ctrl[0] = 4.0
    mujoco.mj_step(model, data, nstep=100)
    assert data.act[0] == pytest.approx(4.0 * (1.0 - np.exp(-1.0)), rel=1e-6)


@pytest.mark.parametrize(
    "changed",
    [
        {"friction_growth": 0.5},
        {"asymmetry": 1.5},
        {"lags": (1.0,), "relaxation": ((2.0,),)},
        {"areas": ((100.0, -60.0, 5.0),)},
        {"elasticity": ((1.0, 2.0, 3.0),)},
        {"walls": (0.1,)},
        {"lines": (0.1,)},
        {"mass": (0.01,)},
        {"pushes": (10.0,)},
        {"loads": ((),), "scheduled": ()},
    ],
    ids=lambda changed: next(iter(changed)),
)
def test_what_mjcf_does_not_carry_is_refused(changed: dict[str, Any]) -> None:
    with pytest.raises(ModelError):
        mjcf(replace(MUSCLE, **changed), rest_length=REST)


def test_other_models_and_settings_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ModelError):
        mjcf(PI.example(), rest_length=REST)
    with refused(ModelError, parameter="name"):
        mjcf(MUSCLE, rest_length=REST, name="two words")
    MUSCLE.save(tmp_path / "model.json")
    between = {"rest_length": REST, "site_from": "a", "site_to": "b", "example": "joint"}
    for given in ({}, {"rest_length": 20.0}, {"rest_length": REST, "site_from": "a"}, between):
        with pytest.raises(ModelError):
            workflow.export(tmp_path / "model.json", tmp_path / "m.xml", "mjcf", **given)
    file = tmp_path / "mine.xml"
    file.write_text("<mujoco/>")
    with pytest.raises(DataError):
        workflow.export(MUSCLE, file, "mjcf", rest_length=200.0)
    assert file.read_text() == "<mujoco/>"
    workflow.export(MUSCLE, file, "mjcf", rest_length=200.0, force=True)
    assert compiled(file.read_text(), 0.001).actuator(0).name == "mine"


def test_a_fit_for_mjcf_is_exported_and_states_its_price(tmp_path: Path) -> None:
    time = np.arange(0.0, 30.0, 0.02)
    rig = load_rig("mckibben-530").changed({"sample_time": 0.02})
    given = {
        "pressure": random_wave(time, 0.4, 4.0, 0.5, 0.05, seed=1),
        "force": random_wave(time, 0.2, 250.0, 20.0, 0.05, seed=2),
    }
    run = rig.run(Recording(given, 0.02), seed=0)
    found = workflow.fit("balance", run, target="mjcf")
    about = found.to_dict()
    assert 0.0 < about["force_rmse_unlimited"] < about["force_rmse"] < 0.05 * np.ptp(run["force"])
    export_mjcf(found.model, tmp_path / "muscle.xml", rest_length=530.0)
    with refused(DataError, channel="force"):
        workflow.fit("balance", run.select(["pressure", "displacement"]), target="mjcf")
    with pytest.raises(ModelError):
        workflow.fit("pi", run, target="mjcf")


def test_warp_steps_the_stops_too() -> None:
    warp = pytest.importorskip("warp")
    mujoco_warp = pytest.importorskip("mujoco_warp")
    model = compiled(mjcf(MUSCLE, rest_length=REST), 0.001)
    data = mujoco.MjData(model)
    with warp.ScopedDevice("cpu"):
        there = mujoco_warp.put_data(model, data)
        kernels = mujoco_warp.put_model(model)
        for k in range(400):
            data.ctrl[0] = 3.0 + 2.0 * np.sin(0.02 * k)
            there.ctrl.fill_(float(data.ctrl[0]))
            mujoco_warp.step(kernels, there)
            mujoco.mj_step(model, data)
        assert np.abs(there.plastic.numpy()[0] - data.plastic).max() < 1e-5
        assert there.qpos.numpy()[0, 0] == pytest.approx(data.qpos[0], abs=1e-5)


@pytest.fixture(scope="module")
def joint(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("joint") / "joint.xml"
    return export_mjcf(MUSCLE, file, rest_length=REST, example="joint", lag=0.05)


def test_environments_step_as_single_simulations_do(joint: Path) -> None:
    environment = import_module("examples.joint_environment")
    env = environment.JointTracking(joint, 3, duration=1.0, preview=2, threads=2)
    seen, _ = env.reset(seed=5)
    assert seen.shape == env.observation_space.shape == (3, 7)
    data = mujoco.MjData(env.model)
    random = np.random.default_rng(0)
    over, steps = False, 0
    while not over:
        action = random.uniform(-1.2, 1.2, (3, 2)).astype(np.float32)
        reference = seen[1, 2]
        data.ctrl[:] = 3.0 + 3.0 * np.clip(action[1].astype(float), -1.0, 1.0)
        mujoco.mj_step(env.model, data, nstep=20)
        ahead = seen[:, 3]
        seen, reward, terminated, truncated, info = env.step(action)
        assert seen[1, 0] == pytest.approx((data.qpos[0] - env.middle) / env.half_range, abs=1e-6)
        np.testing.assert_array_equal(seen[:, 2], ahead)
        np.testing.assert_allclose(reward, -np.abs(info["error"]) / env.half_range)
        assert not terminated.any()
        over, steps = bool(truncated.all()), steps + 1
    assert steps == 50
    assert abs(reference) <= 1.0
