"""Record the antagonistic joint, choose a model, and follow angles with its compensator.

Run: python docs/rigs/joint.py      writes docs/rigs/joint.md and docs/pictures/antagonistic_joint.png
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

import mckibben
from mckibben import Recording
from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.setting import with_fields
from mckibben.control import Tracked, before, track
from mckibben.control.uncompensated import UNCOMPENSATED, Rule, curve
from mckibben.metrics import score
from mckibben.rigs import Rig, load_rig, record
from mckibben.rigs.physics.compiled import GRAVITY
from mckibben.signals import random_wave

NAME = "antagonistic-joint"
MODELS = ("balance", "play-ridge", "coupled-memory", "arx", "tsfnn")
SEEDS = (0, 1, 2)
"""Of the sensors' noise in recordings and loops, and of the motions that are followed."""

LOW, HIGH, FASTEST, TIME = -0.45, 0.35, 0.3, 60.0
"""Of desired angles [rad], their highest frequency [Hz], and how long they are followed [s]."""

PRELOADS = (2.0, 3.0, 4.0)
"""Co-contractions that the compensator is asked for [bar]."""

MAP = 3.0
"""Co-contraction of the static map [bar]."""

MASS = 1.5
"""At the arm while it follows, in no recording that is fitted [kg]."""

LOADS = ("none", f"{MASS:g} kg, weight known", f"{MASS:g} kg, torque measured")
"""Loads while it follows, and what the compensator is given of them."""

PAGE = """# An antagonistic joint

Made by `python docs/rigs/joint.py`; do not edit. The rig `{name}` has two unequal fluidic
muscles that pull against each other over a pulley with an arm in gravity. A tendon only pulls: a muscle
without pressure is slack. Inputs are two pressures and a torque at the arm, outputs the pressures, the
angle, and the torque of the load (applied, and the payload's weight and inertia).

```bash
mckibben rig record {name} -o joint
mckibben study joint --rig {name} -o study
mckibben track study/inverse.json --rig {name} --reference desired.csv --set preload=4
```

![Loops, stiffness, slack tendons, and following](../pictures/antagonistic_joint.png)

*Top: the angle over half the difference of the pressures at three co-contractions; a load of 5 N m let
go. Bottom: tendon forces while muscle 1 is driven alone; a desired angle, with and without a model.*

## The rig

The protocol has {runs} runs: loops of the difference at several co-contractions (means of both
pressures), each muscle alone, the co-contraction alone, steps, loads let go, masses, and random
pressures. On another joint its levels are in proportion to that one's ranges.

| co-contraction | turned by 5 N m | stiffness |
|---|---|---|
{stiffness}

## Models

Free-run RMSE of the angle on the test [mrad], fitted to the {fitted} training runs. The first test run
has a co-contraction, two have a mass, that no training run has. Seeds are of the sensors' noise.

| model | {tests} | all, seeds {seeds} |
|---|{dashes}---|
{models}

## Following an angle

RMSE [mrad] of desired angles at random up to {fastest:g} Hz, from {low:g} to {high:g} rad; one motion a
seed. `preload` is the pressure from which the compensator of `balance` departs as little as it can: the
co-contraction is the second wish, beside the angle. The static map is the middle of a slow loop
at {map:g} bar. *{uncompensated}* is that of `mckibben track`: each muscle driven alone, linear.

The torque that a sensor measures has the inertia of the mass in it. Given back at once by the
compensator, it makes the loop oscillate (last rows); given the weight at the desired angle, as a column
`torque` of the reference, the compensator needs no sensor.

| load | control | mean pressure | {each} |
|---|---|---|{seed_dashes}
{followed}
"""


def stem(recordings: Sequence[Recording]) -> tuple[list[Recording], list[Recording]]:
    """Return the recordings to fit and to test."""
    train = [one for one in recordings if one.meta["role"] == "train"]
    return train, [one for one in recordings if one.meta["role"] == "test"]


@dataclass(frozen=True)
class Identified:
    """Recordings with one seed, the errors of models by test run [mrad], and the compensator."""

    recordings: dict[str, Recording]
    errors: dict[str, Array]
    inverse: Block


