"""Inverses that learn, on rigs that drift: beside fixed ones, feedback, and a model fitted afresh.

    python benchmarks/adaptive.py [--rig mas20-hanging] [--kind gpi] [--motions 3] [--change all]
    python benchmarks/adaptive.py --hour
    python benchmarks/adaptive.py --alarms
    python benchmarks/adaptive.py --instructions

The first prints, of random motions, the tracking error by law [mm]: the minute before a step of 20 %,
the first three ten seconds after it, and a minute from 40 s after; then of 20 % over ten minutes, the
middle and the last minute. The second prints an hour without drift; the third how
far what is learnt then goes from a fit to slow decaying triangles, and alarms, beside those of a step of
20 %; the last, a generalised
Prandtl-Ishlinskii model of ten operators on an emulated Cortex-M4F.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mckibben import Block, Recording
from mckibben.blocks.adaptive.adaptive_series import adaptive
from mckibben.blocks.play_type.gpi import GPI
from mckibben.control import control_law, track, tune_pid
from mckibben.control.controller import Controller
from mckibben.control.drifting import Drift, Drifting
from mckibben.export.c.emulation import emulate
from mckibben.registry import load
from mckibben.rigs import load_rig
from mckibben.signals import decaying_triangle

Array = NDArray[np.float64]

STEP = 0.02
CHANGES = {
    "stiffness -20 %": {"stiffness": 0.8},
    "friction +20 %": {"friction": 1.2},
    "gain +20 %": {"gain": 1.2},
    "all": {"stiffness": 0.8, "friction": 1.2, "gain": 0.8},
}
APPROACH = 10.0
AT = 120.0
"""When a step comes, of the motion [s]."""


def driving(seed: int, seconds: float = 120.0) -> Array:
    """Return pressures from one random turn to the next, at random rates [bar]."""
    rng = np.random.default_rng(seed)
    pressures = [0.3]
    while len(pressures) < seconds / STEP:
        turn, rate = rng.uniform(0.2, 4.5), rng.uniform(0.3, 1.5)
        n = max(int(abs(turn - pressures[-1]) / rate / STEP), 2)
        pressures += np.linspace(pressures[-1], turn, n)[1:].tolist()
    return np.array(pressures[: round(seconds / STEP)])


def motion(model: Block, seconds: float, seed: int) -> Array:
    """Return smooth motion from one random turn to the next within 60 % of what is reached [mm]."""
    rng = np.random.default_rng(seed)
    low, high = (float(end[0]) for end in model.reachable())
    values = [low + 0.45 * (high - low)]
    while len(values) < seconds / STEP:
        turn, n = low + (high - low) * rng.uniform(0.15, 0.75), int(rng.uniform(1, 4) / STEP)
        s = np.linspace(0, 1, n + 1)[1:]
        values += (values[-1] + (turn - values[-1]) * (3 * s**2 - 2 * s**3)).tolist()
    return np.array(values[: round(seconds / STEP)])


def errors(law: Block | Controller, plant: Drifting, asked: Array, seed: int) -> Array:
    """Return tracking errors [mm]."""
    wanted = Recording({"displacement": asked}, STEP)
    found = track(law, plant, wanted, approach=APPROACH, seed=seed).recording
    return np.asarray(found["displacement"] - found["reference_displacement"])


def windows(values: Array, ends: Sequence[tuple[float, float]]) -> list[float]:
    """Return root mean squares between times [s]."""
    return [float(np.sqrt(np.mean(values[int(a / STEP) : int(b / STEP)] ** 2))) for a, b in ends]


def fitted(kind: str, plant: Drifting, seed: int) -> Block:
    """Return a model of a plant as it is, from two minutes."""
    plant.reset(seed)
    pressures = driving(0)
    seen = np.array([plant.step({"pressure": p}) for p in pressures])
    channels = dict(zip(plant.outputs, seen.T, strict=True))
    model: Block = load("estimators", kind)().fit([Recording(channels, STEP)]).model_
    return model


def told(name: str, rows: Sequence[Sequence[float]]) -> None:
    middle, worst = np.median(rows, axis=0), np.max(rows, axis=0)
    print(
        f"| {name} | "
        + " | ".join(f"{m:.2f} ({w:.2f})" for m, w in zip(middle, worst, strict=True))
        + " |",
        flush=True,
    )


def laws(
    model: Block, fresh: Block, pid: Callable[[], object], time: float
) -> dict[str, Callable[[], Block | Controller]]:
    inverse = model.inverse()

    def law(name: str, compensator: Block) -> Callable[[], Block | Controller]:
        return lambda: control_law(name, compensator, pid)  # type: ignore[arg-type]

    return {
        "fixed": lambda: inverse,
        "fitted afresh": fresh.inverse,
        "adaptive": lambda: adaptive(model, time),
        "fixed, PID": law("feedforward-pid", inverse),
        "observer": law("observer", inverse),
        "adaptive, PID": law("feedforward-pid", adaptive(model, time)),
    }


def drifts(rig_name: str, kind: str, motions: int, time: float, only: str) -> None:
    rig = load_rig(rig_name).changed({"sample_time": STEP})
    model = fitted(kind, Drifting(rig, []), 1)
    tuned = tune_pid(rig, sample_time=STEP)
    after = [
        (AT - 60, AT),
        *((AT + 10 * k, AT + 10 * k + 10) for k in range(3)),
        (AT + 40, AT + 100),
    ]
    for change, factors in CHANGES.items():
        if not change.startswith(only):
            continue
        aged = Drifting(rig, [Drift(group, factor) for group, factor in factors.items()])
        fresh = fitted(kind, aged, 2)
        for shape, over, length in (("step", 0.0, AT + 100), ("ten minutes", 600.0, 660.0)):
            ends = after if over == 0 else [(300.0, 360.0), (600.0, 660.0)]
            start = AT if over == 0 else 0.0
            print(
                f"\n{rig_name}, {kind}: {change}, {shape}; error [mm], median (largest) of {motions}",
                flush=True,
            )
            print("| law | " + " | ".join(f"{a:.0f}-{b:.0f} s" for a, b in ends) + " |")
            plant = Drifting(rig, [Drift(g, f, start, over) for g, f in factors.items()])
            for name, law in laws(model, fresh, lambda: tuned, time).items():
                runs = range(motions)
                told(
                    name,
                    [
                        windows(errors(law(), plant, motion(model, length, 10 + k), k), ends)
                        for k in runs
                    ],
                )


def hour(rig_name: str, kind: str, time: float) -> None:
    rig = load_rig(rig_name).changed({"sample_time": STEP})
    plant = Drifting(rig, [])
    model = fitted(kind, plant, 1)
    asked = motion(model, 3600.0, 5)
    found = {
        name: errors(law, plant, asked, 0)
        for name, law in (("fixed", model.inverse()), ("adaptive", adaptive(model, time)))
    }
    minutes = [(60.0 * k, 60.0 * k + 60.0) for k in range(60)]
    by = {name: np.array(windows(values, minutes)) for name, values in found.items()}
    ratio = by["adaptive"] / by["fixed"]
    whole = [windows(values, [(0.0, 3600.0)])[0] for values in found.values()]
    print(
        f"{rig_name}, {kind}, an hour without drift: fixed {whole[0]:.3f}, adaptive {whole[1]:.3f} mm"
    )
    print(f"by minutes, adaptive / fixed: median {np.median(ratio):.3f}, largest {ratio.max():.3f}")


def alarms(rig_name: str, kind: str) -> None:
    rig = load_rig(rig_name).changed({"sample_time": STEP})
    t = np.arange(6000) * STEP
    slow = rig.run(
        Recording({"pressure": decaying_triangle(t, low=0.0, high=5.0, period=20.0)}, STEP)
    )
    model: Block = load("estimators", kind)().fit([slow]).model_
    low, high = (float(end[0]) for end in model.reachable())
    t = np.arange(round(300.0 / STEP)) * STEP
    print("| change | period, time [s] | looks, alarms | largest changes | in standard errors |")
    for change, factors in {"none": {}, **CHANGES}.items():
        for period, time in ((20.0, 60.0), (10.0, 60.0), (20.0, 20.0), (5.0, 20.0)):
            plant = Drifting(rig, [Drift(group, f, 60.0) for group, f in factors.items()])
            swing = np.sin(2 * np.pi * t / period) * (0.6 + 0.4 * np.cos(0.0731 * t))
            asked = low + (high - low) * (0.5 + 0.35 * swing)
            out = plant.outputs.index("displacement")
            block = adaptive(model, time)
            stream, seen = block.stream(STEP), plant.reset(1)
            told = []
            for k, y in enumerate(asked):
                pressure = float(stream.step([y, seen[out]])[0])
                seen = plant.step({"pressure": min(max(pressure, 0.0), 6.0)})
                if k % 250 == 249:
                    told.append(block.drift(stream.state))
            changes = np.abs([found.changes for found in told]).max(axis=0)
            sizes = np.abs([found.by_errors for found in told]).max(axis=0)
            print(
                f"| {change} | {period:g}, {time:g} | {len(told)}, {sum(f.alarm for f in told)} | "
                + " | ".join(", ".join(f"{x:.2f}" for x in row) for row in (changes, sizes))
                + " |",
                flush=True,
            )


def instructions() -> None:
    thresholds, weights = tuple(0.05 * k for k in range(10)), tuple(12 / (1 + k) for k in range(10))
    model = replace(GPI.example(), thresholds=thresholds, weights=weights)
    for block in (model.inverse(), adaptive(model, 60.0)):
        print(f"{block.title}: {emulate(block, sample_time=0.01)}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--rig", default="mas20-hanging")
    parser.add_argument("--kind", default="gpi")
    parser.add_argument("--motions", type=int, default=3)
    parser.add_argument("--time", type=float, default=60.0)
    parser.add_argument("--change", default="", help="how the name of the change begins")
    parser.add_argument("--hour", action="store_true")
    parser.add_argument("--alarms", action="store_true")
    parser.add_argument("--instructions", action="store_true")
    chosen = parser.parse_args()
    if chosen.instructions:
        instructions()
    elif chosen.alarms:
        alarms(chosen.rig, chosen.kind)
    elif chosen.hour:
        hour(chosen.rig, chosen.kind, chosen.time)
    else:
        drifts(chosen.rig, chosen.kind, chosen.motions, chosen.time, chosen.change)
