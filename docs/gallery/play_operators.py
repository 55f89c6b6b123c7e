"""Play operators: a Prandtl-Ishlinskii model is their weighted sum."""

import sys

import numpy as np
from matplotlib.figure import Figure

import mckibben
from mckibben.signals import decaying_triangle

pressure = decaying_triangle(np.arange(2000) * 0.02, period=10.0, high=4.0, low=0.0)
figure = Figure(figsize=(8, 3), layout="constrained")
axes = figure.subplots(1, 3)
for axis, threshold in zip(axes, (0.25, 1.0), strict=False):
    axis.plot(pressure, mckibben.PI(thresholds=(threshold,), weights=(1.0,)).simulate(pressure))
    axis.set(title=f"threshold {threshold} bar", xlabel="pressure [bar]")
model = mckibben.PI(thresholds=(0.0, 0.25, 0.5, 1.0), weights=(4.0, 2.0, 2.0, 3.0))
axes[2].plot(pressure, model.simulate(pressure))
axes[2].set(title="sum of four", xlabel="pressure [bar]", ylabel="displacement [mm]")
axes[0].set_ylabel("output [bar]")
figure.savefig(sys.argv[1], dpi=150)
