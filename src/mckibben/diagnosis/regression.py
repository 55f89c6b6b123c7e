"""Regression of residuals on possible causes, with autocorrelated noise of varying variance.

Noise is an autoregression of the greatest restricted likelihood beside *all* columns (Harville, JASA 72,
1977), so that the freedom that columns take makes it look no rougher than it is. A test has the larger
p-value of two in the whitened series, as either alone rejects too often: the F-test, with the freedom by
which that noise is known (Satterthwaite); and Hotelling's T² by the covariance HC3 (MacKinnon and White,
J. Econometrics 29, 1985). ``benchmarks/validation.py`` measures what comes of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import numpy as np

from mckibben.arrays import Array
from mckibben.statistics import Autoregression, autoregression

MOST_ORDER, SAMPLES_PER_TERM = 6, 16
"""Largest order of the noise model, and samples needed per term."""

SMOOTHEST = 3.8
"""Bound of partial correlations of the noise: at most the tanh of this, 0.999."""

STEP, LEAST_CURVATURE = 0.02, 0.1
"""Step of finite differences of the likelihood, and smallest curvature along a partial correlation.
"""

DEPENDENT, ROUNDING = 1e-9, 1e-12
"""Shares of a column's energy: below the first it is linearly dependent; the second is added for
regularisation.
"""

MOST_LEVERAGE = 0.9
"""Largest leverage of a sample that is corrected for."""

Places = tuple[int, ...]


class FTest(NamedTuple):
    """F test of columns in addition to others.

    Parameters
    ----------
    p_value : float
        Probability that noise alone is followed as well.
    explained, by_noise : float
        Sum of squares that the columns explain beside the others; what they would of noise, on average.
    """

    p_value: float
    explained: float
    by_noise: float


class Regression:
    """Pieces of a series, candidate regressors, and the noise model.

    Parameters
    ----------
    series : sequence of array, shape (n,)
        One per recording; nothing crosses from one into the next.
    columns : sequence of array, shape (n, k)
        A constant is one of them, or there is none.

    Attributes
    ----------
    noise : Autoregression
        What is left when all columns are taken out.
    """

    def __init__(self, series: Sequence[Array], columns: Sequence[Array]) -> None:
        whole = np.column_stack([np.concatenate(columns), np.concatenate(series)])
        size = np.sqrt(np.mean(whole**2, axis=0))
        self._size = np.where(size > 0, size, 1.0)
        self._plain = whole / self._size
        self._ends = np.cumsum([len(piece) for piece in series])[:-1]
        self._partial, self._doubt = self._fitted_noise()
        order, whitener = self._partial.size, _whitener(self._partial)
        unit = Autoregression(-whitener[1:], 1.0, 0.0)
        tables = np.split(self._plain, self._ends)
        self._white = np.concatenate([unit.whitened(table)[order:] for table in tables])
        basis = _basis(self._white[:, :-1])
        left = self._white[:, -1] - basis @ (basis.T @ self._white[:, -1])
        self._freedom = max(len(left) - basis.shape[1] - order, 1)
        self._variance = float(left @ left) / self._freedom
        self._left = left / (1 - np.minimum((basis**2).sum(axis=1), MOST_LEVERAGE))
        deviation = float(np.sqrt(self._variance) * self._size[-1])
        variance = deviation**2 / float(np.prod(1 - np.tanh(self._partial) ** 2))
        self.noise = Autoregression(-whitener[1:], deviation, variance)
        self.test = cache(self._test)

    def _test(self, chosen: Places, beside: Places = ()) -> FTest:
        """Test some of the columns in addition to others, by index."""
        from scipy.special import fdtrc

        plain = _added(self._plain, chosen, beside)
        explained = float(np.sum((plain.T @ self._plain[:, -1]) ** 2)) * float(self._size[-1]) ** 2
        by_noise = self._variance_along(np.split(plain, self._ends))
        new = _added(self._white, chosen, beside)
        q = new.shape[1]
        if q == 0 or self._variance <= 0:
            return FTest(1.0, explained, by_noise)
        along = new.T @ self._white[:, -1]
        unsure = self._unsure(chosen, beside, q)
        freedom = 2 / (2 / self._freedom + unsure)
        alike = fdtrc(q, freedom, along @ along / q / self._variance)
        scores = new * self._left[:, np.newaxis]
        # samples of which columns are 0 say nothing of their noise
        weights = (new**2).sum(axis=1) / q
        freedom = 2 / (2 * max(1 / self._freedom, float(weights @ weights)) + unsure)
        below = max(freedom - q + 1, 1.0)
        squared = along @ np.linalg.pinv(scores.T @ scores, hermitian=True) @ along
        differing = fdtrc(q, below, squared / q * below / max(freedom, below))
        return FTest(float(max(alike, differing)), explained, by_noise)

    def coefficient(self, place: int) -> float:
        """Return the coefficient of the single column that best explains the whitened series."""
        column = self._white[:, place]
        along = column @ self._white[:, -1] / (column @ column)
        return float(along * self._size[-1] / self._size[place])

    def deviation(self, weights: Sequence[Array]) -> float:
        """Return the standard deviation, due to noise, of a weighted sum of pieces, (n,) each."""
        return float(np.sqrt(self._variance_along(weights)))

    def _variance_along(self, ways: Sequence[Array]) -> float:
        return float(sum(np.sum(self.noise.coloured(way) ** 2) for way in ways))

    def _fitted_noise(self) -> tuple[Array, Array]:
        """Return the artanh of the noise's partial correlations, and their covariance."""
        from scipy.optimize import approx_fprime, minimize

        fitted = _basis(self._plain[:, :-1])
        left = self._plain[:, -1] - fitted @ (fitted.T @ self._plain[:, -1])
        spare = max(len(left) - fitted.shape[1], 0) // SAMPLES_PER_TERM
        # columns may have taken what is slow in the noise: so the whole is a start as well
        found = [
            _partial(autoregression(np.split(part, self._ends)).coefficients)
            for part in (left, self._plain[:, -1] - self._plain[:, -1].mean())
        ]
        order = min(max(start.size for start in found), MOST_ORDER, spare)
        starts = [np.pad(start[:order], (0, max(order - start.size, 0))) for start in found]
        tables = np.split(self._plain, self._ends)
        self._lagged = _lagged(tables, order)
        # of the rows that noise is known by: what is only in the first ones would be nothing there
        inner = _independent(np.concatenate([table[order:, :-1] for table in tables]))
        k = inner.shape[1]
        change = np.zeros((len(inner) + 1, k + 1))
        change[:-1, :k], change[-1, k] = inner, 1.0
        self._small = np.einsum("ia,pqij,jb->pqab", change, self._lagged, change, optimize=True)
        if not order:
            return np.zeros(0), np.zeros((0, 0))
        freedom = max(sum(max(len(table) - order, 0) for table in tables) - k, 1)

        def cost(partial: Array) -> float:
            columns, left = _sizes(self._small, partial)
            return freedom * left + columns

        ends = [(-SMOOTHEST, SMOOTHEST)] * order
        tried = [minimize(cost, start, method="L-BFGS-B", bounds=ends) for start in starts]
        at = min(tried, key=lambda one: float(one.fun)).x
        slope = approx_fprime(at, cost, STEP)
        moved = [approx_fprime(at + step, cost, STEP) for step in STEP * np.eye(order)]
        curvature = (np.array(moved) - slope) / STEP
        energies, ways = np.linalg.eigh((curvature + curvature.T) / 2)
        return at, np.asarray(2 * (ways / np.maximum(energies, LEAST_CURVATURE)) @ ways.T)

    def _unsure(self, chosen: Places, beside: Places, q: int) -> float:
        """Return the variance of the logarithm of the noise's power with columns fitted."""
        from scipy.optimize import approx_fprime

        if not self._partial.size:
            return 0.0

        def power(partial: Array) -> float:
            products = _filtered(self._lagged, partial)
            new = _log_size(products, (*beside, *chosen)) - _log_size(products, beside)
            return new / q - _sizes(self._small, partial)[1]

        slopes = approx_fprime(self._partial, power, STEP)
        return float(slopes @ self._doubt @ slopes)


