"""Small recordings of every kind that estimators learn from, and settings that make fits quick."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import Any

import pytest

from mckibben import Recording
from mckibben.channels import Channels, channels_of
from mckibben.registry import load, names
from tests.golden.plants import runs

QUICK: dict[str, Any] = {
    "n_operators": 4,
    "n_starts": 4,
    "n_refined": 1,
    "rate_time_constant": 0.0,
    "n_levels": 5,
    "n_units": 2,
    "n_terms": 6,
    "max_evaluations": 6,
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
    """Channels that belong together, and the plant that was recorded with them."""

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    plant: str
    scheduling: tuple[str, ...] = ()

    @property
    def channels(self) -> tuple[str, ...]:
        """All of them."""
        return (*self.inputs, *self.scheduling, *self.outputs)


KINDS = {
    "muscle": Kind(("pressure",), ("displacement",), "muscle"),
    "isobaric": Kind(("length",), ("force",), "bench", ("pressure",)),
    "activated": Kind(("contraction",), ("pressure",), "activated", ("force",)),
    "commanded": Kind(("voltage",), ("pressure",), "commanded"),
    "loaded": Kind(("pressure",), ("displacement",), "lifted", ("force",)),
    "shaken": Kind(("force",), ("displacement",), "shaken"),
    "two muscles": Kind(
        ("pressure_1", "pressure_2"),
        ("displacement_1", "displacement_2"),
        "arm",
        ("pressure_extensor",),
    ),
}


def resolved(kind: str) -> Channels:
    """Return the channels of models of a kind."""
    return channels_of(recorded(kind), KINDS[kind].inputs, KINDS[kind].outputs)


def recorded(kind: str) -> tuple[Recording, ...]:
    """Return the runs of a kind."""
    return runs(KINDS[kind].plant)


@cache
def kinds_for(name: str) -> tuple[str, ...]:
    """Return the kinds of recording that an estimator learns from, by its own word.

    Of any one input and output, those of pressure and displacement stand for all.
    """
    estimator_class = load("estimators", name)
    fits = tuple(
        kind for kind in KINDS if estimator_class.objection(recorded(kind), resolved(kind)) is None
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
    cheap = {key: value for key, value in QUICK.items() if key in known}
    cheap |= {key: min(known[key], 1) for key in ORDERS if key in known}
    if known.get("method") == "pso":
        cheap["method"] = "ls"
    channels = estimator_class.channel_settings(resolved(kind or kinds_for(name)[0]))
    return estimator_class(**cheap | channels | settings)


CASES = tuple((name, kind) for name in names("estimators") for kind in kinds_for(name))
"""Every estimator on every kind of recording that it learns from."""


@pytest.fixture(autouse=True, scope="module")
def few_steps() -> Iterator[None]:
    """Let linear models take few steps: what is asked here does not depend on how far they go."""
    with pytest.MonkeyPatch.context() as patch:
        for steps in ("FIRST_STEPS", "STEPS"):
            patch.setattr(f"mckibben.estimators.dynamics.prediction_error.{steps}", 2)
        yield
