"""Fit every model to a short recording of a virtual rig, for the pages of models; run by hand.

    python docs/models/fits.py [MODEL ...]      # all by default; some minutes
    python docs/models/fits.py --draw [MODEL ...]   # the pictures only, of models fitted before

Writes docs/models/fitted/MODEL.json, a model as `save` does, and docs/pictures/models/MODEL.png, it
running free on what it was fitted to. `docs/build.py` makes the pages of these, and fits nothing.
"""

from __future__ import annotations

import sys
import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

import mckibben
from mckibben import registry
from mckibben.blocks.hysteresis.oscillators import BoucWenOscillator
from mckibben.blocks.saving import load
from mckibben.channels import channels_of
from mckibben.errors import MckibbenError
from mckibben.recording import Recording
from mckibben.report.figures import write_figure
from mckibben.rigs import load_rig, record
from mckibben.signals import decaying_triangle, multisine
from mckibben.signals.protocol import protocol
from mckibben.signals.resampling import resample

DOCS = Path(__file__).parents[1]
MODELS = DOCS / "models" / "fitted"
PICTURES = DOCS / "pictures" / "models"

PROTOCOLS = {
    "activation-pressure": ("sine-50N-0.5Hz", "sine-150N-0.5Hz"),
    "multistate-friction": ("isometric-200mm", "isometric-190mm", "isobaric-2bar", "isobaric-4bar"),
    "mpi-narmax": ("status-1", "status-2", "status-3"),
    "sdchm": ("gpi-1", "gpi-2", "gpi-3", *(f"network-p0-{p}-drive-{d}" for p in ("0.4", "1.2", "2.0")
                                           for d in ("1", "2", "3", "123"))),
}  # fmt: skip
"""Runs of the papers' protocols, on their virtual rigs."""

SHORT = {"particles": 6, "iterations": 8, "n_rounds": 1}
SETTINGS: dict[str, dict[str, object]] = {
    "state-network": {"n_states": 3, "n_units": 6},
    "tsfnn": {"particles": 6, "iterations": 8},
    **dict.fromkeys(("coupled-pi", "sdchm", "sdchm-published"), SHORT),
}
"""Settings that differ from the defaults, for speed."""


@dataclass(frozen=True)
class Task:
    """Recordings, and the channels between which a model is fitted to them."""

    recordings: Sequence[Recording]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    scheduling: tuple[str, ...] | None = None
    picture: str = "loops"