def _independent(columns: Array, energy: float = 0.0) -> Array:
    """Return the weights, (k, rank), that orthonormalise columns."""
    energies, ways = np.linalg.eigh(columns.T @ columns)
    kept = energies > DEPENDENT * (energy or float(energies.max(initial=1e-300)))
    return np.asarray(ways[:, kept] / np.sqrt(energies[kept]))


def _basis(columns: Array) -> Array:
    """Return an orthonormal basis of columns, shape (n, rank)."""
    return columns @ _independent(columns)


def _added(table: Array, chosen: Places, beside: Places) -> Array:
    """Return an orthonormal basis of chosen columns, after projection on others."""
    known, new = _basis(table[:, list(beside)]), table[:, list(chosen)]
    rest = new - known @ (known.T @ new)
    return rest @ _independent(rest, float((new**2).sum()))


def _lagged(tables: Sequence[Array], order: int) -> Array:
    """Return the products of columns at lags i and j, summed over time, (order + 1, order + 1, k, k)."""
    width = tables[0].shape[1]
    total = np.zeros(((order + 1) * width,) * 2)
    for table in tables:
        shifted = [table[order - lag : max(len(table) - lag, 0)] for lag in range(order + 1)]
        side = np.concatenate(shifted, axis=1) if len(table) > order else np.zeros((0, len(total)))
        total += side.T @ side
    return total.reshape(order + 1, width, order + 1, width).transpose(0, 2, 1, 3)


def _whitener(partial: Array) -> Array:
    """Return a stable autoregressive filter from the artanh of its partial correlations."""
    found = np.ones(1)
    for value in np.tanh(partial):
        longer = np.append(found, 0.0)
        found = longer - value * longer[::-1]
    return found


def _partial(coefficients: Array) -> Array:
    """Return the inverse of `_whitener`, from its coefficients after the first, negated."""
    found, whitener = [], np.concatenate([[1.0], -coefficients])
    while whitener.size > 1:
        value = -whitener[-1]
        found.append(value)
        whitener = ((whitener + value * whitener[::-1]) / (1 - value**2))[:-1]
    return np.arctanh(found[::-1]).clip(-SMOOTHEST, SMOOTHEST)


def _filtered(lagged: Array, partial: Array) -> Array:
    """Return the products of columns whitened by a noise model."""
    whitener = _whitener(partial)
    return np.asarray(np.tensordot(np.outer(whitener, whitener), lagged, 2))


def _sizes(lagged: Array, partial: Array) -> tuple[float, float]:
    """Return the log determinants of whitened columns, and of their residuals."""
    products = _filtered(lagged, partial)
    products += ROUNDING * np.eye(len(products))
    columns = np.linalg.slogdet(products[:-1, :-1])[1]
    return float(columns), float(np.linalg.slogdet(products)[1] - columns)


def _log_size(products: Array, chosen: Places) -> float:
    """Return the log determinant of columns, without rounding."""
    energies = np.linalg.eigvalsh(products[np.ix_(list(chosen), list(chosen))])
    return float(np.log(energies[energies > DEPENDENT * energies.max(initial=1e-300)]).sum())
