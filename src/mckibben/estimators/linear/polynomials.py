"""Prediction errors of linear models, and their derivatives.

A(q) y = B(q) / F(q) u + C(q) / D(q) e. Residuals are one-step prediction errors
e = D / C (A y - B / F u - start), where start is the free response from the state before the first
sample, one to each run, estimated with the rest. ARX has A and B, ARMAX A, B and C, output-error B
and F, Box-Jenkins B, F, C and D.

Source: Ljung, "System Identification", 1999, chapters 4 and 7.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mckibben.estimators.data import Run

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Orders:
    """How many coefficients each polynomial has, beside the leading ones.

    Parameters
    ----------
    b : int
        Coefficients of B, at least 1.
    a, f, c, d : int
        Orders of the others.
    delay : int
        Samples before B's first coefficient.
    lags : tuple of int, optional
        Of B's coefficients, in samples, instead of the next ones after the delay.
    """

    b: int
    a: int = 0
    f: int = 0
    c: int = 0
    d: int = 0
    delay: int = 0
    lags: tuple[int, ...] | None = None

    @property
    def input_lags(self) -> tuple[int, ...]:
        """By how many samples the input of each coefficient of B lies back."""
        return self.lags or tuple(range(self.delay, self.delay + self.b))

    @property
    def poles(self) -> int:
        """Order of the recursion from input to output: A or F, of which a model has one."""
        return self.a + self.f

    @property
    def size(self) -> int:
        """Parameters: B, poles, C, D and a constant."""
        return self.b + self.poles + self.c + self.d + 1


@dataclass(frozen=True)
class Polynomials:
    """The coefficients, those after the leading 1 where there is one, and the constant."""

    b: Array
    poles: Array
    c: Array
    d: Array
    constant: float

    @classmethod
    def of(cls, theta: Array, orders: Orders) -> Polynomials:
        """Return the polynomials of a parameter vector."""
        sizes = np.cumsum([orders.b, orders.poles, orders.c, orders.d])
        b, poles, c, d, rest = np.split(theta, sizes)
        return cls(b, poles, c, d, float(rest[0]))


def spectral_radius(tail: Array) -> float:
    """Return the largest size of the roots of a polynomial with a leading 1."""
    if tail.size == 0 or not np.isfinite(tail).all():
        return 0.0 if tail.size == 0 else np.inf
    if tail.size > 2:
        return float(np.abs(np.roots([1.0, *tail])).max())
    a, b = float(tail[0]), float(tail[1]) if tail.size == 2 else 0.0
    inside = a * a - 4.0 * b
    return 0.5 * (abs(a) + inside**0.5) if inside >= 0 else b**0.5


def errors(theta: Array, orders: Orders, run: Run) -> tuple[Array, Array]:
    """Return the prediction errors of a run without its start, and their derivatives by theta.

    Returns
    -------
    errors : array, shape (n,)
    jacobian : array, shape (n, size + poles)
        By theta, then by the start of this run, in which the errors are linear.
    """
    from scipy.signal import lfilter

    p = Polynomials.of(theta, orders)
    poles, c, d = np.array([1.0, *p.poles]), np.array([1.0, *p.c]), np.array([1.0, *p.d])
    n = run.u.size
    u = run.u

    def later(x: Array, samples: int) -> Array:
        moved = np.zeros_like(x)
        moved[samples:] = x[: x.size - samples] if samples else x
        return moved

    def by_noise(x: Array) -> Array:
        return np.asarray(lfilter(d, c, x))

    def alone(denominator: Array, x: Array) -> Array:
        return np.asarray(lfilter([1.0], denominator, x))

    # a filter at rest answers what comes later as much later, so each is run only once
    lags = orders.input_lags
    driven = sum((b * later(u, lag) for lag, b in zip(lags, p.b, strict=True)), np.zeros(n))
    impulse = np.eye(1, n)[0]
    by_constant = -by_noise(np.ones(n))
    if orders.a:
        # equation error: the recursion is taken on measured outputs
        gap = np.asarray(lfilter(poles, [1.0], run.y)) - driven - p.constant
        by_input, by_start = -by_noise(u), -by_noise(impulse)
        behind = by_noise(run.y)
    else:
        free = alone(poles, driven)
        gap = run.y - free - p.constant
        by_input, by_start = -by_noise(alone(poles, u)), -by_noise(alone(poles, impulse))
        behind = by_noise(alone(poles, free))
    e = by_noise(gap)
    by_b = [later(by_input, lag) for lag in lags]
    by_poles = [later(behind, i + 1) for i in range(orders.poles)]
    starts = [later(by_start, k) for k in range(orders.poles)]
    whitened_e, whitened_gap = alone(c, e), alone(c, gap)
    by_c = [-later(whitened_e, i + 1) for i in range(orders.c)]
    by_d = [later(whitened_gap, i + 1) for i in range(orders.d)]
    return e, np.column_stack([*by_b, *by_poles, *by_c, *by_d, by_constant, *starts])
