"""How often `mckibben.check` rejects a correct model, and which fault of a wrong one it finds first.

    python benchmarks/validation.py --seeds 100

`right`: the truth with noise of several kinds; share of checks that find anything.
`faults`: virtual plants whose physics is no model of the package, checked against themselves without
the fault; share of checks that name it first.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from importlib import import_module
from itertools import product
from types import SimpleNamespace
from typing import Any

import numpy as np
from scipy.signal import lfilter
from tests.plants import motions

from mckibben import Recording
from mckibben.arrays import Array
from mckibben.blocks.hysteresis.pi import PI
from mckibben.blocks.runs import FreeRun, run_of
from mckibben.diagnosis.check import check_runs
from mckibben.system.threads import one_blas_thread

STEP = 0.02

MOTIONS: dict[str, Callable[[np.random.Generator, float], Array]] = {
    "wander": lambda rng, s: motions.wander(rng, s, STEP, 0.3, 4.8),
    "waves": lambda rng, s: motions.waves(rng, s, STEP, 0.3, 4.8, (0.04, 0.5)),
    "ramps": lambda rng, s: motions.ramps(rng, s, STEP, 0.2, 5.0, (0.5, 3.0), 2.0),
    "stairs": lambda rng, s: motions.stairs(rng, s, STEP, 0.3, 4.8),
    "loops": lambda rng, s: motions.through([5, 0.3, 5, 1, 4, 1.5, 3.5, 2, 3], s, STEP),
}

NOISES = ("white", "AR(0.9)", "AR(0.98)", "AR(0.995)", "by input", "by input, AR(0.9)", "quantised")

RUNS = {"60 s": (60.0,), "6 s": (6.0,), "4 x 15 s": (15.0,) * 4}

FAULTS = {
    "lag": ("lag",),
    "load": ("load",),
    "friction": ("hysteresis",),
    "contact": ("output", "curve"),
    "warming": ("drift",),
}
"""What is planted, and the kinds that name it."""

PLANTS = ("lugre_muscle", "load_rig", "lifter")


def noise(kind: str, x: Array, rng: np.random.Generator) -> Array:
    """Return noise of unit size about, beside an input."""
    white = rng.standard_normal(x.size + 3000)
    found = white[3000:]
    if "AR" in kind:
        memory = float(kind.split("(")[1].rstrip(")"))
        found = np.asarray(lfilter([np.sqrt(1 - memory**2)], [1, -memory], white))[3000:]
    return found * (0.3 + x / 2) if kind.startswith("by input") else found


def reader(*inputs: str) -> Any:
    """Return what stands for a model: names of its channels."""
    channels = [SimpleNamespace(name=name, unit="") for name in inputs]
    output = SimpleNamespace(name="displacement", unit="mm")
    return SimpleNamespace(kind="truth", inputs=channels, outputs=[output], scheduling=())


def run(pressure: Array, measured: Array, modelled: Array, **loads: Array) -> FreeRun:
    channels = {"pressure": pressure, "displacement": measured, **loads}
    recorded = run_of(Recording(channels, STEP), ["pressure"], ["displacement"])
    return FreeRun.of(recorded, modelled[:, np.newaxis])


def right(seeds: int) -> None:
    truth = PI(thresholds=(0.0, 0.3, 0.6, 1.0), weights=(3.0, 1.0, 0.7, 0.5))
    every: dict[str, list[bool]] = {}
    for (name, lengths), motion, kind in product(RUNS.items(), MOTIONS, NOISES):
        found = []
        for seed in range(seeds):
            rng = np.random.default_rng((seed, 1))
            runs = []
            for seconds in lengths:
                u = MOTIONS[motion](rng, seconds)
                modelled = truth.simulate(u)
                e = 0.02 * np.ptp(modelled) * noise(kind, u, rng)
                y = modelled + e
                if kind == "quantised":
                    y = 0.1 * np.round(y / 0.1)
                runs.append(run(u, y, modelled))
            found.append(not check_runs(reader("pressure"), runs).right)
        every.setdefault(kind, []).extend(found)
        every.setdefault(name, []).extend(found)
        every.setdefault(motion, []).extend(found)
    for kind, found in every.items():
        print(
            f"right  {kind:18} rejected {100 * np.mean(found):5.2f} % of {len(found)}", flush=True
        )


def planted(plant: str, fault: str, motion: str, seed: int) -> tuple[str, ...]:
    """Return what a check names first of a fault, with what it may be as well."""
    module, rng = import_module(f"tests.plants.{plant}"), np.random.default_rng((seed, 2))
    pressure = MOTIONS[motion](rng, 90.0)
    held = np.full(pressure.size, module.BENCH.load or 0.0)
    load = held.copy()
    command = pressure
    if fault == "lag":
        share = 1 - np.exp(-STEP / 0.15)
        start = [(1 - share) * pressure[0]]
        command = np.asarray(lfilter([share], [1, share - 1], pressure, zi=start)[0])
    if fault == "load":
        load = held + motions.stairs(rng, 90.0, STEP, -12.0, 12.0, (3.0, 6.0), 0.5)[: held.size]
    modelled, y = (responded(module, *given) for given in ((pressure, held), (command, load)))
    span, time = np.ptp(modelled), np.linspace(0, 1, y.size)
    if fault == "friction":
        way = (pressure - PI(thresholds=(0.15,), weights=(1.0,)).simulate(pressure)) / 0.15
        y = y - 0.05 * span * np.maximum(way, 0)
    if fault == "contact":
        wall = modelled.min() + 0.75 * span
        y = np.where(y > wall, wall + 0.2 * (y - wall), y)
    if fault == "warming":
        y = y * (1 + 0.15 * (1 - np.exp(-2 * time)))
    y = y + 0.01 * span * noise(("white", "AR(0.9)")[seed % 2], pressure, rng)
    loads = {"force": load} if np.ptp(load) > 0 else {}
    missing = (
        check_runs(reader("pressure"), [run(pressure, y, modelled, **loads)]).outputs[0].missing
    )
    return (missing[0].kind,) if missing else ("nothing",)


def responded(module: Any, pressure: Array, load: Array) -> Array:
    """Return what a plant does over samples of `STEP`, which its own are a part of."""
    fine = round(STEP / module.BENCH.sample_time)
    loads = np.repeat(load, fine)[:, np.newaxis] if module.BENCH.loads else np.zeros((0, 0))
    times = np.arange(fine * pressure.size) / fine
    steps = np.interp(times, np.arange(pressure.size), pressure)
    return np.asarray(module.move(steps[:, np.newaxis], loads).answered()[::fine, 0])


def faults(seeds: int) -> None:
    for fault, kinds in FAULTS.items():
        every: list[bool] = []
        for plant, motion in product(PLANTS, MOTIONS):
            if fault == "load" and plant == "lugre_muscle":
                continue
            named = [planted(plant, fault, motion, seed) for seed in range(seeds)]
            hits = [bool(set(one) & set(kinds)) for one in named]
            every += hits
            if not all(hits):
                others = sorted({one[0] for one, hit in zip(named, hits, strict=True) if not hit})
                print(
                    f"fault  {fault:9} {plant:13} {motion:7} {100 * np.mean(hits):4.0f} %, else {others}"
                )
        print(
            f"fault  {fault:9} named first in {100 * np.mean(every):5.1f} % of {len(every)}",
            flush=True,
        )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=100)
    given = parser.parse_args()
    with one_blas_thread():
        faults(max(given.seeds // 10, 2))
        right(given.seeds)
