"""Make the example recordings: a small force balance of a muscle with a hanging load.

The muscle pulls with the braid-geometry force of a 20 mm, 200 mm muscle; against it stand the load, a
stiffening bladder with slow relaxation, and friction between braid and bladder as a few elasto-plastic
elements whose limits grow with pressure and differ between contraction and extension. None of the
hysteresis models of the package is in it.

Run: python examples/make.py
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import mckibben

Array = NDArray[np.float64]

SAMPLE_TIME = 0.02  # s
REST_LENGTH = 200.0  # mm
RADIUS = 10.0  # mm
BRAID_ANGLE = math.radians(25.0)
LOAD = 20.0 * 9.81  # N
BLADDER = (900.0, 9000.0)  # N per contraction, and per contraction cubed
RELAXATION = (350.0, 6.0)  # N per contraction, s
REACH = (0.002, 0.006, 0.015, 0.04)  # contraction at which each friction element slips
FRICTION = ((9.0, 8.0, 7.0, 5.0), (7.0, 6.0, 4.0, 4.0))  # N per bar, contracting and extending
SENSOR_NOISE = (0.004, 0.02)  # bar, mm


def pull(pressure: float, contraction: float) -> float:
    """Return the braid-geometry force [N]."""
    a, b = 3 / math.tan(BRAID_ANGLE) ** 2, 1 / math.sin(BRAID_ANGLE) ** 2
    area = math.pi * RADIUS**2
    return area * 0.1 * pressure * (a * (1 - 1.25 * contraction) ** 2 - b)


@dataclass
class Muscle:
    """What the muscle remembers: contraction, its relaxed part, and every friction element's stretch."""

    contraction: float = 0.0
    relaxed: float = 0.0
    stretch: Array = field(default_factory=lambda: np.zeros(len(REACH)))

    def surplus(self, pressure: float, contraction: float) -> float:
        """Return the force that is left over at a contraction [N]; it falls as the muscle contracts."""
        force = pull(pressure, contraction) - LOAD - BLADDER[0] * contraction
        force -= BLADDER[1] * contraction**3 + RELAXATION[0] * (contraction - self.relaxed)
        for stretch, reach, up, down in zip(self.stretch, REACH, *FRICTION, strict=True):
            share = stretch + (contraction - self.contraction) / reach
            limit = (up if share > 0 else down) * (pressure + 0.3)
            force -= limit * min(max(share, -1.0), 1.0)
        return force

    def step(self, pressure: float) -> float:
        """Return the contraction at which the forces balance, one sample later."""
        low, high = -0.02, 0.35
        for _ in range(45):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if self.surplus(pressure, middle) > 0 else (low, middle)
        moved = middle - self.contraction
        self.stretch = np.clip(self.stretch + moved / np.array(REACH), -1.0, 1.0)
        self.relaxed += -math.expm1(-SAMPLE_TIME / RELAXATION[1]) * (middle - self.relaxed)
        self.contraction = middle
        return middle


def ramps(turning_points: list[float], rate: float) -> Array:
    """Return a pressure that goes from one turning point to the next at a rate [bar/s]."""
    times = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(turning_points)) / rate)])
    return np.interp(np.arange(0.0, times[-1], SAMPLE_TIME), times, turning_points)


def record(name: str, turning_points: list[float], seed: int, notes: str) -> mckibben.Recording:
    """Return the recording of a run through turning points [bar], with sensor noise."""
    rng = np.random.default_rng(seed)
    pressure = ramps(turning_points, 1.0)
    muscle = Muscle()
    displacement = REST_LENGTH * np.array([muscle.step(p) for p in pressure.tolist()])
    return mckibben.Recording(
        {
            "pressure": np.round(
                pressure + SENSOR_NOISE[0] * rng.standard_normal(pressure.size), 4
            ),
            "displacement": np.round(
                displacement + SENSOR_NOISE[1] * rng.standard_normal(pressure.size), 3
            ),
        },
        SAMPLE_TIME,
        meta={
            "name": name,
            "rig": "simulated 20 mm, 200 mm muscle with a hanging 20 kg",
            "notes": notes,
        },
    )


def main() -> None:
    """Write both recordings beside this file."""
    folder = Path(__file__).parent
    falling = [1.0]
    for top in np.linspace(5.5, 1.8, 8):
        falling += [float(top), 1.0]
    mckibben.write(
        record("decaying_triangle", falling, 1, "triangle whose amplitude falls each cycle"),
        folder / "decaying_triangle.csv",
    )
    irregular = np.random.default_rng(2).uniform(1.0, 5.4, 24).tolist()
    mckibben.write(
        record(
            "irregular_triangle", [1.0, *irregular], 3, "triangle with irregular turning points"
        ),
        folder / "irregular_triangle.csv",
    )


if __name__ == "__main__":
    main()
