"""Targets of a muscle on a rail that is pulled at."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np

from balance_rows import BALANCE, Array, Fits, Row, decimated, free_run, missed, rms
from mckibben import Recording, Series, load_rig
from mckibben.blocks.core.block import Block
from mckibben.blocks.coupled.load_estimate import load_of
from mckibben.control import track
from mckibben.papers.mpi_narmax.models import PLAIN, TOLD
from mckibben.papers.mpi_narmax.protocol import HELD, HELD_CYCLE
from mckibben.rigs import record
from mckibben.signals import random_wave

EVERY = 20
"""Samples of the rig, at 1 kHz, to one that is learned from, at 50 Hz."""

FIRM = 1.5
"""Pressure above which a muscle is no longer limp [bar]."""

LIGHT = 105.0
"""Highest force of the runs of up to 100 N, as measured [N]."""

SMOOTHED = 0.5
"""Time of means whose range is a swing [s], so that noise is none."""

LEVEL = 0.95
"""Share of samples that intervals should hold."""

LOOP_TIME, LOOP_FREQUENCY, STROKE = 60.0, 0.2, (8.0, 36.0)
"""Of the smooth random reference: time [s], highest frequency [Hz], range [mm]."""

TESTS = ("status-4", "random-3")

Runs = dict[str, Recording]


@dataclass
class Found:
    """Figures by row and model, a figure a seed, and what is to be said of rows."""

    figures: dict[str, dict[str, list[float]]] = field(default_factory=dict)
    notes: dict[str, str] = field(default_factory=dict)

    def add(self, row: str, name: str, value: float) -> None:
        """Add a figure."""
        self.figures.setdefault(row, {}).setdefault(name, []).append(value)


@cache
def rail_runs(seed: int) -> tuple[Runs, Runs]:
    """Return the runs to learn from and those to test on, at 50 Hz."""
    sides: dict[str, Runs] = {"train": {}, "test": {}}
    for run, recording in record("mpi-narmax", seed=seed, jobs=1):
        sides[run.role][run.name] = decimated(recording, EVERY)
    return sides["train"], sides["test"]


def forces(seed: int, fits: Fits, found: Found) -> None:
    """Find errors of forces on status 4, and how good an interval is that runs left out in turn give.

    Of these, loads beyond those of the other runs do not count.
    """
    train, test = rail_runs(seed)
    misses = {}
    for name, run in train.items():
        others = [other for place, other in train.items() if place != name]
        known = run["force"] <= max(other["force"].max() for other in others)
        if known.mean() > 0.5:
            model = fits(("rail without", name, seed), BALANCE, others, input=("pressure",))
            misses[name] = np.abs(load_of(model).simulate(run)["force"] - run["force"])[known]
    model = fits(("rail", seed), BALANCE, list(train.values()), input=("pressure",))
    half = float(np.quantile(np.concatenate(list(misses.values())), LEVEL))
    estimate = load_of(model)
    off = {name: estimate.simulate(run)["force"] - run["force"] for name, run in test.items()}
    status = test["status-4"]
    span = float(np.ptp(status["force"]))
    missing = off["status-4"]
    found.add("force", BALANCE, 100 * rms(missing) / span)
    found.add("coverage", BALANCE, 100 * float(np.mean(np.abs(missing) <= half)))
    found.add("half", BALANCE, half)
    firm = 100 * rms(off["status-4"][status["pressure"] > FIRM]) / span
    held = {name: 100 * float(np.mean(np.abs(error) <= half)) for name, error in off.items()}
    worst = max(misses, key=lambda name: rms(misses[name]))
    found.notes["force"] = f"balance: {firm:.2g} % of range above {FIRM:g} bar"
    found.notes["coverage"] = found.notes["half"] = (
        f"of runs left out in turn the worst is {worst} ({rms(misses[worst]):.1f} N RMSE); over all "
        f"test runs the interval holds {np.mean(list(held.values())):.1f} %, least "
        f"{min(held.values()):.1f} %"
    )


def swing(values: Array, step: float) -> float:
    """Return the range over the last cycle of the force, of means [mm]."""
    n = round(SMOOTHED / step)
    last = values[-round(HELD_CYCLE / step) :]
    return float(np.ptp(last[: len(last) // n * n].reshape(-1, n).mean(axis=1)))


def swing_error(model: Block, run: Recording) -> float:
    """Return how far a model's loop by force is from the measured, in per cent of it."""
    step = run.sample_time or 1.0
    found = free_run(model, run, "displacement")[:, 0]
    return 100 * abs(swing(found, step) / swing(run["displacement"], step) - 1.0)


