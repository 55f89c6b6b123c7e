"""How parameters are found: linear ones solved for, the others searched within bounds."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Progress = Callable[[float, float], None]
"""Called with the share of the work done, 0 to 1, and the best RMSE so far."""


class Interrupted(Exception):  # noqa: N818  # it is no error: the best so far is kept
    """Raised inside a search when the user interrupts it, once there is something to keep."""


_whole: ContextVar[bool] = ContextVar("_whole", default=False)


@contextmanager
def whole_searches() -> Iterator[None]:
    """Let an interrupt end a fit within this context, instead of leaving the best found until then.

    A search cut short is no model to be ranked, or kept as finished.
    """
    before = _whole.set(True)
    try:
        yield
    finally:
        _whole.reset(before)


@dataclass
class Tracker:
    """Keeps the best point of a search, reports progress, and survives an interrupt.

    Parameters
    ----------
    progress : callable or None
        Told the share done and the best cost.
    budget : int
        Evaluations expected, for the share done.
    """

    progress: Progress | None = None
    budget: int = 1
    evaluations: int = 0
    best_cost: float = np.inf
    best: Array | None = None
    interrupted: bool = False

    def end(self) -> None:
        """Pass an interrupt on where only whole searches are wanted.

        Raises
        ------
        KeyboardInterrupt
            If the search was interrupted.
        """
        if self.interrupted and _whole.get():
            raise KeyboardInterrupt

    def saw(self, point: Array, cost: float) -> None:
        """Take note of one evaluation."""
        self.evaluations += 1
        if cost < self.best_cost:
            self.best_cost, self.best = cost, np.array(point)
        if self.progress is not None and self.evaluations % 16 == 0:
            self.progress(min(self.evaluations / self.budget, 0.99), self.best_cost)


def solve_linear(
    basis: Array,
    target: Array,
    *,
    nonnegative: bool,
    least: Array | None = None,
    with_offset: bool = True,
) -> tuple[Array, float]:
    """Solve ``basis @ x + offset = target`` in least squares.

    Columns are centred, which solves for the offset exactly, then reduced by an orthogonal (QR)
    factorisation; normal equations would square the condition of neighbouring operators.

    Parameters
    ----------
    basis : array, shape (n, m)
    target : array, shape (n,)
    nonnegative : bool
        Whether every x must be at least 0.
    least : array, shape (m,), optional
        Then the least that every x may be, instead.
    with_offset : bool
        Whether the offset is free, or 0.

    Returns
    -------
    x : array, shape (m,)
    offset : float
    """
    from scipy.optimize import nnls

    m = basis.shape[1]
    means, mean = np.zeros(m), 0.0
    if with_offset:
        means, mean = basis.mean(axis=0), float(target.mean())
    triangle: Array = np.linalg.qr(np.column_stack([basis - means, target - mean]), mode="r")  # type: ignore[assignment]
    scale = np.maximum(np.sqrt((triangle[:, :m] ** 2).sum(axis=0)), 1e-300)
    scaled, right = triangle[:, :m] / scale, triangle[:, m]
    if nonnegative:
        floor = np.zeros(m) if least is None else least
        x = floor + nnls(scaled, right - triangle[:, :m] @ floor, maxiter=30 * m)[0] / scale
    else:
        x = np.linalg.lstsq(scaled, right, rcond=1e-12)[0] / scale
    return x, mean - float(means @ x)


EXCHANGES = 3
"""How often groups of parameters are exchanged and what was found refined, at most."""


@dataclass(frozen=True)
class Choice:
    """Values that some of the parameters may be exchanged for, together.

    Parameters
    ----------
    places : array of int, shape (k,)
        Which parameters.
    values : array, shape (n, k)
        What to try for them.
    """

    places: NDArray[np.intp]
    values: Array


def exchange(cost: Callable[[Array], float], start: Array, choices: Sequence[Choice]) -> Array:
    """Return the best point found by exchanging group after group, or the start where none is better.

    It leaves local minima from which no small step leads on.
    """
    best, least = start, cost(start)
    for choice in choices:
        held = best
        for values in choice.values:
            tried = held.copy()
            tried[choice.places] = values
            if (found := cost(tried)) < least:
                best, least = tried, found
    return best


def multi_start(
    residuals: Callable[[Array], Array],
    starts: Sequence[Array],
    lower: Array,
    upper: Array,
    tracker: Tracker,
    *,
    n_refined: int,
    max_evaluations: int,
    jacobian: Callable[[Array], Array] | None = None,
    choices: Sequence[Choice] = (),
) -> Array:
    """Return the best point found by refining the most promising of many starts within bounds.

    Every start is evaluated once; the best ``n_refined`` are refined by a bounded trust-region
    method, with the derivatives of the residuals where given, else with finite differences. Where
    there are choices, the best is then improved by exchange, and refined again.
    """
    from scipy.optimize import least_squares

    def evaluate(point: Array) -> Array:
        try:
            r = residuals(point)
            tracker.saw(point, float(np.sqrt(np.mean(r**2))))
        except KeyboardInterrupt:
            if tracker.best is None:
                raise
            raise Interrupted from None
        return r

    def slopes(point: Array) -> Array:
        assert jacobian is not None
        try:
            return jacobian(point)
        except KeyboardInterrupt:
            raise Interrupted from None

    def cost(point: Array) -> float:
        return float(np.mean(evaluate(point) ** 2))

    def refine(start: Array) -> None:
        margin = 1e-9 * (upper - lower)
        least_squares(
            evaluate,
            np.clip(start, lower + margin, upper - margin),
            jac="2-point" if jacobian is None else slopes,
            bounds=(lower, upper),
            x_scale=np.maximum(upper - lower, 1e-12),
            max_nfev=max_evaluations,
            ftol=1e-7,
            xtol=1e-7,
        )

    inside = [np.clip(start, lower, upper) for start in starts]
    try:
        costs = [cost(start) for start in inside]
        for index in np.argsort(costs, kind="stable")[:n_refined]:
            refine(inside[index])
        for _ in range(EXCHANGES if choices else 0):
            assert tracker.best is not None
            best = tracker.best
            better = exchange(cost, best, choices)
            if better is best:
                break
            refine(better)
    except Interrupted:
        tracker.interrupted = True
    assert tracker.best is not None
    return tracker.best


@dataclass(frozen=True)
class Swarm:
    """Settings of particle swarm optimisation.

    Parameters
    ----------
    particles, iterations : int
        Size of the swarm and number of moves.
    inertia : (float, float)
        At the first and last move, linear between; equal for a constant.
    c1, c2 : float
        Pull towards a particle's own best and the swarm's best.
    """

    particles: int = 20
    iterations: int = 50
    inertia: tuple[float, float] = (0.9, 0.4)
    c1: float = 2.0
    c2: float = 2.0


def particle_swarm(
    costs: Callable[[Array], Array],
    lower: Array,
    upper: Array,
    swarm: Swarm,
    tracker: Tracker,
    seed: int,
) -> Array:
    """Return the best point of a particle swarm within bounds.

    Source: "High-Precision Displacement and Force Hybrid Modeling of Pneumatic Artificial Muscle
    Using 3D PI-NARMAX Model", Section 3.3: velocities from own and global best, inertia falling
    linearly. Particles that leave the bounds stop at them, and none moves further than a fifth of
    the bounds at a time.

    Parameters
    ----------
    costs : callable
        Maps points, shape (particles, m), to their costs, shape (particles,), all at once.
    """
    rng = np.random.default_rng(seed)
    shape = (swarm.particles, lower.size)
    position = rng.uniform(lower, upper, shape)
    velocity = rng.uniform(-1, 1, shape) * 0.1 * (upper - lower)
    own, own_cost = position.copy(), np.full(swarm.particles, np.inf)
    first, last = swarm.inertia
    try:
        for iteration in range(swarm.iterations + 1):
            cost = np.nan_to_num(costs(position), nan=np.inf)
            better = cost < own_cost
            own[better], own_cost[better] = position[better], cost[better]
            for point, value in zip(position, cost, strict=True):
                tracker.saw(point, float(value))
            leader = own[np.argmin(own_cost)]
            weight = first + (last - first) * iteration / max(swarm.iterations, 1)
            pulls = rng.random((2, *shape))
            velocity = (
                weight * velocity
                + swarm.c1 * pulls[0] * (own - position)
                + swarm.c2 * pulls[1] * (leader - position)
            )
            velocity = np.clip(velocity, -0.2 * (upper - lower), 0.2 * (upper - lower))
            position = position + velocity
            outside = (position < lower) | (position > upper)
            velocity[outside] = 0.0
            position = np.clip(position, lower, upper)
    except KeyboardInterrupt:
        if tracker.best is None:
            raise
        tracker.interrupted = True
    assert tracker.best is not None
    return tracker.best
