"""How fast muscles are in MuJoCo, and what a muscle loses that is fitted for MJCF.

    python benchmarks/mujoco_muscles.py ../shared/data

Prints muscle-steps a second, of two muscles at a joint in many copies on all processors; then errors
within the limits of MJCF and without them, of recordings that are not fitted: of the force where one was
measured (the last of three repeats), else of the displacement (the second half).
"""

from __future__ import annotations

import sys
import tempfile
import time
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from mckibben import workflow
from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.coupled.load_estimate import load_of
from mckibben.estimators.coupled.balance import BalanceEstimator
from mckibben.exporting.mjcf import export_mjcf
from mckibben.reading import read_files
from mckibben.recording import Recording
from mckibben.rigs import load_rig
from mckibben.signals import random_wave

sys.path.insert(0, str(Path(__file__).parents[1] / "examples"))
from joint_environment import JointTracking

COPIES, CONTROL_STEPS = 256, 100
LIMITS = BalanceEstimator.targets["mjcf"]

Settings = Mapping[str, Any]


def speed() -> float:
    """Return muscle-steps a second of a muscle fitted to the rig `mckibben-530`."""
    time_grid = np.arange(0.0, 60.0, 0.02)
    given = {
        "pressure": random_wave(time_grid, 0.4, 4.0, 0.5, 0.05, seed=1),
        "force": random_wave(time_grid, 0.2, 250.0, 20.0, 0.05, seed=2),
    }
    run = (
        load_rig("mckibben-530").changed({"sample_time": 0.02}).run(Recording(given, 0.02), seed=0)
    )
    model = workflow.fit("balance", run, settings=LIMITS).model
    with tempfile.TemporaryDirectory() as folder:
        file = export_mjcf(
            model, Path(folder) / "m.xml", rest_length=530.0, example="joint", lag=0.05
        )
        env = JointTracking(file, COPIES)
    env.reset(seed=0)
    actions = np.random.default_rng(0).uniform(-1, 1, (CONTROL_STEPS, COPIES, 2)).astype(np.float32)
    begun = time.perf_counter()
    for action in actions:
        env.step(action)
    steps = CONTROL_STEPS * COPIES * 2 * round(env.control_time / env.model.opt.timestep)
    return steps / (time.perf_counter() - begun)


def error(model: Block, runs: list[Recording], first: int = 0) -> float:
    """Return the RMSE of a model's output from rest, from a sample on."""
    names, (output,) = [one.name for one in model.inputs], [one.name for one in model.outputs]
    squares: list[Array] = []
    for run in runs:
        found = model.simulate(run.matrix(names), sample_time=run.sample_time)[:, 0]
        squares.append((found - run[output])[first:] ** 2)
    return float(np.sqrt(np.concatenate(squares).mean()))


def of_force(folder: Path, muscle: str, settings: Settings) -> float:
    """Return the error of the force of the third repeats, of a muscle fitted to the first two [N]."""
    repeats = [
        read_files(
            sorted((folder / "festo_isometric_20mm").glob(f"{muscle}*_run{k}.csv")), None, None
        )
        for k in (1, 2, 3)
    ]
    fitted = workflow.fit("balance", repeats[0] + repeats[1], settings=settings)
    return error(load_of(fitted.model), repeats[2])


def of_displacement(folder: Path, name: str, settings: Settings) -> float:
    """Return the error of the displacement in the second half, of a muscle fitted to the first [mm]."""
    (run,) = read_files([folder / name / f"{name}.csv"], None, None)
    half = run.n_samples // 2
    fitted = workflow.fit("balance", run.slice(0, half), settings=settings)
    return error(fitted.model, [run], half)


def main() -> None:
    warnings.simplefilter("ignore")  # about the recordings, which are read as they are
    print(f"{speed():.2g} muscle-steps/s, {COPIES} joints of two muscles")
    folder = Path(sys.argv[1])
    moving = {name: value for name, value in LIMITS.items() if name != "of_force"}
    print(f"{'muscle':30}{'for MJCF':>10}{'free':>10}{'ratio':>8}")
    for name in ("muscle12cm", "muscle30cm"):
        limited, free = (of_force(folder, name, chosen) for chosen in (LIMITS, {"of_force": True}))
        print(f"{f'isometric, {name}':30}{limited:8.1f} N{free:8.1f} N{limited / free:8.2f}")
    for name in ("festo_dmsp10_static", "festo_dmsp10_levels"):
        limited, free = (of_displacement(folder, name, chosen) for chosen in (moving, {}))
        print(f"{name:30}{limited:7.3f} mm{free:7.3f} mm{limited / free:8.2f}")


if __name__ == "__main__":
    main()
