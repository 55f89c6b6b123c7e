"""How much worse the chosen model is than the best one on the table, on many tasks.

    python benchmarks/regret.py [--data FOLDER] [--only TEXT] [--without MODEL ...] [--json FILE]

A task is a comparison of the quick models on training recordings, and separate test recordings:
README's example, virtual rigs, the plants of tests/plants (which know no model), and, with ``--data``,
the sets of a folder as of `mckibben measured`. Regret is the test error of the model chosen by
cross-validation over the least test error of any model; 1 where the best is chosen. Where no model is
recommended, nothing is chosen, and the task is listed without. Means are geometric; recordings that a
set leaves out in turn are one task.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent))

from tests.plants import PLANTS

import mckibben
from mckibben import Recording, registry
from mckibben.comparison.leaderboard import Leaderboard
from mckibben.errors import MckibbenError
from mckibben.estimators.catalogue import declared
from mckibben.measured.sets import chosen_in, fit_and_test_data
from mckibben.rigs import load_rig
from mckibben.studying.rig_runs import commands

SEED = 0

RIGS: Mapping[str, tuple[str, Sequence[tuple[str, ...]], Sequence[tuple[str, ...]], float]] = {
    "mas20-hanging, random": (
        "mas20-hanging",
        [("random-wave:max_frequency=0.2",)],
        [("decaying-triangle:period=8,n_cycles=5",)],
        60.0,
    ),
    "mas20-hanging, triangles": (
        "mas20-hanging",
        [("progressive-triangle:period=10,n_cycles=5",)],
        [("random-wave:max_frequency=0.3",)],
        50.0,
    ),
    "mas20-hanging, slow, then fast": (
        "mas20-hanging",
        [("decaying-sine:period=20,n_cycles=5",)],
        [("multisine:period=20,max_frequency=0.8",)],
        100.0,
    ),
    "mckibben-530, random": (
        "mckibben-530",
        [("pressure=random-wave:max_frequency=0.1", "force=constant:value=100")],
        [("pressure=irregular-triangle:n_turns=12", "force=constant:value=100")],
        80.0,
    ),
    "mckibben-530, loads": (
        "mckibben-530",
        [
            ("pressure=random-wave:max_frequency=0.1", f"force=constant:value={load}")
            for load in (50, 150, 250)
        ],
        [("pressure=random-wave:max_frequency=0.1", "force=constant:value=200")],
        50.0,
    ),
    "rail, random": (
        "rail",
        [("voltage=random-wave:max_frequency=0.2", "force=constant:value=0")],
        [("voltage=irregular-triangle:n_turns=12", "force=constant:value=0")],
        50.0,
    ),
}
"""Rig, signals of every training run, of every test run, and duration of each [s]."""


@dataclass(frozen=True)
class Task:
    """Recordings to fit and to test on; channels, where they are not found by their names."""

    name: str
    recorded: Callable[[], tuple[list[Recording], list[Recording]]]
    inputs: Sequence[str] | None = None
    outputs: Sequence[str] | None = None
    load: str | None = None


def on_rig(name: str) -> tuple[list[Recording], list[Recording]]:
    """Return the recordings of a task of `RIGS`."""
    rig_name, train, test, duration = RIGS[name]
    rig = load_rig(rig_name)
    sides: list[list[Recording]] = [[], []]
    for side, runs in enumerate((train, test)):
        for place, signals in enumerate(runs):
            seed = SEED + 100 * side + place
            given = commands(rig, signals, duration, None, seed)
            sides[side].append(rig.run(given, seed).with_meta(name=f"{side}-{place}"))
    return sides[0], sides[1]


def on_plant(name: str) -> Task:
    """Return the task of a plant: all its groups of test runs together."""
    plant = PLANTS[name](SEED)
    bench = plant.bench
    loads = bench.loads if len(bench.loads) < 2 else ()

    def recorded() -> tuple[list[Recording], list[Recording]]:
        return list(plant.train), [run for runs in plant.test.values() for run in runs]

    return Task(f"plant {name}", recorded, bench.pressures, bench.outputs, next(iter(loads), None))


def tasks(data: Path | None) -> Iterator[Task]:
    """Yield all tasks."""

    def example() -> tuple[list[Recording], list[Recording]]:
        from mckibben.example import TEST, TRAIN

        return mckibben.read(TRAIN), mckibben.read(TEST)

    yield Task("README's example", example)
    for name in RIGS:
        yield Task(f"rig {name}", lambda name=name: on_rig(name))  # type: ignore[misc]
    for name in PLANTS:
        yield on_plant(name)
    for one in chosen_in(data) if data is not None else ():
        for place, task in enumerate(one.tasks()):
            yield Task(
                f"measured {one.name} {task.name or place}",
                lambda task=task, one=one: fit_and_test_data(task, one.recordings(), one.folder),  # type: ignore[misc]
                task.inputs,
                task.outputs,
                task.load,
            )


def regret_of(board: Leaderboard) -> tuple[str, float, str, float] | None:
    """Return the chosen model, its test error, and those of the best one; None without a choice."""
    tested = [row for row in board.rows if row.reason is None and np.isfinite(row.test_error)]
    if board.best is None or not tested:
        return None
    best = min(tested, key=lambda row: row.test_error)
    return board.best.model, board.best.test_error, best.model, best.test_error


def geometric(values: Sequence[float]) -> float:
    """Return the geometric mean."""
    return float(np.exp(np.mean(np.log(values))))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, help="folder of measured sets")
    parser.add_argument("--only", default="", help="tasks with this in their name")
    parser.add_argument("--without", nargs="+", default=[], metavar="MODEL")
    parser.add_argument("--jobs", type=int)
    parser.add_argument("--json", type=Path, help="file for all leaderboards")
    given = parser.parse_args()
    warnings.simplefilter("ignore")
    names = [name for name in registry.names("estimators") if declared(name).quick]
    models = [name for name in names if name not in given.without]
    found: dict[str, list[float]] = {}
    boards: dict[str, Any] = {}
    print("| task | chosen | test | best | test | regret | s |\n|---|---|---:|---|---:|---:|---:|")
    for task in tasks(given.data):
        if given.only not in task.name:
            continue
        started = time.perf_counter()
        try:
            train, test = task.recorded()
            board = mckibben.compare(
                train,
                test,
                input=task.inputs,
                output=task.outputs,
                load=task.load,
                models=models if given.without else "quick",
                jobs=given.jobs,
            )
        except MckibbenError as error:
            print(f"| {task.name} | {' '.join(str(error).split())} ||||||", flush=True)
            continue
        seconds = time.perf_counter() - started
        boards.setdefault(task.name, []).append(board.to_dict())
        outcome = regret_of(board)
        if outcome is None:
            print(
                f"| {task.name} | none ({board.not_recommended}) ||||| {seconds:.0f} |", flush=True
            )
            continue
        chosen, own, best, least = outcome
        found.setdefault(task.name, []).append(own / least)
        row = f"{chosen} | {own:.3g} | {best} | {least:.3g} | {own / least:.2f} | {seconds:.0f}"
        print(f"| {task.name} | {row} |", flush=True)
    if found:
        means = {name: geometric(each) for name, each in found.items()}
        worst = max(means, key=means.__getitem__)
        print(
            f"\n{len(means)} tasks: regret {geometric(list(means.values())):.3f}, "
            f"worst {means[worst]:.2f} ({worst})"
        )
    if given.json:
        given.json.write_text(json.dumps(boards, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
