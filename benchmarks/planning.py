"""How much recording time plans save: the papers' protocols against planned motion of half the time.

    python benchmarks/planning.py [--seeds 3] [--only rail,...] [--sigma 30]

Of every seed: a pilot of random motion takes a share of the time, a model is fitted to it, and the rest
is planned from it; nothing of the plant's own numbers is used. Random motion as long stands beside. The
same model is fitted to all, and runs free over random motion held out.
"""

from __future__ import annotations

import argparse
import statistics
import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from mckibben import Recording, load_rig
from mckibben.blocks.core.writing import quantities
from mckibben.excitation.candidates import random_plan
from mckibben.excitation.limits import Limit, Limits, at_rates, followed, limits_of_rig, narrowed
from mckibben.excitation.planning import plan
from mckibben.registry import load
from mckibben.signals.protocol import protocol

PILOT = 0.3
"""Share of the time that is random motion, to which the first model is fitted."""

HELD_OUT = 120.0
"""Random motion to test on [s]."""


@dataclass
class Plant:
    """What is recorded, and how the papers do it.

    ``paper`` gives its recordings, by seed.
    """

    name: str
    model: str
    step: float
    limits: Limits
    run: Callable[[Recording, int, dict[str, float]], Recording]
    paper: Callable[[int], list[Recording]]
    outputs: tuple[str, ...]
    settings: dict[str, Any] = field(default_factory=dict)
    rig: str | None = None


def coarser(recording: Recording, step: float) -> Recording:
    """Return every so manieth sample."""
    every = max(round(step / (recording.sample_time or step)), 1)
    channels = {name: samples[::every] for name, samples in recording.channels.items()}
    return Recording(channels, every * (recording.sample_time or step), meta=recording.meta)


def on_rig(
    name: str,
    paper: str,
    runs: Sequence[str],
    step: float,
    model: str,
    asked: Any = None,
    **how: Any,
) -> Plant:
    """Return a virtual rig as a plant, with the runs of its paper that take up to about 200 s."""
    rig = load_rig(name)
    limits = narrowed(limits_of_rig(rig), asked or {})
    moves = [n for n in rig.outputs if n.startswith("displacement")] or ["force"]
    kept = [*rig.inputs, *moves]

    def run(commands: Recording, seed: int, settings: dict[str, Any]) -> Recording:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return coarser(rig.changed(settings).run(commands, seed), step).select(kept)

    def papers(seed: int) -> list[Recording]:
        made = {one.name: one for one in protocol(paper).runs}
        found = []
        for number, one in enumerate(runs):
            given = made[one]
            whole = run(given.inputs, 100 * seed + number, dict(given.settings))
            found.append(whole.slice(round(given.lead / (whole.sample_time or 1.0)), len(whole)))
        return found

    return Plant(name, model, step, limits, run, papers, tuple(moves), how, name)


def bouc_wen(commands: Recording, seed: int, settings: dict[str, float]) -> Recording:
    """Run a muscle of other physics: Bouc-Wen hysteresis that grows with pressure, creep, and a lag.

    Pressure in, displacement out; an S-shaped characteristic, nothing of which is a balance of forces.
    """
    fine = 0.002
    time_ = np.arange(0.0, (commands.duration or 0.0) + fine / 2, fine)
    u = np.interp(time_, commands.time - commands.time[0], commands["pressure"])
    z, lag, creep, found = 0.0, u[0], np.array([u[0]] * 3), np.empty(time_.size)
    rates = np.exp(-fine / np.array([0.8, 6.0, 40.0]))
    before = u[0]
    for i, pressure in enumerate(u.tolist()):
        du = pressure - before
        before = pressure
        z += 1.6 * du - 0.9 * abs(du) * z - 0.5 * du * abs(z)
        creep = pressure + (creep - pressure) * rates
        lag += (pressure - lag) * fine / 0.06
        smooth = 30.0 / (1.0 + np.exp(-1.1 * (lag - 2.4)))
        found[i] = smooth - (1.1 + 0.25 * lag) * z + 0.35 * float(creep.sum())
    found -= found[0]
    noise = np.random.default_rng(seed).standard_normal(time_.size)
    every = round((commands.sample_time or 0.02) / fine)
    y = (found + 0.03 * noise)[::every][: len(commands)]
    return Recording({"pressure": commands["pressure"], "displacement": y}, commands.sample_time)


