"""Particle swarms, of known minima."""

from __future__ import annotations

import numpy as np

from mckibben.numerics.swarm import Swarm, particle_swarm
from mckibben.numerics.tracker import Tracker


def test_a_swarm_finds_the_minimum_and_repeats() -> None:
    lower, upper = np.array([-1.0, -2.0, 0.0]), np.array([1.0, 2.0, 3.0])

    def sphere(points: np.ndarray) -> np.ndarray:
        return np.asarray(((points - 0.3) ** 2).sum(axis=1))

    start = np.random.default_rng(0).uniform(lower, upper, (8, 3))
    first, second = (
        particle_swarm(sphere, lower, upper, Swarm(8, 30), Tracker(), 5, start) for _ in range(2)
    )
    np.testing.assert_array_equal(first, second)
    assert sphere(first[np.newaxis])[0] < 1e-2
