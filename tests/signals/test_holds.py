"""Holds: where all of several signals stand still, whatever their noise and resolution."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from mckibben.signals.holds import holds

LEVELS = np.array([0.0, 3.0, 1.0, 4.0, 0.0])


def stairs(hold: int = 200, ramp: int = 50) -> NDArray[np.float64]:
    """Return levels that are held, with ramps between them, and where each hold begins."""
    at = np.concatenate([[k * (hold + ramp), k * (hold + ramp) + hold] for k in range(LEVELS.size)])
    return np.interp(np.arange(at[-1]), at, np.repeat(LEVELS, 2))


@pytest.mark.parametrize("noise", [0.0, 0.002, 0.02])
@pytest.mark.parametrize("step", [0.0, 0.01, 0.1])
def test_levels_are_found_under_noise_and_coarse_readings(noise: float, step: float) -> None:
    x = stairs() + noise * np.random.default_rng(0).standard_normal(stairs().size)
    x = step * np.round(x / step) if step else x
    found = holds(x[:, np.newaxis], shortest=50)
    assert len(found) == LEVELS.size
    for k, one in enumerate(found):
        assert abs(one.start - 250 * k) < 15
        assert abs(one.stop - 250 * k - 200) < 15


def test_every_signal_must_stand_still() -> None:
    x = stairs()
    load = np.where(np.arange(x.size) < 300, 10.0, 20.0)
    both = holds(np.column_stack([x, load]), shortest=50)
    assert len(both) == LEVELS.size + 1
    assert [one.start for one in both][1:3] == [pytest.approx(250, abs=3), 300]
    assert holds(np.column_stack([x, np.sin(np.arange(x.size) / 30)]), shortest=20) == []


@pytest.mark.parametrize("n", [200, 2000, 20_000])
def test_motion_is_no_hold(n: int) -> None:
    rng = np.random.default_rng(1)
    for x in (np.linspace(0, 1, n), np.sin(np.linspace(0, 30, n)), rng.uniform(size=n)):
        assert holds(x[:, np.newaxis], shortest=max(10, n // 50)) == []


def test_a_range_may_be_that_of_other_recordings() -> None:
    x = 0.004 * np.sin(np.arange(500) / 40)
    assert holds(x[:, np.newaxis], shortest=50) == []
    assert holds(x[:, np.newaxis], spans=[1.0], shortest=50) == [slice(0, 500)]
