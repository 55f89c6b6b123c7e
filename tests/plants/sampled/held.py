"""A random muscle on a stiff end, held at lengths, or free under loads or against a spring."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from mckibben import Recording
from mckibben.arrays import Array
from tests.plants.sampled import motions, physics
from tests.plants.sampled.draws import (
    LAWS,
    RATES,
    Truth,
    by_pressure,
    draw_friction,
    draw_law,
    draw_rate,
)
from tests.plants.sampled.physics import Drive, Slope


class HeldMuscle:
    """A muscle whose force is measured, in series with the compliance of its end."""

    def __init__(self, rng: np.random.Generator, seed: int, length_noise: float = 0.0) -> None:
        self.rng, self.rest, self.dt = rng, rng.uniform(120, 300), 0.02
        self.law, muscle = draw_law(rng, LAWS[seed % 4], self.rest)
        per_bar, limit = muscle["blocked_N_per_bar"], muscle["largest_contraction"]
        self.top = rng.uniform(3.5, 6)
        self.span = 0.62 * limit * self.rest  # mm of contraction that are measured
        stiff = per_bar * self.top / (limit * self.rest)
        self.rubber, self.end = stiff * rng.uniform(0.03, 0.08), stiff * rng.uniform(4, 12)
        kinds = ("maxwell_slip", "dahl", "pressure_scaled", "coulomb")
        friction = kinds[(seed + seed // 4) % 4]
        width = rng.uniform(0.012, 0.03) * per_bar * self.top
        self.resistance, truth = draw_friction(rng, friction, width, self.span * 0.3)
        rates = draw_rate(rng, RATES[(seed + 2) % 4], 0.4 * stiff)
        self.resistance.dashpot, self.resistance.prony, rate = rates
        bar, base = 0.5 * self.top, rng.uniform(0.2, 0.5)
        self.scale = by_pressure(base, bar) if friction == "pressure_scaled" else None
        if self.scale:
            truth["scales"] = f"by {base:.3f} + {1 - base:.3f} * pressure / {bar:.3f} bar"
        self.filling = float(rng.choice([0.0, 0.04]))
        self.noise = {"length_mm": length_noise, "pressure_bar": rng.uniform(0.001, 0.004)}
        self.noise["force_N"] = rng.uniform(0.0005, 0.002) * per_bar * self.top
        self.least_tension = np.inf
        self.truth: Truth = {
            "muscle": muscle,
            "rubber_N_per_mm": self.rubber,
            "end_compliance_N_per_mm": self.end,
            "friction": truth,
            "rate": rate,
            "filling_s": self.filling,
            "noise_std": self.noise,
            "sample_time_s": self.dt,
            "largest_pressure_bar": self.top,
            "measured_contractions_mm": [0.0, self.span],
        }

    def at(self, x: float) -> str:
        """Return a contraction as a length, for names."""
        return f"{self.rest - x:.1f} mm"

    def held(self, name: str, p: Array, x: ArrayLike) -> Recording:
        """Hold the muscle at contractions, and record its tension."""

        def drive(y: float, ps: Sequence[float], at: float) -> Slope:
            f, k = self._muscle(y, ps)
            return f - self.end * (y - at), k - self.end

        at = np.broadcast_to(np.asarray(x, float), p.shape)
        y, inside = self._moved(drive, p, at)
        tension = self.end * (y - at)
        self.least_tension = min(self.least_tension, tension.min())
        return self._recorded(name, inside, at, tension)

    def free(self, name: str, p: Array, load: Array) -> Recording:
        """Let the muscle move under a load."""

        def drive(y: float, ps: Sequence[float], pull: float) -> Slope:
            f, k = self._muscle(y, ps)
            return f - pull, k

        y, inside = self._moved(drive, p, load)
        return self._recorded(name, inside, y - load / self.end, load)

    def sprung(self, name: str, p: Array, spring: float) -> Recording:
        """Let the muscle pull at a spring [N/mm], and record that force."""
        series = spring * self.end / (spring + self.end)

        def drive(y: float, ps: Sequence[float], _: float) -> Slope:
            f, k = self.law(ps[0], y)
            return f - (self.rubber + series) * y, k - self.rubber - series

        y, inside = self._moved(drive, p, None)
        return self._recorded(name, inside, y * self.end / (self.end + spring), series * y)

    def sweep(self, kind: str, seconds: float, x: float, faster: float = 1.0) -> Array:
        """Return a pattern of pressures, down to where the muscle still pulls at a contraction."""
        low = 0.3
        while self.law(low, x)[0] - self.rubber * x < 0.05 * self.law(self.top, 0.0)[0]:
            low += 0.05
        return self.pattern(kind, seconds, low, faster)

    def pattern(self, kind: str, seconds: float, low: float, faster: float = 1.0) -> Array:
        """Return a pattern of pressures from a lowest one."""
        rng, ends = self.rng, (low, self.top)
        if kind == "nested":
            return motions.nested(rng, seconds, self.dt, *ends, 9.0 / faster)
        if kind == "stairs":
            return motions.stairs(rng, seconds, self.dt, *ends, 3.0 / faster)
        if kind == "sines":
            return motions.sines(rng, seconds, self.dt, *ends, 0.25 * faster)
        return motions.turning(rng, seconds, self.dt, *ends, 3.5 / faster)

    def _muscle(self, y: float, ps: Sequence[float]) -> Slope:
        f, k = self.law(ps[0], y)
        return f - self.rubber * y, k - self.rubber

    def _moved(self, drive: Drive, p: Array, load: Array | None) -> tuple[Array, Array]:
        rig = physics.Rig(
            drive, self.resistance, filling=self.filling, scale=self.scale, substep=self.dt
        )
        y, inside = physics.simulate(rig, p, load, self.dt)
        return y, inside[:, 0]

    def _recorded(self, name: str, p: Array, x: Array, tension: Array) -> Recording:
        rng, noise, n = self.rng, self.noise, p.size
        channels = {
            "pressure": p + noise["pressure_bar"] * rng.standard_normal(n),
            "length": self.rest - x + noise["length_mm"] * rng.standard_normal(n),
            "force": tension + noise["force_N"] * rng.standard_normal(n),
        }
        meta = {"name": name, "rest_length": round(self.rest, 3)}
        return Recording(channels, sample_time=self.dt, meta=meta)
