"""What of a reference the model that a compensator undoes cannot reach, and what that costs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.fields import Channel
from mckibben.control.connecting import match

ROUNDING = 1e-9
"""Share of what is reached by which a reference touches its end."""


class Beyond(NamedTuple):
    """Samples of a reference that are out of reach.

    Parameters
    ----------
    samples : int
    low, high : float
        What the model can reach whatever happened before [mm or N].
    rmse_elsewhere : float
        RMSE over all other samples [mm or N]; not a number where there are none.
    """

    samples: int
    low: float
    high: float
    rmse_elsewhere: float


def ends(
    model: Block | None, followed: Sequence[Channel], rest_length: float | None
) -> dict[str, tuple[float, float]]:
    """Return the lowest and highest that a model can reach of what is followed, as far as it says.

    Parameters
    ----------
    model : Block or None
        What a compensator undoes.
    followed : sequence of Channel
    rest_length : float or None
        Of the muscle [mm].
    """
    found: dict[str, tuple[float, float]] = {}
    if model is None:
        return found
    for channel in followed:
        line = match(channel, model.outputs, rest_length)
        if line is not None:
            place, gain, offset = line
            low, high = sorted(float(gain * end[place] + offset) for end in model.reachable())
            if np.isfinite([low, high]).all():
                found[channel.name] = low, high
    return found


def outside(reference: Array, low: float, high: float) -> NDArray[np.bool_]:
    """Return which samples of a reference, shape (n,), lie beyond both ends and rounding."""
    margin = ROUNDING * (high - low)
    return np.asarray((reference < low - margin) | (reference > high + margin))


def beyond(errors: Array, out: NDArray[np.bool_], low: float, high: float) -> Beyond | None:
    """Return what of a reference is out of reach, or None.

    Parameters
    ----------
    errors : array, shape (n,)
    out : array of bool, shape (n,)
        From `outside`.
    low, high : float
    """
    if not out.any():
        return None
    others = errors[~out]
    elsewhere = float(np.sqrt(np.mean(others**2))) if others.size else float("nan")
    return Beyond(int(out.sum()), low, high, elsewhere)
