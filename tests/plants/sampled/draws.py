"""Random muscles, friction and viscoelasticity, each with its truth."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mckibben import Recording
from tests.plants.sampled import physics
from tests.plants.sampled.physics import Law, Resistance

FRICTIONS = (
    *("coulomb", "maxwell_slip", "dahl", "lugre"),
    *("bouc_wen", "pressure_scaled", "log_rate", "smooth_coulomb"),
)
RATES = ("none", "dashpot", "sls", "power_law")
LAWS = ("braid", "exponential", "virtual_spring", "braid_end_effect")

Truth = dict[str, Any]
"""Numbers and words by name, as JSON has them; units are in the names."""


@dataclass
class Plant:
    """A drawn plant: runs to fit, runs to check by kind of motion, and what is truly so."""

    name: str
    train: list[Recording]
    tests: dict[str, list[Recording]]
    truth: Truth


def rounded(value: Any, digits: int = 6) -> Any:
    """Round all numbers in dicts and lists, so that truths are easy to read."""
    if isinstance(value, dict):
        return {k: rounded(v, digits) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [rounded(v, digits) for v in value]
    if isinstance(value, float | np.floating):
        return float(f"{value:.{digits}g}")
    return value


def draw_law(rng: np.random.Generator, kind: str, rest: float) -> tuple[Law, Truth]:
    """Return a muscle's law, and its truth."""
    diameter, angle = rng.uniform(8, 24), math.radians(rng.uniform(19, 27))
    k = rng.uniform(1.05, 1.35)
    area = math.pi * diameter**2 / 4
    a, b = 3 / math.tan(angle) ** 2, 1 / math.sin(angle) ** 2
    blocked = physics.BAR * area * (a - b)
    limit = (1 - math.sqrt(b / a)) / k
    truth = {"law": kind, "rest_length_mm": rest}
    truth |= {"blocked_N_per_bar": blocked, "largest_contraction": limit}
    braid = {"diameter_mm": diameter, "braid_angle_rad": angle, "k": k}
    if kind == "braid":
        return physics.braid(rest, diameter, angle, k), truth | braid
    if kind == "braid_end_effect":
        low, p_low = rng.uniform(0.1, 0.35), rng.uniform(0.5, 2.0)
        law = physics.braid(rest, diameter, angle, k, low, p_low)
        return law, truth | braid | {"k_low": low, "p_low_bar": p_low}
    if kind == "exponential":
        extra = {"decay": rng.uniform(0.03, 0.09), "limit": limit}
        extra |= {"share": rng.uniform(0.15, 0.45), "p_shift": rng.uniform(0, 0.4)}
        return physics.exponential(rest, blocked, **extra), truth | extra
    s1 = blocked / (0.85 * limit * rest)
    extra = {"s1": s1, "s2": s1 * rng.uniform(-0.04, 0.06)}
    extra |= {"limit": limit, "p_half": rng.uniform(0.5, 2)}
    return physics.virtual_spring(rest, **extra), truth | extra


def draw_friction(
    rng: np.random.Generator, kind: str, width: float, stroke: float, ratio: float = 1.0
) -> tuple[Resistance, Truth]:
    """Return friction of a force [N] on the way up, ``ratio`` times that on the way down."""
    reach = stroke * rng.uniform(0.01, 0.05)  # mm until most of the friction has built up
    truth = {"kind": kind, "force_up_N": width, "force_down_N": width * ratio}
    truth |= {"ratio_down_to_up": ratio, "presliding_mm": reach}
    if kind == "coulomb":
        coulomb = (width, width * ratio)
        return Resistance(coulomb=coulomb), truth | {"presliding_mm": 0.0}
    if kind in ("maxwell_slip", "pressure_scaled"):
        reaches = stroke * np.geomspace(0.004, rng.uniform(0.08, 0.35), 6)
        shares = rng.dirichlet(np.full(6, 2.0))
        truth["slider_reaches_mm"] = reaches.tolist()
        truth["slider_forces_up_N"] = (width * shares).tolist()
        stiffness, limits = width * shares / reaches, width * shares
        return Resistance(lambda: physics.MaxwellSlip(stiffness, limits, ratio)), truth
    if kind == "lugre":
        extra, v_s = rng.uniform(0.15, 0.4), stroke * rng.uniform(0.1, 0.3)
        viscous = 0.95 * extra * width * max(1, ratio) / v_s
        truth |= {"stribeck_share": extra, "stribeck_mm_per_s": v_s}
        return Resistance(
            lambda: physics.Bristle(width / reach, width, ratio, stribeck=extra, v_s=v_s),
            dashpot=viscous,
        ), truth | {"viscous_N_s_per_mm": viscous}
    if kind == "log_rate":
        rate, v_0 = rng.uniform(0.08, 0.2), stroke * 0.002
        return Resistance(
            lambda: physics.Bristle(width / reach, width, ratio, log_rate=rate, v_0=v_0)
        ), truth | {"log_rate_share": rate, "v_0_mm_per_s": v_0}
    if kind == "smooth_coulomb":
        v_0 = stroke * rng.uniform(0.005, 0.02)
        truth |= {"v_0_mm_per_s": v_0, "presliding_mm": 0.0}
        return Resistance(lambda: physics.SmoothCoulomb(width, v_0, ratio)), truth
    element = physics.Bristle if kind == "dahl" else physics.BoucWen
    return Resistance(lambda: element(width / reach, width, ratio)), truth


def draw_rate(
    rng: np.random.Generator, kind: str, stiffness: float
) -> tuple[float, list[tuple[float, float]], Truth]:
    """Return a dashpot [N s/mm] and Maxwell elements of a muscle with a stiffness [N/mm]."""
    if kind == "dashpot":
        c = stiffness * rng.uniform(0.02, 0.12)
        return c, [], {"kind": kind, "dashpot_N_s_per_mm": c}
    if kind == "sls":
        k = stiffness * rng.uniform(0.12, 0.4)
        tau = float(np.exp(rng.uniform(np.log(0.3), np.log(6))))
        return 0.0, [(k, tau)], {"kind": kind, "stiffness_N_per_mm": k, "relaxation_s": tau}
    if kind == "power_law":
        n, total = rng.uniform(0.08, 0.25), stiffness * rng.uniform(0.2, 0.5)
        elements = power_law(n, total, 0.03, 300, 6)
        truth = {"kind": kind, "exponent": n, "sum_stiffness_N_per_mm": total}
        return 0.0, elements, truth | {"times_s": [tau for _, tau in elements]}
    return 0.0, [], {"kind": "none"}


def power_law(
    n: float, total: float, shortest: float, longest: float, count: int
) -> list[tuple[float, float]]:
    """Return Maxwell elements whose stiffnesses sum up to ``total`` and fall with time to the n."""
    taus = np.geomspace(shortest, longest, count)
    ks = taus**-n
    ks *= total / ks.sum()
    return list(zip(ks.tolist(), taus.tolist(), strict=True))


def by_pressure(base: float, bar: float) -> Callable[[Sequence[float]], float]:
    """Return the factor of friction that grows with the mean pressure, 1 at ``bar``."""
    return lambda ps: base + (1 - base) * sum(ps) / len(ps) / bar
