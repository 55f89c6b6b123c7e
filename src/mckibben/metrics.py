"""Error measures of models, and measures of loops."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mckibben.arrays import Array, check_finite
from mckibben.errors import DataError

USEFUL = 0.9
"""Test error, relative to that of the constant, above which no model is recommended."""


@dataclass(frozen=True)
class Scores:
    """All errors of one model on one output.

    Parameters
    ----------
    rmse : float
        Root of the mean squared error, unit of the output.
    mae : float
        Mean absolute error, unit of the output.
    r2 : float
        Share of the variance explained, at most 1; 100 times that is "fitness". NaN where the
        measured output is constant.
    max_error : float
        Largest absolute error, unit of the output.
    nrmse : float
        RMSE over the range of the measured output; NaN where that is constant.
    err : float
        Sum of absolute errors over that of deviations from the mean [%]; NaN where the measured
        output is constant.
    """

    rmse: float
    mae: float
    r2: float
    max_error: float
    nrmse: float
    err: float


def score(measured: ArrayLike, modelled: ArrayLike) -> Scores:
    """Return all errors of a modelled output.

    Parameters
    ----------
    measured, modelled : array_like, shape (n,)
        Finite, at least one sample, in the same unit.

    Raises
    ------
    DataError
        If the two differ in length, are empty or hold values that are not finite.

    Examples
    --------
    >>> score([0.0, 1.0, 2.0], [0.0, 1.0, 2.3]).max_error.__round__(12)
    0.3
    """
    return Scores(
        rmse=rmse(measured, modelled),
        mae=mae(measured, modelled),
        r2=r2(measured, modelled),
        max_error=max_error(measured, modelled),
        nrmse=nrmse(measured, modelled),
        err=err(measured, modelled),
    )


def mean_scores(scores: Sequence[Scores]) -> Scores:
    """Return the combined errors of several outputs: means, and the overall largest error."""
    means = {
        name: float(np.mean([getattr(one, name) for one in scores]))
        for name in ("rmse", "mae", "r2", "nrmse", "err")
    }
    return Scores(**means, max_error=max(one.max_error for one in scores))


def rmse(measured: ArrayLike, modelled: ArrayLike) -> float:
    """Return the root mean square error, in the unit of the output."""
    y, model = _pair(measured, modelled)
    return float(np.sqrt(np.mean((y - model) ** 2)))


def mae(measured: ArrayLike, modelled: ArrayLike) -> float:
    """Return the mean absolute error, in the unit of the output."""
    y, model = _pair(measured, modelled)
    return float(np.mean(np.abs(y - model)))


def max_error(measured: ArrayLike, modelled: ArrayLike) -> float:
    """Return the largest absolute error, in the unit of the output."""
    y, model = _pair(measured, modelled)
    return float(np.max(np.abs(y - model)))


def r2(measured: ArrayLike, modelled: ArrayLike) -> float:
    """Return the share of the variance that the model explains; NaN for a constant measurement.

    1 is perfect, 0 no better than the mean, below 0 worse. "Fitness" is 100 times that.
    """
    y, model = _pair(measured, modelled)
    variance = np.sum((y - y.mean()) ** 2)
    if np.ptp(y) == 0 or variance == 0:
        return float("nan")
    return float(1 - np.sum((y - model) ** 2) / variance)


def nrmse(measured: ArrayLike, modelled: ArrayLike) -> float:
    """Return the RMSE over the range of the measurement; NaN for a constant measurement."""
    y, model = _pair(measured, modelled)
    return float("nan") if np.ptp(y) == 0 else rmse(y, model) / float(np.ptp(y))


def err(measured: ArrayLike, modelled: ArrayLike) -> float:
    r"""Return the sum of absolute errors over that of deviations from the mean [%].

    .. math:: Err = \sum|y-\hat y| \,/\, \sum|y-\bar y| \cdot 100\,\%

    NaN for a constant measurement.
    """
    y, model = _pair(measured, modelled)
    if np.ptp(y) == 0:
        return float("nan")
    return float(100 * np.sum(np.abs(y - model)) / np.sum(np.abs(y - y.mean())))


def useful(error: float, constant: float) -> bool:
    """Return whether an error is clearly smaller than that of the constant on the same samples."""
    return error < USEFUL * constant


def loop_width(u: ArrayLike, y: ArrayLike) -> float:
    """Return the width e_w of one cycle at mid input, over the range of its output [%].

    Parameters
    ----------
    u, y : array_like, shape (n,)
        Input and output over one cycle of the input, minimum to minimum. It is cut into its rising
        and its falling branch at the maximum of the input; mid input is the middle of what both
        cover. Noise is not smoothed away; ``mckibben.characterize`` does that.

    Raises
    ------
    DataError
        On unequal lengths, a constant input or output, or an input without a rising and a falling
        branch.

    Examples
    --------
    >>> loop_width([0.0, 1.0, 2.0, 1.0, 0.0], [0.0, 1.0, 4.0, 3.0, 0.0])
    50.0
    """
    return crosstalk(u, y, y)


def crosstalk(u: ArrayLike, y: ArrayLike, relative_to: ArrayLike) -> float:
    """Return the same distance of branches over the range of another signal [%].

    For instance how far an output that should rest follows a cycle of another, of what that one moves:
    of an output that hardly moves `loop_width` is arbitrary.

    Parameters
    ----------
    u, y : array_like, shape (n,)
        As for `loop_width`.
    relative_to : array_like, shape (n,)
        The signal whose range counts, in the unit of the output.

    Raises
    ------
    DataError
        On unequal lengths, a signal that is constant, or an input without a rising and a falling branch.

    Examples
    --------
    >>> crosstalk([0.0, 1.0, 2.0, 1.0, 0.0], [0.0, 0.0, 1.0, 1.0, 0.0], [0.0, 2.0, 4.0, 2.0, 0.0])
    25.0
    """
    along, heights = _pair(u, y)
    span = float(np.ptp(_pair(u, relative_to)[1]))
    top = int(np.argmax(along))
    bottom = max(along[0], along[-1])
    if not 0 < top < along.size - 1 or bottom >= along[top]:
        raise DataError(
            "the input does not rise and fall again, so there is no loop",
            remedy="give one whole cycle, such as a slice of mckibben.signals.cycles",
        )
    if span == 0:
        raise DataError("the output is constant", remedy="give one that follows the input")
    middle = 0.5 * (bottom + along[top])
    up, down = (
        _at(middle, along[part], heights[part]) for part in (slice(0, top + 1), slice(top, None))
    )
    return 100 * abs(up - down) / span


def loop_area(u: ArrayLike, y: ArrayLike) -> float:
    """Return the area that a path encloses, in units of input times output.

    The path is closed by a straight line. Parts run round in opposite senses cancel, as in a loop
    that crosses itself.

    Parameters
    ----------
    u, y : array_like, shape (n,)
        Input and output over one cycle.

    Raises
    ------
    DataError
        On unequal lengths.

    Examples
    --------
    >>> loop_area([0.0, 2.0, 2.0, 0.0], [0.0, 0.0, 3.0, 3.0])
    6.0
    """
    x, z = _pair(u, y)
    # From the first point on, so that an offset costs no digits.
    x, z = x - x[0], z - z[0]
    return float(0.5 * abs(np.sum(x[:-1] * z[1:] - z[:-1] * x[1:])))


def _at(level: float, u: Array, y: Array) -> float:
    order = np.argsort(u, kind="stable")
    return float(np.interp(level, u[order], y[order]))


def _pair(first: ArrayLike, second: ArrayLike) -> tuple[Array, Array]:
    a, b = np.asarray(first, dtype=float), np.asarray(second, dtype=float)
    if a.ndim != 1 or a.shape != b.shape or a.size == 0:
        raise DataError(
            f"shapes {a.shape} and {b.shape} cannot be compared",
            remedy="give two rows of the same length, one value a sample",
        )
    for values in (a, b):
        check_finite(values)
    return a, b
