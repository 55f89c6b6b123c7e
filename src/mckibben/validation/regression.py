"""Regression of a residual on what it may depend on, under noise whose neighbours are alike.

Noise is autoregressive. Its coefficients are those of the greatest restricted likelihood beside *all*
columns, so that neither what the columns explain nor the freedom that they take makes it look smoother
or rougher than it is, and one noise model serves every test. A test of some columns beside others is an
F-test of what is left of both when that noise model has whitened them. Recordings are whitened each by
itself; nothing crosses from one into the next.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from mckibben.arrays import Array

MOST_ORDER = 6
"""Largest order of the noise model."""

APART = 8
"""Samples of the shortest recording to an order of the noise model at least."""

DEPENDENT = 1e-9
"""Share of a column's energy below which what is new in it beside the others is rounding."""

LIMIT = 3.8
"""Partial correlations of noise are the tanh of at most this: 0.999."""

STEP = 0.02
"""By which these are moved to see what depends on them."""

LEAST_CURVATURE = 0.1
"""Of the likelihood, so that what the data do not tell has a large error and no infinite one."""

FLAT = 0.1
"""Slope of minus twice the logarithm of the likelihood up to which it is at its least."""

TINY = 1e-300

IMPOSSIBLE = 1e9
"""Cost of a noise model under which columns say nothing new."""

Columns = Sequence[int]


@dataclass(frozen=True)
class Tested:
    """An F-test of some columns beside others.

    Parameters
    ----------
    p_value : float
        How likely noise alone would be followed as well.
    freedom : int
        Columns that say something new.
    """

    p_value: float
    freedom: int


