"""Compensation: no compensation, an inverse model, and the inverse model with feedback."""

import sys

import numpy as np
from matplotlib.figure import Figure

import mckibben
from mckibben import example
from mckibben.control import before, control_law, track, tune_pid

(train,) = mckibben.read(example.TRAIN)
inverse = mckibben.GPIEstimator().fit(train).model_.inverse()
rig = mckibben.load_rig("mas20-hanging")
pid = tune_pid(rig, sample_time=0.02)
t = np.arange(1500) * 0.02
wave = 18 - 7 * np.cos(2 * np.pi * t / 10) - 3 * np.cos(2 * np.pi * t / 3.7)
reference = mckibben.Recording({"displacement": wave}, 0.02)
runs = {
    "no compensation": before(inverse, rig, reference).tracked,
    "inverse model": track(inverse, rig, reference),
    "inverse model and PID": track(
        control_law("feedforward-pid", inverse, lambda: pid), rig, reference
    ),
}
figure = Figure(figsize=(7, 5), layout="constrained")
motion, error = figure.subplots(2, sharex=True)
for name, run in runs.items():
    moved = run.recording["displacement"][-t.size :]
    motion.plot(t, moved, lw=1.2, label=name)
    error.plot(t, moved - wave, lw=1.2)
motion.plot(t, wave, "k--", lw=1, label="desired motion")
motion.set(ylabel="displacement [mm]", ylim=(6, 34))
motion.legend(ncols=2, fontsize=8, loc="upper right")
error.set(xlabel="time [s]", ylabel="error [mm]")
figure.savefig(sys.argv[1], dpi=150)
