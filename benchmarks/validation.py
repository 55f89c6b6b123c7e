"""How often `mckibben.check` says that a right model is wrong, and how often that a wrong one is.

    python benchmarks/validation.py --seeds 400

`right-white`, `right-coloured`: true models (PI, GPI, rate-dependent PI, linear), inputs (triangle,
decaying triangle, random, multisine, random levels, steps), lengths, noise that is white or has a
memory. Share of seeds in which the tests reject at 1 %: whiteness (white noise only), branches, inputs
now and before; and how often the verdict names anything at all. A right test has 0.5 to 1.5 % in 400
seeds four times out of five; so the shares over all cases stand below.

`fitted`: the same of models that were fitted to the recording.

`wrong`: a straight line fitted to a play and noise: share in which the branch test, and the verdict,
find it.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from mckibben import GPI, PI, Block, PIEstimator, RateDependentPI, Recording
from mckibben.blocks.dynamic.transfer_function import TransferFunction
from mckibben.signals import random_wave, triangle
from mckibben.signals.steps import random_steps
from mckibben.system.threads import one_blas_thread
from mckibben.validation.check import check
from mckibben.validation.level import LEVEL

Array = NDArray[np.float64]

STEP = 0.02


def inputs(name: str, n: int, seed: int) -> Array:
    """Return an input from 0 to 5 bar."""
    t = STEP * np.arange(n)
    rng = np.random.default_rng(10_000 + seed)
    if name == "triangle":
        return triangle(t, 6.0, [5.0])
    if name == "decaying":
        return triangle(t, 6.0, [5.0, 4.0, 3.0, 2.0, 4.5, 1.0])
    if name == "random":
        return random_wave(t, 1.0, 5.0, seed=seed)
    if name == "multisine":
        waves = [np.sin(2 * np.pi * (f * t + rng.uniform())) for f in np.arange(0.05, 0.8, 0.08)]
        whole = np.sum(waves, axis=0)
        return 5 * (whole - whole.min()) / np.ptp(whole)
    if name == "levels":
        return rng.uniform(0, 5, n)
    if name == "steps":
        return random_steps(t, 5.0, seed=seed)
    raise ValueError(name)


def noise(n: int, alike: float, rng: np.random.Generator) -> Array:
    """Return noise of unit deviation whose neighbours are so much alike."""
    white = rng.standard_normal(n + 1000)
    return np.asarray(lfilter([np.sqrt(1 - alike**2)], [1, -alike], white))[1000:]


MODELS: dict[str, Callable[[], Block]] = {
    "pi": lambda: PI(thresholds=(0.0, 0.3, 0.6, 1.0), weights=(3.0, 1.0, 0.7, 0.5)),
    "gpi": GPI.example,
    "rdpi": RateDependentPI.example,
    "oe": lambda: TransferFunction(
        numerator=(0.0, 0.2), denominator=(-0.9,), sample_time=STEP, initial="first_sample"
    ),
}


def rejected(p_value: float | None) -> bool:
    """Tell whether a test was made, and rejects."""
    return p_value is not None and p_value <= LEVEL


@dataclass
class Counts:
    """How often each test rejects."""

    n: int = 0
    white: int = 0
    branch: int = 0
    verdict: int = 0
    crossing: int = 0

    def take(self, one: Any) -> None:
        """Count one output's check."""
        self.n += 1
        self.white += rejected(one.whiteness.p_value)
        self.branch += rejected(one.p_branch)
        self.crossing += any(rejected(each.p_value) for each in one.crossings)
        self.verdict += not one.right

    def __add__(self, other: Counts) -> Counts:
        return Counts(
            *(a + b for a, b in zip(vars(self).values(), vars(other).values(), strict=True))
        )

    def __str__(self) -> str:
        shares = {name: 100 * value / self.n for name, value in vars(self).items() if name != "n"}
        return "  ".join(f"{name} {share:5.2f} %" for name, share in shares.items())


def measured(model: Block, u: Array, share: float, alike: float, *seeds: int) -> Recording:
    """Return what a model gives, with noise of a share of its range."""
    y = model.simulate(u, sample_time=STEP)
    e = share * np.ptp(y) * noise(u.size, alike, np.random.default_rng(seeds))
    names = (model.inputs[0], model.outputs[0])
    return Recording(
        dict(zip((c.name for c in names), (u, y + e), strict=True)),
        STEP,
        {c.name: c.unit for c in names},
    )


CASES = [
    *((model, given, 2000, 1) for model in MODELS for given in ("triangle", "random", "multisine")),
    *(("pi", given, 2000, 1) for given in ("decaying", "levels", "steps")),
    ("gpi", "triangle", 600, 1),
    ("pi", "random", 500, 4),
    ("pi", "triangle", 200, 1),
]
"""Model, input, samples, recordings."""


def right(seeds: int, alike: float) -> None:
    """Print how often tests of true models reject under noise whose neighbours are so much alike."""
    total = Counts()
    for case, (name, given, n, count) in enumerate(CASES):
        model, counts = MODELS[name](), Counts()
        for seed in range(seeds):
            runs = [
                measured(model, inputs(given, n, 1000 * k + seed), 0.02, alike, case, k, seed)
                for k in range(count)
            ]
            counts.take(check(model, runs).outputs[0])
        total = total + counts
        print(f"right  {name:4} {given:9} {count} x {n:5} alike {alike}: {counts}", flush=True)
    print(f"right, all, alike {alike}: {total}", flush=True)


def fitted(seeds: int) -> None:
    """Print the same of models fitted to the recording."""
    for given in ("triangle", "random", "multisine"):
        for alike in (0.0, 0.9):
            own, other = Counts(), Counts()
            for seed in range(seeds):
                model = MODELS["pi"]()
                first, second = (
                    measured(model, inputs(given, 2000, s), 0.02, alike, s)
                    for s in (seed, seed + 5000)
                )
                found = PIEstimator(n_operators=8).fit(first).model_
                own.take(check(found, first).outputs[0])
                other.take(check(found, second).outputs[0])
            print(f"fitted pi {given:9} alike {alike}: {own}", flush=True)
            print(f"  on another recording: {other}", flush=True)


def wrong(seeds: int) -> None:
    """Print how often a straight line through a play and noise is found out."""
    for given in ("triangle", "decaying", "random", "multisine"):
        for width in (0.05, 0.1, 0.2):
            for share, alike, n in ((0.01, 0.0, 1500), (0.03, 0.0, 1500), (0.02, 0.9, 3000)):
                counts = Counts()
                for seed in range(seeds):
                    play = PI(thresholds=(5.0 * width / 2,), weights=(4.0,))
                    run = measured(play, inputs(given, n, seed), share, alike, seed)
                    slope, offset = np.polyfit(run["pressure"], run["displacement"], 1)
                    line = PI(thresholds=(0.0,), weights=(slope,), offset=offset)
                    counts.take(check(line, run).outputs[0])
                about = f"{given:9} loop {width:4} noise {share} alike {alike} n {n}"
                print(f"wrong  {about}: {counts}", flush=True)


PARTS: dict[str, Callable[[int], None]] = {
    "right-white": lambda seeds: right(seeds, 0.0),
    "right-coloured": lambda seeds: right(seeds, 0.9),
    "fitted": fitted,
    "wrong": wrong,
}


def main() -> None:
    """Run what is asked for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("parts", nargs="*", default=list(PARTS))
    parser.add_argument("--seeds", type=int, default=400)
    given = parser.parse_args()
    with one_blas_thread():
        for part in given.parts:
            PARTS[part](given.seeds)


if __name__ == "__main__":
    main()
