"""Balances of forces that learn: measured levels ahead, a soft arm that ages, instructions.

    python benchmarks/adaptive_balance.py --levels FOLDER
    python benchmarks/adaptive_balance.py --arm
    python benchmarks/adaptive_balance.py --instructions

The first prints errors [mm] of models of the first 150 levels, and of the first 100, on the last 50
levels of `festo_dmsp10_levels` in FOLDER, where every level is foretold from those before it, with the
default noise, and with what the model left in training. The second prints the tracking error of the
worst muscle of a soft arm in the half minute before rubber softens and friction grows by 20 % at once,
from 10 s after it, and from a minute after it. `adaptive.py` has the rigs.
"""

from __future__ import annotations

import argparse
import warnings
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mckibben import Block, Recording
from mckibben.blocks.adaptive.adaptive import Adaptive
from mckibben.blocks.adaptive.adaptive_series import adaptive
from mckibben.blocks.coupled.balance import Balance
from mckibben.control import track
from mckibben.control.drifting import Drift, Drifting
from mckibben.export.c.emulation import emulate
from mckibben.measured.sets import sets_in
from mckibben.registry import load
from mckibben.rigs import load_rig

Array = NDArray[np.float64]

TIMES = (30.0, 60.0, 120.0)
"""To learn in [s]."""

STEP = 0.05
ARM_AT = 90.0
"""When the arm ages [s]."""


def foretold(block: Block, forward: Block, pressures: Array, levels: Array, step: float) -> Array:
    """Return every level by the model as it is after the levels before it.

    The inverse is asked for what the model says of the pressure that was applied, and so applies it.
    """
    assert isinstance(block, Adaptive)
    n, found = block.fixed.n_states, np.empty(len(levels))
    inputs, outputs = np.zeros((1, 2)), np.zeros((1, 1))
    state = block.initial_state(np.array([levels[0], np.nan]))
    if forward.n_states == n:
        state[:n] = forward.initial_state(pressures[:1])
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
        fixed = model.simulate(whole)["displacement"]
        noise = float(np.median(np.abs(fixed - shown)[:first])) / 0.6745
        found = {"fixed": fixed} | {
            f"{time:g} s{told}": foretold(
                adaptive(model, time, given), model, pressures, shown, step
            )
            for told, given in (("", None), (" with noise", noise))
            for time in TIMES
        }
        errors = {k: np.sqrt(np.mean((v - shown)[150:] ** 2)) for k, v in found.items()}
        print(f"fitted to {first}: " + ", ".join(f"{k} {v:.3f} mm" for k, v in errors.items()))


def turning(rng: np.random.Generator, n: int, low: float, high: float, slow: float) -> Array:
    """Return smooth motion from one random turn to the next, shape (n,)."""
    values = [0.5 * (low + high)]
    while len(values) < n:
        turn, steps = rng.uniform(low, high), int(rng.uniform(0.4, 1.0) * slow / STEP)
        s = np.linspace(0, 1, steps + 1)[1:]
        values += (values[-1] + (turn - values[-1]) * (3 * s**2 - 2 * s**3)).tolist()
    return np.array(values[:n])


def driven(plant: Drifting, seed: int, seconds: float) -> Recording:
    """Return a recording of an arm whose pressures all turn at random."""
    rng, n = np.random.default_rng(seed), round(seconds / STEP)
    pressures = np.column_stack([turning(rng, n, 0.0, 2.2, 5.0) for _ in range(3)])
    inputs = np.column_stack([pressures, np.full(n, 1.0)])
    inputs[: round(3 / STEP), :3] *= np.linspace(0, 1, round(3 / STEP))[:, np.newaxis]
    plant.reset(seed)
    seen = np.array([plant.step(row) for row in inputs])
    return Recording(dict(zip(plant.outputs, seen.T, strict=True)), STEP)


def arm() -> None:
    rig = load_rig("soft-arm").changed({"sample_time": STEP, "start.pressure_extensor": 1.0})
    factors = {"stiffness": 0.8, "friction": 1.2}
    plants = {
        "fixed": Drifting(rig, []),
        "fitted afresh": Drifting(rig, [Drift(g, f) for g, f in factors.items()]),
    }
    models = {
        name: load("estimators", "balance")(scheduling=("pressure_extensor",), contact=False)
        .fit([driven(plant, 1, 150.0)])
        .model_
        for name, plant in plants.items()
    }
    outputs = [name for name in rig.outputs if name.startswith("displ")]
    shown = driven(plants["fixed"], 2, ARM_AT + 120.0)
    # what the arm can do: its own motion, a little smaller
    asked = {name: 0.8 * shown[name] + 0.1 * np.mean(shown[name]) for name in outputs}
    reference = Recording(asked | {"pressure_extensor": np.full(len(shown), 1.0)}, STEP)
    laws = {name: model.inverse() for name, model in models.items()}
    laws |= {f"adaptive, {time:g} s": adaptive(models["fixed"], time, 0.05) for time in TIMES}
    plant = Drifting(rig, [Drift(g, f, ARM_AT + 10.0) for g, f in factors.items()])
    ends = [(ARM_AT - 30, ARM_AT), (ARM_AT + 10, ARM_AT + 40), (ARM_AT + 60, ARM_AT + 120)]
    for name, law in laws.items():
        found = track(law, plant, reference, approach=10.0).recording
        errors = np.column_stack([found[o] - found[f"reference_{o}"] for o in outputs])
        worst = [
            float(np.sqrt(np.mean(errors[round(a / STEP) : round(b / STEP)] ** 2, axis=0)).max())
            for a, b in ends
        ]
        print(f"arm, {name}: " + ", ".join(f"{value:.2f}" for value in worst) + " mm", flush=True)


def instructions() -> None:
    pair = Balance.example()
    driven_by = {"driven": pair.driven[:1], "given": pair.given[:1]}
    one = Balance(
        springs=((0.96, 0.16),),
        elasticity=((-14.0, 31.0, -48.0, 39.0, 3.5, -35.0, 27.0, -7.0),),
        areas=((1.0, -0.51, 0.02),),
        friction=((0.19, 0.04, 0.07, 0.007, 0.001, 0.0002),),
        relaxation=((0.0044, 0.0032),),
        loads=((),),
        damping=(0.001,),
        walls=(0.0,),
        limits=(0.023, 0.063, 0.18, 0.49, 1.4, 3.8),
        grip=0.5,
        lags=(1.8, 25.0),
        hull=((0.0, 31.0),),
        scale=32.0,
        degree=2,
        scheduled=(),
        **driven_by,  # type: ignore[arg-type]
    )
    for what, balance in (("one muscle, six stops, two lags", one), ("two muscles", pair)):
        for block in (balance, adaptive(balance.inverse(), 60.0)):
            print(f"{what}, {block.title}: {emulate(block, sample_time=0.01)}")


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    parser = argparse.ArgumentParser()
    parser.add_argument("--levels", type=Path)
    parser.add_argument("--arm", action="store_true")
    parser.add_argument("--instructions", action="store_true")
    chosen = parser.parse_args()
    if chosen.levels is not None:
        levels(chosen.levels)
    if chosen.arm:
        arm()
    if chosen.instructions:
        instructions()
