"""Compensators that `study` writes, run on the plants of tests/plants, which know no model.

    python benchmarks/compensators.py [PLANT ...] [--seed N]

The desired motion is what the plant does, without noise, under the pressures of test runs of another
seed. Compared with it are the plant behind the compensator, and behind a static map from outputs to
pressures: polynomials fitted to the training recordings. Predicted is the error that `study` states.
"""

from __future__ import annotations

import argparse
import sys
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent))

from tests.plants import PLANTS, Plant

from mckibben import Recording, study
from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.studying.inverting import static_map
from mckibben.studying.study import Study

LIKELY = (0.6, 1.6)
"""Predicted over measured error within which a prediction is good."""


Law = Callable[[Recording], Array]
"""Pressures, (n, muscles), for desired outputs and loads."""


def static_law(plant: Plant) -> Law:
    """Return pressures as a polynomial of outputs and loads, least squares on the training runs."""
    names = plant.bench.outputs + plant.bench.loads
    given = [run.matrix(names) for run in plant.train]
    wanted = [run.matrix(plant.bench.pressures) for run in plant.train]
    found, every = static_map(given, wanted), np.concatenate(wanted)
    ends = every.min(axis=0), every.max(axis=0)
    return lambda desired: np.clip(found(desired.matrix(names)), *ends)


def inverse_law(plant: Plant, inverse: Block) -> Law:
    """Return the pressures of a compensator."""
    names = [channel.name for channel in inverse.inputs]
    return lambda desired: inverse.simulate(desired.select(names)).matrix(plant.bench.pressures)


def motions(plant: Plant, other: Plant) -> Iterator[tuple[Recording, Array]]:
    """Yield what a plant does, without noise, in the test runs of another seed, and the loads."""
    bench, names = plant.bench, plant.bench.outputs + plant.bench.loads
    for run in (run for runs in other.test.values() for run in runs):
        loads = np.column_stack([np.empty((len(run), 0)), *(run[name] for name in bench.loads)])
        desired = plant.respond(run.matrix(bench.pressures), loads)
        columns = dict(zip(names, np.column_stack([desired, loads]).T, strict=True))
        units = {name: run.units[name] for name in names}
        yield Recording(columns, bench.sample_time, units, meta={"name": run.name}), loads


def followed(plant: Plant, other: Plant, law: Law) -> float:
    """Return the mean RMSE over outputs of a plant that follows the test runs of another seed."""
    bench, errors = plant.bench, []
    for asked, loads in motions(plant, other):
        found = plant.respond(bench.allowed(law(asked)), loads)
        errors.append(found - asked.matrix(bench.outputs))
    return float(np.sqrt((np.concatenate(errors) ** 2).mean(axis=0)).mean())


def studied(plant: Plant) -> Study:
    """Return the study of a plant's runs."""
    bench = plant.bench
    return study(
        list(plant.train),
        [run for runs in plant.test.values() for run in runs],
        input=bench.pressures,
        output=bench.outputs,
        load=bench.loads[0] if len(bench.loads) == 1 else None,
        models="quick",
    )


def main() -> None:
    """Print a row for every plant, and the summary."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("plants", nargs="*", default=list(PLANTS))
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    warnings.simplefilter("ignore")
    print("| plant | chosen | inverse of | predicted | measured | static map | better |")
    print("|---|---|---|---:|---:|---:|---:|")
    better, likely = [], []
    for name in given.plants:
        plant, other = PLANTS[name](given.seed), PLANTS[name](given.seed + 1)
        found = studied(plant)
        best, own = found.leaderboard.best, found.inverse
        start = f"| {name} | {'none' if best is None else best.model}"
        static = followed(plant, other, static_law(plant))
        if own is None:
            print(f"{start} | refused ||| {static:.3g} ||", flush=True)
            for model, why in found.passed_over.items():
                print(f"    {model}: {' '.join(why.split())}")
            continue
        error = followed(plant, other, inverse_law(plant, own.inverse))
        better.append(static / error)
        likely.append(own.following_error / error)
        numbers = f"{own.following_error:.3g} | {error:.3g} | {static:.3g} | {better[-1]:.1f}"
        print(f"{start} | {own.model} | {numbers} |", flush=True)
    within = np.mean([LIKELY[0] <= ratio <= LIKELY[1] for ratio in likely])
    print(f"\nbetter than a static map: median {np.median(better):.1f}, least {min(better):.2f}")
    print(f"predicted over measured within {LIKELY[0]} to {LIKELY[1]}: {100 * within:.0f} %")


if __name__ == "__main__":
    main()
