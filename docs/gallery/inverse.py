"""Exact inverse: model, inverse, and both in series, which is the identity."""

import sys

import numpy as np
from matplotlib.figure import Figure

import mckibben
from mckibben import example

(train,) = mckibben.read(example.TRAIN)
model = mckibben.GPIEstimator().fit(train).model_
(low,), (high,) = model.reachable()
t = np.arange(3000) * 0.02
desired = low + (high - low) * (0.5 - 0.45 * np.cos(0.6 * t) * np.cos(0.11 * t))
pressure = model.inverse().simulate(desired)
figure = Figure(figsize=(8, 3), layout="constrained")
first, second, third = figure.subplots(1, 3)
first.plot(pressure, model.simulate(pressure))
first.set(title="model", xlabel="pressure [bar]", ylabel="displacement [mm]")
second.plot(desired, pressure)
second.set(title="inverse", xlabel="desired displacement [mm]", ylabel="pressure [bar]")
third.plot(desired, model.simulate(pressure))
third.set(title="in series", xlabel="desired displacement [mm]", ylabel="displacement [mm]")
figure.savefig(sys.argv[1], dpi=150)
