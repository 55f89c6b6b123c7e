"""Lags of signals behind others, at any length and rate."""

from __future__ import annotations

import numpy as np
import pytest

from mckibben import Recording
from mckibben.signals.lags import MOST_SAMPLES, comes_first, lag, lags


def walk(n: int, period: int) -> np.ndarray:
    """Return a smooth signal that does not repeat itself; ``period`` is that of its fastest part."""
    rng, time = np.random.default_rng(0), np.arange(n)
    waves = zip(period * rng.uniform(1.0, 9.0, 20), rng.uniform(0.0, 2 * np.pi, 20), strict=True)
    return np.sum([np.cos(2 * np.pi * time / slow + phase) for slow, phase in waves], axis=0)


@pytest.mark.parametrize("n", [2_000, 2 * MOST_SAMPLES + 1, 5 * MOST_SAMPLES])
@pytest.mark.parametrize("share", [-0.01, 0.0, 0.02])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_delay_is_found_in_samples_of_the_recording(n: int, share: float, sign: float) -> None:
    late = round(share * n)
    whole = walk(n + 2 * abs(late), n // 10)
    start = abs(late)
    cause, effect = whole[start : start + n], sign * whole[start - late : start - late + n]
    found = lag(cause, effect, sign)
    assert found.samples == pytest.approx(late, rel=0.01, abs=0.5)
    assert found.correlation > 0.99


def test_every_motion_has_the_lag_behind_the_drive_of_its_number() -> None:
    n, late = 3_000, {"displacement_1": 20, "displacement_2": 50}
    drives = {f"pressure_{k}": walk(n + 100, 100 + 200 * k)[::way] for k, way in ((1, 1), (2, -1))}
    moved = {
        name: drives[f"pressure_{name[-1]}"][100 - by : 100 - by + n] for name, by in late.items()
    }
    channels = {name: x[100:] for name, x in drives.items()} | moved
    found = lags(Recording(channels, 0.01))
    assert {name: round(one.samples) for name, one in found.items()} == late
    early = lag(channels["displacement_2"], channels["pressure_2"], 1.0)
    assert comes_first(early)
    assert not any(map(comes_first, found.values()))
