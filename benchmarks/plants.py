"""`balance` beside every model that fits, and its inverse, on virtual plants that know no model.

    python benchmarks/plants.py [PLANT ...] [--set develop|sealed|all] [--seeds N] [--models NAME ...]

Every model is fitted to a plant's training runs, with loads told to it if it can be told, else as
inputs, else left out, and runs free on every group of test runs; of several outputs, errors are the
mean. Beside `balance` stands the best of the others in each group. Commands of the inverse, and those of
a polynomial without memory, go to the plant itself, along a motion that it made within the pressures of
training. A ratio above 1 is in favour of `balance`. Sealed plants are for models that are finished.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, field
from functools import partial
from itertools import combinations_with_replacement
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent))

from tests.plants import DEVELOP, PLANTS, SEALED, Plant, motions

from mckibben import Recording, registry
from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.channels import Channels
from mckibben.comparison.fitting import Candidate
from mckibben.comparison.planning import objections
from mckibben.estimators.core.estimator import Estimator
from mckibben.numerals import numeral

BALANCE, STATIC, INVERSE = "balance", "polynomial", "inverse"
SETS = {"develop": DEVELOP, "sealed": SEALED, "all": DEVELOP + SEALED}

SECONDS, SETTLING, INNER = 60.0, 5.0, 0.15
"""Of the motion to follow; of its start, not scored; share of the pressures' range left out."""


@dataclass
class Found:
    """What came of a model: errors by group of runs, what failed, CPU time, and what its fit said."""

    name: str
    errors: dict[str, float] = field(default_factory=dict)
    failed: list[str] = field(default_factory=list)
    seconds: float = 0.0
    notes: tuple[str, ...] = ()

    def note(self, group: str, job: Callable[[], float]) -> None:
        """Keep the error that a job gives, or why it gives none: others have their turn all the same."""
        try:
            if not np.isfinite(error := job()):
                raise ValueError("it is not finite")
            self.errors[group] = error
        except Exception as why:
            words = " ".join(str(why).split()).replace("|", "/")
            self.failed.append(f"{self.name}, {group}: {type(why).__name__}: {words}")


def arranged(name: str, plant: Plant) -> Channels | None:
    """Return the channels on which a model has a place, those first that tell it most."""
    given, loads, moved = plant.bench.pressures, plant.bench.loads, plant.bench.outputs
    told = (given, moved, loads or None), (given + loads, moved, None), (given, moved, None)
    ways = (Channels(*one) for one in told)
    return next(
        (way for way in ways if not objections({name: Candidate(name)}, plant.train, way)), None
    )


def begun(name: str, channels: Channels, seed: int) -> Estimator:
    """Return a model's estimator on channels."""
    found = registry.load("estimators", name)
    told = (channels.inputs, channels.outputs, channels.scheduling)
    return found(**found.channel_settings(*told), seed=seed)


def tried(name: str, channels: Channels, plant: Plant, seed: int) -> Found:
    """Return what comes of a model on a plant."""
    found, estimator = Found(name), begun(name, channels, seed)
    started = time.process_time()
    found.note("fit", lambda: float(estimator.fit(list(plant.train)).diagnostics_.rmse))
    found.seconds = time.process_time() - started
    if not found.failed:
        block, found.notes = estimator.model_, estimator.diagnostics_.notes
        for group, runs in plant.test.items():
            found.note(group, partial(tested, block, plant, runs))
        if name == BALANCE:
            found.note(INVERSE, lambda: followed(plant, seed, block.inverse().simulate))
    return found


def tested(block: Block, plant: Plant, runs: Sequence[Recording]) -> float:
    """Return the error of free runs."""
    names = plant.bench.outputs
    return missed(
        np.vstack([block.simulate(run).matrix(names) - run.matrix(names) for run in runs])
    )


def missed(errors: Array) -> float:
    return float(np.mean(np.sqrt(np.mean(errors**2, axis=0))))


def stacked(plant: Plant, names: Sequence[str]) -> Array:
    return np.vstack([run.matrix(names) for run in plant.train])


def ends(plant: Plant) -> Array:
    """Return the lowest and highest pressures of training, and loads, without most of their noise."""
    known = stacked(plant, plant.bench.pressures + plant.bench.loads)
    return np.quantile(known, (0.01, 0.99), axis=0)


