"""Prediction band: calibrated on one recording, shown on another."""

import sys

import numpy as np
from matplotlib.figure import Figure

import mckibben
from mckibben import example
from mckibben.signals import random_wave

(train,) = mckibben.read(example.TRAIN)
(held_out,) = mckibben.read(example.TEST)
banded = mckibben.calibrate(mckibben.fit("gpi", train), held_out).model
t = np.arange(2000) * 0.02
pressure = random_wave(t, max_frequency=0.2, low=1.0, high=5.0, seed=3)
rig = mckibben.load_rig("mas20-hanging")
new = rig.run(mckibben.Recording({"pressure": pressure}, 0.02), seed=3)
found = banded.simulate(new)
figure = Figure(figsize=(7, 3.5), layout="constrained")
axis = figure.subplots()
lower, upper = found["displacement_lower"], found["displacement_upper"]
axis.fill_between(t, lower, upper, alpha=0.35, label=f"band, level {banded.band.level:.0%}")
axis.plot(t, new["displacement"], "k", lw=1, label="virtual muscle")
axis.set(xlabel="time [s]", ylabel="displacement [mm]", xlim=(10, 40))
axis.legend()
figure.savefig(sys.argv[1], dpi=150)
