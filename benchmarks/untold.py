"""Print how well rate dependence and creep can be told from signals, beside what is said of it.

    python benchmarks/untold.py

Least squares of a small effect, a twentieth of the gain, beside 51 columns that any hysteresis without
rate is closely a sum of, offset and drift; of creep, beside lags of 0.5 and 2 s too. Noise is 0.2 % of
the range. A standard error above half of the effect means that it cannot be told.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mckibben import PI, Recording, untold
from mckibben.signals import decaying_triangle, irregular_triangle, random_wave, sine, triangle

Array = NDArray[np.float64]

STEP = 0.05
NOISE = 0.06
EFFECT = 0.4
LEVELS = (4.0, 0.5, 3.4, 1.0, 3.0, 1.4, 2.6, 1.8, 4.0, 0.0)


def lag(u: Array, seconds: float) -> Array:
    """Return a first-order lag that begins at rest."""
    y, keep = u.copy(), np.exp(-STEP / seconds)
    for i in range(1, u.size):
        y[i] = keep * y[i - 1] + (1 - keep) * u[i]
    return y


def hysteresis(u: Array) -> list[Array]:
    """Return what hysteresis without rate is a sum of, with offset and drift."""
    shapes = [u / 4, (u / 4) ** 2, np.sqrt(np.abs(u / 4)), (u / 4) ** 3]
    thresholds = np.linspace(0, 0.5, 12)
    plays = [
        PI(thresholds=(float(r),), weights=(1.0,)).simulate(s) for s in shapes for r in thresholds
    ]
    t = np.arange(u.size) / u.size
    return [*plays, np.ones(u.size), t, t**2]


def error(effect: Array, beside: list[Array]) -> float:
    """Return the standard error of an effect's size, relative to it."""
    design = np.column_stack(beside)
    left, sizes, _ = np.linalg.svd(design / np.linalg.norm(design, axis=0), full_matrices=False)
    known = left[:, sizes > 1e-7 * sizes[0]]
    alone = effect - known @ (known.T @ effect)
    return float(NOISE / np.linalg.norm(EFFECT * alone))


def held(speed: float, hold: float) -> Array:
    """Return an input that goes from level to level, and rests at each."""
    times, levels = [0.0], [0.0]
    for level in LEVELS * 2:
        times += [times[-1] + abs(level - levels[-1]) / speed]
        times += [times[-1] + hold]
        levels += [level, level]
    return np.interp(np.arange(0, times[-1], STEP), times, levels)


def main() -> None:
    t = np.arange(0, 100, STEP)
    signals = {
        "triangle": triangle(t, period=10.0, peaks=4.0),
        "sine": sine(t, period=10.0, peaks=4.0),
        "decaying triangle": decaying_triangle(t, period=12.5, high=4.0, n_cycles=8),
        "irregular triangle": irregular_triangle(t, n_turns=14, high=4.0, seed=1),
        "random wave": random_wave(t, max_frequency=0.3, high=4.0, seed=1),
        "levels held for 4 s": held(4.0, 4.0),
        "levels held for 20 s": held(1.0, 20.0),
    }
    print("signal                 lag 0.5 s  creep 10 s    30 s   100 s   200 s  said")
    for name, u in signals.items():
        base = hysteresis(u)
        slower = [*base, lag(u, 0.5), lag(u, 2.0)]
        errors = [error(lag(u, 0.5), base), *(error(lag(u, s), slower) for s in (10, 30, 100, 200))]
        gaps = untold(Recording({"pressure": u, "displacement": 8 * u + lag(u, 1.0)}, STEP))
        said = [gap.sentence.split(":")[0] for gap in gaps if gap.what in ("rate", "creep")]
        shown = "".join(f"{100 * one:6.0f} %" for one in errors)
        print(f"{name:22s} {shown}  {'; '.join(said) or '-'}")


if __name__ == "__main__":
    main()
