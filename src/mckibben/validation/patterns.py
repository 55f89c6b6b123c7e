"""A residual against what it should not depend on: means over bins, with intervals, and a joint test."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from mckibben.arrays import Array
from mckibben.validation.regression import Regression

BINS = 10
"""Bins of as many samples each."""

PARTS = 6
"""Parts of an input's range in which branches are compared."""

TOLD = 1.96
"""Standard deviations of a 95 % interval."""


@dataclass(frozen=True)
class Bin:
    """Residuals where something is within two ends.

    Parameters
    ----------
    label : str
        In words, where there are some.
    low, high : float
        Ends.
    n : int
        Samples.
    mean : float
        Of the residual.
    interval : (float, float)
        95 % interval of the mean, reckoned with noise whose samples are like their neighbours.
    """

    label: str
    low: float
    high: float
    n: int
    mean: float
    interval: tuple[float, float]


@dataclass(frozen=True)
class Pattern:
    """A residual against one thing.

    Parameters
    ----------
    against : str
        ``input``, ``load``, ``output``, ``rate`` or ``branch``.
    channel, unit : str
        What it is against.
    bins : tuple of Bin
    p_value : float or None
        How likely noise that does not depend on it would look as if it did; None where there are too
        few samples.
    """

    against: str
    channel: str
    unit: str
    bins: tuple[Bin, ...]
    p_value: float | None

    def to_dict(self) -> dict[str, Any]:
        """Return it for JSON."""
        return asdict(self)


def binned(
    residuals: Sequence[Array], values: Sequence[Array], every: int, regression: Regression
) -> tuple[Bin, ...]:
    """Return the residual's means where values are in bins of as many samples each."""
    ends = np.unique(np.quantile(np.concatenate(values), np.linspace(0, 1, BINS + 1)))
    if ends.size < 2:
        return ()
    place = [np.clip(np.searchsorted(ends, v, side="right") - 1, 0, ends.size - 2) for v in values]
    return tuple(
        found
        for k in range(ends.size - 1)
        if (
            found := _bin(
                "",
                (float(ends[k]), float(ends[k + 1])),
                residuals,
                [own == k for own in place],
                every,
                regression,
            )
        )
    )


def by_branch(
    residuals: Sequence[Array],
    inputs: Sequence[Array],
    ways: Sequence[Array],
    every: int,
    regression: Regression,
) -> tuple[Bin, ...]:
    """Return the residual's means on rising and falling branches, in parts of an input's range."""
    low, high = min(u.min() for u in inputs), max(u.max() for u in inputs)
    ends = np.linspace(low, high, PARTS + 1)
    found = []
    for k in range(PARTS):
        for way, name in ((1, "rising"), (-1, "falling")):
            chosen = [
                (w * way > 0) & (u >= ends[k]) & ((u < ends[k + 1]) | (k == PARTS - 1))
                for u, w in zip(inputs, ways, strict=True)
            ]
            one = _bin(
                name,
                (float(ends[k]), float(ends[k + 1])),
                residuals,
                chosen,
                every,
                regression,
            )
            found.append(one)
    return tuple(one for one in found if one)


def _bin(
    label: str,
    ends: tuple[float, float],
    residuals: Sequence[Array],
    chosen: Sequence[Array],
    every: int,
    regression: Regression,
) -> Bin | None:
    n = int(sum(own.sum() for own in chosen))
    if n == 0:
        return None
    weights = [own / n for own in chosen]
    mean = float(sum(w @ e for w, e in zip(weights, residuals, strict=True)))
    reach = TOLD * regression.spread(weights)
    return Bin(label, *ends, n * every, mean, (mean - reach, mean + reach))
