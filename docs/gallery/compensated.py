"""Open loop, feedback, and both: a virtual muscle follows a wave."""

import sys

import numpy as np
from matplotlib.figure import Figure

import mckibben
from mckibben.control import Feedforward, FeedforwardPID, track, tune_pid

(train,) = mckibben.read("examples/decaying-triangle.csv")
inverse = mckibben.GPIEstimator().fit(train).model_.inverse()
rig = mckibben.load_rig("mas20-hanging")
pid = tune_pid(rig, sample_time=0.02)
t = np.arange(1500) * 0.02
reference = mckibben.Recording({"displacement": 18 - 10 * np.cos(2 * np.pi * t / 10)}, 0.02)
figure = Figure(figsize=(7, 3.5), layout="constrained")
axis = figure.subplots()
for name, controller in (
    ("inverse", Feedforward(inverse)),
    ("PID", pid),
    ("inverse and PID", FeedforwardPID(inverse, pid)),
):
    found = track(controller, rig, reference).recording
    kept = found.time >= 0
    error = found["displacement"] - found["reference_displacement"]
    axis.plot(found.time[kept], error[kept], label=name)
axis.set(xlabel="time [s]", ylabel="error [mm]")
axis.legend()
figure.savefig(sys.argv[1], dpi=150)
