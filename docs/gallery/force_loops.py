"""Force over length at constant pressure: loops of a virtual muscle in a test stand."""

import sys

import numpy as np
from matplotlib.figure import Figure

import mckibben

stand = mckibben.load_rig("mas10-test-stand")
t = np.arange(3000) * 0.02
length = 190.0 + 8.0 * np.cos(2 * np.pi * t / 20)
figure = Figure(figsize=(5, 4), layout="constrained")
axis = figure.subplots()
for pressure in (2.0, 3.0, 4.0, 5.0):
    run = stand.run(mckibben.Recording({"pressure": 0 * t + pressure, "length": length}, 0.02))
    last = run.time >= 20.0
    axis.plot(run["length"][last], run["force"][last], label=f"{pressure:g} bar")
axis.set(xlabel="length [mm]", ylabel="force [N]")
axis.legend()
figure.savefig(sys.argv[1], dpi=150)
