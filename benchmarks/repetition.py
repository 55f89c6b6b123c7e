"""Iterative learning on the plants of tests/plants: errors before and after ten repetitions.

    python benchmarks/repetition.py [PLANT ...] [--seed N] [--repetitions N]

The compensators are those that `study` writes, the desired motions those of benchmarks/compensators.py.
What is learned from has the noise of the plant's sensor. Errors are of the plant itself, without
noise, over that noise, the mean over outputs: of the first run, and of the repetition that is kept.
Expected and convergence are factors per repetition: of a linear plant, and as measured.
"""

from __future__ import annotations

import argparse
import sys
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent))

from tests.plants import PLANTS, Plant

from compensators import inverse_law, motions, studied
from mckibben import Recording
from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.control import learn

TARGET = 3.0
"""Error after the repetitions, over the noise of the sensor."""


def runner(
    plant: Plant, asked: Recording, loads: Array, rng: np.random.Generator
) -> tuple[Callable[[Block], Array], Callable[[Block], Recording]]:
    """Return functions of a compensator: what the plant does, and what is recorded of it."""
    bench = plant.bench

    def respond(block: Block) -> Array:
        return plant.respond(bench.allowed(inverse_law(plant, block)(asked)), loads)

    def run(block: Block) -> Recording:
        outputs = respond(block)
        seen = outputs + bench.noise[1] * rng.standard_normal(outputs.shape)
        columns = {f"reference_{name}": asked[name] for name in bench.outputs}
        columns |= dict(zip(bench.outputs, seen.T, strict=True))
        units = {name: asked.units[name.removeprefix("reference_")] for name in columns}
        return Recording(columns, bench.sample_time, units)

    return respond, run


def main() -> None:
    """Print a row for every motion of every plant, and the summary."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("plants", nargs="*", default=list(PLANTS))
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--repetitions", type=int, default=10)
    given = parser.parse_args()
    warnings.simplefilter("ignore")
    print("| plant | motion | first run | kept | which | cut-off [Hz] | expected | convergence |")
    print("|---|---|---:|---:|---:|---:|---:|---:|")
    rows: dict[str, list[tuple[float, float]]] = {}
    for name in given.plants:
        plant, other = PLANTS[name](given.seed), PLANTS[name](given.seed + 1)
        compensation = studied(plant).inverse
        if compensation is None:
            print(f"| {name} | no compensator ||||||||", flush=True)
            continue
        rng = np.random.default_rng(given.seed)
        for asked, loads in motions(plant, other):
            respond, run = runner(plant, asked, loads, rng)
            found = learn(compensation.inverse, run, given.repetitions)
            desired = asked.matrix(plant.bench.outputs)
            first, kept = (
                float(np.sqrt(((respond(block) - desired) ** 2).mean(axis=0)).mean())
                / plant.bench.noise[1]
                for block in (compensation.inverse, found.best)
            )
            rows.setdefault(name, []).append((first, kept))
            cutoff, expected, convergence = (
                float(np.mean([*one.values()]))
                for one in (found.cutoff, found.expected, found.convergence)
            )
            numbers = f"{first:.1f} | {kept:.1f} | {found.best_repetition} | {cutoff:.2g}"
            print(
                f"| {name} | {asked.name} | {numbers} | {expected:.2f} | {convergence:.2f} |",
                flush=True,
            )
    print()
    for name, errors in rows.items():
        (first, kept), worst = (
            np.sqrt(np.mean(np.square(errors), axis=0)),
            max(e for _, e in errors),
        )
        print(f"{name}: {first:.1f} to {kept:.1f} x noise; worst motion {worst:.1f}")
    met = sum(np.sqrt(np.mean(np.square(errors), axis=0))[1] <= TARGET for errors in rows.values())
    every = [kept for errors in rows.values() for _, kept in errors]
    print(f"\nat most {TARGET:g} x noise: {met} of {len(rows)} plants, ", end="")
    print(f"{sum(kept <= TARGET for kept in every)} of {len(every)} motions")


if __name__ == "__main__":
    main()
