"""Planned recordings: the test error of a model decreases over three rounds on a virtual muscle."""

import sys

import numpy as np
from matplotlib.figure import Figure

import mckibben
from mckibben.estimators.coupled.balance import BalanceEstimator
from mckibben.signals import random_wave, triangle

STEP = 0.05
rig = mckibben.load_rig("mas20-hanging")
time = np.arange(0, 60, STEP)


def recorded(pressure: np.ndarray, seed: int) -> mckibben.Recording:
    """Return a run of the virtual muscle."""
    return rig.run(mckibben.Recording({"pressure": pressure}, STEP), seed=seed)


new = recorded(random_wave(time, 0.3, 6.0, seed=1), seed=1)
runs = [recorded(triangle(time[:800], 10.0, 5.0), seed=0)]
names = ["one triangle", "and a planned minute", "and another"]
figure = Figure(figsize=(7, 3.8), layout="constrained")
axis = figure.subplots()
for place, name in enumerate(names):
    if place:
        planned = mckibben.plan(runs, rig=rig, minutes=1, seed=place).recording
        runs.append(rig.run(planned, seed=10 + place))
    model = BalanceEstimator().fit(runs).model_
    error = (model.simulate(new)["displacement"] - new["displacement"])[100:]
    rms = np.sqrt(np.mean(error**2))
    axis.plot(new.time[100:], error, lw=1.2, label=f"{name}: {rms:.2f} mm RMS")
axis.set(xlabel="time [s]", ylabel="test error [mm]")
axis.legend(loc="upper right")
figure.savefig(sys.argv[1], dpi=150)
