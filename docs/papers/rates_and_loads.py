"""Errors of the soft arm's compensators over frequency and load: python docs/papers/rates_and_loads.py.

Writes docs/papers/rates-and-loads.md. What the paper leaves open in its Section 6: it identifies and
compensates at 0.02 Hz without a load.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from tracking import Panel, Trial, errors, picture, table

from mckibben import registry
from mckibben.blocks.base import Block
from mckibben.control import Controller, tune_pid
from mckibben.estimators.coupled.fuzzy import Search, printed_swarm
from mckibben.estimators.coupled.sdchm import learned_inverse
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
    F,
    held,
)
from mckibben.papers.sdchm.protocol import EXTENSOR
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
    level = dict(zip((k for k, _ in MOVES), (p0 for _, p0 in MOVES), strict=True))[1]
    return {
        NONE: None,
        SINGLE: models[INDIVIDUAL].parts[0].inverse(),
        SDIHC: learned_inverse(models[PUBLISHED], network, search=search),
        SDIHC_OURS: models[OURS].inverse(),
        BALANCE: models[BALANCE].inverse(),
        PID: tune_pid(rig, sample_time=STEP, scheduled={EXTENSOR: level}, seed=SEED),
    }


def reference(rig: Rig, frequency: float) -> Recording:
    """Return the reference of Table 5 that moves muscle 1, at a frequency."""
    time = np.arange(round(max(SHORTEST, CYCLES / frequency) / STEP)) * STEP
    outputs = [name for name in rig.outputs if name.startswith("displacement")]
    return held(outputs, outputs[0], np.asarray(time, dtype=np.float64), MOVES[0][1], f=frequency).reference


def page(by_rate: Mapping[Any, float], by_load: Mapping[Any, float], laws: Sequence[str]) -> str:
    """Return the page."""
    rates = {law: [by_rate[law, f] for f in FREQUENCIES] for law in laws}
    loads = {law: [by_load[law, load] for load in LOADS] for law in laws}
    picture(
        "rates-and-loads.png",
        [
            Panel("frequency [Hz]", FREQUENCIES, rates, logarithmic=True),
            Panel("load [kg]", LOADS, loads),
        ],
        "RMSE of the worst muscle [mm]",
    )
    return "\n".join(
        [
            HEAD,
            "## By frequency, no load: RMSE of the worst muscle [mm]\n",
            *table(["controller", *(f"{f:g} Hz" for f in FREQUENCIES)], rates),
            "## By load, 0.02 Hz: RMSE of the worst muscle [mm]\n",
            *table(["controller", *(f"{load:g} kg" for load in LOADS)], loads),
            "## What came out\n",
            *found(rates, loads),
        ]
    )


HEAD = """# Frequency and load: the soft arm's compensators

Made by `python docs/papers/rates_and_loads.py`; do not edit. [The paper](sdchm.md) identifies and
compensates at 0.02 Hz without a load, and leaves higher frequencies and loads open (Section 6). Here its
compensator and others are identified on its own runs (0.02 Hz, no load; one seed) and then follow its
reference at other frequencies and under loads that they are not told of: muscle 1 follows
33 + 6 sin(2 pi f t) mm, the others hold 33 mm, extensor at 0.7 bar, on the virtual rig `soft-arm`. Errors
are after the first third; a control step is 0.05 s, so at 2 Hz a cycle has ten. PID is tuned without a
load and measures the motion; the others are feedforward. No compensation is a static map from one slow
rise of all pressures.

![Error over frequency and over load](../pictures/papers/rates-and-loads.png)
"""


def found(rates: Mapping[str, Sequence[float]], loads: Mapping[str, Sequence[float]]) -> list[str]:
    """Return what the numbers are, a sentence each controller."""
    slow = FREQUENCIES.index(F)
    lines = []
    for law, errors_ in rates.items():
        within = [f for f, error in zip(FREQUENCIES, errors_, strict=True) if error <= 2 * errors_[slow]]
        more = loads[law][-1] / loads[law][0]
        lines.append(
            f"- {law}: at most twice its error at {F:g} Hz at {min(within):g} to {max(within):g} Hz; "
            f"at {FREQUENCIES[-1]:g} Hz {errors_[-1] / errors_[slow]:.1f} times; "
            f"under {LOADS[-1]:g} kg {more:.1f} times that without a load."
        )
    for place, f in enumerate(FREQUENCIES):
        best = min(rates, key=lambda law: rates[law][place])
        if f in (F, 0.2, 2.0):
            lines.append(f"- Least error at {f:g} Hz: {best} ({rates[best][place]:.2g} mm).")
    return [*lines, ""]


def main() -> None:
    """Identify, follow, and write the page and its picture."""
    rig = load_rig("soft-arm")
    laws = compensators(rig)
    trials = {
        (law, f): Trial(block, rig, reference(rig, f), SEED)
        for law, block in laws.items()
        for f in FREQUENCIES
    }
    loaded = {
        (law, load): Trial(block, rig.changed({"payload": load}), reference(rig, F), SEED)
        for law, block in laws.items()
        for load in LOADS
    }
    text = page(errors(trials), errors(loaded), [*laws])
    Path(__file__).with_name("rates-and-loads.md").write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
