"""A balance of more muscles than the coordinates they move, of physics that is none of its own."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import brentq

from mckibben import Recording
from mckibben.estimators.coupled.balance import BalanceEstimator
from mckibben.signals.broadband import random_wave

Array = NDArray[np.float64]

STEP = 0.05


def joint(seed: int, *, noise: float = 0.02) -> Recording:
    """Return a joint between two muscles, with friction that breaks away, moved at random from rest."""
    time = np.arange(900) * STEP
    rises = np.minimum(time / 2.0, 1.0)
    p = np.array([random_wave(time, 0.2, 4.0, seed=10 * seed + k) * rises for k in (1, 2)])
    angle, rubbed, angles = 0.0, 0.0, []

    def excess(now: float, pulls: Array) -> float:
        friction = 4.0 * np.clip(rubbed + now - angle, -0.6, 0.6)
        return float(12.0 * now + friction - pulls @ [60.0 - 0.8 * now, -60.0 - 0.8 * now])

    for pulls in p.T:
        now = brentq(excess, -60.0, 60.0, args=(pulls,), xtol=1e-12)
        rubbed, angle = float(np.clip(rubbed + now - angle, -0.6, 0.6)), now
        angles.append(now)
    measured = np.array(angles) + noise * np.random.default_rng(seed).standard_normal(len(time))
    channels = {"pressure_1": p[0], "pressure_2": p[1], "displacement": measured}
    return Recording(channels, STEP, meta={"name": f"run-{seed}"})


@pytest.fixture(scope="module")
def found() -> BalanceEstimator:
    return BalanceEstimator().fit([joint(seed) for seed in (1, 2)])


def test_two_muscles_at_a_joint_follow_what_was_not_trained(found: BalanceEstimator) -> None:
    other = joint(3)
    missed = found.predict(other).ravel() - other["displacement"]
    assert np.sqrt(np.mean(missed**2)) < 0.02 * np.ptp(other["displacement"])
