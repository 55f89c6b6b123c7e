"""Description of a model on recordings: equations, and parameters with uncertainty."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.coupled.balance import balance_in
from mckibben.blocks.equations import Quantity, quantities, written
from mckibben.blocks.free_runs import FreeRuns
from mckibben.blocks.inverse import commands
from mckibben.blocks.notation import Written
from mckibben.errors import DataError, ModelWarning
from mckibben.estimators.core.uncertainty import (
    autoregressions,
    covariance_of,
    unknown,
    vanishing,
)
from mckibben.estimators.coupled.balance import fixed_in
from mckibben.estimators.coupled.balance_errors import covariance_of_balance
from mckibben.numerics.statistics import NORMAL_95, student
from mckibben.recording import Recording
from mckibben.system.atomic import Numbers

MOST_PARAMETERS = 300
"""Number of parameters above which single parameters are not interpreted."""

MOST_OPERATIONS = 200_000_000
"""Limit of operations for all sensitivities; longer recordings are truncated."""


@dataclass(frozen=True)
class Parameter(Quantity):
    """One parameter of a model.

    Parameters
    ----------
    name, symbol, unit, meaning : str
        As `mckibben.blocks.equations.Quantity` has them.
    value : float
    status : str
        ``estimated``; ``fixed``: chosen, or at a bound; ``undetermined`` by the recordings;
        ``unknown``: no parameter of such a model means anything alone.
    standard_error : float or None
        In its unit; None unless it is estimated.
    interval : (float, float) or None
        In which it lies by 95 %.
    """

    value: float
    status: str
    standard_error: float | None
    interval: tuple[float, float] | None


@dataclass(frozen=True, eq=False)
class ModelDescription(Numbers):
    """Description of a model, with uncertainties.

    Parameters
    ----------
    written : Written
        Its equations with its numbers, in LaTeX.
    parameters : tuple of Parameter
        In the order of ``block.pack()``.
    recordings : tuple of str
        Names of those that all this rests on.
    fitted : bool
        Whether the model was fitted to them.
    """

    written: Written
    parameters: tuple[Parameter, ...]
    recordings: tuple[str, ...]
    fitted: bool


def describe(
    block: Block, recordings: Sequence[Recording], *, fitted: bool = True
) -> ModelDescription:
    """Describe a model on recordings, usually its training data.

    Standard errors are those of a least-squares fit of the free run to these recordings, as a fit has
    them in its diagnostics: they hold where residuals are autocorrelated.

    Parameters
    ----------
    block : Block
        The model.
    recordings : sequence of Recording
        With its inputs and outputs.
    fitted : bool
        Whether the model was fitted to these recordings.

    Raises
    ------
    DataError
        If there are no recordings, or a channel is absent.
    """
    if not recordings:
        raise DataError("there are no recordings to describe a model on", remedy="give one or more")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ModelWarning)
        covariance, half = uncertainty(block, recordings)
    names = tuple(recording.name for recording in recordings)
    return ModelDescription(written(block), parameters(block, covariance, half), names, fitted)


def uncertainty(block: Block, recordings: Sequence[Recording]) -> tuple[Array, float]:
    """Return the covariance of a model's parameters, NaN if unknown, and a half width in errors."""
    share = min(1.0, MOST_OPERATIONS / max(_operations(block, recordings), 1.0))
    shortened = [r.slice(0, max(round(share * len(r)), min(len(r), 50))) for r in recordings]
    share = sum(map(len, shortened)) / sum(map(len, recordings))
    if _means_nothing(block):
        return unknown(block), np.nan
    runs = FreeRuns.of(block, shortened)
    if not np.isfinite(runs.residual).all():
        return unknown(block), np.nan
    if balance_in(block) is not None:
        return share * covariance_of_balance(runs, fixed_in(block))[1], NORMAL_95
    covariance = share * covariance_of(runs, np.flatnonzero(fixed(block)).tolist())[1]
    pairs = zip(runs.runs, runs.modelled, strict=True)
    residuals = [np.where(r.counts[:, None], r.outputs - modelled, np.nan) for r, modelled in pairs]
    n = sum(int(rows.sum()) for rows in runs.rows)
    n_effective = min(m.effective_sample_size(n) for m in autoregressions(residuals)) / share
    freedom = n_effective - np.isfinite(np.diag(covariance)).sum()
    return covariance, student(max(freedom, 1.0))


def parameters(block: Block, covariance: Array, half_width: float) -> tuple[Parameter, ...]:
    """Return every entry of ``block.pack()``, in order, with its meaning and uncertainty.

    Values that are rounding compared with the others, such as a weight of 1e-17, are shown as 0.
    """
    values, errors, is_fixed = block.pack(), np.sqrt(np.diag(covariance)), fixed(block)
    is_known = np.isfinite(errors)
    otherwise = "unknown" if _means_nothing(block) else "undetermined"
    status = np.where(is_known, "estimated", np.where(is_fixed, "fixed", otherwise)).tolist()
    shown = np.where(vanishing(values), 0.0, values)
    ends = np.transpose(shown + half_width * np.outer([-1, 1], errors))
    return tuple(
        Parameter(
            *(
                quantity.name,
                quantity.symbol,
                quantity.unit,
                quantity.meaning,
                float(shown[place]),
                status[place],
            ),
            float(errors[place]) if is_known[place] else None,
            (float(ends[place, 0]), float(ends[place, 1])) if is_known[place] else None,
        )
        for place, quantity in enumerate(quantities(block))
    )


def fixed(block: Block) -> NDArray[np.bool_]:
    """Return the parameters that are not fitted: exactly 0 or 1, or the operating point."""
    values = block.pack()
    about = [name.endswith("input offset") for name in block.parameter_names]
    return np.asarray(vanishing(values) | (values == 1) | about)


def _means_nothing(block: Block) -> bool:
    """Return whether standard errors of single parameters are meaningless, as in large networks."""
    return not 0 < block.n_parameters <= MOST_PARAMETERS or commands(block)


def _operations(block: Block, recordings: Sequence[Recording]) -> float:
    """Return about how many operations all sensitivities take."""
    per_sample = 2 * block.n_parameters + 4 * block.n_states
    return float(per_sample * block.n_parameters * sum(map(len, recordings)))
