"""A model that has seen one recording, running free on another."""

import sys

import mckibben
from mckibben import example
from mckibben.report.figures import plot_model

(train,) = mckibben.read(example.TRAIN)
(test,) = mckibben.read(example.TEST)
model = mckibben.GPIEstimator(n_operators=12, envelope="piecewise-linear").fit(train).model_
plot_model(model, [test], "loops", sys.argv[1])