def followed(plant: Plant, seed: int, inverse: Callable[[Recording], Recording]) -> float:
    """Return by how much a plant misses a motion of its own on commands of an inverse."""
    bench, step = plant.bench, plant.bench.sample_time
    rng, (low, high) = np.random.default_rng((seed, 1)), ends(plant)
    low, high = low + INNER * (high - low), high - INNER * (high - low)
    both = zip(low[: len(bench.pressures)], high, strict=False)
    drawn = [motions.wander(rng, SECONDS, step, *one, (1.5, 5.0)) for one in both]
    loads = np.full((len(drawn[0]), len(bench.loads)), bench.load)
    wanted = plant.respond(np.column_stack(drawn), loads)
    names = bench.outputs + bench.loads
    told = Recording(dict(zip(names, np.hstack([wanted, loads]).T, strict=True)), step)
    answer = plant.respond(inverse(told).matrix(bench.pressures), loads)
    return missed((answer - wanted)[round(SETTLING / step) :])


def static(plant: Plant, wanted: Recording) -> Recording:
    """Return the commands of a polynomial: pressures near mid-range by which it gives what is wanted."""
    bench, n = plant.bench, len(plant.bench.pressures)
    known, (low, high) = stacked(plant, bench.pressures + bench.loads), ends(plant)

    def terms(known: Array) -> Array:
        scaled = (known - low) / (high - low) - 0.5
        powers = range(6 if n == 1 else 4)
        chosen = (one for p in powers for one in combinations_with_replacement(range(len(low)), p))
        return np.column_stack([scaled[:, list(one)].prod(axis=1) for one in chosen])

    fitted = np.linalg.lstsq(terms(known), stacked(plant, bench.outputs), rcond=None)[0]
    now = np.tile(0.5 * (low + high), (len(wanted), 1))
    for place, load in enumerate(bench.loads):
        now[:, n + place] = wanted[load]
    most, small = 0.1 * (high - low)[:n], 1e-4 * np.eye(len(low))[:n]
    for _ in range(40):  # of Newton's steps, the shortest of many
        left = wanted.matrix(bench.outputs) - terms(now) @ fitted
        slopes = np.stack([(terms(now + one) - terms(now - one)) @ fitted for one in small], axis=2)
        step = (np.linalg.pinv(slopes / 2e-4, rcond=1e-3) @ left[:, :, None])[:, :, 0]
        now[:, :n] = np.clip(now[:, :n] + np.clip(step, -most, most), low[:n], high[:n])
    return Recording(dict(zip(bench.pressures, now.T, strict=False)), bench.sample_time)


def lines(plant: Plant, seed: int, every: Sequence[Found]) -> Iterator[str]:
    """Yield a line of the table for every group of runs, and for the inverse."""
    own = next((one.errors for one in every if one.name == BALANCE), {})
    for group in (*plant.test, INVERSE):
        others = [one for one in every if one.name != BALANCE and group in one.errors]
        best = min(others, key=lambda one: one.errors[group], default=Found("none"))
        theirs, ours = best.errors.get(group, np.nan), own.get(group, np.nan)
        figures = (f"{best.name} {numeral(theirs)}", numeral(ours), numeral(theirs / ours))
        failed = "; ".join(w for one in every for w in one.failed) if group == INVERSE else ""
        yield f"| {' | '.join((plant.name, str(seed), group, *figures, failed))} |"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("plants", nargs="*", metavar="PLANT", help=", ".join(PLANTS))
    parser.add_argument("--set", choices=SETS, default="develop", help="where no plant is named")
    parser.add_argument("--seeds", type=int, default=1)
    names = registry.names("estimators")
    parser.add_argument("--models", nargs="+", metavar="NAME", choices=names, default=names)
    parser.add_argument("--notes", action="store_true", help="what the fits of balance say")
    parser.add_argument("--json", type=Path, help="file for what came of every model")
    given = parser.parse_args()
    if unknown := {*given.plants} - {*PLANTS}:
        parser.error(f"there is no plant {', '.join(sorted(unknown))}")
    warnings.simplefilter("ignore")
    print("| plant | seed | runs | best other | balance | ratio | failed |")
    print("|---|---:|---|---|---:|---:|---|")
    kept: dict[str, list[Found]] = {}
    for name in given.plants or SETS[given.set]:
        for seed in range(given.seeds):
            plant, every = PLANTS[name](seed), kept.setdefault(f"{name}, seed {seed}", [])
            for model in given.models:
                if channels := arranged(model, plant):
                    every.append(tried(model, channels, plant, seed))
            every.append(Found(STATIC))
            every[-1].note(INVERSE, partial(followed, plant, seed, partial(static, plant)))
            print("\n".join(lines(plant, seed, every)), flush=True)
    for title, found in kept.items() if given.notes else ():
        for one in (one for one in found if one.name == BALANCE):
            print("\n- ".join((f"\n{title}, fitted in {one.seconds:.1f} s of CPU:", *one.notes)))
    if given.json:
        told = {title: [asdict(one) for one in found] for title, found in kept.items()}
        given.json.write_text(json.dumps(told, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
