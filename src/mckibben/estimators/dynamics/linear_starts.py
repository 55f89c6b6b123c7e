"""What linear estimators share: starts fitted with the rest, unless they explain the data alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from mckibben.estimators.core.data import Mask
from mckibben.estimators.core.estimator import Estimator, Initial
from mckibben.estimators.optimisers.tracker import Progress
from mckibben.recording import Recording


@dataclass(kw_only=True, repr=False, eq=False)
class LinearEstimator(Estimator):
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

    input: str = "pressure"
    output: str = "displacement"
    initial: Initial = "fitted"

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
