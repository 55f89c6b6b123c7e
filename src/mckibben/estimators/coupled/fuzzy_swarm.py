"""Antecedents of a fuzzy network by the paper's particle swarm.

Source: "Modeling and Compensation of Stiffness-Dependent Hysteresis Coupling Behavior for Parallel
Pneumatic Artificial Muscle-Driven Soft Manipulator", Algorithm 1. Centres and widths start from N(0, 1),
in the inputs' own units; the consequents' printed start is of no effect, for they are solved for at
once. The inertia is not printed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mckibben.estimators.coupled.fuzzy import Problem, Sets

Array = NDArray[np.float64]

ATTRACTION = 0.5
"""Of a particle's own best and of the swarm's, c_1 and c_2 as printed."""

INERTIA = 0.7

LEAST_WIDTH = 1e-3
"""Of a set; the sign of a width means nothing, since only its square is used."""


@dataclass(frozen=True)
class Swarm:
    """A particle swarm; the defaults are the paper's."""

    particles: int = 20
    iterations: int = 50

    def best(self, problem: Problem, n_sets: int, seed: int, tell: Callable[[float], None]) -> Sets:
        """Return the best antecedents found."""
        rng = np.random.default_rng(seed)
        shape = (problem.x.shape[1], n_sets)
        places = rng.standard_normal((self.particles, 2 * shape[0] * shape[1]))

        def sets(place: Array) -> Sets:
            centres, widths = place.reshape(2, *shape)
            return Sets(centres, np.maximum(np.abs(widths), LEAST_WIDTH))

        def cost(place: Array) -> float:
            return problem.cost(sets(place))

        speeds = np.zeros_like(places)
        own, costs = places.copy(), np.array([cost(place) for place in places])
        for iteration in range(self.iterations):
            best = own[np.argmin(costs)]
            pull = ATTRACTION * rng.uniform(size=(2, *places.shape))
            speeds = INERTIA * speeds + pull[0] * (own - places) + pull[1] * (best - places)
            places = places + speeds
            for k, place in enumerate(places):
                found = cost(place)
                if found < costs[k]:
                    own[k], costs[k] = place, found
            tell((iteration + 1) / self.iterations)
        return sets(own[np.argmin(costs)])
