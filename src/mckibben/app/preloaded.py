"""What jobs need, loaded once by the process that they are forked from."""

from __future__ import annotations

import numba
import scipy.optimize as optimize

import mckibben.app.work as work
import mckibben.comparison.ranking as ranking
import mckibben.control as control

__all__ = ["control", "numba", "optimize", "ranking", "work"]
