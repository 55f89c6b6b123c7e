"""Bands of 90 % of chosen models on motion of other kinds: share of samples inside, and if it is known.

    python benchmarks/bands.py [--only TEXT] [--models NAME ...] [--seeds N] [--every]

Tasks are those of `benchmarks/regret.py`: README's example, virtual rigs, and the plants of
`tests/plants`, which know no model of the package. Models are fitted to the training recordings, and the
one that is chosen there has its band calibrated there. Every kind of test motion is then a test of its
own. Whether the band is known is also asked of the other kinds alone, which tells how far a band that
passed its test may be trusted on another motion.
"""

from __future__ import annotations

import argparse
import sys
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent))

from tests.plants import PLANTS

import mckibben
from mckibben import Recording
from mckibben.comparison.planning import Plan, plan_of
from mckibben.comparison.ranking import (
    FitResult,
    constant_of,
    fit,
    held_out_runs,
    row_of,
    test_errors,
)
from mckibben.diagnosis.bands import SHARES, TestedBand, tested_band
from mckibben.errors import MckibbenError
from regret import RIGS, on_rig

MODELS = ("balance", "play-ridge", "coupled-memory", "gpi", "cpi", "arx")

Sides = tuple[Sequence[Recording], Mapping[str, Sequence[Recording]]]
"""Training recordings, and test recordings by kind of motion."""


@dataclass(frozen=True)
class Tested:
    """Band of a model on one kind of test motion, its test RMSE, and whether other kinds know it."""

    task: str
    model: str
    motion: str
    band: TestedBand
    rmse: float
    elsewhere: bool | None

    @property
    def right(self) -> bool:
        """Whether every recording has its share of samples inside."""
        return SHARES[0] <= self.band.lowest and self.band.highest <= SHARES[1]


def tasks(seeds: int) -> Iterator[tuple[str, Callable[[], Sides], dict[str, object]]]:
    """Yield the name of every task, what records it, and its channels."""

    def example() -> Sides:
        from mckibben.example import TEST, TRAIN

        return mckibben.read(TRAIN), {"another day": mckibben.read(TEST)}

    def rig(name: str) -> Sides:
        train, test = on_rig(name)
        return train, {"other motion": test}

    yield "README's example", example, {}
    for name in RIGS:
        yield f"rig {name}", lambda name=name: rig(name), {}  # type: ignore[misc]
    for name, draw in PLANTS.items():
        for seed in range(seeds):
            plant = draw(seed)
            bench = plant.bench
            load = bench.loads[0] if len(bench.loads) == 1 else None
            channels = {"inputs": bench.pressures, "outputs": bench.outputs, "load": load}
            yield f"plant {name} {seed}", lambda plant=plant: (plant.train, plant.test), channels  # type: ignore[misc]


def tested(plan: Plan, found: FitResult, rows: Sequence[int]) -> tuple[TestedBand, float] | None:
    """Return the band of a fitted model on some of the test recordings, and its RMSE there."""
    split, n = plan.data.split, len(plan.data.split.train)
    some = replace(
        split,
        test=tuple(split.test[k] for k in rows),
        test_rows=tuple(split.test_rows[k] for k in rows),
    )
    outputs = [*found.outputs[:n], *(found.outputs[n + k] for k in rows)]
    assert found.block is not None
    predictions, data = (
        held_out_runs(plan.data, found.predictions, found.block),
        replace(plan.data, split=some),
    )
    banded = tested_band(found.block, predictions, outputs, some)
    errors = test_errors(data, outputs)
    return banded and (banded[1], float(np.sqrt((errors**2).mean())))


def of_task(
    name: str, sides: Sides, models: Sequence[str], every: bool, **channels: object
) -> list[Tested]:
    """Return the band of the chosen model, or of all, on every kind of test motion."""
    train, groups = sides
    kinds = [motion for motion, runs in groups.items() for _ in runs]
    tests = [run for runs in groups.values() for run in runs]
    plan = plan_of(train, tests, models=models, **channels)  # type: ignore[arg-type]
    fits = {
        label: fit(plan.data, (label, item), lambda *_: None)
        for label, item in plan.items.items()
        if label not in plan.refused
    }
    sound = {label: found for label, found in fits.items() if found.reason is None}
    constant = constant_of(plan.data).squares
    orders = {
        label: row_of(plan.data, label, found, constant, 0).order for label, found in sound.items()
    }
    ranked = sorted(orders, key=orders.__getitem__)
    result = []
    for label in ranked if every else ranked[:1]:
        for motion in groups:
            here = [k for k, kind in enumerate(kinds) if kind == motion]
            away = [k for k, kind in enumerate(kinds) if kind != motion]
            own = tested(plan, sound[label], here)
            other = tested(plan, sound[label], away) if away else None
            if own is not None:
                elsewhere = None if other is None else other[0].unknown is None
                result.append(Tested(name, label, motion, *own, elsewhere))
    return result


def summary(what: str, rows: Sequence[Tested]) -> str:
    """Return how many bands are known, and the shares inside of these."""
    known = [row for row in rows if row.band.unknown is None]
    judged = [row for row in rows if row.elsewhere]
    narrow = sum(row.band.lowest < SHARES[0] for row in judged)
    shares = [share for row in known for share in row.band.coverage.values()] or [np.nan]
    return (
        f"{what}: {len(rows)} cases, {len(known)} known, which contain {100 * min(shares):.0f} to "
        f"{100 * max(shares):.0f} % of the test samples; of {len(judged)} that are known from other "
        f"kinds of motion, {sum(row.right for row in judged)} are right, {narrow} too narrow"
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--only", default="", help="tasks with this in their name")
    parser.add_argument("--models", nargs="+", default=MODELS)
    parser.add_argument("--seeds", type=int, default=1, help="draws of every plant")
    parser.add_argument("--every", action="store_true", help="not of the chosen model only")
    given = parser.parse_args()
    warnings.simplefilter("ignore")
    rows: list[Tested] = []
    heads = "task | model | motion | level [%] | inside [%] | half width | RMSE | blocks | branches"
    print(f"| {heads} | known | from others |\n|---|---|---|---:|---:|---:|---:|---:|---:|---|---|")
    for name, record, channels in tasks(given.seeds):
        if given.only not in name:
            continue
        try:
            found = of_task(name, record(), given.models, given.every, **channels)
        except MckibbenError as error:
            print(f"| {name} | {' '.join(str(error).split())} |", flush=True)
            continue
        for row in found:
            band = row.band
            inside = " ".join(f"{100 * share:.0f}" for share in band.coverage.values())
            half = " ".join(f"{width / 2:.3g}" for width in band.width.values())
            others = {None: "", True: "yes", False: "no"}[row.elsewhere]
            known = band.unknown or "yes"
            print(
                f"| {name} | {row.model} | {row.motion} | {100 * band.level:.0f} | {inside} | {half} "
                f"| {row.rmse:.3g} | {band.units} | {band.branches} | {known} | {others} |",
                flush=True,
            )
        rows += found
    if rows:
        print()
        print(summary("all", rows))
        print(summary("other kinds than training", [r for r in rows if r.motion != "patterns"]))


if __name__ == "__main__":
    main()
