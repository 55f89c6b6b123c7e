"""Creep: displacement continues after pressure steps, differently in either direction."""

import sys

import numpy as np
from matplotlib.figure import Figure

import mckibben

levels = np.repeat([1.0, 2.0, 3.0, 4.0, 3.0, 2.0, 1.0], 1000)
run = mckibben.load_rig("mas20-hanging").run(mckibben.Recording({"pressure": levels}, 0.02))
figure = Figure(figsize=(7, 3.5), layout="constrained")
axis = figure.subplots()
for start in (1000, 2000, 4000, 5000):
    part = run["displacement"][start : start + 1000]
    settled = part - part[100]
    way = "rising" if levels[start] > levels[start - 1] else "falling"
    axis.plot(np.arange(1000) * 0.02, settled, label=f"{levels[start]:g} bar, {way}")
axis.set(xlabel="time after the step [s]", ylabel="change since 2 s [mm]", ylim=(-1, 1))
axis.legend()
figure.savefig(sys.argv[1], dpi=150)
