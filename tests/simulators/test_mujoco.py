"""Fitted muscles in MuJoCo: its memory, its energy, and the same motion as the model gives alone."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from mckibben import PI, muscles
from mckibben.blocks.coupled.balance import Balance
from mckibben.blocks.coupled.load_estimate import LoadEstimate
from mckibben.blocks.force.laws import TonduLopez
from mckibben.blocks.force.multistate_friction import MultistateFriction
from mckibben.errors import DataError, ModelError
from tests.tools import needs

mujoco = pytest.importorskip("mujoco")

from mckibben.simulators.mujoco import Muscle, with_muscles  # noqa: E402

Array = NDArray[np.float64]

LIFT = """
<mujoco>
  <option timestep="{step}" integrator="{integrator}"/>
  <worldbody>
    <body>
      <joint name="lift" type="slide" axis="0 0 -1" damping="{damping}"/>
      <geom type="sphere" size="0.05" mass="{mass}"/>
    </body>
  </worldbody>
  <tendon><fixed name="muscle"><joint joint="lift" coef="1"/></fixed></tendon>
</mujoco>
"""
"""A mass that hangs on a muscle."""

MASS = 20.0
WEIGHT = 9.81 * MASS
FITTED = muscles.load("mas20-hanging").balance
QUICK = replace(FITTED, lags=(), relaxation=((),), damping=(0.0,), lines=(), settled=True)
"""The same muscle without anything that takes time."""


@pytest.fixture(autouse=True)
def no_callback() -> Iterator[None]:
    mujoco.set_mjcb_act_bias(None)
    yield
    mujoco.set_mjcb_act_bias(None)


def lift(
    model: Any = QUICK,
    *,
    step: float = 0.001,
    mass: float = MASS,
    damping: float = 0.0,
    integrator: str = "Euler",
    compiled: bool = False,
    **options: Any,
) -> Any:
    text = LIFT.format(step=step, mass=mass, damping=damping, integrator=integrator)
    spec = mujoco.MjSpec.from_string(text)
    muscle = Muscle(model, pressures=(0.0, 6.0), **options)
    return with_muscles(spec, {"muscle": muscle}, compiled=compiled)


def run(
    model: Any, seconds: float, pressure: Callable[[float], float], data: Any = None
) -> tuple[Array, Any]:
    """Return shortening [mm], pull [N] and pressure [bar] before every step, and the data."""
    data = mujoco.MjData(model) if data is None else data
    told = np.empty((round(seconds / model.opt.timestep), 3))
    for row in told:
        data.ctrl[0] = pressure(data.time)
        mujoco.mj_step(model, data)
        row[:] = -1000 * data.actuator_length[0], -data.actuator_force[0], data.ctrl[0]
    return told, data


def wave(t: float) -> float:
    return float(3.0 - 2.5 * np.cos(2 * np.pi * t) * np.exp(-0.2 * t))


def test_it_goes_where_its_model_says() -> None:
    """By what it pulls and its pressure, the model's own equilibrium is where it is, loop and all."""
    told, _ = run(lift(damping=100.0), 40.0, lambda t: 3.0 - 2.5 * np.cos(2 * np.pi * t / 20))
    said = QUICK.inverse().simulate(told[:, [2, 1]])[:, 0]
    np.testing.assert_allclose(told[:, 0], said, atol=1e-9)
    up, down = told[24000], told[36000]  # at the same pressure
    assert down[0] - up[0] > 1.0
    assert np.median(np.abs(told[20000:, 1] - WEIGHT)) < 0.02 * WEIGHT


@pytest.mark.parametrize("pressure", [1.0, 3.0, 5.0])
def test_friction_takes_energy_and_never_gives_any(pressure: float) -> None:
    """It never gives back more than it held when the mass was let go, at any time of the oscillation."""
    told, _ = run(lift(pulls_only=False), 3.0, lambda _: pressure)
    without = LoadEstimate(replace(QUICK, friction=((0.0,) * len(QUICK.limits),)))
    friction = told[:, 1] - without.simulate(told[:, [0, 2]])[:, 0]
    work = np.cumsum(0.5 * (friction[1:] + friction[:-1]) * np.diff(told[:, 0]))
    limits = np.array(QUICK.limits) * (pressure + QUICK.grip)
    held = 0.5 * np.sum(QUICK.friction[0] * limits**2)
    assert work.max() <= held
    tops = [abs(part).max() for part in np.split(told[:, 0] - told[-500:, 0].mean(), 6)]
    assert work[-1] < -10.0  # N mm
    assert np.ptp(told[-500:, 0]) < 0.2 * np.ptp(told[:500, 0])
    assert all(after <= before for before, after in pairwise(tops))


