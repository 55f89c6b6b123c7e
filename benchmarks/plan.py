"""A minute of planned motion beside other motion of as long: errors on motion never seen.

    python benchmarks/plan.py [--seeds N] [--model NAME] [PLANT ...]

Virtual plants that know no model are recorded for 20 s, and for a minute of the plan, of a random wave
of all inputs and loads at one speed, or of triangles over the range, within the same limits and rates. A
model is fitted to both recordings. Its free-run errors on strokes, steps and fast waves, over the
standard deviation of the outputs, stand in the table, with medians of the plan's over the other's.
"""

from __future__ import annotations

import argparse
import sys
import warnings
from collections import defaultdict
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent))

from tests.diagnosis.lacking import Recorder
from tests.plants import motions

from mckibben import Recording, plan, registry
from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.signals import random_wave, triangle

PLANTS = ("lugre_muscle", "antagonistic_joint", "continuum_section", "soft_finger", "lifter")
FIRST, SECONDS, SETTLING = 20.0, 60.0, 3.0
"""Of the first recording, of the second, and of the start of tests, not scored [s]."""

CROSSING = 1.0
"""Time in which limits let everything cross its range [s]."""


def waves(own: Recorder, seconds: float, seed: int) -> Array:
    """Return a random wave of everything, as fast as limits let it."""
    time, columns = own.step * np.arange(round(seconds / own.step)), []
    for number in range(own.width):
        fastest = 0.5 / CROSSING
        for _ in range(3):
            wave = random_wave(time, fastest, 1.0, seed=1000 * seed + number)
            fastest *= min(1.0, own.step / CROSSING / np.abs(np.diff(wave)).max())
        columns.append(wave)
    return np.column_stack(columns)


def triangles(own: Recorder, seconds: float) -> Array:
    """Return triangles over the range, of another period for each channel."""
    time = own.step * np.arange(round(seconds / own.step))
    periods = 2 * CROSSING * np.linspace(1.5, 3.0, own.width)
    return np.column_stack([triangle(time, period, peaks=1.0) for period in periods])


def planned(own: Recorder, first: Recording, model: Block, seed: int) -> Array:
    """Return the plan, from 0 to 1."""
    names, (low, high) = (*own.pressures, *own.loads), np.transpose(own.ends)
    rates = (high - low) / CROSSING
    limits = dict(zip(names, np.column_stack([low, high, rates]).tolist(), strict=True))
    found = plan(first, minutes=SECONDS / 60, limits=limits, seed=seed)
    return (found.recording.matrix(names) - low) / (high - low)


def tests(own: Recorder) -> list[Recording]:
    """Record motion of other kinds than any of these."""
    given = own.rng, 40.0, own.step
    parts = (
        [motions.wander(*given, 0.03, 0.97, (1.5, 6.0)) for _ in range(own.width)],
        [motions.stairs(*given, 0.03, 0.97, (2.0, 6.0), 1.0) for _ in range(own.width)],
        [motions.waves(*given, 0.1, 0.9, (0.1, 0.4)) for _ in range(own.width)],
    )
    return [own.record(np.column_stack(part)) for part in parts]


def fitted(own: Recorder, runs: list[Recording], name: str) -> Block:
    """Return a model of some recordings."""
    settings = {"input": own.pressures, "output": own.outputs}
    model: Block = registry.load("estimators", name)(**settings).fit(runs).model_
    return model


def error(own: Recorder, model: Block, runs: list[Recording]) -> float:
    """Return the mean free-run error over the standard deviation of outputs."""
    begun, found = round(SETTLING / own.step), []
    for run in runs:
        given, wanted = model.simulate(run).matrix(own.outputs), run.matrix(own.outputs)
        off = np.sqrt(np.mean((given - wanted)[begun:] ** 2, axis=0))
        found.append(off / wanted[begun:].std(axis=0))
    return float(np.mean(found))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("plants", nargs="*", default=PLANTS)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--model", default="balance")
    given = parser.parse_args()
    warnings.simplefilter("ignore")
    print(f"{'plant':20} {'plan':>7} {'random':>7} {'ratio':>6} {'triangles':>10} {'ratio':>6}")
    for plant in given.plants:
        errors = defaultdict[str, list[float]](list)
        for seed in range(given.seeds):
            own = Recorder(plant, seed)
            first, tested = own.record(waves(own, FIRST, seed + 500)), tests(own)
            before = fitted(own, [first], given.model)
            motion = {
                "plan": planned(own, first, before, seed),
                "random": waves(own, SECONDS, seed),
                "triangles": triangles(own, SECONDS),
            }
            for name, shares in motion.items():
                model = fitted(own, [first, own.record(shares)], given.model)
                errors[name].append(error(own, model, tested))
        middle = {name: float(np.median(found)) for name, found in errors.items()}
        ratios = {n: float(np.median(np.divide(errors["plan"], x))) for n, x in errors.items()}
        print(
            f"{plant:20} {middle['plan']:7.4f} {middle['random']:7.4f} {ratios['random']:6.2f} "
            f"{middle['triangles']:10.4f} {ratios['triangles']:6.2f}",
            flush=True,
        )


if __name__ == "__main__":
    main()
