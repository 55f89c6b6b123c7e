"""Measure the model `balance` beside the others on the same data, against its targets.

    python benchmarks/balance.py [SECTION ...] [--data FOLDER] [--seeds N] [--json]

Every figure is of runs that nothing learned from. Of several seeds or runs, a cell has median and range,
and a target is met by the median. Seeds are those of sensor noise and of random references. Forces are
found from pressure and displacement by solving the balance for its load. FOLDER holds measured
recordings, which do not come with the package (see docs/measured); sections
without theirs are passed over. All sections take about ten minutes on one core.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np

from balance_arm import arm, joint, robust, whole
from balance_measured import hanging, lifting, measured
from balance_rail import rail, rail_runs
from balance_rows import BALANCE, Array, Fits, Row, table
from mckibben import Recording
from mckibben.blocks.core.block import Block

FOUR = ("status-1", "status-2", "status-3", "training-pulls-100N")
"""Runs of 60 s at 50 Hz."""

STEPS = 20_000


def fit_seconds(train: Sequence[Recording], model: str = BALANCE, **how: object) -> float:
    """Return the time of a fit [s]."""
    started = time.perf_counter()
    Fits()("", model, train, **how)
    return time.perf_counter() - started


def step_microseconds(block: Block, inputs: Array, sample_time: float) -> float:
    """Return the median time of a step from Python [µs]."""
    stream = block.stream(sample_time)
    times = np.empty(STEPS)
    rows = inputs[np.arange(STEPS) % len(inputs)]
    for t, row in enumerate(rows):
        started = time.perf_counter_ns()
        stream.step(row)
        times[t] = time.perf_counter_ns() - started
    return float(np.median(times)) / 1e3


def speed(seeds: int) -> Iterator[Row]:
    """Yield the times of fits, and of steps from Python."""
    train, _ = rail_runs(0)
    four, arms = [train[name] for name in FOUR], list(joint(0).values())
    fit_seconds(four)  # compiles
    for what, runs, how, target in (
        ("fit of one muscle, 4 x 60 s at 50 Hz", four, {"input": ("pressure",)}, 2.0),
        ("fit of the arm's joint runs", arms, {}, np.nan),
        ("fit of the arm's whole protocol", whole(0), {}, 15.0),
    ):
        seconds = [fit_seconds(runs, BALANCE, **how) for _ in range(seeds)]
        yield Row("speed", what, "s", target, {BALANCE: seconds})
    fits = Fits()
    for what, runs, how, target in (
        ("one muscle", four, {"input": ("pressure",)}, 3.0),
        ("three muscles", arms, {}, 10.0),
    ):
        steps: tuple[dict[str, list[float]], dict[str, list[float]]] = ({}, {})
        model, run = fits(what, BALANCE, runs, **how), runs[-1]
        for figures, block in zip(steps, (model, model.inverse()), strict=True):
            inputs = run.matrix([channel.name for channel in block.inputs])
            figures[BALANCE] = [step_microseconds(block, inputs, run.sample_time or 1.0)]
        for way, figures in zip(("displacements", "pressures"), steps, strict=True):
            yield Row("speed", f"step from Python, {what}, to {way}", "µs", target, figures)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    choices = ("rail", "arm", "measured", "speed", "robust", "all")
    parser.add_argument(
        "sections", nargs="*", default=["all"], metavar="SECTION", help=f"{choices}"
    )
    parser.add_argument("--data", type=Path, help="folder of measured recordings")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    if unknown := set(given.sections) - set(choices):
        parser.error(f"there is no section {', '.join(sorted(unknown))}. Remedy: name {choices}")
    sections: dict[str, tuple[Callable[[], Iterator[Row]], ...]] = {
        "rail": (lambda: rail(given.seeds),),
        "arm": (lambda: arm(given.seeds),),
        "measured": (
            lambda: hanging(given.seeds),
            lambda: lifting(given.seeds),
            lambda: measured(given.data),
        ),
        "speed": (lambda: speed(given.seeds),),
        "robust": (lambda: robust(given.seeds),),
    }
    chosen = sections if "all" in given.sections else given.sections
    rows = [row for name in chosen for part in sections[name] for row in part()]
    if given.json:
        told = [asdict(row) | {"met": row.met, "section": row.section} for row in rows]
        print(json.dumps(told, indent=1, allow_nan=True))
    else:
        print(table(rows))
        judged = [row.met for row in rows if row.met is not None]
        print(f"\n{sum(judged)} of {len(judged)} targets met.")


if __name__ == "__main__":
    main()
