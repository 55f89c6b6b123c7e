"""Free-run simulation: a model fitted to one recording, simulated on another."""

import sys

import mckibben
from mckibben import example
from mckibben.report.figures import write_figure

(train,) = mckibben.read(example.TRAIN)
(test,) = mckibben.read(example.TEST)
model = mckibben.GPIEstimator(n_operators=12, envelope="piecewise-linear").fit(train).model_
write_figure(model, sys.argv[1], "loops", recording=test)
