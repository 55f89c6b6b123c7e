"""Inverses that learn, on a rig that drifts and on a measured muscle.

    python benchmarks/adaptive.py [--motions 3] [--levels FOLDER] [--instructions]

Without an option: tracking errors [mm] of a `gpi` model of `mas20-hanging` on random motions; the rig
changes at 120 s. `--levels`: errors [mm] of `balance` models of the first 150 and 100 levels of
`festo_dmsp10_levels` in FOLDER, on the last 50; every level is predicted from those before it.
`--instructions`: a `gpi` model of ten operators on an emulated Cortex-M4F.
"""

from __future__ import annotations

import argparse
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mckibben import Block, Recording
from mckibben.blocks.adaptive import Adaptive, adaptive
from mckibben.blocks.hysteresis.gpi import GPI
from mckibben.control import track
from mckibben.exporting.c.emulation import emulate
from mckibben.measured.sets import sets_in
from mckibben.registry import load
from mckibben.rigs import load_rig
from mckibben.rigs.drifting import Drifting

Array = NDArray[np.float64]

STEP = 0.02
RIG = load_rig("mas20-hanging").changed({"sample_time": STEP})

TIME = 60.0
"""To learn in [s]."""

CHANGES: dict[str, dict[str, float]] = {
    "none": {},
    "stiffness -20 %": {"stiffness": 0.8},
    "friction +20 %": {"friction": 1.2},
    "gain +20 %": {"gain": 1.2},
    "all": {"stiffness": 0.8, "friction": 1.2, "gain": 0.8},
}


def drifting(change: str, start: float = 0.0) -> Drifting:
    """Return the rig, changed at a time [s]."""
    return Drifting(RIG, CHANGES[change], start)


def rms(errors: Array) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(errors**2)))


def fitted(plant: Drifting, seed: int) -> Block:
    """Return a model of a plant as it is, from two minutes from one random turn to the next."""
    rng, n = np.random.default_rng(0), round(120.0 / STEP)
    pressures = [0.3]
    while len(pressures) < n:
        turn, rate = rng.uniform(0.2, 4.5), rng.uniform(0.3, 1.5)
        steps = max(int(abs(turn - pressures[-1]) / rate / STEP), 2)
        pressures += np.linspace(pressures[-1], turn, steps)[1:].tolist()
    plant.reset(seed)
    seen = np.array([plant.step({"pressure": pressure}) for pressure in pressures[:n]])
    channels = dict(zip(plant.outputs, seen.T, strict=True))
    model: Block = load("estimators", "gpi")().fit([Recording(channels, STEP)]).model_
    return model


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


def drifts(motions: int) -> None:
    ends = [(60, 120), (120, 130), (130, 140), (140, 150), (160, 220)]
    print("| law | " + " | ".join(f"{a}-{b} s" for a, b in ends) + " |")
    model, fresh = fitted(drifting("none"), 1), fitted(drifting("all"), 2)
    plant = drifting("all", 120.0)
    for name, law in (
        ("fixed", model.inverse()),
        ("fitted afresh", fresh.inverse()),
        ("adaptive", adaptive(model, TIME)),
    ):
        rows = []
        for seed in range(motions):
            asked = Recording({"displacement": motion(model, 220.0, 10 + seed)}, STEP)
            found = track(law, plant, asked, approach=10.0, seed=seed).recording
            errors = found["displacement"] - found["reference_displacement"]
            rows.append([rms(errors[int(a / STEP) : int(b / STEP)]) for a, b in ends])
        cells = zip(np.median(rows, axis=0), np.max(rows, axis=0), strict=True)
        print(
            f"| {name} | " + " | ".join(f"{m:.2f} ({w:.2f})" for m, w in cells) + " |", flush=True
        )


def predicted(block: Block, forward: Block, pressures: Array, levels: Array, step: float) -> Array:
    """Return every level by the model as it is after the levels before it.

    The inverse's reference is the model's answer to the measured pressure, and so gives that pressure.
    """
    assert isinstance(block, Adaptive)
    n, found = block.fixed.n_states, np.empty(len(levels))
    inputs, outputs = np.zeros((1, 2)), np.zeros((1, 1))
    state = block.initial_state(np.array([levels[0], np.nan]), sample_time=step)
    if forward.n_states == n:
        state[:n] = forward.initial_state(pressures[:1], sample_time=step)
    run = block.bind(step, state, inputs, outputs)
    for t, pressure in enumerate(pressures):
        before = state.copy()
        inputs[0] = found[t - 1] if t else levels[0], levels[t - 1] if t else np.nan
        run()  # learns; what it applies is passed over
        model, answer = block.present(state), np.zeros((1, 1))
        own = before[: model.n_states].copy()
        model.bind(step, own, np.array([[pressure]]), answer)()
        found[t] = answer[0, 0]
        state[:] = before
        inputs[0, 0] = found[t]
        run()
    return found


def levels(folder: Path) -> None:
    chosen = next(one for one in sets_in(folder) if one.name == "festo_dmsp10_levels")
    whole = chosen.recordings()[0].select(["pressure", "displacement"])
    pressures, shown, step = whole["pressure"], whole["displacement"], whole.sample_time or 4.0
    for first in (150, 100):
        model = load("estimators", "balance")().fit([whole.slice(0, first)]).model_
        found = {"fixed": model.simulate(whole)["displacement"]} | {
            f"{time:g} s": predicted(adaptive(model, time), model, pressures, shown, step)
            for time in (30.0, 60.0, 120.0)
        }
        errors = {name: rms((values - shown)[150:]) for name, values in found.items()}
        print(f"fitted to {first}: " + ", ".join(f"{k} {v:.3f} mm" for k, v in errors.items()))


def instructions() -> None:
    thresholds, weights = tuple(0.05 * k for k in range(10)), tuple(12 / (1 + k) for k in range(10))
    model = replace(GPI.example(), thresholds=thresholds, weights=weights)
    for block in (model.inverse(), adaptive(model, TIME)):
        print(f"{block.title}: {emulate(block, sample_time=0.01)}")


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--motions", type=int, default=3)
    parser.add_argument("--levels", type=Path)
    parser.add_argument("--instructions", action="store_true")
    chosen = parser.parse_args()
    if chosen.instructions:
        instructions()
    elif chosen.levels is not None:
        levels(chosen.levels)
    else:
        drifts(chosen.motions)
