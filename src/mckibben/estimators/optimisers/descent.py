"""Descent of a sum of squares by Gauss-Newton steps, each as long as it is trusted.

One loop, with two ways to trust: a region about the parameters, whose radius follows from how well the
last step kept its promise (Moré); or damping, which grows until a step leads down, where steps have
bounds of their own (Marquardt). The derivatives are brought to a triangle once a step, so that trying
how far to trust them costs next to nothing beside the evaluations.

Sources: Moré, "The Levenberg-Marquardt algorithm: implementation and theory", 1978; Marquardt, "An
algorithm for least-squares estimation of nonlinear parameters", 1963.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator
from itertools import count

import numpy as np

from mckibben.arrays import Array

Steps = Callable[[Array, Array, Array, float], Iterable[Array]]
"""From parameters, slopes, errors and a damping, where a damped step may lead: first what is best.

Slopes and errors are as many as parameters: those that make the same steps as all of them.
"""

SHORTEST = 1e-9
"""Step, relative to the parameters in their scales, that is none."""

LIGHTEST = 1e-12
"""Damping that is as good as none."""


class Trust(ABC):
    """How far the slopes are trusted."""

    @abstractmethod
    def steps(self, theta: Array, slopes: Array, errors: Array) -> Iterator[Array]:
        """Yield where to go, and after every refusal where to go instead, until there is no step."""

    @abstractmethod
    def took(self, gained: float) -> bool:
        """Learn what the last step gained; tell whether more could be gained where it did little."""


def descend(
    errors: Callable[[Array], Array],
    slopes: Callable[[Array], Array],
    start: Array,
    trust: Trust,
    *,
    least_gain: float,
    most_evaluations: float = np.inf,
) -> Iterator[tuple[Array, float]]:
    """Yield the start, then parameters of ever smaller sums of squares, until these stop falling.

    Parameters
    ----------
    errors : callable
        Parameters, shape (p,), to errors, shape (n,), n >= p; finite at the start. Others refuse a step.
    slopes : callable
        Parameters to the derivatives of the errors, shape (n, p); asked for where errors were last.
    start : array, shape (p,)
    trust : Trust
    least_gain : float
        Share of the sum of squares that a step has to gain for another to follow.
    most_evaluations : int
        Of the errors.

    Yields
    ------
    array, shape (p,), and float
        Parameters, and their sum of squares.
    """
    theta, e = start, errors(start)
    cost, evaluations = float(e @ e), 1
    yield theta, cost
    while cost > 0.0:
        for tried in trust.steps(theta, slopes(theta), e):
            if evaluations >= most_evaluations:
                return
            e_tried = errors(tried)
            evaluations += 1
            found = float(e_tried @ e_tried)
            if found < cost:
                break
        else:
            return
        gained, before = cost - found, cost
        theta, e, cost = tried, e_tried, found
        yield theta, cost
        if not trust.took(gained) and gained < least_gain * before:
            return


class Radius(Trust):
    """A region of trust.

    Parameters
    ----------
    start, scale : arrays, shape (p,)
        Where the descent starts, and how far each parameter may be thought to move.
    """

    def __init__(self, start: Array, scale: Array) -> None:
        self.scale = scale
        self.radius = float(np.linalg.norm(start / scale)) or 1.0
        self.length = self.promised = 0.0

    def steps(self, theta: Array, slopes: Array, errors: Array) -> Iterator[Array]:
        """Yield the best place within the radius, and within ever smaller ones."""
        triangle, right = reduced(slopes * self.scale, errors)
        least = SHORTEST * float(np.linalg.norm(theta / self.scale))
        while True:
            step = trusted(triangle, right, self.radius)
            self.length = float(np.linalg.norm(step))
            if self.length <= least:
                return
            self.promised = float(right @ right - np.sum((triangle @ step + right) ** 2))
            yield theta + step * self.scale
            self.radius = 0.25 * self.length

    def took(self, gained: float) -> bool:
        """Widen the region where the promise was kept at its border, narrow it where it was broken."""
        ratio = gained / self.promised
        if not ratio >= 0.25:
            self.radius = 0.25 * self.length
        elif ratio > 0.75 and self.length > 0.95 * self.radius:
            self.radius *= 2.0
        return not ratio > 0.25


def marquardt(
    theta: Array, slopes: Array, errors: Array, damping: float, floor: float = 0.0
) -> Iterable[Array]:
    """Return where the damped step leads; see `damped`."""
    return (theta + damped(slopes, errors, damping, floor),)


class Damping(Trust):
    """Damping that grows until a step leads down, and eases after.

    Parameters
    ----------
    first, heaviest : float
        Damping to begin with, and that at which no step is left.
    growth, speeding : float
        Factor after a refusal, and by how much that grows after each.
    easing : float
        Divisor after a step.
    tries : int, optional
        Most dampings tried for a step.
    steps : callable
        Where damped steps lead; default `marquardt`.
    """

    def __init__(
        self,
        first: float,
        heaviest: float = np.inf,
        *,
        growth: float = 4.0,
        speeding: float = 2.0,
        easing: float = 10.0,
        tries: int | None = None,
        steps: Steps = marquardt,
    ) -> None:
        self.damping, self.heaviest = first, heaviest
        self.growth, self.speeding, self.easing = growth, speeding, easing
        self.tries, self.leads = tries, steps

    def steps(self, theta: Array, slopes: Array, errors: Array) -> Iterator[Array]:
        """Yield where steps of ever heavier damping lead."""
        growth = self.growth
        triangle, right = reduced(slopes, errors)
        for tried in count():
            if self.damping >= self.heaviest or tried == self.tries:
                return
            yield from self.leads(theta, triangle, right, self.damping)
            self.damping, growth = self.damping * growth, growth * self.speeding

    def took(self, gained: float) -> bool:
        """Ease the damping."""
        self.damping = max(self.damping / self.easing, LIGHTEST)
        return False


def reduced(slopes: Array, errors: Array) -> tuple[Array, Array]:
    """Return a triangle, shape (p, p), and p errors that make the same steps as all of them."""
    p = slopes.shape[1]
    triangle: Array = np.linalg.qr(np.column_stack([slopes, errors]), mode="r")  # type: ignore[assignment]
    return triangle[:p, :p], triangle[:p, p]


def damped(slopes: Array, errors: Array, damping: float, floor: float = 0.0) -> Array:
    """Return the step with the least errors and damped length, by the sizes of the slopes.

    Parameters
    ----------
    floor : float
        What is added to every slope's square, relative to the sum of all: a parameter that next to
        nothing depends on then stays where it is.
    """
    squares = (slopes**2).sum(axis=0)
    size = np.maximum(np.sqrt(squares + floor * squares.sum()), 1e-300)
    triangle, right = reduced(slopes / size, errors)
    system = np.vstack([triangle, np.sqrt(damping) * np.eye(size.size)])
    rest = np.append(-right, np.zeros(size.size))
    return np.asarray(np.linalg.lstsq(system, rest, rcond=None)[0] / size)


def trusted(triangle: Array, right: Array, radius: float) -> Array:
    """Return the step s, no longer than the radius, with the least |triangle s + right|."""
    left, singular, turned = np.linalg.svd(triangle)
    kept = singular > np.finfo(float).eps * right.size * singular[0]
    singular, along = singular[kept], -(left.T @ right)[kept]
    damping = 0.0
    for _ in range(50):
        step = singular * along / (singular**2 + damping)
        length = float(np.linalg.norm(step))
        if length <= 1.01 * radius:
            break
        # Newton's method on 1 / length, which is nearly linear in the damping
        bend = float(np.sum(step**2 / (singular**2 + damping)))
        damping += (length / radius - 1.0) * length**2 / bend
    return np.asarray((step * min(1.0, radius / length if length > 0 else 1.0)) @ turned[kept])