def other_physics() -> Plant:
    """Return the plant that is no rig, its paper's protocol that of the hanging muscle from 0 bar."""
    made = protocol("field-models").runs[0].inputs
    wave = (made["pressure"] - 1.0) / 4.5 * 5.0
    command = Recording({"pressure": wave}, made.sample_time)
    return Plant(
        "bouc-wen with creep",
        "balance",
        0.02,
        {"pressure": Limit(0.0, 5.0, 2.5, 0.0)},
        bouc_wen,
        lambda seed: [bouc_wen(command, seed, {})],
        ("displacement",),
    )


TAUT = {"pressure": (3.0, 6.0, 1.5), "length": (190.0, 200.0, 10.0)}
"""Limits within which the muscle of the test stand is never slack."""

PLANTS: dict[str, Callable[[], Plant]] = {
    "mas20-hanging": lambda: on_rig(
        "mas20-hanging", "field-models", ["decaying-triangle"], 0.02, "balance"
    ),
    "rail": lambda: on_rig(
        "rail",
        "mpi-narmax",
        ["status-1", "status-2", "training-pulls-100N"],
        0.02,
        "balance",
        {"force": (0.0, 200.0, 60.0)},
        input=("voltage",),
    ),
    "mckibben-530": lambda: on_rig(
        "mckibben-530",
        "activation-pressure",
        ["static-0N", *(f"sine-{f}N-{w}Hz" for f in range(0, 350, 50) for w in ("0.5", "2.0"))],
        0.02,
        "balance",
        {"pressure": (0.0, 4.0, 2.0)},
    ),
    "soft-arm": lambda: on_rig(
        "soft-arm",
        "sdchm",
        ["network-p0-1.0-drive-123", "network-p0-1.0-drive-1"],
        0.05,
        "balance",
    ),
    "mas10-test-stand": lambda: on_rig(
        "mas10-test-stand",
        "multistate-friction",
        ["isobaric-4bar", "isometric-198mm", "isometric-190mm"],
        0.02,
        "multistate",
        TAUT,
    ),
    "other physics": other_physics,
}


def commanded(plant: Plant, columns: np.ndarray, step: float) -> Recording:
    """Return commands as a recording."""
    return Recording(dict(zip(plant.limits, columns.T, strict=True)), step)


def random_run(plant: Plant, seconds: float, seed: int, noise: int) -> Recording:
    """Record random motion within the limits, from rest."""
    rest = at_rates(plant.limits)[3]
    rng, n = np.random.default_rng(seed), round(seconds / plant.step)
    targets = random_plan(plant.limits, 1, n, plant.step, rng)[0].targets
    path = np.vstack([rest, followed(targets, rest, plant.limits, plant.step)])
    return recorded(plant, commanded(plant, path, plant.step), noise)


def recorded(plant: Plant, commands: Recording, seed: int) -> Recording:
    """Record commands from where they start."""
    start = {f"start.{name}": limit.rest for name, limit in plant.limits.items()}
    return plant.run(commands, seed, start)


def fitted(plant: Plant, recordings: Sequence[Recording]) -> Any:
    """Return the plant's model fitted to recordings."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return load("estimators", plant.model)(**plant.settings).fit(list(recordings)).model_


def missed(plant: Plant, model: Any, held_out: Recording) -> float:
    """Return the error of a free run over the outputs, in per cent of their ranges."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = model.simulate(held_out)
    shares = [
        np.sqrt(np.mean((found[name] - held_out[name]) ** 2)) / np.ptp(held_out[name])
        for name in plant.outputs
    ]
    return 100 * float(np.sqrt(np.mean(np.square(shares))))


