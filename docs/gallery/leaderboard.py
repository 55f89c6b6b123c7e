"""Leaderboard: four models fitted to one recording, selected by cross-validation, tested on another."""

import sys

import mckibben
from mckibben import example
from mckibben.report.figures import write_figure

(train,) = mckibben.read(example.TRAIN)
(test,) = mckibben.read(example.TEST)
board = mckibben.compare(train, test, models=["pi", "gpi", "mpi", "preisach"])
write_figure(board, sys.argv[1], "errors")
