"""Targets of a muscle on a rail that is pulled at."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from functools import cache

import numpy as np

from balance_rows import BALANCE, Array, Fits, Row, decimated, free_run, missed, rms
from mckibben import Recording, Series, load_rig
from mckibben.blocks.core.block import Block
from mckibben.blocks.coupled.balance import Balance
from mckibben.blocks.coupled.balance_law import (
    AT_REST,
    FROM_REST,
    IN_TIME,
    area,
    begin,
    elastic,
    keep,
    lagging,
    muscle_width,
    muscles,
    rubbed,
)
from mckibben.control import track
from mckibben.estimators.coupled.force_estimate import fit_force_estimate
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

Runs = dict[str, Recording]


@cache
def rail_runs(seed: int) -> tuple[Runs, Runs]:
    """Return the runs to learn from and those to test on, at 50 Hz."""
    sides: dict[str, Runs] = {"train": {}, "test": {}}
    for run, recording in record("mpi-narmax", seed=seed, jobs=1):
        sides[run.role][run.name] = decimated(recording, EVERY)
    return sides["train"], sides["test"]


def load_of(model: Block, recording: Recording) -> Array:
    """Return the load of a single muscle that balances what was measured [N].

    Explicit: all that holds a pressure but the load is known from displacement, pressure and their past.
    """
    balance = model.inverse()
    assert isinstance(balance, Balance) and len(balance.driven) == balance.n_loads == 1
    c = balance.coefficients(recording.sample_time)
    own = muscles(c)
    share = c[own + muscle_width(c) - 1]
    state, gradient, no_load = np.zeros(balance.n_states), np.zeros(1), np.zeros(1)
    scratch = np.zeros(balance.n_scratch)
    y = np.ascontiguousarray(recording["displacement"])
    p = np.ascontiguousarray(recording[balance.given[0].name])
    found = np.empty(len(y))

    def left(t: int, way: int) -> float:
        held = elastic(c, own, 0, y[t : t + 1], no_load, gradient)
        held += rubbed(c, own, 0, state, way, y[t], p[t])[0]
        held += lagging(c, own, 0, state, way, y[t])[0]
        return float((p[t] * area(c, own, y[t])[0] - held) / share)

    first = np.array([left(0, AT_REST)])
    begin(c, state, first, np.zeros(1), scratch)
    for t in range(len(y)):
        way = IN_TIME if t else FROM_REST
        found[t] = left(t, way)
        keep(c, state, way, y[t : t + 1], p[t : t + 1])
    return found


def forces(train: Runs, test: Runs, fits: Fits, seed: int) -> tuple[float, float, float, str]:
    """Return error in per cent of range, coverage in per cent and half-width on status 4."""
    misses = {}
    for name in train:
        others = [run for other, run in train.items() if other != name]
        model = fits(("rail without", name, seed), BALANCE, others, input=("pressure",))
        force = train[name]["force"]
        known = force <= max(run["force"].max() for run in others)
        if known.mean() > 0.5:  # the hull of what was recorded
            misses[name] = np.abs(load_of(model, train[name]) - force)[known]
    half = float(np.quantile(np.concatenate(list(misses.values())), LEVEL))
    worst = max(misses, key=lambda name: rms(misses[name]))
    model = fits(("rail", seed), BALANCE, list(train.values()), input=("pressure",))
    off = {name: load_of(model, run) - run["force"] for name, run in test.items()}
    status, span = off["status-4"], float(np.ptp(test["status-4"]["force"]))
    within = {name: 100 * float(np.mean(np.abs(error) <= half)) for name, error in off.items()}
    pressed = test["status-4"]["pressure"] > FIRM
    said = (
        f"{100 * rms(status[pressed]) / span:.2g} % of range above {FIRM:g} bar; held out in turn, worst {worst} ({rms(misses[worst]):.1f} N); coverage over all test runs "
        f"{np.mean(list(within.values())):.1f} %, least {min(within.values()):.1f} % "
        f"({min(within, key=lambda name: within[name])})"
    )
    return 100 * rms(status) / span, within["status-4"], half, said


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


def in_front(train: Runs, fits: Fits, key: object, name: str, **how: object) -> Block:
    """Return a model from voltage: air, and behind it a model from measured pressure."""
    air = fits((key, "air"), "air", list(train.values()), longest_dead_time=0.1)
    return Series((air, fits(key, name, list(train.values()), input=("pressure",), **how)))


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


def rail(seeds: int) -> Iterator[Row]:
    """Yield the targets of the rail."""
    figures: dict[str, dict[str, list[float]]] = {}
    said = dict.fromkeys(("voltage", "force", "held", "loop"), "")

    def note(row: str, name: str, value: float) -> None:
        figures.setdefault(row, {}).setdefault(name, []).append(value)

    narmax = {**TOLD[PLAIN].settings}
    for seed in range(seeds):
        fits = Fits()
        train, test = rail_runs(seed)
        runs = list(train.values())
        light = [run for run in runs if run["force"].max() < LIGHT]
        on_pressure: dict[str, dict[str, object]] = {
            "cpi": {},
            "gpi": {},
            "mpi-narmax": {"input": "pressure", **narmax},
            "force-balance": {"input": ("pressure",)},
            BALANCE: {"input": ("pressure",)},
        }
        for name, how in on_pressure.items():
            model = fits(("rail", seed), name, runs, **how)
            for run in ("status-4", "random-3"):
                note(run, name, missed(model, test[run], "displacement"))
            loops = [swing_error(model, test[f"held-{volt:g}V"]) for volt in HELD]
            note("held", name, max(loops))
            if name == BALANCE:
                said["held"] = ", ".join(
                    f"{volt:g} V {error:.1f} %" for volt, error in zip(HELD, loops, strict=True)
                )
            if name in ("cpi", "gpi"):
                continue
            model = fits(("light", seed), name, light, **how)
            note("213 N", name, missed(model, train["status-3"], "displacement"))
            note("152 N", name, missed(model, test["status-4"], "displacement"))
        ways = {
            "directly": fits(("rail", seed), BALANCE, runs, input=("voltage",)),
            "air in front": in_front(train, fits, ("rail", seed), BALANCE),
        }
        own = {
            way: rms(np.array([missed(model, run, "displacement") for run in runs]))
            for way, model in ways.items()
        }
        better = min(own, key=lambda way: own[way])  # by what was learned from
        voltage: dict[str, Block] = {
            "mpi-narmax": fits(("rail", seed), "mpi-narmax", runs, **narmax),
            "force-balance": fits(("rail", seed), "force-balance", runs, input=("voltage",)),
            BALANCE: ways[better],
        }
        for run in ("status-4", "random-3"):
            for name, model in voltage.items():
                note(f"voltage, {run}", name, missed(model, test[run], "displacement"))
            for way, model in ways.items():
                note(f"voltage, {run}", way, missed(model, test[run], "displacement"))
        said["voltage"] = f"the way that is better where it learned: {better}"
        del voltage["mpi-narmax"]  # which has no inverse
        for name, model in (voltage | ways).items():
            note("loop", name, following(model, test["status-4"], seed))
        percent, coverage, half, said["force"] = forces(train, test, fits, seed)
        other = fit_force_estimate(runs)
        measured = test["status-4"]["force"]
        off = other.estimate(test["status-4"])["force_model"] - measured
        note("force", "force-balance", 100 * rms(off) / float(np.ptp(measured)))
        note("coverage", "force-balance", 100 * float(np.mean(np.abs(off) <= other.half_width)))
        note("half", "force-balance", other.half_width)
        for row, value in (("force", percent), ("coverage", coverage), ("half", half)):
            note(row, BALANCE, value)

    def row(name: str, what: str, unit: str, target: float, note: str = "", least: float = -np.inf):
        return Row("rail", what, unit, target, figures[name], note, least)

    for run in ("status-4", "random-3"):
        yield row(run, f"from pressure and force, {run}", "mm", 0.16)
    for run in ("status-4", "random-3"):
        yield row(f"voltage, {run}", f"from voltage and force, {run}", "mm", 0.40, said["voltage"])
    yield row("213 N", "trained up to 100 N, at 213 N (status-3)", "mm", 0.5)
    yield row("152 N", "trained up to 100 N, at up to 152 N (status-4)", "mm", 0.3)
    yield row("held", "swing by force at held voltage, worst of five", "%", 10.0, said["held"])
    yield row("force", "force from pressure and displacement, status-4", "% of range", 2.0)
    yield row("coverage", "its 95 % interval holds", "%", 97.0, said["force"], 93.0)
    yield row("half", "its half-width", "N", 8.0)
    yield row("loop", "open loop on a random reference under pulls", "mm", 0.35)
