"""How a residual goes along with an input, and with its changes, shifted in time; with bands.

Bands reckon with residuals and inputs whose samples are like their neighbours: they come from the
noise model of the regression, run through the very input.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from mckibben.arrays import Array
from mckibben.validation.regression import Regression
from mckibben.validation.whiteness import BAND

MOST = 48
"""Blocks that are shifted either way at most."""

SHORTEST = 4
"""Share of the median recording, as one over it, that is shifted at most."""


@dataclass(frozen=True)
class Crossing:
    """The cross-correlation of a residual with an input.

    Parameters
    ----------
    channel : str
        The input.
    lags : tuple of int
        In samples; of positive ones the residual is later than the input.
    with_input, with_changes : tuple of float
        Correlations with the input, and with its changes.
    band, band_of_changes : float
        How far from zero 99 % are of noise that knows nothing of the input.
    p_value : float or None
        How likely such noise would follow the input, now and before, as well; None where there are too
        few samples.
    """

    channel: str
    lags: tuple[int, ...]
    with_input: tuple[float, ...]
    with_changes: tuple[float, ...]
    band: float
    band_of_changes: float
    p_value: float | None

    def to_dict(self) -> dict[str, Any]:
        """Return it for JSON."""
        return asdict(self)


def crossing(
    channel: str,
    residuals: Sequence[Array],
    inputs: Sequence[Array],
    every: int,
    regression: Regression,
    p_value: float | None,
) -> Crossing:
    """Return how a residual goes along with an input, both means over blocks of ``every`` samples."""
    most = max(1, min(MOST, int(np.median([len(r) for r in residuals])) // SHORTEST))
    lags = range(-most, most + 1)
    changes = [np.diff(u, prepend=u[:1]) for u in inputs]
    along, band = _correlations(residuals, inputs, lags, regression)
    after, other = _correlations(residuals, changes, lags, regression)
    return Crossing(channel, tuple(every * lag for lag in lags), along, after, band, other, p_value)


def _correlations(
    residuals: Sequence[Array], inputs: Sequence[Array], lags: range, regression: Regression
) -> tuple[tuple[float, ...], float]:
    n = sum(map(len, residuals))
    e = [r - sum(float(x.sum()) for x in residuals) / n for r in residuals]
    v = [u - sum(float(x.sum()) for x in inputs) / n for u in inputs]
    size = float(np.sqrt(sum(x @ x for x in e) * sum(x @ x for x in v)))
    if size == 0:
        return tuple(0.0 for _ in lags), 0.0
    found = []
    for lag in lags:
        total = 0.0
        for own, other in zip(e, v, strict=True):
            m = len(own) - abs(lag)
            if m > 0:
                ahead, behind = max(lag, 0), max(-lag, 0)
                total += float(own[ahead : ahead + m] @ other[behind : behind + m])
        found.append(total / size)
    return tuple(found), BAND * regression.spread(v) / size