@cache
def recorded(name: str) -> list[Recording]:
    """Return some runs of a protocol, of some hundred samples each."""
    plan = protocol(name)
    runs = [
        run
        for _, run in record(plan, load_rig(plan.rig), runs=list(PROTOCOLS[name]), seed=0, jobs=1)
    ]
    step = max(run.n_samples // 800 * (run.sample_time or 0.0) for run in runs)
    step = max(step, *(run.sample_time or 0.0 for run in runs))
    return [resample(run, step) for run in runs]


@cache
def lifted() -> list[Recording]:
    """Return a run of one muscle that lifts a mass."""
    clock = np.arange(800) * 0.05
    pressure = decaying_triangle(clock, period=10.0, high=5.0, low=1.0)
    return [load_rig("mas20-hanging").run(mckibben.Recording({"pressure": pressure}, 0.05))]


def activated() -> list[Recording]:
    """Return runs under loads, with the contraction of a muscle of 530 mm."""
    runs = recorded("activation-pressure")
    return [
        run.with_channels({"contraction": ""}, contraction=run["displacement"] / 530.0)
        for run in runs
    ]


@cache
def benchmark() -> list[Recording]:
    """Return a simulation of the Bouc-Wen benchmark (Noel and Schoukens, 2016)."""
    system = BoucWenOscillator(2.0, 0.01, 50.0, 50.0, 0.8, -1.1)
    clock = np.arange(1500) / 750.0
    force = multisine(clock, 1.0, 20.0, 120.0, -120.0, "random", seed=0)
    given = system.simulate(Recording({"force": force}, 1.0 / 750.0))["displacement"]
    made = {"rig": "Bouc-Wen benchmark (virtual)"}
    return [Recording({"force": force, "displacement": given}, 1.0 / 750.0, meta=made)]


MUSCLES = tuple(f"pressure_{place}" for place in (1, 2, 3))
MOVED = tuple(f"displacement_{place}" for place in (1, 2, 3))

TASKS: dict[str, Callable[[], Task]] = {
    "muscle": lambda: Task(lifted(), ("pressure",), ("displacement",)),
    "force": lambda: Task(recorded("multistate-friction"), ("length",), ("force",)),
    "activation": lambda: Task(activated(), ("contraction",), ("pressure",)),
    "mass": lambda: Task(benchmark(), ("force",), ("displacement",), picture="fit"),
    "load": lambda: Task(recorded("mpi-narmax"), ("voltage",), ("displacement",), ("force",)),
    "air": lambda: Task(recorded("mpi-narmax"), ("voltage",), ("pressure",)),
    "arm": lambda: Task(recorded("sdchm"), MUSCLES, MOVED, ("pressure_extensor",)),
}
"""Tasks, recorded on demand: a model is fitted to the first that applies."""

PREFERRED = {
    **dict.fromkeys(("coupled-memory", "coupled-pi", "tsfnn", "sdchm", "sdchm-published"), "arm"),
    "mpi-narmax": "load",
    "air": "air",
    "state-network": "mass",
}
"""Tasks that show more of a model than the first that applies."""


def fit(name: str) -> str:
    """Fit a model to the first task that applies, and write model and figure."""
    estimator = registry.load("estimators", name)
    reasons = []
    for key in [PREFERRED[name]] if name in PREFERRED else TASKS:
        task = TASKS[key]()
        channels = channels_of(task.recordings, task.inputs, task.outputs, task.scheduling)
        reason = estimator.objection(task.recordings, channels)
        if reason is None:
            try:
                chosen = estimator.channel_settings(channels) | SETTINGS.get(name, {})
                estimator(**chosen).fit(task.recordings).model_.save(MODELS / f"{name}.json")
                draw(name, task)
            except MckibbenError as error:
                reason = str(error)
            else:
                return told(task)
        reasons.append(reason)
    sys.exit(f"{name} could not be fitted: {reasons}")


def redraw(name: str) -> str:
    """Draw a saved model on the first task with its channels."""
    if not (PICTURES / f"{name}.png").is_file():
        return "has no picture"
    block = load(MODELS / f"{name}.json")
    given, asked = ({one.name for one in side} for side in (block.outputs, block.inputs))
    for key in [PREFERRED[name]] if name in PREFERRED else TASKS:
        task = TASKS[key]()
        if given == set(task.outputs) and set(task.inputs) <= asked <= set(
            task.recordings[0].units
        ):
            draw(name, task)
            return told(task)
    sys.exit(f"{name} leads from {asked} to {given}: no task has these")


def draw(name: str, task: Task) -> None:
    """Draw the free run of a saved model on the recording with the largest motion of its first input."""
    picture = PICTURES / f"{name}.png"
    moving = max(task.recordings, key=lambda recording: np.ptp(recording[task.inputs[0]]))
    write_figure(load(MODELS / f"{name}.json"), picture, task.picture, recording=moving)
    smaller(picture)


def told(task: Task) -> str:
    """Return the channels of a task."""
    return f"{', '.join(task.inputs)} to {', '.join(task.outputs)}"


def smaller(picture: Path) -> None:
    """Reduce a figure to few colours and the width of a page."""
    from PIL import Image

    with Image.open(picture) as opened:
        flat = opened.convert("RGB")
    flat.thumbnail((900, 700))
    flat.quantize(48).save(picture, optimize=True)


def main() -> None:
    """Fit or draw the requested models."""
    MODELS.mkdir(exist_ok=True)
    PICTURES.mkdir(exist_ok=True)
    warnings.simplefilter("ignore")
    asked = [name for name in sys.argv[1:] if name != "--draw"]
    do = redraw if "--draw" in sys.argv else fit
    for name in asked or registry.names("estimators"):
        started = time.perf_counter()
        print(f"{name}: {do(name)}, {time.perf_counter() - started:.1f} s", flush=True)


if __name__ == "__main__":
    main()
