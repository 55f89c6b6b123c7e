"""Errors of the soft arm's compensators over frequency and load, a page of beyond.py.

What the paper leaves open in its Section 6: it identifies and compensates at 0.02 Hz without a load.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from tracking import Panel, Trial, errors, picture, table

from mckibben import registry
from mckibben.blocks.base import Block
from mckibben.control import Controller, tune_pid
from mckibben.estimators.coupled.fuzzy import Search, printed_swarm
from mckibben.estimators.coupled.sdchm import learned_inverse
from mckibben.papers.recognising import EXTENSOR
from mckibben.papers.sdchm.loops import (
    BALANCE,
    INDIVIDUAL,
    MOVES,
    OURS,
    PID,
    PUBLISHED,
    SAMPLES,
    SDIHC,
    SDIHC_OURS,
    SINGLE,
    SWING,
    F,
    single_task,
)
from mckibben.papers.sdchm.run import PAPERS
from mckibben.recording import Recording
from mckibben.rigs import Rig, load_rig, record
from mckibben.signals.protocol import protocol

FREQUENCIES = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0)
"""Of the reference [Hz]."""

LOADS = (0.0, 0.5, 1.0, 2.0, 3.0, 4.0)
"""Hung on the disc [kg]."""

STEP, SHORTEST, CYCLES = 0.05, 60.0, 3
"""Between control steps, shortest reference [s], and fewest cycles of it."""

GROWTH = (
    "controller",
    f"at most doubled up to [Hz], from {F:g}",
    f"{FREQUENCIES[-1]:g} Hz over {F:g} Hz",
    f"{LOADS[-1]:g} kg over none",
)

NONE = "no compensation"
SEED = 0

MODELS: Mapping[str, tuple[str, dict[str, Any]]] = {
    PUBLISHED: ("sdchm-published", {"memory_settings": PAPERS}),
    INDIVIDUAL: ("coupled-pi", {"memory_settings": PAPERS}),
    OURS: ("sdchm", {}),
    BALANCE: ("balance", {}),
}
"""As in the re-run of the paper, fitted to the same runs."""


def compensators(rig: Rig) -> dict[str, Block | Controller | None]:
    """Return the compensators of the paper's re-run, PID and none."""
    plan = protocol("sdchm")
    names = [run.name for run in plan.select("train") if run.labels["stage"] != "joint"]
    runs = [recording for _, recording in record(plan, rig, runs=names, seed=SEED)]
    models: dict[str, Any] = {}
    for name, (model, settings) in MODELS.items():
        estimator: Callable[..., Any] = registry.load("estimators", model)
        seeded = {"seed": SEED} if name in (PUBLISHED, OURS) else {}
        models[name] = estimator(**settings, **seeded).fit(runs).model_
    network = [one for one in runs if str(one.name).startswith("network")]
    search = Search("pso", SAMPLES, printed_swarm(), SEED)
    return {
        NONE: None,
        SINGLE: models[INDIVIDUAL].parts[0].inverse(),
        SDIHC: learned_inverse(models[PUBLISHED], network, search=search),
        SDIHC_OURS: models[OURS].inverse(),
        BALANCE: models[BALANCE].inverse(),
        PID: tune_pid(rig, sample_time=STEP, scheduled={EXTENSOR: MOVES[0][1]}, seed=SEED),
    }


def reference(rig: Rig, frequency: float) -> Recording:
    """Return the reference of Table 5 that moves muscle 1, at a frequency."""
    time = np.arange(round(max(SHORTEST, CYCLES / frequency) / STEP)) * STEP
    outputs = [name for name in rig.outputs if name.startswith("displacement")]
    grid = np.asarray(time, dtype=np.float64)
    return single_task(outputs, outputs[0], grid, MOVES[0][1], f=frequency).reference


HEAD = """# Frequency and load: the soft arm's compensators

Made by `python docs/papers/beyond.py rates-and-loads`; do not edit. [The paper](sdchm.md) identifies and
compensates at 0.02 Hz without a load, and leaves higher frequencies and loads open (Section 6). Here its
compensator and others are identified on its own runs (0.02 Hz, no load, one seed) and then follow its
reference at other frequencies and under loads that are not among their inputs: muscle 1 follows
33 + 6 sin(2 pi f t) mm, the others hold 33 mm, extensor at 0.7 bar, on the virtual rig `soft-arm`.
Errors are RMSE of the worst muscle after the first third. A control step is 0.05 s: ten a cycle at 2 Hz.
PID is tuned without a load and measures the motion; the others are feedforward. No compensation is a
static map from one slow cycle of all pressures.

![Error over frequency and over load](../pictures/papers/rates-and-loads.png)
"""


def grown(rates: Sequence[float], loads: Sequence[float]) -> list[float]:
    """Return how far an error is at most doubled [Hz], and how often it is that of the paper's case.

    The last two are for the highest frequency, and for the largest load.
    """
    slow = FREQUENCIES.index(F)
    doubled = [f for f, error in zip(FREQUENCIES, rates, strict=True) if error > 2 * rates[slow]]
    below = [f for f in FREQUENCIES if f < min(doubled, default=np.inf)]
    return [max(below), rates[-1] / rates[slow], loads[-1] / loads[0]]


def page() -> str:
    """Identify, follow, draw the picture, and return the page."""
    rig = load_rig("soft-arm")
    laws = compensators(rig)
    by_rate = errors(
        {
            (law, f): Trial(block, rig, reference(rig, f), SEED)
            for law, block in laws.items()
            for f in FREQUENCIES
        }
    )
    slow = reference(rig, F)
    by_load = errors(
        {
            (law, load): Trial(block, rig.changed({"payload": load}), slow, SEED)
            for law, block in laws.items()
            for load in LOADS
        }
    )
    rates = {law: [by_rate[law, f] for f in FREQUENCIES] for law in laws}
    loads = {law: [by_load[law, load] for load in LOADS] for law in laws}
    panels = [
        Panel("frequency [Hz]", FREQUENCIES, rates, logarithmic=True),
        Panel("load [kg]", LOADS, loads),
    ]
    picture("rates-and-loads.png", panels, "RMSE of the worst muscle [mm]")
    return "\n".join(
        [
            HEAD,
            "## By frequency, without a load [mm]\n",
            *table(["controller", *(f"{f:g} Hz" for f in FREQUENCIES)], rates),
            f"A muscle that stands still is off by {SWING / np.sqrt(2):.3g} mm.\n",
            "## By load, at 0.02 Hz [mm]\n",
            *table(["controller", *(f"{load:g} kg" for load in LOADS)], loads),
            "## Growth of the error\n",
            *table(GROWTH, {law: grown(rates[law], loads[law]) for law in laws}),
        ]
    )
