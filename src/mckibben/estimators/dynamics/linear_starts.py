"""What linear estimators share: runs started as fitted, and covariances that stand coloured noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Literal, Self

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.estimators.core.data import Mask, TrainingData
from mckibben.estimators.core.single import SingleEstimator
from mckibben.estimators.core.uncertainty import (
    relative_sizes,
    sensitivities,
    told_by_runs,
)
from mckibben.estimators.optimisers.tracker import Progress
from mckibben.recording import Recording


@dataclass(kw_only=True, repr=False, eq=False)
class LinearEstimator(SingleEstimator):
    """An estimator of a linear dynamic model.

    Parameters
    ----------
    initial : {"fitted", "first_sample", "virgin"}
        State before the first sample of every recording, in the search, in what the fit says of itself
        and, as the rule of the block, after it: with the least squared error; at rest at the first
        input; at rest at the operating point. A model with a fitted start that from rest is further off
        than the output ever moves has let its starts explain the data, and could not run on any other:
        it is then identified from rest, and its block says so.
    """

    initial: Literal["first_sample", "virgin", "fitted"] = "fitted"

    def _fit(
        self,
        recordings: Recording | Sequence[Recording],
        rows: Sequence[Mask] | None,
        validation: Sequence[Recording],
        progress: Progress | None,
    ) -> Self:
        super()._fit(recordings, rows, validation, progress)
        found = self.diagnostics_
        if self.initial != "fitted" or found.interrupted:
            return self
        target = self.data(recordings, rows).target
        if found.rmse_from_rest <= np.ptp(target):
            return self
        settings = self.get_params()
        at_rest = type(self)(**settings | {"initial": "first_sample"})
        at_rest._fit(recordings, rows, validation, progress)
        for name, value in vars(at_rest).items():
            if name not in settings:
                setattr(self, name, value)
        return self

    def undetermined(self) -> tuple[int, ...]:
        """Return the places of what the recordings do not determine; the input's offset is chosen."""
        names = self.fitted.parameter_names
        return tuple(place for place in super().undetermined() if names[place] != "input offset")

    def free_run_covariance(
        self, block: Block, data: TrainingData, fixed: Sequence[int]
    ) -> tuple[float, Array]:
        """Return the condition and covariance of what was found by free-run errors; NaN where fixed.

        The derivatives are those with every start solved for. Residuals may be coloured, and are taken
        not to depend on the input; see `uncertainty`.
        """
        values = block.pack()
        covariance = np.full((values.size, values.size), np.nan)
        free = [place for place in range(values.size) if place not in fixed]
        sizes = relative_sizes(values)
        slopes = sensitivities(block, free, sizes[free], partial(self.free_runs, data=data))
        if not np.isfinite(slopes).all():
            return np.inf, covariance
        residual = data.target - self.free_runs([block], data)[0]
        condition, own = told_by_runs(slopes, residual, data.runs)
        covariance[np.ix_(free, free)] = own * np.outer(sizes[free], sizes[free])
        return condition, covariance
