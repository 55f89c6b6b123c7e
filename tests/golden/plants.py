"""Small recordings of plants that are written out here, so that no change of the package moves them."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial

import numpy as np
from numpy.typing import NDArray

import mckibben
from mckibben import Recording, example

Array = NDArray[np.float64]

STEP = 0.05
N = 400

LEVELS = ((1.0, 0.4), (0.6, 1.0), (0.8, 0.5), (0.3, 0.7))
"""Peak of every cycle, as a share, of two runs' motions (the second by order of runs)."""


def cycles(peak: float, *, run: int = 0, n: int = N) -> Array:
    """Return four cosine cycles from 0 whose peaks differ."""
    shares = np.array([level[run % 2] for level in LEVELS])
    t = np.arange(n) * 4 / n
    found: Array = 0.5 * peak * shares[t.astype(int)] * (1 - np.cos(2 * np.pi * t))
    return found


def noise(seed: int, size: float, n: int = N) -> Array:
    """Return white noise."""
    return size * np.random.default_rng(seed).standard_normal(n)


def play(u: Array, radius: float, down: float | None = None) -> Array:
    """Return a play operator's output, which may be wider downwards."""
    out, w = np.empty(len(u)), 0.0
    for k, x in enumerate(u):
        w = max(x - radius, min(x + (radius if down is None else down), w))
        out[k] = w
    return out


def stop(u: Array, limit: float) -> Array:
    """Return a spring that slips."""
    out, s = np.empty(len(u)), 0.0
    for k, dx in enumerate(np.diff(u, prepend=u[0])):
        s = min(max(s + dx, -limit), limit)
        out[k] = s
    return out


def lag(u: Array, time: float, down: float | None = None, step: float = STEP) -> Array:
    """Return a first-order lag, which may be slower downwards."""
    out, x = np.empty(len(u)), float(u[0])
    for k, v in enumerate(u):
        tau = time if v > x or down is None else down
        x += (v - x) * -np.expm1(-step / tau)
        out[k] = x
    return out


def muscle(run: int) -> Recording:
    """A loop of pressure and displacement that saturates, is asymmetric, and creeps a little."""
    p = cycles(5.0, run=run)
    bent = 2.0 * np.tanh(0.6 * p - 1.2) + 1.67
    y = 4.0 * bent + 3.0 * play(bent, 0.3, 0.4) + 2.0 * play(bent, 0.8, 1.0)
    y = y + 0.5 * lag(y, 2.0) + noise(run, 0.02)
    return Recording({"pressure": p, "displacement": y}, STEP)


def bundled(run: int) -> Recording:
    """The bundled example, every tenth sample."""
    (whole,) = mckibben.read((example.TRAIN, example.TEST)[run])
    return Recording(
        {name: np.array(whole[name][::10]) for name in ("pressure", "displacement")}, 0.2
    )


