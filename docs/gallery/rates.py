"""Rate dependence: the loop of a virtual muscle widens with the frequency."""

import sys

import numpy as np
from matplotlib.figure import Figure

import mckibben

rig = mckibben.load_rig("rail")
figure = Figure(figsize=(5, 4), layout="constrained")
axis = figure.subplots()
for period in (20.0, 4.0, 1.0):
    t = np.arange(0, 3 * period, 0.005)
    voltage = 4.0 - 3.5 * np.cos(2 * np.pi * t / period)
    run = rig.run(mckibben.Recording({"voltage": voltage, "force": 0 * t}, 0.005))
    last = run.time >= 2 * period
    axis.plot(run["voltage"][last], run["displacement"][last], label=f"{1 / period:g} Hz")
axis.set(xlabel="valve voltage [V]", ylabel="displacement [mm]")
axis.legend()
figure.savefig(sys.argv[1], dpi=150)
