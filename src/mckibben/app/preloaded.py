"""What the server that jobs are forked from loads, so that no job has to: its import does all of it."""

from __future__ import annotations

import numpy as np
from numba.core.registry import cpu_target

from mckibben import registry
from mckibben.app import modelling as modelling
from mckibben.estimators.catalogue import declared
from mckibben.signals.reversals import reversals

for name in registry.names("estimators"):
    declared(name)
cpu_target.typing_context.refresh()
cpu_target.target_context.refresh()
reversals(np.arange(3.0))
