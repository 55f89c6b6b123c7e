"""Bands of 90 % on motion of the calibration's kind and of others: share of samples held, and width.

    python benchmarks/bands.py [PLANT ...] [--seeds N] [--models NAME ...]

Plants are those of `tests/plants`, which know no model of the package. A model is fitted to the
first training run and calibrated on the others, which are patterns of pressure; then it is tried on
every kind of motion of the test.
"""

from __future__ import annotations

import argparse
import sys
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent))

from tests.plants import PLANTS, Plant

from mckibben import Recording, registry
from mckibben.blocks.bands import Banded
from mckibben.comparison.channels import Channels
from mckibben.comparison.fitting import Candidate
from mckibben.comparison.planning import objections
from mckibben.diagnosis.bands import calibration, held_of
from mckibben.errors import MckibbenError

MODELS = ("pi", "gpi", "coupled-memory", "arx")
SAME = "patterns"
"""Kind of test motion that is like that of training."""


class Tried(NamedTuple):
    """Share of samples held by a band on one kind of motion, and mean width over that of a constant."""

    plant: str
    model: str
    motion: str
    level: float
    held: float
    ratio: float


def arranged(name: str, plant: Plant) -> Channels | None:
    """Return channels on which a model has a place, those first that tell it most."""
    given, loads, moved = plant.bench.pressures, plant.bench.loads, plant.bench.outputs
    ways = (
        Channels(given, moved, loads or None),
        Channels(given + loads, moved),
        Channels(given, moved),
    )
    return next(
        (way for way in ways if not objections({name: Candidate(name)}, plant.train, way)), None
    )


def share(banded: Banded, runs: Sequence[Recording]) -> float:
    """Return the share of the samples of runs that a band holds, started as those of calibration."""
    holds = []
    for run in (held_of(banded.forward, run) for run in runs):
        ends = banded.band.simulate(run.modelled, sample_time=run.sample_time)
        _, low, high = ends.reshape(*run.modelled.shape, 3)[run.counts].T
        measured = run.measured[run.counts].T
        holds.append(((low <= measured) & (measured <= high)).ravel())
    return float(np.concatenate(holds).mean())


def tried(name: str, model: str, seed: int) -> list[Tried]:
    """Return how the band of a model holds on a plant's motions; nothing where it cannot be fitted."""
    plant = PLANTS[name](seed)
    channels = arranged(model, plant)
    if channels is None:
        return []
    kind = registry.load("estimators", model)
    told = kind.channel_settings(channels.inputs, channels.outputs, channels.scheduling)
    try:
        block = kind(**told, seed=seed).fit([plant.train[0]]).model_
        banded, found = calibration(block, plant.train[1:])
        return [
            Tried(
                name,
                model,
                motion,
                banded.band.level,
                share(banded, runs),
                float(np.mean(found.over_constant)),
            )
            for motion, runs in plant.test.items()
        ]
    except MckibbenError as error:
        print(f"{name}, {model}: {str(error)[:100]}", file=sys.stderr)
        return []


def main(plants: Sequence[str], models: Sequence[str], seeds: int) -> None:
    rows = [
        row
        for name in plants
        for model in models
        for seed in range(seeds)
        for row in tried(name, model, seed)
    ]
    print(
        "| plant, model | motion | level [%] | held [%] | width / constant |\n|---|---|---:|---:|---:|"
    )
    for row in rows:
        print(
            f"| {row.plant}, `{row.model}` | {row.motion} | {100 * row.level:.0f} "
            f"| {100 * row.held:.0f} | {row.ratio:.2f} |"
        )
    for what, some in (
        ("motion like the calibration's", [row for row in rows if row.motion == SAME]),
        ("motion of other kinds", [row for row in rows if row.motion != SAME]),
    ):
        held = np.array([row.held for row in some])
        met = np.mean([row.held >= row.level - 0.05 for row in some])
        tenth, middle = np.quantile(held, [0.1, 0.5])
        print(
            f"{what}: {held.size} cases, held {100 * held.mean():.0f} % on average, median "
            f"{100 * middle:.0f} %, lowest tenth {100 * tenth:.0f} %; in {100 * met:.0f} % of them no "
            "more than 5 % below the level"
        )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("plants", nargs="*", default=list(PLANTS))
    parser.add_argument("--models", nargs="*", default=MODELS)
    parser.add_argument("--seeds", type=int, default=2)
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    main(arguments.plants or list(PLANTS), arguments.models, arguments.seeds)
