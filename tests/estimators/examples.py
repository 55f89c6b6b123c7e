"""Small recordings of every kind that estimators learn from, and settings that make fits quick."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from mckibben import GPI, PI, Recording
from mckibben.blocks.coupled.force_balance import ForceBalance
from mckibben.blocks.differential.bouc_wen_oscillator import BoucWenOscillator
from mckibben.blocks.dynamic.air import Air
from mckibben.blocks.force.multistate_friction import MultistateFriction
from mckibben.blocks.force.polynomial_force import PolynomialForce
from mckibben.registry import load, names

STEP = 0.05
SAMPLES = 240

QUICK: dict[str, Any] = {
    "n_operators": 4,
    "n_starts": 4,
    "n_refined": 1,
    "rate_time_constant": 0.0,
    "n_levels": 5,
    "n_units": 2,
    "n_terms": 6,
    "max_evaluations": 6,
    "pso_particles": 6,
    "pso_iterations": 4,
    "n_play": 3,
    "n_stops": 3,
    "n_lags": 1,
    "steps": 3,
    "n_steps": 8,
    "ridge": 1e-3,
    "n_sets": 2,
    "elements": ("both",),
    "n_rounds": 1,
    "memory_settings": {"n_operators": 3, "n_starts": 1, "n_refined": 1},
    "particles": 4,
    "iterations": 3,
    "search_samples": 200,
}


ORDERS = ("n_poles", "n_noise", "n_noise_poles", "output_lags", "input_lags")
"""Settings of which a quick fit has at most 1."""


@dataclass(frozen=True)
class Kind:
    """Channels that belong together, and how to record runs with them, each with a seed."""

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    make: Callable[[int], Recording]
    scheduling: tuple[str, ...] = ()
    n_runs: int = 2

    @property
    def channels(self) -> tuple[str, ...]:
        """All of them."""
        return (*self.inputs, *self.scheduling, *self.outputs)


def cycles(n: int = SAMPLES, first: float = 2.5) -> np.ndarray:
    """Return decaying cycles from 0, shape (n,)."""
    t = np.linspace(0, 1, n)
    return first * (1 - 0.7 * np.floor(4 * t).clip(0, 3) / 3) * (1 - np.cos(8 * np.pi * t))


def noise(seed: int, size: float, n: int = SAMPLES) -> np.ndarray:
    """Return white noise, shape (n,)."""
    return size * np.random.default_rng(seed).standard_normal(n)


def muscle(seed: int) -> Recording:
    """A saturating loop of pressure and displacement."""
    p = cycles(first=2.5 - 0.1 * seed)
    y = GPI.example().simulate(p) + noise(seed, 0.02)
    return Recording({"pressure": p, "displacement": y}, STEP)


def isobaric(seed: int) -> Recording:
    """Force on a muscle that is pulled under a pressure that hardly changes."""
    waves = 4.0 + 0.2 * seed + 0.5 * np.sin(np.linspace(0, 9, SAMPLES))
    given = Recording({"length": 200.0 - 3.0 * cycles(), "pressure": waves}, STEP)
    friction = MultistateFriction.example().simulate(given, initial="virgin")["force"]
    law = PolynomialForce((60.0, 20.0), (-20.0, 30.0), 192.0, 8.0).simulate(given)["force"]
    return given.with_channels(force=friction + law + noise(seed, 1.0))


def activated(seed: int) -> Recording:
    """Pressure that a contraction needs under a constant force."""
    contraction = 0.02 + 0.05 * cycles()
    given = {"contraction": contraction, "force": np.full(SAMPLES, 100.0 + 50.0 * seed)}
    friction = PI((0.0, 0.005, 0.02), (10.0, 3.0, 2.0), 0.5).simulate(contraction)
    pressure = friction + 20 * contraction**2 + noise(seed, 0.01)
    return Recording(given | {"pressure": pressure}, STEP)


def loaded(seed: int) -> Recording:
    """A muscle under a load that changes; of two runs the first is without."""
    volts = cycles()
    load = seed % 2 * 40.0 * (1 - np.cos(np.linspace(0, 6 * np.pi, SAMPLES)))
    y = 8.0 * GPI.example().simulate(volts) - 0.05 * load + noise(seed, 0.05)
    return Recording({"voltage": volts, "force": load, "displacement": y}, STEP)


def two_muscles(seed: int) -> Recording:
    """Two muscles in an arm: of three runs each alone, then both."""
    alone = ((1, 0), (0, 1), (1, 1))[seed % 3]
    p = np.column_stack([0.5 * cycles() * on for on in alone])
    stiffness = np.full(SAMPLES, float(seed // 3))
    arm = ForceBalance.example().inverse()
    y = arm.simulate(np.column_stack([p, stiffness])[:, : len(arm.inputs)])
    channels = {"pressure_1": p[:, 0], "pressure_2": p[:, 1], "pressure_extensor": stiffness}
    channels |= {f"displacement_{k + 1}": y[:, k] + noise(seed + 9 * k, 0.01) for k in range(2)}
    return Recording(channels, STEP)


def commanded(seed: int) -> Recording:
    """Pressure behind a regulator that is driven by a voltage."""
    volts = cycles(first=5.0 - 0.2 * seed)
    p = Air(0.6, 0.1, 0.06, 0.2, 0.3, 0.1).simulate(volts, sample_time=STEP) + noise(seed, 0.005)
    return Recording({"voltage": volts, "pressure": p}, STEP)


def shaken(seed: int) -> Recording:
    """A mass on a spring beside an element that remembers, shaken by a force from rest."""
    rng, t = np.random.default_rng(seed), STEP * np.arange(SAMPLES)
    waves = rng.uniform(0.4, 1.0, 4), 2 * np.pi * np.array([0.3, 0.7, 1.1, 1.9])
    force = sum(a * np.sin(w * t) for a, w in zip(*waves, strict=True))
    y = BoucWenOscillator.example().simulate(force, sample_time=STEP) + noise(seed, 0.02)
    return Recording({"force": force, "displacement": y}, STEP)


KINDS = {
    "muscle": Kind(("pressure",), ("displacement",), muscle),
    "isobaric": Kind(("length",), ("force",), isobaric, ("pressure",)),
    "activated": Kind(("contraction",), ("pressure",), activated, ("force",)),
    "commanded": Kind(("voltage",), ("pressure",), commanded),
    "loaded": Kind(("voltage",), ("displacement",), loaded, ("force",), n_runs=4),
    "shaken": Kind(("force",), ("displacement",), shaken),
    "two muscles": Kind(
        ("pressure_1", "pressure_2"),
        ("displacement_1", "displacement_2"),
        two_muscles,
        ("pressure_extensor",),
        n_runs=6,
    ),
}


@cache
def recorded(kind: str) -> tuple[Recording, ...]:
    """Return the runs of a kind."""
    return tuple(KINDS[kind].make(seed) for seed in range(KINDS[kind].n_runs))


@cache
def kinds_for(name: str) -> tuple[str, ...]:
    """Return the kinds of recording that an estimator learns from, by its own word.

    Of any one input and output, those of pressure and displacement stand for all.
    """
    estimator_class = load("estimators", name)
    fits = tuple(
        kind
        for kind, made in KINDS.items()
        if estimator_class.objection(recorded(kind), made.inputs, made.outputs) is None
    )
    several = tuple(kind for kind in fits if len(KINDS[kind].inputs) > 1)
    return ("muscle", *several) if "muscle" in fits else fits


def example_for(name: str) -> tuple[Recording, ...]:
    """Return small recordings that suit an estimator."""
    return recorded(kinds_for(name)[0])


def quick(name: str, kind: str | None = None, **settings: Any) -> Any:
    """Return an estimator of its example's channels with settings that make it quick."""
    estimator_class = load("estimators", name)
    known = estimator_class().get_params()
    made = KINDS[kind or kinds_for(name)[0]]
    cheap = {key: value for key, value in QUICK.items() if key in known}
    cheap |= {key: min(known[key], 1) for key in ORDERS if key in known}
    if known.get("method") == "pso" and "pso_particles" not in known:
        cheap["method"] = "ls"
    channels = estimator_class.channel_settings(made.inputs, made.outputs)
    return estimator_class(**cheap | channels | settings)


CASES = tuple((name, kind) for name in names("estimators") for kind in kinds_for(name))
"""Every estimator on every kind of recording that it learns from."""
