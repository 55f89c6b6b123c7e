"""What causes come to in a closed loop, whose feedback answers each of them.

Feedback is no cause: it answers the error, F = G e, and the error is e = d + F. By the same G every
cause d_i comes to e_i = d_i + G e_i, and these add up to the error as the d_i add up to d. G is found by
least squares, as controllers are: the last errors and their sum.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mckibben.arrays import Array

TAPS = 4
"""Last errors that feedback answers."""

EXPLAINED = 0.8
"""Share of the feedback's squares, about their mean, that the error has to explain."""

STABLE = 1 + 1e-6
"""Largest root of a loop that is stable, and of a sum that nothing closes."""

FEEDBACK = "feedback"


def closed(signals: Mapping[str, Array]) -> dict[str, Array] | None:
    """Return what every cause comes to with feedback, and what feedback does else; None if unknown.

    Parameters
    ----------
    signals : mapping of str to array, shape (n,)
        Parts of an error, which add up to it; what feedback does is ``feedback``.
    """
    from scipy.signal import lfilter

    error = np.sum(list(signals.values()), axis=0)
    answer = signals[FEEDBACK]
    if not answer.any():
        return None
    past = [np.concatenate([np.zeros(k), error[: len(error) - k]]) for k in range(TAPS)]
    summed = np.cumsum(error)
    table = np.column_stack([*past, summed, np.ones(len(error))])
    size = np.sqrt(np.mean(table**2, axis=0))
    weights = np.linalg.lstsq(table / size, answer, rcond=1e-12)[0] / size
    left = answer - table @ weights
    if np.sum(left**2) > (1 - EXPLAINED) * np.sum((answer - answer.mean()) ** 2):
        return None
    taps, integral = weights[:TAPS], weights[TAPS]
    # (1 - z⁻¹) e_i = (1 - z⁻¹) d_i + ((1 - z⁻¹) taps + integral) e_i
    loop = np.convolve([1.0, -1.0], np.append(1 - taps[0], -taps[1:]))
    loop[0] -= integral
    if loop[0] <= 0 or np.abs(np.roots(loop)).max() > STABLE:
        return None
    found = {
        kind: np.asarray(lfilter([1.0, -1.0], loop, signal))
        for kind, signal in signals.items()
        if kind != FEEDBACK
    }
    return found | {FEEDBACK: error - np.sum(list(found.values()), axis=0)}


def each_closed(signals: Mapping[str, Array], ends: Array) -> dict[str, Array] | None:
    """Return what causes come to with feedback, log by log; None where that is unknown of one.

    The logs follow one another; each begins where the one before ends, at ``ends``.
    """
    pieces = {kind: np.split(signal, ends) for kind, signal in signals.items()}
    found = []
    for k in range(len(ends) + 1):
        one = closed({kind: parts[k] for kind, parts in pieces.items()})
        if one is None:
            return None
        found.append(one)
    return {kind: np.concatenate([one[kind] for one in found]) for kind in found[0]}
