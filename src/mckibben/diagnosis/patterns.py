"""Figures of residuals: autocorrelation, and means over variables."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mckibben.arrays import Array
from mckibben.diagnosis.regression import Regression
from mckibben.statistics import NORMAL_95

TESTED, PER_LAG = 12, 20
"""Largest number of lags tested together, and samples needed per lag."""

SHOWN, PAIRS = 50, 5
"""Largest number of single lags drawn; samples needed per lag, as its multiple."""

NORMAL_99 = 2.5758
"""Half width, in standard deviations, of the central 99 % of a normal distribution."""

BINS = 10
"""Number of bins, of equal numbers of samples."""


@dataclass(frozen=True)
class Whiteness:
    """The autocorrelation of a residual.

    Parameters
    ----------
    lags : tuple of int
        In samples, from 1.
    autocorrelation, band : tuple of float
        At every lag, and how far from zero 99 % of those of white noise are.
    n_tested : int
        Lags tested together, the first ones.
    p_value : float or None
        Probability of white noise as far from zero; None where recordings are too short.
    """

    lags: tuple[int, ...]
    autocorrelation: tuple[float, ...]
    band: tuple[float, ...]
    n_tested: int
    p_value: float | None


@dataclass(frozen=True)
class Bin:
    """Mean residual of ``n`` samples between two ends, and its 95 % interval for correlated noise.

    ``label`` is the branch, "rising" or "falling", where there are two.
    """

    label: str
    low: float
    high: float
    n: int
    mean: float
    interval: tuple[float, float]


@dataclass(frozen=True)
class Pattern:
    """Mean residual over one variable.

    Parameters
    ----------
    against : str
        ``input``, ``load``, ``output`` or ``branch``.
    channel, unit : str
        What it is against.
    bins : tuple of Bin
    """

    against: str
    channel: str
    unit: str
    bins: tuple[Bin, ...]


def whiteness(residuals: Sequence[Array]) -> Whiteness:
    """Return the autocorrelation of a residual, pieces (n,), and whether it is white noise.

    Products of samples at a lag are compared with their own scatter, so that white noise whose size
    depends on the input or the run passes as what it is.
    """
    from scipy.special import chdtrc

    room, n = max(map(len, residuals)) // (PAIRS + 1), sum(map(len, residuals))
    lags = np.arange(1, min(SHOWN, room) + 1)
    if room > SHOWN:
        lags = np.union1d(lags, np.geomspace(SHOWN, room, SHOWN).astype(int))
    mean = float(np.concatenate(residuals).mean())
    left = [e - mean for e in residuals]
    power = float(sum(e @ e for e in left))
    found, scatter = np.zeros(lags.size), np.zeros(lags.size)
    for place, lag in enumerate(lags.tolist()):
        products = np.concatenate([e[lag:] * e[: len(e) - lag] for e in left if len(e) > lag])
        # the mean was taken off: what noise itself would give is below zero
        found[place] = products.sum() + len(products) / n * power / n
        scatter[place] = products @ products
    tested, deviation = min(TESTED, room, n // PER_LAG), np.sqrt(scatter)
    ratio = np.divide(found, deviation, out=np.zeros(lags.size), where=deviation > 0)
    p_value = float(chdtrc(tested, float(np.sum(ratio[:tested] ** 2)))) if tested else None
    by_lag = [(x / (power or 1.0)).tolist() for x in (found, NORMAL_99 * deviation)]
    return Whiteness(tuple(lags.tolist()), tuple(by_lag[0]), tuple(by_lag[1]), tested, p_value)


def bins(
    left: Sequence[Array],
    values: Sequence[Array],
    every: int,
    regression: Regression,
    branches: Sequence[Array] | None = None,
) -> tuple[Bin, ...]:
    """Return means of a residual in bins of equal numbers of samples.

    Parameters
    ----------
    left, values : sequence of array, shape (n,)
        Means over blocks of ``every`` samples.
    branches : sequence of array, shape (n,), optional
        Positive on the rising branch and negative on the falling one, to take them apart.
    """
    ends = np.unique(np.quantile(np.concatenate(values), np.linspace(0, 1, BINS + 1)))
    ways = (
        [np.zeros(len(x)) for x in values] if branches is None else [np.sign(x) for x in branches]
    )
    places = [np.clip(np.searchsorted(ends, x, "right") - 1, 0, ends.size - 2) for x in values]
    labels = {"": 0} if branches is None else {"rising": 1, "falling": -1}
    found = []
    for k in range(ends.size - 1):
        for label, way in labels.items():
            chosen = [(p == k) & (w == way) for p, w in zip(places, ways, strict=True)]
            n = int(sum(own.sum() for own in chosen))
            if n:
                weights = [own / n for own in chosen]
                mean = float(sum(w @ e for w, e in zip(weights, left, strict=True)))
                half = NORMAL_95 * regression.deviation(weights)
                ends_of = float(ends[k]), float(ends[k + 1])
                found.append(Bin(label, *ends_of, n * every, mean, (mean - half, mean + half)))
    return tuple(found)
