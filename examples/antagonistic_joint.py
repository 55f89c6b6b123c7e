"""A joint between two muscles in MuJoCo: backlash, and friction that grows with what it carries.

    pip install 'mckibben[mujoco]'
    python examples/antagonistic_joint.py docs/pictures/antagonistic_joint.png

Two muscles pull at a pulley, one against the other; their pressures go up and down by turns about a
common one, or the forearm is moved by hand. The muscle is one of the library; give your own model as a
second argument (``mckibben fit balance`` on recordings with a measured force).
"""

import sys

import mujoco
import numpy as np
from matplotlib.figure import Figure

import mckibben
from mckibben.blocks.base import Block
from mckibben.simulators.mujoco import Muscle, with_muscles

Loop = tuple[np.ndarray, np.ndarray]

JOINT = """
<mujoco>
  <option timestep="0.002" integrator="implicitfast"/>
  <worldbody>
    <body pos="0 0 1">
      <joint name="elbow" type="hinge" axis="0 1 0" damping="0.05"/>
      <geom type="capsule" size="0.02" fromto="0 0 0 0 0 -0.3" mass="0.5"/>
      <body pos="0 0 -0.3"><geom name="hand" type="sphere" size="0.03" mass="{load}"/></body>
    </body>
  </worldbody>
  <tendon>
    <fixed name="flexor"><joint joint="elbow" coef="0.02"/></fixed>
    <fixed name="extensor"><joint joint="elbow" coef="-0.02"/></fixed>
  </tendon>
</mujoco>
"""
"""A pulley of 20 mm, and a forearm of 0.3 m with something in its hand [kg]."""

PERIOD, TRAVEL = 8.0, 1.2
"""Of the pressures' difference: period [s] and amplitude [bar]."""

REST = 0.015
"""How much both muscles have shortened where the joint is straight [m]."""


def joint(muscle: Block, load: float) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """Return the joint with two muscles alike."""
    spec = mujoco.MjSpec.from_string(JOINT.format(load=load))
    fitted = Muscle(muscle, zero=REST, pressures=(0.0, 6.0))
    model = with_muscles(spec, {"flexor": fitted, "extensor": fitted})
    return model, mujoco.MjData(model)


def moved_by_pressures(muscle: Block, common: float) -> Loop:
    """Return half the difference of the pressures [bar] and the angle [degrees] over one cycle."""
    model, data = joint(muscle, load=1.0)
    told = []
    while data.time < 1.6 * PERIOD:
        difference = TRAVEL * np.sin(2 * np.pi * data.time / PERIOD)
        data.ctrl[:] = common + difference, common - difference
        mujoco.mj_step(model, data)
        told.append((data.time, difference, -np.degrees(data.qpos[0])))
    return cycle(told)


def moved_by_hand(muscle: Block, common: float) -> Loop:
    """Return the angle [degrees] and the muscles' torque [N m] over one cycle."""
    model, data = joint(muscle, load=0.0)
    told = []
    while data.time < 1.6 * PERIOD:
        data.qpos[0] = 0.3 * np.sin(2 * np.pi * data.time / PERIOD)
        data.ctrl[:] = common
        mujoco.mj_forward(model, data)
        told.append((data.time, -np.degrees(data.qpos[0]), -data.qfrc_actuator[0]))
        data.time += model.opt.timestep
    return cycle(told)


def cycle(told: list[tuple[float, float, float]]) -> Loop:
    """Return the second and third numbers from when all has settled."""
    time, x, y = np.array(told).T
    kept = time >= 0.6 * PERIOD
    return x[kept], y[kept]


def width(x: np.ndarray, y: np.ndarray) -> float:
    """Return how far apart the ways there and back are in the middle."""
    return float(np.ptp(y[:-1][np.diff(np.sign(x)) != 0]))


def main() -> None:
    muscle: Block
    if len(sys.argv) > 2:
        muscle = mckibben.load(sys.argv[2])
    else:
        muscle = mckibben.muscles.load("mas20-hanging").balance
    figure = Figure(figsize=(9, 3.6), layout="constrained")
    left, right = figure.subplots(1, 2)
    for common in (1.5, 3.0, 4.5):
        loop = moved_by_pressures(muscle, common)
        left.plot(*loop, label=f"both at {common:g} bar: {width(*loop):.1f}° apart")
        loop = moved_by_hand(muscle, common)
        right.plot(*loop, label=f"both at {common:g} bar: {width(*loop):.2f} N m apart")
    left.set(title="backlash: moved by the muscles, 1 kg in the hand")
    left.set(xlabel="half the difference of the pressures [bar]", ylabel="angle [degrees]")
    right.set(title="friction by load: moved by hand")
    right.set(xlabel="angle [degrees]", ylabel="torque of the muscles [N m]")
    for axis in (left, right):
        axis.legend()
    figure.savefig(sys.argv[1], dpi=120)


if __name__ == "__main__":
    main()
