"""Bands of 90 % on measured runs left out: share held, and width over that of a constant band.

    python benchmarks/bands.py --data FOLDER

The constant band is conformal too, from the same runs: one width for all samples. Of a set's runs, or
pieces of them, a third is tested, in several draws: the rest is fitted to, and what fits to three
quarters of it miss on the fourth calibrates. Where a model leaves but noise no band is narrower than a
constant one: simple models of the field are shown, which leave something.
"""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from mckibben import Recording
from mckibben.bands.finding import find_band
from mckibben.bands.held import Held
from mckibben.bands.scale import SHAPES
from mckibben.blocks.bands.band import Band
from mckibben.blocks.base import Block
from mckibben.comparison.calibrating import held_of
from mckibben.measured.sets import sets_in
from mckibben.registry import load
from mckibben.signals import resample

PARTS, DRAWS = 4, 7
"""Parts of what is fitted to, each left out in turn; and draws of what is tested."""

MOVED = ("pressure", "displacement")
HELD_LENGTH = (("force-petrovic",), "length", "force")
ARM = (("input_1", "input_2", "input_3"), ("displacement_1", "displacement_2"))
"""What is given and what is modelled of measured sets."""


def missed(model: Block, runs: Sequence[Recording]) -> list[Held]:
    """Return what a model misses on runs that it was not fitted to."""
    outputs = [channel.name for channel in model.outputs]
    return [held_of(model, run, outputs) for run in runs]


def tried(band: Band, runs: Sequence[Held]) -> tuple[float, float]:
    """Return the share of samples held, and the mean width, over runs."""
    held, width = [], []
    for run in runs:
        ends = band.simulate(np.hstack([run.inputs, run.modelled]), sample_time=run.sample_time)
        ends = ends.reshape(len(ends), -1, 3)[run.counts]
        measured = run.measured[run.counts]
        held.append(((ends[..., 1] <= measured) & (measured <= ends[..., 2])).mean())
        width.append((ends[..., 2] - ends[..., 1]).mean())
    return float(np.mean(held)), float(np.mean(width))


def drawn(
    estimator: Callable[[], Any], runs: Sequence[Recording], seed: int
) -> tuple[float, float]:
    """Return the share of a third of the runs held [%], and the width over the constant band's."""
    order = np.random.default_rng(seed).permutation(len(runs))
    test, rest = (
        [runs[place] for place in sorted(some)]
        for some in (order[: len(runs) // 3], order[len(runs) // 3 :])
    )
    held = []
    for part in range(PARTS):
        known = [run for place, run in enumerate(rest) if place % PARTS != part]
        model = estimator().fit(known).model_
        held += [replace(run, by=part) for run in missed(model, rest[part::PARTS])]
    model = estimator().fit(rest).model_
    bands = [find_band(model, held, shapes=shapes).band for shapes in (SHAPES, SHAPES[:1])]
    asked = missed(model, test)
    (share, width), (_, constant) = (tried(band, asked) for band in bands)
    return 100 * share, width / constant


def cut(runs: Sequence[Recording], n: int) -> list[Recording]:
    """Return so many parts of every run."""
    return [run.slice(k * len(run) // n, (k + 1) * len(run) // n) for run in runs for k in range(n)]


def main(folder: Path) -> None:
    found = {one.name: one.recordings() for one in sets_in(folder)}
    sample = [run for run in found["cavatappi_loads"] if run.name.startswith("sample3")]
    held = [resample(run, 0.2) for run in found["festo_isometric_20mm"]]
    arm = cut([resample(run, 0.25) for run in found["soft_arm_three_muscles"]], 3)
    training, *_, test = found["bouc_wen_benchmark"]
    print("| what | held [%]: median (range) | width / constant |\n|---|---:|---:|")
    for name, runs, kinds, given, wanted in (
        ("DMSP-10, levels", cut(found["festo_dmsp10_levels"], 12), ("gpi", "pi", "arx"), *MOVED),
        ("Cavatappi, sample 3", cut(sample, 6), ("gpi", "pi", "p2uz"), *MOVED),
        *(
            (f"DMSP-20, {length}", [run for run in held if length in run.name], *HELD_LENGTH)
            for length in ("12cm", "30cm")
        ),
        ("soft arm", arm, ("coupled-memory",), *ARM),
        ("soft arm, one muscle of three", arm, ("pi",), "input_1", "displacement_1"),
        ("wing", cut(found["sma_wing"], 10), ("gpi", "pi"), *MOVED),
        ("Bouc-Wen", cut([training, test], 12), ("arx",), "force", "displacement"),
    ):
        for kind in kinds:
            estimator = partial(load("estimators", kind), input=given, output=wanted)
            shares, wide = np.array([drawn(estimator, runs, seed) for seed in range(DRAWS)]).T
            print(
                f"| {name}, `{kind}` | {np.median(shares):.1f} "
                f"({shares.min():.0f} to {shares.max():.0f}) | {np.median(wide):.2f} "
                f"({wide.min():.2f} to {wide.max():.2f}) |",
                flush=True,
            )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, required=True, help="folder of measured recordings")
    warnings.simplefilter("ignore")
    main(parser.parse_args().data)