def compared(plant: Plant, seeds: int) -> None:
    """Print the errors of the paper's protocol, a plan and random motion, seed by seed."""
    rows = []
    for seed in range(seeds):
        began = time.perf_counter()
        paper = plant.paper(seed)
        whole = sum(one.duration or 0.0 for one in paper)
        half = 0.5 * whole
        held_out = random_run(plant, HELD_OUT, 1000 + seed, 2000 + seed)
        pilot = random_run(plant, PILOT * half, seed, 3000 + seed)
        first = fitted(plant, [pilot])
        asked = {name: (one.low, one.high, one.rate) for name, one in plant.limits.items()}
        left = (1 - PILOT) * half
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            next_ = plan(
                [pilot], rig=plant.rig, model=first, minutes=left / 60, limits=asked, seed=seed
            )
        commands = coarser(next_.recording, plant.step)
        planned = [pilot, recorded(plant, commands, 4000 + seed)]
        took = time.perf_counter() - began
        random = [pilot, random_run(plant, left, 500 + seed, 4000 + seed)]
        row = [missed(plant, fitted(plant, one), held_out) for one in (paper, planned, random)]
        used = sum(one.duration or 0.0 for one in planned)
        rows.append(row)
        print(
            f"{plant.name} seed {seed}: paper {whole:.0f} s {row[0]:.3g} %, planned {used:.0f} s "
            f"{row[1]:.3g} %, random as long {row[2]:.3g} % of range ({took:.0f} s to plan)",
            flush=True,
        )
    middle = [statistics.median(column) for column in zip(*rows, strict=True)]
    print(
        f"{plant.name}, median of {seeds}: paper {middle[0]:.3g} %, planned {middle[1]:.3g} %, random "
        f"{middle[2]:.3g} %: {'met' if middle[1] <= middle[0] else 'NOT met'}",
        flush=True,
    )


def friction_told(elements: Any, repeats: int) -> None:
    """Print standard errors of sigma before and after a plan for it, and the spread of estimates.

    Before is the isobaric cycle from which the paper identifies its friction, at 2 mm/s; the plan is 90
    seconds at the same pressure, at up to 20 mm/s. Both are recorded anew for every repeat, with other
    noise.
    """
    rig = load_rig("mas10-test-stand")
    made = {one.name: one for one in protocol("multistate-friction").runs}["isobaric-4bar"]
    estimator = load("estimators", "multistate")(elements=elements)

    def cycle(seed: int) -> Recording:
        return rig.changed(dict(made.settings)).run(made.inputs, seed)

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        first = estimator.fit([cycle(0)]).model_
        limits = {"length": (185.0, 200.0, 20.0), "pressure": (4.0, 4.0)}
        next_ = plan(
            [cycle(0)], rig=rig, model=first, minutes=1.5, limits=limits, goal="sigma", seed=0
        )
        start = {f"start.{name}": float(x[0]) for name, x in next_.recording.channels.items()}
        found, before = [], []
        for repeat in range(repeats):
            again = coarser(rig.changed(start).run(next_.recording, 1000 + repeat), 0.02)
            before.append(estimator.fit([cycle(2000 + repeat)]).model_.pack())
            found.append(estimator.fit([cycle(2000 + repeat), again]).model_.pack())
    names = [quantity.name for quantity in quantities(first)]
    for one in next_.learned:
        place = names.index(one.name)
        was, now = (np.array(values)[:, place] for values in (before, found))
        print(
            f"{elements} {one.name}: standard error {100 * one.now:.3g} -> {100 * one.after:.3g} %, "
            f"spread of {repeats} estimates {100 * was.std(ddof=1) / abs(was.mean()):.3g} -> "
            f"{100 * now.std(ddof=1) / abs(now.mean()):.3g} %, mean {was.mean():.3g} -> "
            f"{now.mean():.3g}",
            flush=True,
        )


def main() -> None:
    """Print all that is asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sigma", type=int, default=0, metavar="REPEATS", help="of friction")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--only", default=",".join(PLANTS))
    given = parser.parse_args()
    for elements in (("shared",), "each-way") if given.sigma else ():
        friction_told(elements, given.sigma)
    for name in filter(None, given.only.split(",")):
        compared(PLANTS[name](), given.seeds)


if __name__ == "__main__":
    main()