def in_front(train: Runs, fits: Fits, key: object) -> Block:
    """Return the balance from voltage: air, and behind it the balance of measured pressure."""
    runs = list(train.values())
    air = fits(key, "air", runs, longest_dead_time=0.1)
    return Series((air, fits(key, BALANCE, runs, input=("pressure",))))


def following(model: Block, pulls: Recording, seed: int) -> float:
    """Return the RMSE of the rig open loop, on a smooth random reference under pulls [mm]."""
    step = pulls.sample_time or 1.0
    time = np.arange(round(LOOP_TIME / step)) * step
    low, high = STROKE
    wanted = random_wave(time, LOOP_FREQUENCY, high, low, seed=1000 + seed)
    force = np.interp(time, pulls.time - pulls.time[0], pulls["force"]).clip(0.0)
    reference = Recording({"displacement": wanted, "force": force}, step)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = track(model.inverse(), load_rig("rail"), reference, approach=10.0, seed=seed)
    return found.rmse["displacement"]


def from_pressure(seed: int, fits: Fits, found: Found) -> None:
    """Find errors of models of measured pressure and force."""
    train, test = rail_runs(seed)
    runs = list(train.values())
    light = [run for run in runs if run["force"].max() < LIGHT]
    models: dict[str, dict[str, Any]] = {
        "cpi": {},
        "gpi": {},
        "mpi-narmax": {"input": "pressure", **TOLD[PLAIN].settings},
        BALANCE: {"input": ("pressure",)},
    }
    for name, how in models.items():
        model = fits(("rail", seed), name, runs, **how)
        for run in TESTS:
            found.add(run, name, missed(model, test[run], "displacement"))
        loops = [swing_error(model, test[f"held-{volt:g}V"]) for volt in HELD]
        found.add("held", name, max(loops))
        found.notes["held"] = "balance: " + ", ".join(
            f"{volt:g} V {error:.1f} %" for volt, error in zip(HELD, loops, strict=True)
        )
        if name not in ("cpi", "gpi"):  # which know no force
            model = fits(("light", seed), name, light, **how)
            found.add("213 N", name, missed(model, train["status-3"], "displacement"))
            found.add("152 N", name, missed(model, test["status-4"], "displacement"))


def from_voltage(seed: int, fits: Fits, found: Found) -> None:
    """Find errors of models of voltage and force, and of the rig driven by their inverses."""
    train, test = rail_runs(seed)
    runs = list(train.values())
    ways = {
        "directly": fits(("rail", seed), BALANCE, runs, input=("voltage",)),
        "air in front": in_front(train, fits, ("rail", seed)),
    }
    own = {
        way: rms(np.array([missed(model, run, "displacement") for run in runs]))
        for way, model in ways.items()
    }
    better = min(own, key=lambda way: own[way])  # by what was learned from
    narmax = fits(("rail", seed), "mpi-narmax", runs, **TOLD[PLAIN].settings)
    models = {"mpi-narmax": narmax, **ways, BALANCE: ways[better]}
    for name, model in models.items():
        for run in TESTS:
            found.add(f"voltage, {run}", name, missed(model, test[run], "displacement"))
        if name != "mpi-narmax":  # which has no inverse
            found.add("loop", name, following(model, test["status-4"], seed))
    for row in (*(f"voltage, {run}" for run in TESTS), "loop"):
        found.notes[row] = f"balance: the way that is better where it learned, {better}"


def rail(seeds: int) -> Iterator[Row]:
    """Yield the targets of the rail."""
    found = Found()
    for seed in range(seeds):
        fits = Fits()
        from_pressure(seed, fits, found)
        from_voltage(seed, fits, found)
        forces(seed, fits, found)
    for name, what, unit, target, least in (
        *((run, f"from pressure and force, {run}", "mm", 0.16, -np.inf) for run in TESTS),
        *(
            (f"voltage, {run}", f"from voltage and force, {run}", "mm", 0.4, -np.inf)
            for run in TESTS
        ),
        ("213 N", "learned up to 100 N, at 213 N (status-3)", "mm", 0.5, -np.inf),
        ("152 N", "learned up to 100 N, up to 152 N (status-4)", "mm", 0.3, -np.inf),
        ("held", "swing by force at held voltage, worst of five", "%", 10.0, -np.inf),
        ("force", "force from pressure and displacement, status-4", "% of range", 2.0, -np.inf),
        ("coverage", "its interval of 95 % holds", "%", 97.0, 93.0),
        ("half", "its half-width", "N", 8.0, -np.inf),
        ("loop", "open loop on a random reference under pulls", "mm", 0.35, -np.inf),
    ):
        note = found.notes.get(name, "")
        yield Row("rail", what, unit, target, found.figures[name], note, least)
