"""Information criteria, where they mean something: where residuals are white.

AIC = n ln(det V) + 2 p, BIC = n ln(det V) + p ln n, FPE = det V (1 + p / n) / (1 - p / n), of n samples
and p parameters, V the residuals' covariance; constants are left out. All three count every sample as
news: of residuals that remember they would praise large models, and are not given.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.recording import Recording
from mckibben.validation.k_step import linear, predicted
from mckibben.validation.parameters import fixed
from mckibben.validation.whiteness import whiteness

SURE = 0.01
"""Level at which residuals are not white."""


@dataclass(frozen=True)
class Criteria:
    """AIC, BIC and FPE.

    Parameters
    ----------
    aic, bic, fpe : float or None
        None where they mean nothing; the last in squared units of the outputs, multiplied.
    n_samples, n_parameters : int
        That they count; numbers that are chosen or at a bound are none.
    of : str
        Which residuals they are of.
    said : str
        Why they are not given; empty where they are.
    """

    aic: float | None
    bic: float | None
    fpe: float | None
    n_samples: int
    n_parameters: int
    of: str
    said: str = ""


def criteria(
    block: Block,
    recordings: Sequence[Recording],
    left: Sequence[Array],
    n_effective: float,
    fitted: bool = True,
) -> Criteria:
    """Return the criteria of a model on recordings.

    Parameters
    ----------
    left : sequence of array, shape (n, m)
        Residuals of the free run.
    n_effective : float
        Independent samples that these are worth.
    fitted : bool
        Whether the model was fitted to these recordings: of others there are no criteria.
    """
    n_parameters = fixed(block).count("")
    ahead = _one_step(block, recordings)
    if ahead is not None:
        left, noise = ahead
        n_parameters += noise
    of = "the free run" if ahead is None else "one step ahead"
    together = np.concatenate(left)
    n = len(together)
    none = Criteria(None, None, None, n, n_parameters, of)
    if not fitted:
        return _without(
            none, "they judge a model by the recordings that it was fitted to, not by others"
        )
    if n <= n_parameters or not np.isfinite(together).all() or (white := _white(left)) is None:
        return _without(none, "there are too few samples, or the model's output is not finite")
    if not white:
        if ahead is not None:
            return _without(
                none,
                "the residuals one step ahead are not white: try higher orders",
            )
        return _without(
            none,
            f"the free run's residuals are correlated, so {n} samples are worth about "
            f"{round(n_effective)}: compare models by runs that they were not fitted to",
        )
    determinant = float(np.linalg.det(np.atleast_2d(together.T @ together / n)))
    if determinant <= 0:
        return _without(none, "the residuals are 0")
    size = n * np.log(determinant)
    ratio = n_parameters / n
    return Criteria(
        float(size + 2 * n_parameters),
        float(size + n_parameters * np.log(n)),
        determinant * (1 + ratio) / (1 - ratio),
        n,
        n_parameters,
        of,
    )


def _without(criteria: Criteria, said: str) -> Criteria:
    n, p = criteria.n_samples, criteria.n_parameters
    return Criteria(None, None, None, n, p, criteria.of, said)


def _one_step(block: Block, recordings: Sequence[Recording]) -> tuple[list[Array], int] | None:
    """Return errors one step ahead and how many numbers the noise model has; None of other models."""
    found = linear(block)
    if found is None:
        return None
    name, model = block.outputs[0].name, found[0]
    ahead = [(r[name], predicted(block, r, 1)) for r in recordings]
    left = [(y - one)[:, np.newaxis] for y, one in ahead if one is not None]
    return left, len(model.noise_numerator) + len(model.noise_denominator)


def _white(left: Sequence[Array]) -> bool | None:
    """Return whether the residuals of every output are white; None of too few to tell."""
    found = [whiteness([e[:, j] for e in left]).p_value for j in range(left[0].shape[1])]
    known = [p for p in found if p is not None]
    return None if len(known) < len(found) else min(known) * len(known) >= SURE
