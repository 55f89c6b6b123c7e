"""Closed loops: compensators and feedback on virtual rigs and on twins, within 1 %."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import mckibben
from mckibben import Block, Recording, example, registry
from mckibben.control import Twin, control_law, track, tune_pid
from tests.golden.case import Case, Tree
from tests.golden.commands import call
from tests.golden.plants import runs
from tests.golden.rooms.commands import MODEL
from tests.golden.rounding import rounded

STEP = 0.05

SAMPLES = 40
"""Of a trace that are compared one by one; all are by their RMS."""

Make = Callable[..., Any]


def known(folder: Path, weights: tuple[float, ...] = ()) -> Block:
    """Return a generalised Prandtl-Ishlinskii model whose parameters are written out."""
    path = folder / "model.json"
    path.write_text(json.dumps(MODEL | ({"weights": list(weights)} if weights else {})))
    return mckibben.load(path)


other = partial(known, weights=(9.0, 6.0, 1.5, 2.0, 3.0))


def inverse(make: Make, *options: str, folder: Path) -> Block:
    """Return what the command line makes of a model to undo it."""
    model, out = folder / "forward.json", folder / "inverse.json"
    make(folder).save(model)
    result = call("invert", model, "-o", out, *options)
    if result.code:
        raise RuntimeError(result.err)
    return mckibben.load(out)


def fitted(model: str, plant: str, settings: Mapping[str, Any], folder: Path) -> Block:
    """Return a model of a plant that is written out."""
    del folder
    found: Block = registry.load("estimators", model)(**settings).fit(runs(plant)).model_
    return found


def behind_air(plant: str, make: Make, folder: Path) -> Block:
    """Return a model of a muscle behind one of its valve and air."""
    air = fitted("air", plant, {"n_starts": 4}, folder)
    return mckibben.Series((air, make(folder)))


def bundled(folder: Path) -> Block:
    """Return the inverse of a model of the bundled recording."""
    del folder
    return mckibben.MPIEstimator(n_operators=6).fit(mckibben.read(example.TRAIN)).model_.inverse()


def rig(name: str, settings: Mapping[str, Any], folder: Path) -> Any:
    """Return a virtual rig."""
    del folder
    return mckibben.load_rig(name).changed(settings)


def twin(make: Make, limits: Mapping[str, tuple[float, float]] | None, folder: Path) -> Twin:
    """Return a model as a plant."""
    return Twin(make(folder), limits=limits)


def waves(low: float, high: float, n: int = 300) -> np.ndarray:
    """Return a motion between two ends that never comes twice."""
    t = np.arange(n) * STEP
    found: np.ndarray = low + (high - low) * (0.5 - 0.3 * np.cos(1.3 * t) - 0.2 * np.cos(0.37 * t))
    return found


HANGING = Recording({"displacement": waves(6.0, 26.0)}, STEP)
KNOWN = Recording({"displacement": waves(11.0, 35.0)}, STEP)
BEYOND = Recording({"displacement": waves(5.0, 42.0)}, STEP)
HEAVY = Recording({"displacement": waves(6.0, 18.0), "force": waves(70.0, 110.0)}, STEP)
PULLED = Recording({"force": waves(100.0, 500.0), "length": waves(175.0, 195.0)}, STEP)
BOTH = Recording(
    {
        "displacement_1": waves(2.0, 7.0),
        "displacement_2": waves(1.0, 5.0)[::-1].copy(),
        "pressure_extensor": np.full(300, 0.25),
    },
    STEP,
)


@dataclass(frozen=True)
class Loop:
    """A compensator, a plant, and what is to be followed."""

    compensator: Make
    plant: Make
    reference: Recording
    law: str = "feedforward"
    options: Mapping[str, Any] = field(default_factory=dict)


LOADED = {"input": ("pressure",), "output": ("displacement",), "scheduling": ("force",)}
BALANCE = {"n_stops": 3, "n_lags": 1, "elasticity": 3} | LOADED
INVERSE = partial(inverse, known)
TWIN = partial(twin, other, None)
RIG = partial(rig, "mas20-hanging", {})
PRESSURE, VOLTAGE = {"pressure": (0.0, 6.0)}, {"voltage": (0.0, 10.0)}

LOOPS: Mapping[str, Loop] = {
    "own-twin": Loop(INVERSE, partial(twin, known, None), KNOWN),
    "twin": Loop(INVERSE, TWIN, KNOWN),
    "twin-beyond": Loop(INVERSE, TWIN, BEYOND),
    "twin-slew": Loop(INVERSE, TWIN, KNOWN, options={"slew": 2.0, "settle": 3.0}),
    "twin-feedback": Loop(INVERSE, TWIN, KNOWN, "feedforward-pid", {"noise": 0.05, "delay": 2}),
    "twin-observer": Loop(INVERSE, TWIN, KNOWN, "observer"),
    "twin-adaptive": Loop(partial(inverse, known, "--adaptive"), TWIN, KNOWN),
    "twin-predictive": Loop(
        partial(inverse, known, "--predictive", "--rate-limit", "4"), TWIN, KNOWN
    ),
    "rig": Loop(bundled, RIG, HANGING),
    "rig-pid": Loop(bundled, RIG, HANGING, "pid", {"noise": 0.02}),
    "rig-feedback": Loop(bundled, RIG, HANGING, "feedforward-pid"),
    "rig-observer": Loop(bundled, RIG, HANGING, "observer", {"preview": 0.1}),
    "rig-open": Loop(bundled, RIG, HANGING, options={"pressure_loop": False}),
    "rig-heavier": Loop(bundled, partial(rig, "mas20-hanging", {"payload": 10.0}), HANGING),
    "load": Loop(
        partial(inverse, partial(fitted, "balance", "lifted", BALANCE)),
        partial(twin, partial(fitted, "coupled-memory", "lifted", LOADED), PRESSURE),
        HEAVY,
    ),
    "force": Loop(
        partial(inverse, partial(fitted, "force-bilinear", "bench", {})),
        partial(twin, partial(fitted, "force-minh", "bench", {}), PRESSURE),
        PULLED,
    ),
    "air": Loop(
        partial(inverse, partial(behind_air, "commanded", known)),
        partial(twin, partial(behind_air, "commanded-slower", other), VOLTAGE),
        KNOWN,
        options={"pressure_loop": False},
    ),
    "arm": Loop(
        partial(inverse, partial(fitted, "coupled-pi", "arm", {})),
        partial(
            twin,
            partial(fitted, "coupled-memory", "arm", {}),
            {f"pressure_{k}": (0.0, 3.0) for k in (1, 2)},
        ),
        BOTH,
    ),
}


def closed(name: str, folder: Path) -> Tree:
    """Return what came of a loop."""
    loop = LOOPS[name]
    compensator, plant = loop.compensator(folder=folder), loop.plant(folder=folder)
    law = control_law(loop.law, compensator, lambda: tune_pid(plant, sample_time=STEP))
    found = track(law, plant, loop.reference, approach=5.0, **loop.options)
    recording = found.recording
    return {
        "rmse": rounded({name: float(value) for name, value in found.rmse.items()}),
        "largest": rounded({name: float(value) for name, value in found.largest.items()}),
        "clipped": found.clipped,
        "beyond": {name: [one.low, one.high] for name, one in found.beyond.items()},
        "start_time": recording.start_time,
        "traces": {
            name: {
                "unit": recording.units[name],
                "rms": float(np.sqrt(np.mean(recording[name] ** 2))),
                "some": np.array(recording[name][:: len(recording) // SAMPLES]),
            }
            for name in recording.channels
        },
    }


def cases() -> Iterator[Case]:
    """Yield loops."""
    for name, loop in LOOPS.items():
        options = "".join(f", {key}={value!r}" for key, value in loop.options.items())
        yield Case(
            f"loops/{name}",
            f"track(control_law({loop.law!r}, compensator, tuned), plant, reference{options})",
            partial(closed, name),
            {"*": 0.01},
        )
