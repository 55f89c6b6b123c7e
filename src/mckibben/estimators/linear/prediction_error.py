"""Prediction-error minimisation: Gauss-Newton with damping, from many starts, stable at every step.

The start of every run is linear in the errors and solved for in each evaluation, so the search
runs in the polynomials alone. A step that would leave the stable region is shortened. Several
starts guard against local minima: the high-order ARX model reduced by Steiglitz and McBride's
iteration, slow and fast lags, and random stable poles; the best of all is kept.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mckibben.estimators.data import Run
from mckibben.estimators.descent import reduced
from mckibben.estimators.linear.polynomials import Orders, Polynomials, errors, spectral_radius
from mckibben.estimators.search import Tracker

Array = NDArray[np.float64]

STABLE = 1.0 - 1e-7
"""Largest pole."""

INVERTIBLE = 0.9999
"""Largest root of C."""

FIRST_STEPS, FOLLOWED, STEPS = 8, 3, 60
"""Steps taken from every start; how many of the best, at different places, are followed; how far."""

SAME = 1e-6
SHORTEST = 1e-9
"""Relative improvement at which a descent has arrived."""


def admissible(theta: Array, orders: Orders) -> bool:
    """Tell whether poles, and the roots of C and D, lie where they may."""
    p = Polynomials.of(theta, orders)
    return (
        bool(np.isfinite(theta).all())
        and spectral_radius(p.poles) < STABLE
        and spectral_radius(p.c) < INVERTIBLE
        and spectral_radius(p.d) <= 1.0 + 1e-9
    )


def evaluate(theta: Array, orders: Orders, runs: Sequence[Run]) -> tuple[Array, Array, float]:
    """Return errors, derivatives with every start solved for, and the RMSE, where samples count."""
    found, slopes = [], []
    for run in runs:
        e, jacobian = errors(theta, orders, run)
        e, jacobian = e[run.counts], jacobian[run.counts]
        own, starts = jacobian[:, : orders.size], jacobian[:, orders.size :]
        if starts.shape[1]:
            # the free responses fade: samples beyond them say nothing of the start
            q = np.linalg.qr(starts)[0]
            e = e - q @ (q.T @ e)
            own = own - q @ (q.T @ own)
        found.append(e)
        slopes.append(own)
    e = np.concatenate(found)
    return e, np.concatenate(slopes), float(np.sqrt(np.mean(e**2)))


def minimise(
    runs: Sequence[Run], orders: Orders, starts: Sequence[Array], tracker: Tracker
) -> Array:
    """Return the best parameters found from all starts."""
    tracker.budget = len(starts) * FIRST_STEPS + FOLLOWED * STEPS
    begun = [
        _descend(start, orders, runs, tracker, FIRST_STEPS)
        for start in starts
        if admissible(start, orders)
    ]
    begun.sort(key=lambda found: found[1])
    followed: list[tuple[Array, float]] = []
    for theta, cost in begun:
        # starts that have come to the same place need to be followed only once
        if all(abs(cost - other) > SAME * cost for _, other in followed):
            followed.append((theta, cost))
    ended = [_descend(theta, orders, runs, tracker, STEPS) for theta, _ in followed[:FOLLOWED]]
    return min(ended, key=lambda found: found[1])[0]


def _descend(
    theta: Array, orders: Orders, runs: Sequence[Run], tracker: Tracker, steps: int
) -> tuple[Array, float]:
    e, jacobian, cost = evaluate(theta, orders, runs)
    tracker.saw(theta, cost)
    damping = 1e-4
    for _ in range(steps):
        size = np.maximum(np.linalg.norm(jacobian, axis=0), 1e-300)
        triangle, right = reduced(jacobian / size, e)
        rest = np.append(-right, np.zeros(size.size))
        improved = False
        for _ in range(12):
            system = np.vstack([triangle, np.sqrt(damping) * np.eye(size.size)])
            step = np.linalg.lstsq(system, rest, rcond=None)[0]
            tried = theta + step / size
            if admissible(tried, orders):
                e_tried, jacobian_tried, cost_tried = evaluate(tried, orders, runs)
                tracker.saw(tried, cost_tried)
                if np.isfinite(cost_tried) and cost_tried < cost:
                    improved = True
                    break
            damping *= 6.0
        if not improved:
            break
        gained = (cost - cost_tried) / cost if cost > 0 else 0.0
        theta, e, jacobian, cost = tried, e_tried, jacobian_tried, cost_tried
        damping = max(damping / 10.0, 1e-12)
        if gained < SHORTEST:
            break
    return theta, cost


def arx(runs: Sequence[Run], orders: Orders) -> Array:
    """Return the least-squares ARX model: linear, so found at once."""
    theta = np.zeros(orders.size)
    e, jacobian, _ = evaluate(theta, orders, runs)
    return np.asarray(theta - np.linalg.lstsq(jacobian, e, rcond=1e-12)[0])


def starting_points(runs: Sequence[Run], orders: Orders, n_starts: int, seed: int) -> list[Array]:
    """Return parameters to start from: reduced ARX, lags of a few speeds, random stable poles."""
    rng = np.random.default_rng(seed)
    n = orders.poles
    candidates = [_steiglitz_mcbride(runs, orders, rounds) for rounds in (0, 1, 3, 10)]
    speeds = [np.array([0.2]), np.array([0.9]), np.array([0.99, 0.9]), np.array([0.9995, 0.97])]
    for speed in speeds:
        spread = np.resize(speed, n) * (1 - 1e-3 * np.arange(n))
        candidates.append(np.asarray(np.poly(spread)[1:], dtype=np.float64))
    while len(candidates) < n_starts:
        poles = 1 - 10 ** rng.uniform(-4, 0, n)
        candidates.append(np.asarray(np.poly(poles)[1:], dtype=np.float64))
    return [
        _complete(poles, runs, orders) for poles in candidates if spectral_radius(poles) < STABLE
    ]


def _complete(poles: Array, runs: Sequence[Run], orders: Orders) -> Array:
    """Return parameters with these poles and the B and constant that are best for them."""
    theta = np.zeros(orders.size)
    theta[orders.b : orders.b + orders.poles] = poles
    e, jacobian, _ = evaluate(theta, orders, runs)
    linear = [*range(orders.b), orders.size - 1]
    theta[linear] = -np.linalg.lstsq(jacobian[:, linear], e, rcond=1e-12)[0]
    return theta


def _steiglitz_mcbride(runs: Sequence[Run], orders: Orders, rounds: int) -> Array:
    """Return poles by ARX, iterated on data filtered by the poles found before."""
    from scipy.signal import lfilter

    simple = replace(orders, a=orders.poles, f=0, c=0, d=0)
    poles = np.zeros(orders.poles)
    for _ in range(rounds + 1):
        filtered = [
            Run(
                np.asarray(lfilter([1.0], [1.0, *poles], run.u)),
                np.asarray(lfilter([1.0], [1.0, *poles], run.y)),
                run.counts,
                run.sample_time,
                run.scheduled,
            )
            for run in runs
        ]
        found = arx(filtered, simple)[orders.b : orders.b + orders.poles]
        if spectral_radius(found) >= STABLE:
            roots = np.roots([1.0, *found])
            outside = np.abs(roots) >= STABLE
            roots[outside] /= np.abs(roots[outside]) * (1 + 1e-4)
            found = np.real(np.poly(roots))[1:]
        poles = found
    return poles
