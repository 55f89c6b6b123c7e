"""Linear models whose fitted starts explain the data alone are identified from rest."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from mckibben.estimators.core.data import Mask
from mckibben.recording import Recording

if TYPE_CHECKING:
    from mckibben.estimators.core.estimator import Estimator


def explained_by_starts(
    estimator: Estimator, recordings: Recording | Sequence[Recording], rows: Sequence[Mask] | None
) -> bool:
    """Return whether a model with fitted starts is, from rest, further off than the output moves.

    Its starts have then explained the data, and it could not run on any other.
    """
    found = estimator.diagnostics_
    return not found.interrupted and bool(
        found.rmse_from_rest > np.ptp(estimator.data(recordings, rows).target)
    )


def fit_from_rest(estimator: Estimator, *given: Any) -> None:
    """Fit an estimator anew with starts at rest; its settings stay."""
    settings = estimator.get_params()
    at_rest = type(estimator)(**settings | {"initial": "first_sample"})
    at_rest._fit(*given)
    for name, value in vars(at_rest).items():
        if name not in settings:
            setattr(estimator, name, value)


def but_input_offset(estimator: Estimator, places: Sequence[int]) -> tuple[int, ...]:
    """Return places of undetermined parameters without the input's offset, which is chosen."""
    names = estimator.fitted.parameter_names
    return tuple(place for place in places if names[place] != "input offset")
