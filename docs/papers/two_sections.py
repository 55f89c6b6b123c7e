"""Decoupling across the sections of an arm, a page of beyond.py.

What paper A leaves open in its Section 6: arms of several sections.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from tracking import BySection, Panel, Trial, errors, picture, table

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.control import Controller
from mckibben.estimators.coupled.balance import BalanceEstimator
from mckibben.recording import Recording
from mckibben.rigs import load_rig, record
from mckibben.rigs.setups.two_sections import EXTENSORS, MUSCLES, TwoSections
from mckibben.signals.checking import generator
from mckibben.system.workers import Tell, all_of

SEEDS = (0, 1, 2)

LOADS = (0.0, 0.5, 1.0, 1.5, 2.0)
"""Hung on the last disc [kg]; compensators are identified at that of the rig."""

STEP, DURATION, LEVEL = 0.05, 150.0, 1.0
"""Between control steps and of a reference [s]; pressure of the extensors [bar]."""

MIDDLE, TILT = (40.0, 26.0), (0.2, 0.18)
"""Of each section: shortening of its middle [mm], and largest tilt [rad]."""

FREQUENCIES = (0.02, 0.03)
"""Of each section, where it moves [Hz]."""

TASKS = {"proximal": (True, False), "distal": (False, True), "both": (True, True)}
"""Sections whose tilts go round; one that does not is held bent."""

NONE, ALONE, TOGETHER, ALL = (
    "no compensation",
    "two sections, each identified alone",
    "two sections, each identified on all runs",
    "all muscles",
)


def poses(moving: Sequence[bool], seed: int) -> Array:
    """Return desired poses, shape (n, 6): shortening and tilts of every section."""
    time = np.arange(round(DURATION / STEP)) * STEP
    starts = generator(seed).uniform(0.0, 2 * np.pi, len(MIDDLE))
    sections = [
        np.column_stack([np.full(time.size, middle), tilt * np.cos(turn), tilt * np.sin(turn)])
        for middle, tilt, frequency, moves, start in zip(
            MIDDLE, TILT, FREQUENCIES, moving, starts, strict=True
        )
        for turn in [start + 2 * np.pi * frequency * time * moves]
    ]
    return np.hstack(sections)


def reference(rig: TwoSections, moving: Sequence[bool], seed: int) -> Recording:
    """Return the shortenings of all muscles at desired poses, with the extensors' pressures."""
    wanted = rig.shortened(poses(moving, seed))
    channels = {f"displacement_{k + 1}": wanted[:, k] for k in np.arange(wanted.shape[1])}
    channels |= {name: np.full(len(wanted), LEVEL) for name in EXTENSORS}
    return Recording(channels, STEP)


def inverse(runs: Sequence[Recording], muscles: str, extensors: Sequence[str]) -> Block:
    """Return the compensator of some muscles, of a balance fitted to runs."""
    estimator = BalanceEstimator(
        input=tuple(f"pressure_{k}" for k in muscles),
        output=tuple(f"displacement_{k}" for k in muscles),
        scheduling=tuple(extensors),
    )
    return estimator.fit(runs).model_.inverse()


def compensators(_: None, seed: int, tell: Tell) -> dict[str, Block | Controller | None]:
    """Return compensators identified on the rig's protocol, with a seed of the sensor noise."""
    runs = [one for run, one in record("two-sections", seed=seed, jobs=1) if run.role == "train"]
    sections = [*zip(MUSCLES, MUSCLES.values(), EXTENSORS, strict=True)]

    def of(*driven: str) -> list[Recording]:
        return [one for one in runs if one.meta["labels"]["driven"] in driven]

    return {
        NONE: None,
        ALONE: BySection(*(inverse(of(name), each, [p0]) for name, each, p0 in sections)),
        TOGETHER: BySection(
            *(inverse(of(name, "together"), each, [p0]) for name, each, p0 in sections)
        ),
        ALL: inverse(runs, "".join(MUSCLES.values()), EXTENSORS),
    }


HEAD = f"""# An arm of two sections: decoupling across sections

Made by `python docs/papers/beyond.py two-sections`; do not edit. [The paper](sdchm.md) leaves arms of
several sections open (Section 6). On the virtual rig `two-section-arm` the distal section hangs from the
proximal one: its weight, moved aside, bends the proximal section, whose tilt turns gravity for all that
hangs below. The protocol is `mckibben rig record two-sections`, with a load of 1 kg.

Desired are poses: the tilt of a disc from the disc above it goes round, by {TILT[0]:g} rad at
{FREQUENCIES[0]:g} Hz (proximal) or {TILT[1]:g} rad at {FREQUENCIES[1]:g} Hz (distal), or is held in one
direction. The middles are shortened by {MIDDLE[0]:g} and {MIDDLE[1]:g} mm, and the extensors are at
{LEVEL:g} bar. A seed is that of directions at the start and of the sensors' noise. Errors are RMSE of
the worst of six muscles after the first third.

Compensators are inverses of `balance`, all feedforward: one of all six muscles; or one of each section,
without the other's channels, identified on runs in which only that section is driven, or on these and
those in which both are. No compensation is a static map from one slow cycle of all pressures.

![Errors by the sections that move, and by load](../pictures/papers/two-sections.png)
"""


def page() -> str:
    """Identify, follow, draw the picture, and return the page."""
    rig = load_rig("two-section-arm")
    assert isinstance(rig, TwoSections)
    laws = dict(zip(SEEDS, all_of(compensators, SEEDS), strict=True))
    names, first = [*laws[SEEDS[0]]], laws[SEEDS[0]]
    by_task = errors(
        {
            (task, law, seed): Trial(laws[seed][law], rig, reference(rig, moving, seed), seed)
            for task, moving in TASKS.items()
            for law in names
            for seed in SEEDS
        }
    )
    both = reference(rig, TASKS["both"], SEEDS[0])
    by_load = errors(
        {
            (law, load): Trial(first[law], rig.changed({"payload": load}), both, SEEDS[0])
            for law in names
            for load in LOADS
        }
    )
    rows = {
        f"{task}, {law}": [by_task[task, law, seed] for seed in SEEDS]
        for task in TASKS
        for law in names
    }
    loads = {law: [by_load[law, load] for load in LOADS] for law in names}
    worst = {law: [max(rows[f"{task}, {law}"]) for task in TASKS] for law in names}
    panels = [
        Panel("sections that move, worst seed", [*TASKS], worst),
        Panel("load [kg]", LOADS, loads),
    ]
    picture("two-sections.png", panels, "RMSE of the worst muscle [mm]")
    seeds = [f"seed {seed}" for seed in SEEDS]
    return "\n".join(
        [
            HEAD,
            "## By the sections that move [mm]\n",
            *table(["sections that move, compensator", *seeds], rows),
            "## By load, both move, identified at 1 kg, seed 0 [mm]\n",
            *table(["compensator", *(f"{load:g} kg" for load in LOADS)], loads),
        ]
    )
