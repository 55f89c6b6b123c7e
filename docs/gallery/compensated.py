"""Open loop, feedback, and both: a virtual muscle follows a wave."""

import sys

import numpy as np
from matplotlib.figure import Figure

import mckibben
from mckibben import example
from mckibben.control import control_law, track, tune_pid

(train,) = mckibben.read(example.TRAIN)
inverse = mckibben.GPIEstimator().fit(train).model_.inverse()
rig = mckibben.load_rig("mas20-hanging")
pid = tune_pid(rig, sample_time=0.02)
t = np.arange(1500) * 0.02
reference = mckibben.Recording({"displacement": 18 - 10 * np.cos(2 * np.pi * t / 10)}, 0.02)
figure = Figure(figsize=(7, 3.5), layout="constrained")
axis = figure.subplots()
for law in ("feedforward", "pid", "feedforward-pid"):
    found = track(control_law(law, inverse, lambda: pid), rig, reference).recording
    kept = found.time >= 0
    error = found["displacement"] - found["reference_displacement"]
    axis.plot(found.time[kept], error[kept], label=law)
axis.set(xlabel="time [s]", ylabel="error [mm]")
axis.legend()
figure.savefig(sys.argv[1], dpi=150)
