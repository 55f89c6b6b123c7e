"""Coupling in a soft arm: displacements of all muscles when one is pressurized."""

import sys

import numpy as np
from matplotlib.figure import Figure

import mckibben

t = np.arange(2000) * 0.02
pressures = {f"pressure_{k}": 0 * t for k in (1, 2, 3)}
pressures["pressure_1"] = 1.25 - 1.25 * np.cos(2 * np.pi * t / 10)
figure = Figure(figsize=(8, 3), layout="constrained")
for axis, stiffness in zip(figure.subplots(1, 3, sharey=True), (0.5, 1.25, 2.0), strict=True):
    commands = {**pressures, "pressure_extensor": 0 * t + stiffness}
    found = mckibben.load_rig("soft-arm").run(mckibben.Recording(commands, 0.02))
    for k in (1, 2, 3):
        axis.plot(found["pressure_1"], found[f"displacement_{k}"], label=f"muscle {k}")
    axis.set(xlabel="pressure 1 [bar]", title=f"extensor {stiffness} bar")
figure.axes[0].set_ylabel("displacement [mm]")
figure.axes[0].legend()
figure.savefig(sys.argv[1], dpi=150)
