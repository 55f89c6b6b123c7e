"""Bands on new runs: coverage, and width over that of a band that is the same everywhere.

    python benchmarks/bands.py [--data FOLDER]

The constant band is conformal too, from the same runs and units: one width for all samples, round the
model's value. All that is compared is whether the band follows the state of motion. On rigs a model is
fitted to 6 random runs; of 40 others half calibrate and half are tested, in several draws. Of measured
sets, or pieces of their runs, a third is tested, in several draws: the rest is fitted to, and what fits
to three quarters of it miss on the fourth calibrates. What is tested is used for nothing else. A model
that explains a recording leaves noise, and no band is narrower than a constant one: simple models of the
field, which leave something, are shown beside the best.
"""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from mckibben import Recording, load_rig
from mckibben.bands.finding import find_band
from mckibben.bands.held import Held
from mckibben.bands.scale import SHAPES
from mckibben.blocks.bands.band import Band
from mckibben.blocks.core.block import Block
from mckibben.comparison.calibrating import held_of
from mckibben.measured.sets import sets_in
from mckibben.registry import load
from mckibben.signals import random_steps, random_wave, resample

FITTED, OTHERS, DRAWS, DURATION, STEP = 6, 40, 10, 40.0, 0.05
PARTS, TURNS = 4, 7

RIGS: dict[str, dict[str, dict[str, Any]]] = {
    "mckibben-530": {"balance": {"input": ("pressure",)}, "gpi": {"input": "pressure"}},
    "rail": {"balance": {"input": ("pressure",)}, "gpi": {"input": "pressure"}},
    "mas20-hanging": {"gpi": {}, "balance": {}, "pi": {}, "p2uz": {}, "arx": {}},
    "mas10-test-stand": {
        kind: {"input": "length", "output": "force"}
        for kind in ("force-petrovic", "force-schindele")
    },
    "soft-arm": {
        "coupled-memory": {
            "input": ("pressure_1", "pressure_2", "pressure_3", "pressure_extensor"),
            "output": ("displacement_1", "displacement_2", "displacement_3"),
        }
    },
}
"""Models that the leaderboard chooses, and simple ones that know neither time nor load."""


@dataclass
class Figures:
    """Shares held and widths of draws, of the band and of the constant one."""

    covered: list[float] = field(default_factory=list)
    constant: list[float] = field(default_factory=list)
    ratio: list[float] = field(default_factory=list)
    units: str = ""

    def add(self, one: tuple[float, float], other: tuple[float, float]) -> None:
        """Add a draw: share held and mean width of either."""
        self.covered.append(one[0])
        self.constant.append(other[0])
        self.ratio.append(one[1] / other[1])

    def line(self, name: str) -> str:
        """Return a row of the table."""
        held, wide = np.array(self.covered) * 100, np.array(self.ratio)
        return (
            f"| {name} | {self.units} | {np.median(held):.1f} ({held.min():.0f} to {held.max():.0f}) "
            f"| {held.mean():.1f} | {100 * np.median(self.constant):.1f} | {np.median(wide):.2f} "
            f"({wide.min():.2f} to {wide.max():.2f}) | {wide.size} |"
        )


def random_runs(name: str) -> list[Recording]:
    """Return runs of a rig under random motion of all that drives it, some smooth, some in steps."""
    rig, found = load_rig(name), []
    time = np.arange(round(DURATION / rig.sample_time)) * rig.sample_time
    every = max(1, round(STEP / rig.sample_time))
    for seed in range(FITTED + OTHERS):
        rng, commands = np.random.default_rng([seed, 100]), {}
        for channel in rig.inputs:
            limits = rig.limits(channel)
            span = min(limits.high, 200.0) - limits.low
            low, high = limits.low + span * np.sort(rng.uniform(0.0, 1.0, 2))
            if high - low < 0.4 * span:
                low, high = limits.low, limits.low + span
            own = int(rng.integers(1_000_000))
            fastest = 0.1 if channel == "force" else 0.3
            commands[channel] = (
                random_wave(time, fastest, high, low, seed=own)
                if rng.random() < 0.5
                else random_steps(time, high, low, shortest=1.0, longest=6.0, ramp=0.4, seed=own)
            )
        made = rig.run(Recording(commands, rig.sample_time), seed=seed)
        thinned = {channel: values[::every] for channel, values in made.channels.items()}
        found.append(Recording(thinned, every * (made.sample_time or 0.0), dict(made.units)))
    return found


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


def drawn(model: Block, held: Sequence[Held], figures: Figures, seed: int) -> None:
    """Calibrate on half of the runs and try the other half."""
    order = np.random.default_rng(seed).permutation(len(held))
    half = len(held) // 2
    known, new = ([held[place] for place in some] for some in (order[:half], order[half:]))
    bands = [find_band(model, known, shapes=shapes).band for shapes in (SHAPES, SHAPES[:1])]
    figures.units = f"{bands[0].units} {bands[0].unit}s"
    figures.add(*(tried(band, new) for band in bands))