def test_a_reset_forgets_everything_and_a_saved_state_carries_the_memory() -> None:
    model = lift(FITTED)
    first, data = run(model, 0.5, wave)
    kind = mujoco.mjtState.mjSTATE_INTEGRATION
    saved = np.empty(mujoco.mj_stateSize(model, kind))
    mujoco.mj_getState(model, data, saved, kind)
    went_on, _ = run(model, 0.3, wave, data)
    other = mujoco.MjData(model)
    mujoco.mj_setState(model, other, saved, kind)
    np.testing.assert_array_equal(run(model, 0.3, wave, other)[0], went_on)
    mujoco.mj_resetData(model, data)
    np.testing.assert_array_equal(run(model, 0.5, wave, data)[0], first)
    # asked for forces elsewhere at each step, it goes the same way
    asked = mujoco.MjData(model)
    for row in first:
        asked.ctrl[0] = wave(asked.time)
        here = asked.qpos[0]
        asked.qpos[0] = here + 0.02
        mujoco.mj_forward(model, asked)
        asked.qpos[0] = here
        mujoco.mj_step(model, asked)
        assert -1000 * asked.actuator_length[0] == row[0]


def test_every_muscle_has_a_memory_of_its_own() -> None:
    text = LIFT.format(step=0.001, mass=1.0, damping=5.0, integrator="implicitfast").replace(
        "</tendon>", '<fixed name="other"><joint joint="lift" coef="-1"/></fixed></tendon>'
    )
    spec = mujoco.MjSpec.from_string(text)
    muscle = Muscle(QUICK, zero=0.01)
    model = with_muscles(spec, {"muscle": muscle, "other": muscle})
    data = mujoco.MjData(model)
    for k in range(2000):
        data.ctrl[:] = 2.0 + np.sin(0.005 * k), 2.0 - np.sin(0.005 * k)
        mujoco.mj_step(model, data)
    stops = data.userdata.reshape(2, -1)
    assert model.nuserdata == 2 * (2 + 2 * LoadEstimate(QUICK).n_states)
    assert not np.allclose(stops[0], stops[1])
    # by symmetry the other half of the wave is the mirror of this one
    assert data.actuator_length[0] == -data.actuator_length[1]


@needs("cc")
def test_exported_c_gives_the_same_motion() -> None:
    in_python, _ = run(lift(FITTED), 0.5, wave)
    mujoco.set_mjcb_act_bias(None)
    model = lift(FITTED, compiled=True)
    in_c, data = run(model, 0.5, wave)
    np.testing.assert_allclose(in_c, in_python, rtol=1e-9)
    mujoco.mj_resetData(model, data)
    np.testing.assert_array_equal(run(model, 0.5, wave, data)[0], in_c)
    model.opt.timestep = 0.002
    with pytest.raises(mujoco.FatalError, match="time step"):
        mujoco.mj_step(model, data)


def test_force_laws_and_friction_by_length() -> None:
    """A model of length is told the tendon's length without what is no muscle."""
    law = TonduLopez(200.0, 20.0, 0.45)
    model = lift(law, zero=-0.18)
    data = mujoco.MjData(model)
    data.ctrl[0] = 2.0
    mujoco.mj_forward(model, data)
    (pull,) = law.simulate([[180.0, 2.0]])[0]
    assert -data.actuator_force[0] == pytest.approx(pull, rel=1e-12)
    assert pull > 100.0
    told, _ = run(lift(MultistateFriction.example(), pulls_only=False, mass=200.0), 0.2, wave)
    assert np.isfinite(told).all()
    assert told[:, 1].min() < 0 or told[:, 1].max() > 0


def test_a_lag_fills_the_muscle_slowly() -> None:
    model = lift(lag=0.1, damping=400.0)
    _, data = run(model, 0.1, lambda _: 4.0)
    assert data.act[0] == pytest.approx(4.0 * (1 - np.exp(-1.0)), rel=1e-6)


def test_what_cannot_be_a_muscle_is_refused() -> None:
    for model in (PI.example(), Balance.example(), replace(QUICK, mass=(0.01,))):
        with pytest.raises(ModelError):
            lift(model)
    spec = mujoco.MjSpec.from_string(LIFT.format(step=0.001, mass=1, damping=0, integrator="Euler"))
    with pytest.raises(DataError, match="biceps"):
        with_muscles(spec, {"biceps": Muscle(QUICK)})
    model = lift(integrator="RK4")
    with pytest.raises(ModelError, match="RK4"):
        mujoco.mj_step(model, mujoco.MjData(model))
    mujoco.set_mjcb_act_bias(lambda m, d, k: 0.0)
    with pytest.raises(ModelError):  # as there is another callback
        lift()


def test_muscles_that_are_alike_share_a_number() -> None:
    zeros = (0.0, 0.1, 0.0, 0.1)
    numbers = [float(lift(QUICK, zero=zero).actuator_biasprm[0, 0]) for zero in zeros]
    assert numbers[:2] == numbers[2:]
    assert numbers[0] != numbers[1]
