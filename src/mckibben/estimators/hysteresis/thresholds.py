"""Rules for thresholds: where the dead zones of the operators lie.

An operator of threshold r only moves when the input moves by more than 2 r after a reversal, so
thresholds beyond half the range never move.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from mckibben.arrays import Array

Spacing = Literal["even", "dense"]


def spread(n: int, span: float, spacing: Spacing) -> Array:
    """Return ``n`` thresholds from 0 to below half of ``span``.

    Parameters
    ----------
    n : int
        Number of thresholds, at least 1.
    span : float
        Range of what the operators act on.
    spacing : {"even", "dense"}
        Equal steps, or steps that grow from 0, for loops that bend right after a reversal.

    >>> spread(4, 8.0, "even").tolist()
    [0.0, 1.0, 2.0, 3.0]
    """
    share = np.arange(n) / n
    return 0.5 * span * (share if spacing == "even" else share**1.5)