def rigs() -> Iterator[str]:
    """Yield a row a rig and model."""
    for name, models in RIGS.items():
        runs = random_runs(name)
        for kind, settings in models.items():
            model = load("estimators", kind)(**settings).fit(runs[:FITTED]).model_
            outputs = [channel.name for channel in model.outputs]
            held = [held_of(model, run, outputs) for run in runs[FITTED:]]
            figures = Figures()
            for seed in range(DRAWS):
                drawn(model, held, figures, seed)
            yield figures.line(f"rig {name}, `{kind}`")


def measured(folder: Path) -> Iterator[str]:
    """Yield a row a set of recordings, and model."""
    found = {one.name: one.recordings() for one in sets_in(folder)}
    moved = {"input": "pressure", "output": "displacement"}
    pieces = cut(found["festo_dmsp10_levels"], 12)
    for kind in ("gpi", "pi", "arx"):
        yield turned(f"DMSP-10, levels, `{kind}`", kind, pieces, moved)
    pieces = cut([r for r in found["cavatappi_loads"] if r.name.startswith("sample3")], 6)
    for kind in ("gpi", "pi", "p2uz"):
        yield turned(f"Cavatappi, sample 3, `{kind}`", kind, pieces, moved)
    for muscle in ("12cm", "30cm"):
        runs = [resample(r, 0.2) for r in found["festo_isometric_20mm"] if muscle in r.name]
        how = {"input": "length", "output": "force"}
        yield turned(f"DMSP-20, {muscle}, `force-petrovic`", "force-petrovic", runs, how)
    arms = cut([resample(run, 0.25) for run in found["soft_arm_three_muscles"]], 3)
    arm = {
        "input": ("input_1", "input_2", "input_3"),
        "output": ("displacement_1", "displacement_2"),
    }
    yield turned("soft arm, `coupled-memory`", "coupled-memory", arms, arm)
    one = {"input": "input_1", "output": "displacement_1"}
    yield turned("soft arm, one muscle of three, `pi`", "pi", arms, one)
    pieces = cut(found["sma_wing"], 10)
    for kind in ("gpi", "pi"):
        yield turned(f"wing, `{kind}`", kind, pieces, moved)
    training, *_, test = found["bouc_wen_benchmark"]
    forced = {"input": "force", "output": "displacement"}
    yield turned("Bouc-Wen, `arx`", "arx", cut([training, test], 12), forced)


def cut(runs: Sequence[Recording], n: int) -> list[Recording]:
    """Return so many parts of every run."""
    return [run.slice(k * len(run) // n, (k + 1) * len(run) // n) for run in runs for k in range(n)]


def turned(name: str, kind: str, runs: Sequence[Recording], settings: dict[str, Any]) -> str:
    """Return the row of a set: a third tested, the rest fitted to and, crosswise, missed."""
    figures = Figures()
    estimator = load("estimators", kind)

    def missed(known: Sequence[Recording], new: Sequence[Recording]) -> tuple[Block, list[Held]]:
        model = estimator(**settings).fit(known).model_
        outputs = [channel.name for channel in model.outputs]
        return model, [held_of(model, run, outputs) for run in new]

    for seed in range(TURNS):
        order = np.random.default_rng(seed).permutation(len(runs))
        test, rest = (
            [runs[place] for place in sorted(some)]
            for some in (order[: len(runs) // 3], order[len(runs) // 3 :])
        )
        held = []
        for part in range(PARTS):
            known = [run for place, run in enumerate(rest) if place % PARTS != part]
            held += [replace(run, by=part) for run in missed(known, rest[part::PARTS])[1]]
        model, asked = missed(rest, test)
        found = [find_band(model, held, shapes=shapes) for shapes in (SHAPES, SHAPES[:1])]
        level = 100 * found[0].level
        figures.units = f"{found[0].band.units} {found[0].band.unit}s, {level:.0f} %"
        figures.add(*(tried(one.band, asked) for one in found))
    return figures.line(name)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, help="folder of measured recordings")
    parser.add_argument("--no-rigs", action="store_true")
    given = parser.parse_args()
    warnings.simplefilter("ignore")
    print(
        "| what | units | held [%]: median (range) | mean | constant [%] | width / constant | draws |"
    )
    print("|---|---|---:|---:|---:|---:|---:|")
    for rows in (() if given.no_rigs else rigs(), measured(given.data) if given.data else ()):
        for row in rows:
            print(row, flush=True)


if __name__ == "__main__":
    main()
