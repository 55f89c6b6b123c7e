"""Hysteresis: nested loops of a virtual muscle."""

import sys

import numpy as np

import mckibben
from mckibben.report.figures import write_figure
from mckibben.signals import decaying_triangle

time = np.arange(4500) * 0.02
pressure = decaying_triangle(time, period=10.0, high=5.5, low=1.0)
recording = mckibben.load_rig("mas20-hanging").run(mckibben.Recording({"pressure": pressure}, 0.02))
write_figure(recording, sys.argv[1], "loop")