def identified(seed: int) -> Identified:
    """Record the protocol, and compare models."""
    recordings = {run.name: recording for run, recording in record(NAME, seed=seed)}
    train, tests = stem([*recordings.values()])
    board = mckibben.compare(train, tests, models=list(MODELS), seed=seed)
    errors = {row.model: missed(row.block, tests) for row in board.rows if row.block is not None}
    (inverse,) = (row.inverse for row in board.rows if row.model == "balance")
    return Identified(recordings, errors, inverse)


def missed(model: Block, tests: Sequence[Recording]) -> Array:
    """Return the free-run RMSE of the angle on every test, and over all [mrad]."""
    every = [score(run["angle"], model.simulate(run)["angle"]).rmse for run in tests]
    sizes = [len(run) for run in tests]
    return 1e3 * np.array([*every, np.sqrt(np.average(np.square(every), weights=sizes))])


def desired(seed: int, load: str) -> Recording:
    """Return a random angle, with the torque of the mass at it where this is known."""
    time = np.arange(round(TIME / 0.01)) * 0.01
    angle, rig = random_wave(time, FASTEST, HIGH, LOW, seed=100 + seed), load_rig(NAME).model_dump()
    weight = MASS * GRAVITY * 1e-3 * rig["reach"] * np.sin(angle - np.radians(rig["hanging"]))
    known = {"torque": weight} if load.endswith("known") else {}
    return Recording({"angle": angle} | known, 0.01)


def loaded(load: str) -> Rig:
    """Return the rig with a load; where the weight is known, with none but that."""
    rig = load_rig(NAME)
    fields = rig.model_dump() | {"payload": 0.0 if load == "none" else MASS}
    if load.endswith("known"):
        fields |= {"range": {"pressure": fields["range"]["pressure"]}, "start": {}}
    return type(rig).model_validate(fields)


