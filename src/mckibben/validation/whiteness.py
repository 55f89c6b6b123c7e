"""Whether a residual is white: its autocorrelation, with bands, and a joint test of the first lags.

Products of samples at a lag are compared with their own scatter, so that noise whose size depends on
the input or the run passes as what it is: white. Recordings are pooled, and nothing crosses from one
into the next.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from mckibben.arrays import Array

TESTED = 12
"""Lags that are tested together at most."""

TO_A_LAG = 20
"""Samples to a lag that is tested at least, of all recordings."""

SHOWN = 50
"""Lags that are drawn one by one at most, and as many thinned ones beyond."""

PAIRS = 5
"""Pairs of samples of one recording to a lag at least, as a multiple of the lag."""

BAND = 2.5758
"""Standard deviations of a band that 99 of 100 lags of white noise are in."""


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
        How likely white noise would be as far from zero; None where recordings are too short.
    """

    lags: tuple[int, ...]
    autocorrelation: tuple[float, ...]
    band: tuple[float, ...]
    n_tested: int
    p_value: float | None

    def to_dict(self) -> dict[str, Any]:
        """Return it for JSON."""
        return asdict(self)


def whiteness(residuals: Sequence[Array], reach: float = 0.0) -> Whiteness:
    """Return the autocorrelation of a residual, and whether it is that of white noise.

    Parameters
    ----------
    residuals : sequence of array, shape (n,)
        Of every recording.
    reach : float
        Samples up to which lags are returned, thinned beyond the first ones, where there are as many.
    """
    from scipy.special import chdtrc

    longest = max(map(len, residuals))
    room = longest // (PAIRS + 1)
    most = min(SHOWN, room)
    last = int(np.clip(reach, most, max(room, most)))
    lags = np.arange(1, most + 1)
    if most:
        lags = np.union1d(lags, np.geomspace(most, last, SHOWN).astype(int))
    n = sum(map(len, residuals))
    mean = sum(float(r.sum()) for r in residuals) / n
    left = [r - mean for r in residuals]
    power = sum(float(r @ r) for r in left)
    found, scatter = np.zeros(lags.size), np.zeros(lags.size)
    for place, lag in enumerate(lags.tolist()):
        for r in left:
            if len(r) > lag:
                products = r[lag:] * r[:-lag]
                # the mean was taken off: what noise itself would give is below zero
                expected = -len(products) / n * power / n
                found[place] += products.sum() - expected
                scatter[place] += products @ products
    tested = min(TESTED, most, n // TO_A_LAG)
    safe = np.sqrt(np.where(scatter > 0, scatter, 1.0))
    ratio = np.where(scatter > 0, found / safe, 0.0)
    p_value = float(chdtrc(tested, float(np.sum(ratio[:tested] ** 2)))) if tested else None
    size = power if power > 0 else 1.0
    return Whiteness(
        tuple(lags.tolist()),
        tuple((found / size).tolist()),
        tuple((BAND * safe * (scatter > 0) / size).tolist()),
        tested,
        p_value,
    )
