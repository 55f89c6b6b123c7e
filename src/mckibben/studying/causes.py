"""Causes of an error, each with its share, so that the shares add up to the whole.

The error is a sum of signals, one to a cause. The share of a cause is the mean, over all orders in
which causes are put right one after the other, of what that takes away from the mean square: its
Shapley value. Of a sum of signals this is the mean of the cause's signal times the error, over the
error's mean square; it is negative where a cause works against the others.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import permutations
from typing import Any

import numpy as np

from mckibben.arrays import Array

KINDS = ("model", "actuator", "delay", "noise", "drift", "limits", "feedback", "compensator")
"""Causes, by name."""


@dataclass(frozen=True, eq=False)
class Cause:
    """One cause of an error.

    Parameters
    ----------
    kind : str
        One of `KINDS`.
    share : float
        Of the error's mean square; shares of all causes add up to 1.
    size : float
        Root mean square of this cause alone, unit of the error.
    told : str
        What it is here.
    signal : array, shape (n,)
        Its part of the error, at the scored samples.
    """

    kind: str
    share: float
    size: float
    told: str
    signal: Array = field(repr=False)

    def to_dict(self) -> dict[str, Any]:
        """Return it for JSON, without the signal."""
        return {"cause": self.kind, "share": self.share, "rms": self.size, "told": self.told}


def shares(signals: Mapping[str, Array], told: Mapping[str, str]) -> tuple[Cause, ...]:
    """Return the causes of an error that is the sum of signals, largest share first."""
    error = np.sum(list(signals.values()), axis=0)
    power = float(error @ error)
    found = [
        Cause(
            kind,
            float(signal @ error) / power if power > 0 else 0.0,
            float(np.sqrt(np.mean(signal**2))),
            told.get(kind, ""),
            signal,
        )
        for kind, signal in signals.items()
    ]
    return tuple(sorted(found, key=lambda cause: -cause.share))


def explained(residual: Array, columns: Mapping[str, Array]) -> dict[str, Array]:
    """Return what groups of columns explain of a residual, each on the mean over all orders.

    Parameters
    ----------
    residual : array, shape (n,)
    columns : mapping of str to array, shape (n, k)

    Returns
    -------
    dict of str to array, shape (n,)
        They add up to what all columns explain together.
    """
    known: dict[frozenset[str], Array] = {frozenset(): np.zeros_like(residual)}

    def along(names: frozenset[str]) -> Array:
        if names not in known:
            table = np.concatenate([columns[name] for name in sorted(names)], axis=1)
            known[names] = table @ np.linalg.lstsq(table, residual, rcond=1e-9)[0]
        return known[names]

    orders = list(permutations(columns))
    found = {name: np.zeros_like(residual) for name in columns}
    for order in orders:
        for place, name in enumerate(order):
            before = frozenset(order[:place])
            found[name] += (along(before | {name}) - along(before)) / len(orders)
    return found
