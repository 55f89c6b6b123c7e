"""Particle swarm optimisation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mckibben.arrays import Array
from mckibben.numerics.tracker import Tracker

WORST = float(np.finfo(np.float64).max)
"""Cost of points whose cost is not finite."""


@dataclass(frozen=True)
class Swarm:
    """Settings of particle swarm optimisation."""

    particles: int = 20
    iterations: int = 50
    inertia: tuple[float, float] = (0.9, 0.4)
    """Inertia at the first and the last iteration, linear between."""

    c1: float = 2.0
    c2: float = 2.0
    """Attraction to a particle's best and to the swarm's best point."""

    fastest: float = 0.2
    """Largest velocity of a particle, relative to the bounds."""

    @property
    def budget(self) -> int:
        """Number of evaluations: of all particles initially, and after every iteration."""
        return self.particles * (self.iterations + 1)


def particle_swarm(
    costs: Callable[[Array], Array],
    lower: Array,
    upper: Array,
    swarm: Swarm,
    tracker: Tracker,
    seed: int | np.random.Generator,
    start: Array,
) -> Array:
    """Return the best point of a particle swarm within bounds, which may be infinite.

    Source: "High-Precision Displacement and Force Hybrid Modeling of Pneumatic Artificial Muscle
    Using 3D PI-NARMAX Model", Section 3.3: velocities from own and global best, inertia falling
    linearly. Particles that leave the bounds stop at them.

    Parameters
    ----------
    costs : callable
        Maps points, shape (particles, m), to their costs, shape (particles,), all at once.
    start : array, shape (particles, m)
        Where the particles are at rest at first.
    """
    rng = np.random.default_rng(seed)
    tracker.budget = swarm.budget
    shape = (swarm.particles, lower.size)
    span = upper - lower
    position, velocity = start, np.zeros(shape)
    best, best_cost = position.copy(), np.full(swarm.particles, np.inf)
    first, last = swarm.inertia
    for iteration in range(swarm.iterations + 1):
        cost = np.nan_to_num(costs(position), nan=WORST, posinf=WORST)
        better = cost < best_cost
        best[better], best_cost[better] = position[better], cost[better]
        for point, value in zip(position, cost, strict=True):
            tracker.update(point, float(value))
        leader = best[np.argmin(best_cost)]
        weight = first + (last - first) * iteration / max(swarm.iterations, 1)
        pulls = rng.random((2, *shape))
        velocity = (
            weight * velocity
            + swarm.c1 * pulls[0] * (best - position)
            + swarm.c2 * pulls[1] * (leader - position)
        )
        velocity = np.clip(velocity, -swarm.fastest * span, swarm.fastest * span)
        position = np.clip(position + velocity, lower, upper)
    return tracker.found
