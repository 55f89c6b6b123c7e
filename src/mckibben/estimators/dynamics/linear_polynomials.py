"""Prediction errors of linear models, and their derivatives.

A(q) y = B(q) / F(q) u + C(q) / D(q) e; of several inputs, the sum of B_i / F_i u_i. Residuals are
one-step prediction errors e = D / C (A y - B / F u - start), where the start is what the state before
the first sample adds: nothing, a rest at the first input, or, as a rule, a free response estimated with
the rest, one to each run. The input is taken to have been at its first value before. The noise starts
from nothing. ARX has A and B, ARMAX A, B and C, output-error B and F, Box-Jenkins B, F, C and D.

Source: Ljung, "System Identification", 1999, chapters 4 and 7.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from mckibben.arrays import Array
from mckibben.estimators.core.data import Run

Start = Literal["fitted", "first_sample", "virgin"]
"""State before the first sample: estimated; at rest at the first input; at rest at an input of zero.

Equation errors (of models with A) need no state: outputs before are measured, and the first few
samples, which have none before them, are left out of account by a start that is always estimated.
"""


@dataclass(frozen=True)
class Orders:
    """How many coefficients each polynomial has, beside the leading ones.

    Parameters
    ----------
    b : int
        Coefficients of the B of every input, at least 1.
    a, f, c, d : int
        Orders of the others; of F, for every input.
    delay : int
        Samples before B's first coefficient.
    lags : tuple of int, optional
        Of B's coefficients, in samples, instead of the next ones after the delay.
    inputs : int
        How many there are.
    """

    b: int
    a: int = 0
    f: int = 0
    c: int = 0
    d: int = 0
    delay: int = 0
    lags: tuple[int, ...] | None = None
    inputs: int = 1

    @property
    def input_lags(self) -> tuple[int, ...]:
        """By how many samples the input of each coefficient of B lies back."""
        return self.lags or tuple(range(self.delay, self.delay + self.b))

    @property
    def zeros(self) -> int:
        """Coefficients of the B of all inputs."""
        return self.inputs * self.b

    @property
    def recursions(self) -> int:
        """Recursions from inputs to output: the one of A, or the F of every input."""
        return 1 if self.a else self.inputs

    @property
    def poles(self) -> int:
        """Coefficients of all recursions."""
        return self.a + self.inputs * self.f

    @property
    def size(self) -> int:
        """Parameters: B, poles, C, D and a constant."""
        return self.zeros + self.poles + self.c + self.d + 1


@dataclass(frozen=True)
class Polynomials:
    """The coefficients, those after the leading 1 where there is one, and the constant.

    ``b`` has a row for every input, ``poles`` for every recursion.
    """

    b: Array
    poles: Array
    c: Array
    d: Array
    constant: float

    @classmethod
    def of(cls, theta: Array, orders: Orders) -> Polynomials:
        """Return the polynomials of a parameter vector."""
        sizes = np.cumsum([orders.zeros, orders.poles, orders.c, orders.d])
        b, poles, c, d, rest = np.split(theta, sizes)
        n = orders.recursions
        return cls(b.reshape(orders.inputs, -1), poles.reshape(n, -1), c, d, float(rest[0]))

    @property
    def monic(self) -> tuple[Array, ...]:
        """All that have a leading 1, without it: every recursion, C and D."""
        return (*self.poles, self.c, self.d)


def errors(
    theta: Array,
    orders: Orders,
    run: Run,
    start: Start = "fitted",
    state: Array | None = None,
    *,
    only_starts: bool = False,
) -> tuple[Array, Array]:
    """Return the prediction errors of a run, and their derivatives by theta and by its start.

    Parameters
    ----------
    state : array, shape (poles,), optional
        The start, where it is estimated: what the recursion from input to output is given, beside the
        input, at the first samples. Default is nothing.
    only_starts : bool
        Leave out the derivatives by theta.

    Returns
    -------
    errors : array, shape (n,)
    jacobian : array, shape (n, size + poles)
        By theta, then by the start of this run, in which the errors are linear; without the latter
        where the start is not estimated.
    """
    from scipy.signal import lfilter

    p = Polynomials.of(theta, orders)
    c, d = np.array([1.0, *p.c]), np.array([1.0, *p.d])
    n = run.u.size
    estimated = start == "fitted" or orders.a > 0

    def later(x: Array, samples: int) -> Array:
        moved = np.zeros_like(x)
        moved[samples:] = x[: x.size - samples] if samples else x
        return moved

    def by_noise(x: Array) -> Array:
        return np.asarray(lfilter(d, c, x))

    def alone(denominator: Array, x: Array) -> Array:
        return np.asarray(lfilter([1.0], denominator, x))

    # a filter at rest answers what comes later as much later, so each is run only once
    lags, order = orders.input_lags, p.poles.shape[1]
    impulse, ones = np.eye(1, n)[0], np.ones(n)
    by_constant = -by_noise(ones)
    states = None if state is None else state.reshape(-1, order)
    by_b: list[Array] = []
    by_poles: list[Array] = []
    starts: list[Array] = []
    # equation error: the recursion is taken on measured outputs
    gap = np.asarray(lfilter([1.0, *p.poles[0]], [1.0], run.y)) if orders.a else run.y
    if orders.a:
        behind = by_noise(run.y)
        by_poles = [later(behind, i + 1) for i in range(order)]
        starts = [later(-by_noise(impulse), k) for k in range(order)]
    for place, b in enumerate(p.b):
        poles = np.array([1.0, *p.poles[min(place, len(p.poles) - 1)]])
        whole = run.driven[:, place]
        rest = 0.0 if start == "virgin" else float(whole[0])
        u = whole - rest
        driven = sum((one * later(u, lag) for lag, one in zip(lags, b, strict=True)), np.zeros(n))
        held = float(b.sum()) * rest
        if states is not None and place < len(states):
            driven[:order] += states[place, :n]
        if orders.a:
            gap = gap - driven - held
            by_input, by_rest = -by_noise(u), by_constant
        elif estimated:
            free = alone(poles, driven + held)
            gap = gap - free
            by_input, by_start = -by_noise(alone(poles, u)), -by_noise(alone(poles, impulse))
            by_rest = -by_noise(alone(poles, ones))
            behind = by_noise(alone(poles, free))
            by_poles += [later(behind, i + 1) for i in range(order)]
            starts += [later(by_start, k) for k in range(order)]
        else:
            moved, total = alone(poles, driven), float(poles.sum())
            gap = gap - moved - held / total
            by_input = -by_noise(alone(poles, u))
            by_rest = by_constant / total
            behind = by_noise(alone(poles, moved))
            by_poles += [later(behind, i + 1) - held / total * by_rest for i in range(order)]
        by_b += [later(by_input, lag) + rest * by_rest for lag in lags]
    gap = gap - p.constant
    e = by_noise(gap)
    if only_starts:
        return e, np.column_stack([np.empty((n, 0)), *starts])
    whitened_e, whitened_gap = alone(c, e), alone(c, gap)
    by_c = [-later(whitened_e, i + 1) for i in range(orders.c)]
    by_d = [later(whitened_gap, i + 1) for i in range(orders.d)]
    return e, np.column_stack([*by_b, *by_poles, *by_c, *by_d, by_constant, *starts])