def static_map(recordings: dict[str, Recording]) -> Rule:
    """Return the static map: half the difference of pressures, from the first of its loops."""
    loop = recordings[f"loops-{MAP:g}bar"]
    first = loop.slice(0, len(loop) // 5)
    knots, half = curve(0.5 * (first["pressure_1"] - first["pressure_2"]), first["angle"], "angle")

    def commands(angle: Array) -> Array:
        d = float(np.interp(angle[0], knots, half))
        return np.array([MAP + d, MAP - d])

    return Rule(commands)


def followed(found: Identified, load: str, seed: int) -> dict[str, Tracked]:
    """Return the loops of a seed under a load, by what controls."""
    rig, wanted, loops = loaded(load), desired(seed, load), dict[str, Tracked]()
    without = before(found.inverse, rig, wanted, seed=seed).tracked
    if without is not None:
        loops[UNCOMPENSATED] = without
    loops["static map"] = track(static_map(found.recordings), rig, wanted, seed=seed)
    for preload in PRELOADS:
        inverse = with_fields(found.inverse, {"preload": preload})
        loops[f"preload {preload:g} bar"] = track(inverse, rig, wanted, seed=seed)
    return loops


def mean_pressure(loop: Tracked) -> float:
    """Return the co-contraction that a loop had [bar]."""
    run = loop.recording.slice(round(20 / 0.01), len(loop.recording))
    return float(np.mean([run["pressure_1"], run["pressure_2"]]))


def turned(recordings: dict[str, Recording], c: float) -> tuple[float, float]:
    """Return how far a load turned the arm [rad], and the stiffness [N m/rad]."""
    run = recordings[f"let-go-{c:g}bar"]
    loaded = run["torque"] > 0.5 * run["torque"].max()
    angle = float(np.median(run["angle"][~loaded]) - np.median(run["angle"][loaded]))
    return angle, float(np.median(run["torque"][loaded])) / angle


def draw(found: Identified, loops: dict[str, Tracked]) -> Figure:
    """Draw loops at co-contractions, loads let go, slack tendons, and following."""
    figure, runs = Figure(figsize=(10, 7), layout="constrained"), found.recordings
    axes: Any = figure.subplots(2, 2)
    for c in (1.5, 3.0, 4.5):
        run = runs[f"loops-{c:g}bar"]
        half = 0.5 * (run["pressure_1"] - run["pressure_2"])
        axes[0, 0].plot(half, run["angle"], lw=0.7, label=f"{c:g} bar")
    axes[0, 0].set(xlabel="half the difference of pressures [bar]", ylabel="angle [rad]")
    for c in (1.5, 3.0):
        run = runs[f"let-go-{c:g}bar"].slice(0, 1600)
        axes[0, 1].plot(run.time, run["angle"], lw=0.9, label=f"{c:g} bar")
    axes[0, 1].set(xlabel="time [s]", ylabel="angle [rad]")
    fields = load_rig(NAME).model_dump()
    cells = type(load_rig(NAME)).model_validate(
        fields | {"sensor": fields["sensor"] | {"force": {}}}
    )
    ((_, alone),) = record(NAME, cells, runs=["alone-1-against-0bar"])
    for k in (1, 2):
        axes[1, 0].plot(alone["pressure_1"], alone[f"force_{k}"], lw=0.8, label=f"tendon {k}")
    axes[1, 0].set(xlabel="pressure of muscle 1, muscle 2 without [bar]", ylabel="force [N]")
    shown = {"static map": "static map", "preload 4 bar": "balance, preload 4 bar"}
    for name, label in shown.items():
        run = loops[name].recording.slice(2000, 5000)
        axes[1, 1].plot(run.time, run["angle"], lw=0.9, label=label)
    axes[1, 1].plot(run.time, run["reference_angle"], "k:", lw=0.9, label="desired")
    axes[1, 1].set(xlabel="time [s]", ylabel="angle [rad]")
    for panel in axes.flat:
        panel.legend(fontsize=8)
    return figure


def rows(cells: Sequence[Sequence[str]]) -> str:
    """Return the rows of a table."""
    return "\n".join(f"| {' | '.join(row)} |" for row in cells)


def page(every: dict[int, Identified], loops: dict[tuple[str, int], dict[str, Tracked]]) -> str:
    """Return the page."""
    first = every[SEEDS[0]]
    train, tests = stem([*first.recordings.values()])
    models = [
        [
            f"`{model}`",
            *(f"{x:.1f}" for x in errors[:-1]),
            ", ".join(f"{one.errors[model][-1]:.1f}" for one in every.values()),
        ]
        for model, errors in first.errors.items()
    ]
    stiff = [
        [f"{c:g} bar", f"{angle:.3f} rad", f"{k:.1f} N m/rad"]
        for c in (1.5, 3.0)
        for angle, k in [turned(first.recordings, c)]
    ]
    lines = [
        [
            load,
            name,
            f"{mean_pressure(loop):.2f} bar",
            *(f"{1e3 * loops[load, seed][name].rmse['angle']:.1f}" for seed in SEEDS),
        ]
        for load in LOADS
        for name, loop in loops[load, SEEDS[0]].items()
    ]
    return PAGE.format(
        name=NAME,
        runs=len(first.recordings),
        stiffness=rows(stiff),
        fitted=len(train),
        tests=" | ".join(one.name for one in tests),
        seeds=", ".join(map(str, SEEDS)),
        dashes="---|" * len(tests),
        models=rows(models),
        fastest=FASTEST,
        low=LOW,
        high=HIGH,
        map=MAP,
        uncompensated=UNCOMPENSATED,
        each=" | ".join(f"seed {seed}" for seed in SEEDS),
        seed_dashes="---|" * len(SEEDS),
        followed=rows(lines),
    )


def main() -> None:
    """Write the page and its figure."""
    mpl.rcParams.update({"axes.grid": True, "grid.alpha": 0.3, "font.size": 9})
    every = {seed: identified(seed) for seed in SEEDS}
    loops = {
        (load, seed): followed(found, load, seed) for load in LOADS for seed, found in every.items()
    }
    folder = Path(__file__).parent
    drawn = draw(every[SEEDS[0]], loops[LOADS[0], SEEDS[0]])
    drawn.savefig(folder.parent / "pictures" / "antagonistic_joint.png", dpi=110)
    (folder / "joint.md").write_text(page(every, loops), encoding="utf-8")


if __name__ == "__main__":
    main()
