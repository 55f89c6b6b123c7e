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
from mckibben.blocks.compose import Series
from mckibben.blocks.core.block import Block
from mckibben.blocks.dynamic.transfer_function import TransferFunction
from mckibben.blocks.memoryless.negative import Negative
from mckibben.recording import Recording

LAGS = 20
"""Of the test for whiteness."""

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
        That they count.
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
    block: Block, recordings: Sequence[Recording], left: Sequence[Array], n_effective: float
) -> Criteria:
    """Return the criteria of a model on recordings.

    Parameters
    ----------
    left : sequence of array, shape (n, m)
        Residuals of the free run.
    n_effective : float
        Independent samples that these are worth.
    """
    n_parameters = int(np.count_nonzero(block.pack()))
    ahead = _one_step(block, recordings)
    if ahead is not None:
        left, noise = ahead
        n_parameters += noise
    of = "the free run" if ahead is None else "one step ahead"
    together = np.concatenate(left)
    n = len(together)
    none = Criteria(None, None, None, n, n_parameters, of)
    if n <= n_parameters + LAGS or not np.isfinite(together).all():
        return _without(none, "there are too few samples, or the model's output is not finite")
    if min(_whiteness(left)) < SURE:
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
    turned = 1.0
    if isinstance(block, Series) and len(block.parts) == 2 and isinstance(block.parts[1], Negative):
        block, turned = block.parts[0], -1.0
    if not isinstance(block, TransferFunction):
        return None
    name = block.output.name
    found = []
    for recording in recordings:
        measured = turned * recording[name]
        risen = recording.with_channels({name: recording.units[name]}, **{name: measured})
        found.append((measured - block.predict(risen)[name])[:, np.newaxis])
    return found, len(block.noise_numerator) + len(block.noise_denominator)


def _whiteness(left: Sequence[Array]) -> list[float]:
    """Return the p-value of Ljung and Box's test of every output, over all runs together."""
    from scipy.stats import chi2

    found = []
    for j in range(left[0].shape[1]):
        series = [e[:, j] for e in left if len(e) > LAGS]
        n = sum(map(len, series))
        power = sum(float(e @ e) for e in series)
        if not power > 0:
            found.append(1.0)
            continue
        statistic = 0.0
        for lag in range(1, LAGS + 1):
            r = sum(float(e[lag:] @ e[:-lag]) for e in series) / power
            statistic += r * r / (n - lag)
        found.append(float(chi2.sf(n * (n + 2) * statistic, LAGS)))
    return found
