"""How often `mckibben.check` rejects a right model, and how often it finds a wrong one.

    python benchmarks/validation.py --seeds 400

`right`: true models under white noise and under noise of correlation 0.9. Share of seeds in which the
tests of whiteness (for white noise only) and of branches reject at 1 %, and in which the verdict names
anything. In 400 seeds a right test has 0.5 to 1.5 % four times out of five. `wrong`: the same of a
straight line fitted to a play and noise.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from mckibben import GPI, PI, Block, RateDependentPI, Recording
from mckibben.signals import random_wave, triangle
from mckibben.system.threads import one_blas_thread
from mckibben.validation.check import check
from mckibben.validation.level import LEVEL

Array = NDArray[np.float64]

STEP = 0.02

MODELS: dict[str, Callable[[], Block]] = {
    "pi": lambda: PI(thresholds=(0.0, 0.3, 0.6, 1.0), weights=(3.0, 1.0, 0.7, 0.5)),
    "gpi": GPI.example,
    "rdpi": RateDependentPI.example,
}

CASES = [
    *((model, given, 2000) for model in MODELS for given in ("triangle", "random", "multisine")),
    ("pi", "triangle", 200),
]
"""Model, input, samples."""


def inputs(name: str, n: int, seed: int) -> Array:
    """Return an input from 0 to 5 bar."""
    t = STEP * np.arange(n)
    rng = np.random.default_rng(10_000 + seed)
    if name == "multisine":
        waves = [np.sin(2 * np.pi * (f * t + rng.uniform())) for f in np.arange(0.05, 0.8, 0.08)]
        whole = np.sum(waves, axis=0)
        return 5 * (whole - whole.min()) / np.ptp(whole)
    if name == "random":
        return random_wave(t, 1.0, 5.0, seed=seed)
    return triangle(t, 6.0, [5.0] if name == "triangle" else [5.0, 4.0, 3.0, 2.0, 4.5, 1.0])


def measured(model: Block, u: Array, share: float, alike: float, *seeds: int) -> Recording:
    """Return a model's run with noise: a share of its range, neighbours correlated by `alike`."""
    y = model.simulate(u, sample_time=STEP)
    white = np.random.default_rng(seeds).standard_normal(u.size + 1000)
    noise = np.asarray(lfilter([np.sqrt(1 - alike**2)], [1, -alike], white))[1000:]
    given, found = model.inputs[0], model.outputs[0]
    channels = {given.name: u, found.name: y + share * np.ptp(y) * noise}
    return Recording(channels, STEP, {given.name: given.unit, found.name: found.unit})


def rejections(model: Block, run: Recording) -> list[bool]:
    """Tell whether whiteness, branches and the verdict reject a model."""
    one = check(model, run).outputs[0]
    tests = (one.whiteness.p_value, one.p_branch)
    return [*(p is not None and p <= LEVEL for p in tests), not one.right]


def shown(what: str, found: Sequence[Sequence[bool]]) -> None:
    """Print the shares of models that are rejected."""
    white, branch, verdict = 100 * np.mean(found, axis=0)
    shares = f"white {white:5.2f} %  branch {branch:5.2f} %  verdict {verdict:5.2f} %"
    print(f"{what}: {shares}", flush=True)


def right(seeds: int, alike: float) -> None:
    everything: list[list[bool]] = []
    for case, (name, given, n) in enumerate(CASES):
        model, found = MODELS[name](), []
        for seed in range(seeds):
            run = measured(model, inputs(given, n, seed), 0.02, alike, case, 0, seed)
            found.append(rejections(model, run))
        shown(f"right  {name:4} {given:9} n {n:4} alike {alike}", found)
        everything += found if n == 2000 else []
    shown(f"right, all of 2000, alike {alike}", everything)


def wrong(seeds: int) -> None:
    motions = ("triangle", "decaying", "random", "multisine")
    noises = ((0.01, 0.0, 1500), (0.03, 0.0, 1500), (0.02, 0.9, 3000))
    for given, width, (share, alike, n) in product(motions, (0.05, 0.1, 0.2), noises):
        play, found = PI(thresholds=(5.0 * width / 2,), weights=(4.0,)), []
        for seed in range(seeds):
            run = measured(play, inputs(given, n, seed), share, alike, seed)
            slope, offset = np.polyfit(run["pressure"], run["displacement"], 1)
            line = PI(thresholds=(0.0,), weights=(slope,), offset=offset)
            found.append(rejections(line, run))
        shown(f"wrong  {given:9} loop {width:4} noise {share} alike {alike} n {n}", found)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=400)
    given = parser.parse_args()
    with one_blas_thread():
        right(given.seeds, 0.0)
        right(given.seeds, 0.9)
        wrong(given.seeds)
