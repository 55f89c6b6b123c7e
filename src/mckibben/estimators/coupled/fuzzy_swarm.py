"""Antecedents of a fuzzy network by the paper's particle swarm.

Source: "Modeling and Compensation of Stiffness-Dependent Hysteresis Coupling Behavior for Parallel
Pneumatic Artificial Muscle-Driven Soft Manipulator", Algorithm 1. Centres and widths start from N(0, 1),
in the inputs' own units; the consequents' printed start is of no effect, for they are solved for at
once. The inertia is not printed.
"""

from __future__ import annotations

import numpy as np

from mckibben.arrays import Array
from mckibben.estimators.coupled.fuzzy import Problem, Sets
from mckibben.estimators.coupled.swarm import Swarm, particle_swarm
from mckibben.estimators.optimisers.tracker import Tracker

ATTRACTION = 0.5
"""Of a particle's own best and of the swarm's, c_1 and c_2 as printed."""

INERTIA = 0.7

LEAST_WIDTH = 1e-3
"""Of a set; the sign of a width means nothing, since only its square is used."""


def printed_swarm(particles: int = 20, iterations: int = 50) -> Swarm:
    """Return the paper's swarm, of its size or another."""
    return Swarm(particles, iterations, (INERTIA, INERTIA), ATTRACTION, ATTRACTION)


def swarmed(problem: Problem, n_sets: int, swarm: Swarm, seed: int, tracker: Tracker) -> Sets:
    """Return the best antecedents that a swarm without bounds finds."""
    rng = np.random.default_rng(seed)
    shape = (problem.x.shape[1], n_sets)
    start = rng.standard_normal((swarm.particles, 2 * shape[0] * shape[1]))
    nowhere = np.full(start.shape[1], np.inf)

    def sets(place: Array) -> Sets:
        centres, widths = place.reshape(2, *shape)
        return Sets(centres, np.maximum(np.abs(widths), LEAST_WIDTH))

    def costs(places: Array) -> Array:
        return np.array([problem.cost(sets(place)) for place in places])

    return sets(particle_swarm(costs, -nowhere, nowhere, swarm, tracker, rng, start=start))