def bench(run: int) -> Recording:
    """Force on a muscle in a test stand, pulled while pressure waves."""
    t = np.arange(N) * STEP
    p = 3.0 + run % 2 + 0.8 * np.sin(0.9 * t)
    length = 200.0 - cycles(30.0, run=run) - 2.0
    strain = 1 - length / 200.0
    force = p * (320.0 * (1 - 1.6 * strain) ** 2 - 90.0) + 60.0 * strain - 20.0
    slip = length - length[0]
    force = force + (12.0 + 3.0 * (run // 2)) * stop(slip, 0.8) + 4.0 * stop(slip, 3.0)
    force = force + 1.5 * np.gradient(length, STEP) + noise(run, 0.5)
    return Recording({"length": length, "pressure": p, "force": force}, STEP)


def activated(run: int) -> Recording:
    """Pressure that a contraction needs under a force."""
    contraction = 0.02 + cycles(0.2, run=run)
    force = np.full(N, 80.0 + 60.0 * (run % 2))
    p = 0.3 + 0.004 * force + 8.0 * contraction + 30.0 * contraction**2
    p = p + (15.0 + 10.0 * (run // 2)) * stop(contraction, 0.012) + noise(run, 0.005)
    return Recording({"contraction": contraction, "force": force, "pressure": p}, STEP)


def commanded(run: int) -> Recording:
    """Pressure behind a regulator that is driven by a voltage."""
    volts = cycles(8.0, run=run)
    late = np.concatenate([np.zeros(2), volts[:-2]])
    p = lag(play(0.6 * late, 0.04), 0.15 + 0.1 * (run // 2), 0.35) + noise(run, 0.003)
    return Recording({"voltage": volts, "pressure": p}, STEP)


def shaken(run: int) -> Recording:
    """A mass on a spring beside a Bouc-Wen element, shaken by a force from rest."""
    t, fine = np.arange(N) * STEP, 20
    force = sum(
        a * np.sin(w * t + run)
        for a, w in zip((9.0, 6.0, 5.0, 3.0), (1.9, 4.1, 6.8, 11.0), strict=True)
    )
    h, y, v, z = STEP / fine, 0.0, 0.0, 0.0
    out = np.empty(N)
    for k in range(N):
        out[k] = y
        end = force[min(k + 1, N - 1)]
        for s in range(fine):
            f = force[k] + (end - force[k]) * (s + 0.5) / fine
            z += h * (8.0 * v - 4.0 * abs(v) * z - 2.0 * v * abs(z))
            v += h * (f - 0.8 * v - (20.0 - 6.0 * (run // 2)) * y - 4.0 * z)
            y += h * v
    return Recording({"force": force, "displacement": out + noise(run, 0.002)}, STEP)


def arm(run: int, levels: int = 2) -> Recording:
    """Two muscles round an extensor: of three runs each muscle alone, then both; by stiffness."""
    alone = ((1.0, 0.0), (0.0, 1.0), (1.0, 0.7))[run % 3]
    n, shifts = N // 2, (0, 30)
    p = [
        on * np.roll(cycles(3.0, run=run + k, n=n), shift if sum(alone) > 1 else 0)
        for k, (on, shift) in enumerate(zip(alone, shifts, strict=True))
    ]
    x = np.full(n, 0.5 * (run // 3 % levels))
    pulled = [(6.0 - 0.5 * k) * q + 1.5 * play(q, 0.3) - 0.5 * q**2 for k, q in enumerate(p)]
    channels = {f"pressure_{k + 1}": q for k, q in enumerate(p)} | {"pressure_extensor": x}
    for k in range(2):
        y = (pulled[k] - (0.4 - 0.1 * (run // 3 // levels)) * pulled[1 - k]) / (1 + 0.3 * x)
        channels[f"displacement_{k + 1}"] = y + noise(9 * run + k, 0.02, n)
    return Recording(channels, 2 * STEP)


def isometric(run: int) -> Recording:
    """Force of a muscle held at a length that differs by run, while pressure goes up and down."""
    length = np.full(N // 2, 200.0 - 8.0 * (run // 2))
    p = cycles(5.0, run=run, n=N // 2)
    strain = 1 - length / 200.0
    force = p * (320.0 * (1 - 1.6 * strain) ** 2 - 90.0) + 60.0 * strain - 20.0
    force = force + 6.0 * stop(p, 0.3) + noise(run, 0.8, N // 2)
    return Recording({"length": length, "pressure": p, "force": force}, STEP)


def lifted(run: int) -> Recording:
    """A muscle that lifts a load, which is measured and differs by run and over time."""
    p = 1.0 + cycles(4.0, run=run)
    load = 60.0 + 30.0 * (run % 4) + 15.0 * np.sin(np.linspace(0, 5, N) + run)
    stiff = 1.0 + 0.3 * (run // 4)
    y = (7.0 * p + 2.5 * play(p, 0.3) - 0.4 * p**2 - 0.04 * load) / stiff - 3.0 + noise(run, 0.02)
    return Recording({"pressure": p, "force": load, "displacement": y}, STEP)


PLANTS: dict[str, tuple[Callable[[int], Recording], range]] = {
    "muscle": (muscle, range(2)),
    "bundled": (bundled, range(2)),
    "bench": (bench, range(2)),
    "bench-rougher": (bench, range(2, 4)),
    "activated": (activated, range(2)),
    "activated-rougher": (activated, range(2, 4)),
    "commanded": (commanded, range(2)),
    "commanded-slower": (commanded, range(2, 4)),
    "shaken": (shaken, range(2)),
    "shaken-softer": (shaken, range(2, 4)),
    "lifted": (lifted, range(4)),
    "lifted-stiffer": (lifted, range(4, 8)),
    "arm": (arm, range(6)),
    "arm-of-levels": (partial(arm, levels=4), range(12)),
    "isometric": (isometric, range(10)),
    "arm-looser": (arm, range(6, 12)),
}
"""Name -> how a run is recorded, and which runs."""


@cache
def runs(plant: str) -> tuple[Recording, ...]:
    """Return the runs of a plant."""
    make, numbers = PLANTS[plant]
    return tuple(make(run) for run in numbers)
