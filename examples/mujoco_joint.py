"""A joint between two fitted muscles in MuJoCo, from plain XML: conventions and hysteresis.

    mckibben export mjcf model.json --rest-length 530 --example joint -o joint.xml
    python examples/mujoco_joint.py joint.xml docs/pictures/mujoco_joint.png

Left: meaning of the numbers in the file. Right: the pressures of the two muscles vary in opposite
directions around a common mean; the joint returns on another branch.
"""

import sys

import mujoco
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

PERIOD, SWING = 8.0, 0.8
"""Period [s] and amplitude [bar] of the pressure difference."""

ARROW = {"arrowstyle": "<->", "color": "0.3", "shrinkA": 0, "shrinkB": 0}


def draw_conventions(axes: Axes) -> None:
    """Draw a muscle at rest and a shortened one, with the names used in the file."""
    for y, length, title in ((1.0, 1.0, "no pressure"), (0.0, 0.72, "pressure p")):
        axes.plot([0, length], [y, y], lw=9, color="#4c78a8", solid_capstyle="butt", alpha=0.6)
        axes.plot([0, length], [y, y], "ko", ms=5)
        axes.text(0.02, y + 0.11, title, fontsize=9)
    axes.annotate("", (0, 0.75), (1, 0.75), arrowprops=ARROW)
    axes.text(0.5, 0.78, "rest length: springlength", ha="center", fontsize=9)
    axes.annotate("", (0, -0.2), (0.72, -0.2), arrowprops=ARROW)
    axes.text(0.36, -0.32, "tendon length [m]", ha="center", fontsize=9)
    axes.annotate("", (0.72, -0.2), (1, -0.2), arrowprops=ARROW)
    axes.text(0.86, -0.32, "displacement y > 0", ha="center", fontsize=9)
    axes.annotate("", (0.45, 0), (0.7, 0), arrowprops={"arrowstyle": "->", "lw": 2})
    axes.text(0.36, 0.1, "pull: actuator_force < 0", fontsize=9)
    axes.text(0, 1.25, "site_from", ha="center", fontsize=9)
    axes.text(1, 1.25, "site_to", ha="center", fontsize=9)
    axes.set(xlim=(-0.12, 1.15), ylim=(-0.45, 1.4))
    axes.axis("off")


def loop(model: mujoco.MjModel, common: float) -> np.ndarray:
    """Return half the difference of the pressures [bar] and the angle [degrees] over one cycle."""
    data, rows = mujoco.MjData(model), []
    while data.time < 1.6 * PERIOD:
        difference = SWING * np.sin(2 * np.pi * data.time / PERIOD)
        data.ctrl[:] = common + difference, common - difference
        mujoco.mj_step(model, data)
        if data.time >= 0.6 * PERIOD:
            rows.append((difference, np.degrees(data.qpos[0])))
    return np.array(rows)


def main() -> None:
    model = mujoco.MjModel.from_xml_path(sys.argv[1])
    figure = Figure(figsize=(9, 3.4), layout="constrained")
    left, right = figure.subplots(1, 2)
    draw_conventions(left)
    for common in (1.5, 2.0, 3.0):
        difference, angle = loop(model, common).T
        crossings = angle[:-1][np.diff(np.sign(difference)) != 0]
        right.plot(difference, angle, label=f"{common:g} bar: {np.ptp(crossings):.1f}° backlash")
    right.set(xlabel="half the difference of the pressures [bar]", ylabel="angle [degrees]")
    right.legend(title="common pressure")
    figure.savefig(sys.argv[2], dpi=120)


if __name__ == "__main__":
    main()