class Regression:
    """A residual, what it may depend on, and the noise beside.

    Parameters
    ----------
    pieces : sequence of (array, shape (n,), array, shape (n, k))
        Residual and columns of every recording; all at one sample time.
    """

    def __init__(self, pieces: Sequence[tuple[Array, Array]]) -> None:
        tables = [np.column_stack([columns, residual]) for residual, columns in pieces]
        size = np.sqrt(np.mean(np.concatenate(tables) ** 2, axis=0))
        self._size = np.where(size > 0, size, 1.0)
        tables = [table / self._size for table in tables]
        self.n = sum(map(len, tables))
        self._plain = sum((table.T @ table for table in tables), np.zeros(()))
        shortest = min(map(len, tables))
        k = self._size.size - 1
        spare = (self.n - k) // (2 * APART)
        self._most = int(max(0, min(MOST_ORDER, shortest // APART, spare)))
        self._lagged = _lagged(tables, self._most)
        self.rows = self.n - self._most * len(tables)
        # of the rows that noise is known by: what is only in the first ones would be nothing there
        self._basis = _independent(self._lagged[0, 0, :-1, :-1], range(k))
        self._partial, self._doubt = self._fitted_noise()
        self.noise = _from_partial(self._partial)
        self._white = _filtered(self._lagged, self.noise)
        rank = self._basis.shape[1]
        self.freedom = max(self.rows - rank - (len(self.noise) - 1), 1)
        self._tested: dict[tuple[tuple[int, ...], tuple[int, ...]], Tested] = {}
        self._variance = max(self._left(range(k)), 0.0) / self.freedom
        self.independent = self._independent_samples()

    def test(self, columns: Columns, beside: Columns = ()) -> Tested:
        """Return how likely noise alone would be followed as well by columns beside others."""
        key = (tuple(columns), tuple(beside))
        if key not in self._tested:
            self._tested[key] = self._test(*key)
        return self._tested[key]

    def _test(self, columns: Columns, beside: Columns) -> Tested:
        from scipy.special import fdtrc

        known = _independent(self._white[:-1, :-1], beside).shape[1]
        every = _independent(self._white[:-1, :-1], [*beside, *columns]).shape[1]
        new = every - known
        if new <= 0 or self._variance <= 0:
            return Tested(1.0, 0)
        drop = self._left(beside) - self._left([*beside, *columns])
        ratio = max(drop, 0.0) / new / self._variance
        freedom = self._freedom_of(columns, beside, new)
        return Tested(float(fdtrc(new, freedom, ratio)), new)

    def _freedom_of(self, columns: Columns, beside: Columns, new: int) -> float:
        """Return the freedom behind what noise gives to columns, of which noise is known so well.

        By Satterthwaite: that of a mean of squares with as large a relative error as the noise's power
        has where these columns have theirs.
        """
        slopes = np.zeros(self._partial.size)
        for place in range(slopes.size):
            sides = []
            for step in (-STEP, STEP):
                moved = self._partial.copy()
                moved[place] += step
                white = _filtered(self._lagged, _from_partial(moved))
                size = _log_size(white, [*beside, *columns]) - _log_size(white, beside)
                sides.append(size / new - np.log(max(_left(white, range(len(white) - 1)), TINY)))
            slopes[place] = (sides[1] - sides[0]) / (2 * STEP)
        unsure = float(slopes @ self._doubt @ slopes)
        return 2.0 / (2.0 / self.freedom + unsure)

    def explained(self, columns: Columns, beside: Columns = ()) -> float:
        """Return the sum of squares of the residual that columns explain beside others."""
        own = self._plain
        drop = _left(own, beside) - _left(own, [*beside, *columns])
        return float(max(drop, 0.0) * self._size[-1] ** 2)

    def coefficients(self, columns: Columns) -> Array:
        """Return the coefficients of columns that follow the residual best, whitened, shape (k,)."""
        chosen = list(columns)
        inner = self._white[np.ix_(chosen, chosen)]
        found = np.linalg.lstsq(inner, self._white[chosen, -1], rcond=DEPENDENT)[0]
        return np.asarray(found * self._size[-1] / self._size[chosen])

    def spread(self, weights: Sequence[Array]) -> float:
        """Return the standard deviation that noise alone gives to a weighted sum of the residual.

        Parameters
        ----------
        weights : sequence of array, shape (n,)
            Of every recording.
        """
        total = 0.0
        for own in weights:
            padded = 2 * len(own)
            power = np.abs(np.fft.fft(own, padded)) ** 2
            gain = np.abs(np.fft.fft(self.noise, padded)) ** 2
            total += float(np.mean(power / gain))
        return float(np.sqrt(self._variance * total) * self._size[-1])

    def _left(self, columns: Columns) -> float:
        return _left(self._white, columns)

    def _independent_samples(self) -> float:
        """Return how many samples without memory would know a level as well."""
        # of unit innovations: variance over the spectrum at frequency zero
        power = np.ones(1)
        for value in np.tanh(self._partial):
            power = power / (1 - value**2)
        at_zero = 1.0 / float(self.noise.sum()) ** 2
        return float(self.n * min(1.0, float(power[0]) / at_zero))

    def _fitted_noise(self) -> tuple[Array, Array]:
        """Return what the noise's partial correlations are the tanh of, and its covariance.

        Of the order with the best criterion (BIC).
        """
        from scipy.optimize import minimize

        k = self._basis.shape[1]
        change = np.zeros((self._size.size, k + 1))
        change[:-1, :k], change[-1, k] = self._basis, 1.0
        small = np.einsum("ai,pqab,bj->pqij", change, self._lagged, change, optimize=True)

        def cost(partial: Array) -> float:
            return _restricted(_filtered(small, _from_partial(partial)), self.rows)

        start = np.empty(0)
        price, best = cost(start), start
        for order in range(1, self._most + 1):
            begun = np.append(start, 0.0)
            done = minimize(cost, begun, method="BFGS", options={"gtol": 1e-3})
            if not done.success and np.abs(done.jac).max() > FLAT:
                again = minimize(cost, begun, method="Nelder-Mead", options={"fatol": 1e-3})
                done = min(done, again, key=lambda one: float(one.fun))
            start = np.clip(done.x, -LIMIT, LIMIT)
            new = cost(start) + order * float(np.log(self.rows))
            if new < price:
                price, best = new, start
            elif order > best.size + 1:
                break
        return best, _covariance(cost, best)


def _covariance(cost: Callable[[Array], float], at: Array) -> Array:
    """Return the covariance of parameters where minus twice the logarithm of a likelihood is least."""
    n = at.size
    curvature = np.zeros((n, n))
    steps = STEP * np.eye(n)
    for i in range(n):
        for j in range(i + 1):
            corners = [
                sign * other * cost(at + sign * steps[i] + other * steps[j])
                for sign in (1, -1)
                for other in (1, -1)
            ]
            curvature[i, j] = curvature[j, i] = sum(corners) / (4 * STEP**2)
    energies, ways = np.linalg.eigh(curvature) if n else (np.empty(0), np.empty((0, 0)))
    return np.asarray(2 * (ways / np.maximum(energies, LEAST_CURVATURE)) @ ways.T)


def _log_size(gram: Array, columns: Columns) -> float:
    """Return the logarithm of the determinant of some columns' products, without what is rounding."""
    chosen = list(columns)
    if not chosen:
        return 0.0
    energies = np.linalg.eigvalsh(gram[np.ix_(chosen, chosen)])
    return float(np.log(energies[energies > DEPENDENT * energies[-1]]).sum())


def _restricted(gram: Array, rows: int) -> float:
    """Return minus twice the logarithm of the restricted likelihood, but for a constant."""
    k = gram.shape[0] - 1
    try:
        factor = np.linalg.cholesky(gram[:-1, :-1] + 1e-12 * np.eye(k))
    except np.linalg.LinAlgError:
        return IMPOSSIBLE
    along = np.linalg.solve(factor, gram[:-1, -1])
    left = float(gram[-1, -1] - along @ along)
    free = max(rows - k, 1)
    if left <= 0:
        return IMPOSSIBLE
    return free * float(np.log(left / free)) + 2 * float(np.log(np.diag(factor)).sum())


def _from_partial(partial: Array) -> Array:
    """Return the coefficients of a stable autoregression, beginning with 1, from its partial ones."""
    found = np.ones(1)
    for value in np.tanh(partial):
        longer = np.append(found, 0.0)
        found = longer - value * longer[::-1]
    return found


def _lagged(tables: Sequence[Array], order: int) -> Array:
    """Return the products of all columns at lags i and j, summed over time, shape (p+1, p+1, k, k)."""
    width = tables[0].shape[1]
    total = np.zeros(((order + 1) * width,) * 2)
    for table in tables:
        shifted = [table[order - lag : len(table) - lag] for lag in range(order + 1)]
        side = np.concatenate(shifted, axis=1)
        total += side.T @ side
    return total.reshape(order + 1, width, order + 1, width).transpose(0, 2, 1, 3)


def _filtered(lagged: Array, noise: Array) -> Array:
    """Return the products of columns that a noise model has whitened."""
    p = noise.size
    width = lagged.shape[-1]
    pairs = np.ascontiguousarray(lagged[:p, :p]).reshape(p * p, -1)
    return np.asarray((np.outer(noise, noise).ravel() @ pairs).reshape(width, width))


def _independent(gram: Array, columns: Columns) -> Array:
    """Return an orthonormal basis of some columns, as combinations of all, shape (all, rank)."""
    chosen = list(columns)
    found = np.zeros((len(gram), 0))
    if not chosen:
        return found
    inner = gram[np.ix_(chosen, chosen)]
    energies, ways = np.linalg.eigh(inner)
    kept = energies > DEPENDENT * max(float(energies[-1]), 0.0)
    kept &= energies > 0
    found = np.zeros((len(gram), int(kept.sum())))
    found[chosen] = ways[:, kept] / np.sqrt(energies[kept])
    return found


def _left(gram: Array, columns: Columns) -> float:
    """Return what columns leave of the last one's square."""
    basis = _independent(gram[:-1, :-1], columns)
    along = basis.T @ gram[:-1, -1]
    return float(gram[-1, -1] - along @ along)
