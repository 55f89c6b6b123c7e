"""Counters that wrap are seen at any scale, and what jumps for another reason is none."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mckibben.files.wrapping import quanta, wraps
from tests.files.made import one, put

Random = np.random.Generator
SCALES = (1.0, 0.0125, 0.001, 0.1, 10 / 65536, 20 / 65536, 5 / 1023, 360 / 4096)
"""Of encoders, converters of 10, 12 and 16 bits, and decimals."""


def motion(rng: Random, n: int) -> Any:
    """Return sines, decaying or not, triangles, answers to steps, and ramps with holds."""
    t, kind = np.arange(n) / n, rng.integers(5)
    phase = rng.uniform(0.5, 12) * t + rng.uniform()
    if kind < 2:
        return np.sin(2 * np.pi * phase) * np.exp(-3 * kind * t)
    if kind == 2:
        return 4 * np.abs(phase % 1 - 0.5) - 1
    if kind == 3:
        u, y = np.repeat(rng.uniform(-1, 1, size=n // 40 + 1), 40), np.zeros(n)
        for k in range(1, n):
            y[k] = y[k - 1] + 0.1 * (u[k] - y[k - 1])
        return y
    return np.interp(t, np.linspace(0, 1, 12), np.repeat(rng.uniform(-1, 1, 6), 2))


def ordinary(rng: Random) -> Any:
    """Return a signal that does not wrap, of 32 to 131 072 levels."""
    n = int(rng.choice([200, 400, 1000, 4000]))
    k, kind = np.arange(n), rng.integers(8)
    kinds: Mapping[int, Callable[[], Any]] = {
        0: lambda: np.repeat(rng.integers(0, rng.integers(2, 12), size=25), n // 25),  # steps
        1: lambda: (rng.choice([-1, 1]) * k / rng.uniform(12, n / 2)) % 1,  # sawtooth
        2: lambda: np.abs(2 * ((k / rng.uniform(20, n) + rng.uniform()) % 1) - 1),
        3: lambda: rng.standard_normal(n),
        4: lambda: np.clip(2 * motion(rng, n), -1, 1),  # saturated
        5: lambda: k // rng.integers(3, n // 3) % 2,  # square wave
        6: lambda: k // rng.integers(2, 20) % rng.integers(3, 20),  # stairs
        7: lambda: motion(rng, n),
    }
    y = kinds[int(kind)]()
    y = (y - y.min()) / max(np.ptp(y), 1e-9)
    noise = rng.choice([0, 0, 0.3, 1, 3, 10]) * rng.standard_normal(n)
    counts = 2 ** rng.uniform(5, 17) * y + noise
    counts = np.rint(counts) if rng.integers(4) else counts
    return written(rng.choice(SCALES) * counts + rng.choice([0, rng.uniform(-5, 5)]), rng)


def written(values: Any, rng: Random) -> Any:
    """Return values as in a file, where their step does not get lost."""
    rounded = values.astype(np.float32) if rng.integers(2) else [float(f"{v:.9g}") for v in values]
    return values if rng.integers(3) == 0 else np.array(rounded, dtype=np.float64)


def counter(rng: Random) -> tuple[Any, float, Any]:
    """Return a scaled counter that wraps, its range, and what it would be with more bits."""
    while True:
        n, bits = int(rng.choice([400, 1000, 4000])), int(rng.choice([8, 10, 12, 16, 32]))
        size, scale = 2.0**bits, rng.choice(SCALES)
        near_zero = bits == 32 or rng.integers(3) == 0
        reach = 2 ** rng.uniform(6, 12) if near_zero else rng.uniform(0.3, 6) * size
        counts = reach * motion(rng, n) + rng.choice([0, 0.3, 1, 3]) * rng.standard_normal(n)
        counts = np.rint(counts + rng.uniform(-0.5, 0.5) * reach)
        wrapped = counts % size
        jumps = np.abs(np.diff(wrapped)).max() > size / 2
        if jumps and np.abs(np.diff(counts)).max() < 0.09 * size:
            values = scale * wrapped + rng.choice([0, rng.uniform(-5, 5)])
            rounded = written(values, rng)
            kept = np.abs(rounded - values).max() < scale / 100
            return rounded if kept else values, scale * size, scale * counts


def test_no_ordinary_signal_wraps() -> None:
    found = [seed for seed in range(1000) if wraps(ordinary(np.random.default_rng(seed)))]
    assert not found


def test_scaled_counters_that_wrap_are_seen_and_unwrapped_exactly() -> None:
    seen = 0
    for seed in range(200):
        values, size, counts = counter(np.random.default_rng(seed))
        if found := wraps(values):
            assert found[0] == pytest.approx(size, rel=1e-6)
            back = values + found[0] * np.cumsum([0.0, *found[1]])
            assert back - back[0] == pytest.approx(counts - counts[0], abs=1e-5 * size)
            seen += 1
    assert seen >= 190


@pytest.mark.parametrize("scale", SCALES)
def test_the_step_of_a_column_is_found(scale: float) -> None:
    rng = np.random.default_rng(0)
    counts: Any = rng.integers(0, 2**12, size=300)
    assert any(unit == pytest.approx(scale, rel=1e-9) for unit in quanta(scale * counts - 3))
    assert not [*quanta(rng.standard_normal(300))]
    assert not [*quanta(np.ones(5))]


K = np.arange(400)


@pytest.mark.parametrize("scale", [1.0, 1e-3, 1 / 64])
@pytest.mark.parametrize(("bits", "step"), [(8, 9), (16, 2003), (16, 20), (32, 20_000)])
@pytest.mark.parametrize("jitter", [0, 3])
def test_time_counters_go_on(
    tmp_path: Path, scale: float, bits: int, step: int, jitter: int
) -> None:
    late = np.random.default_rng(0).integers(0, jitter + 1, size=K.size)
    stamps = (2**bits - 3 * step + step * K + late) % 2**bits
    path = put(tmp_path / "run.csv", "time_ms,pressure_bar", scale * stamps, np.sin(K / 9) + 2)
    assert one(path).duration == pytest.approx(1e-3 * scale * step * (K.size - 1), rel=0.02)


def test_an_encoder_in_millimetres_that_wraps_goes_on(tmp_path: Path) -> None:
    counts = np.rint(60_000 + 20_000 * np.sin(K / 25))
    columns = K / 50, np.sin(K / 9) + 2, 0.0125 * (counts % 2**16)
    path = put(tmp_path / "run.csv", "time_s,pressure_bar,displacement_mm", *columns)
    assert one(path)["displacement"] == pytest.approx(0.0125 * counts)
    assert one(path, raw=True)["displacement"] == pytest.approx(columns[2])
