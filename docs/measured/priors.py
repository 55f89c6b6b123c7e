"""What priors from the library are worth: python docs/measured/priors.py [FOLDER].

Muscles of virtual rigs, 10 s with a data sheet and a library that lacks the muscle beside 90 s without;
and, from FOLDER (measured recordings, festo_isometric_20mm in it), one of 300 mm from one of 150 mm.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterable
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
from library import RIGS, STEP, bench

import mckibben
from mckibben import Recording, muscles
from mckibben.blocks.coupled.load_estimate import load_of
from mckibben.errors import DataWarning, ModelWarning
from mckibben.estimators.coupled.balance import BalanceEstimator
from mckibben.muscles import Sheet
from mckibben.muscles import prior as process
from mckibben.muscles.prior import of_muscles
from mckibben.muscles.traits import PLACES
from mckibben.rigs.setups.moving_end import MovingEnd
from mckibben.signals.broadband import random_wave

LITTLE, MUCH, TEST = 10.0, 90.0, 60.0
LOW, HIGH, FASTEST, PULL = 0.17, 0.92, 0.3, 0.05
"""Of random pressures, as shares of the highest, and their highest frequency [Hz]; share of the force
that hangs at the muscle."""

SEEDS, TESTS = range(5), range(100, 103)


def random_motion(stand: MovingEnd, sheet: Sheet, seed: int, seconds: float) -> Recording:
    """Return a recording under random pressures, which begin at rest at the lowest."""
    time = np.arange(round(seconds / STEP) + 1) * STEP
    low, high = LOW * sheet.max_pressure_bar, HIGH * sheet.max_pressure_bar
    wave = random_wave(time, FASTEST, high, low, seed=seed)
    pressure = low + (wave - low) * np.clip(time / 2.0, 0.0, 1.0)
    force = np.full(time.size, PULL * sheet.force)
    run = stand.run(Recording({"pressure": pressure, "force": force}, STEP), seed=seed)
    return run.select(["pressure", "displacement"])


def free(name: str, seeds: Iterable[int]) -> None:
    """Print errors of a rig's muscle on random test motions."""
    stand, sheet = bench(name)
    tests = [random_motion(stand, sheet, seed, TEST) for seed in TESTS]
    library = [muscle for muscle in muscles.list() if muscle.name != name]
    prior, own = of_muscles(library, sheet), muscles.prior_of(name)
    found: dict[str, list[float]] = {}
    for seed in seeds:
        run = random_motion(stand, sheet, seed, MUCH)
        short = Recording({c: run[c][: round(LITTLE / STEP) + 1] for c in run.channels}, STEP)
        for title, data, told in (
            ("90 s", run, None),
            ("10 s", short, None),
            ("10 s, prior leaving it out", short, prior),
            ("10 s, prior itself in the library", short, own),
            ("90 s, prior leaving it out", run, prior),
        ):
            model = BalanceEstimator(prior=told).fit(data).model_
            errors = [rmse(model.simulate(one)["displacement"], one) for one in tests]
            found.setdefault(title, []).append(float(np.median(errors)))
    for case, errors in found.items():
        ratio = np.array(errors) / np.array(found["90 s"])
        print(
            f"{name}, {case}: {np.median(errors):.3f} mm ({min(errors):.3f} to {max(errors):.3f}), "
            f"{np.median(ratio):.2f} x ({ratio.min():.2f} to {ratio.max():.2f})",
            flush=True,
        )


def left_out() -> None:
    """Print the likelihood of each muscle given the others, for settings of the process."""
    tested = ("mas20-hanging", "dmsp20-300")
    listed = [muscle for muscle in muscles.list() if muscle.name not in tested]
    for smooth in (0.01, 1.0, 2.0):
        for near in (0.25, 0.5, 1.0):
            with (
                patch.object(process, "SMOOTH", smooth),
                patch.object(process, "NEAR", near),
            ):
                found = sum(likelihood(one, listed) for one in listed)
                print(f"smooth {smooth:g}, near {near:g}: {found:.1f}")


def likelihood(muscle: muscles.Muscle, listed: list[muscles.Muscle]) -> float:
    """Return the log-likelihood of a muscle given the others, without the wall's stretch."""
    prior = of_muscles([other for other in listed if other is not muscle], muscle.sheet)
    found = 0.0
    for name, place in PLACES.items():
        away = (muscle.traits - prior.mean)[place]
        known = np.isfinite(away)
        if name == "wall" or not known.any():  # one muscle has any
            continue
        covariance = prior.covariance(name)[np.ix_(known, known)]
        found -= 0.5 * float(away[known] @ np.linalg.solve(covariance, away[known]))
        found -= 0.5 * float(np.linalg.slogdet(covariance)[1])
    return found


def rmse(found: Any, run: Recording, channel: str = "displacement") -> float:
    """Return the error of a channel."""
    return float(np.sqrt(np.mean((found - run[channel]) ** 2)))


def held(folder: Path) -> None:
    """Print errors of forces at lengths that were not recorded, in % of the largest force."""
    runs: dict[float, list[Recording]] = {}
    for path in sorted(folder.glob("festo_isometric_20mm/muscle30cm*.csv")):
        run = mckibben.read(path)[0]
        runs.setdefault(float(run["displacement"][0]), []).append(run)
    if not runs:
        return
    largest = max(float(run["force"].max()) for same in runs.values() for run in same)
    short, long = muscles.load("dmsp20-150"), muscles.load("dmsp20-300").sheet
    library = [muscle for muscle in muscles.list() if muscle.name != "dmsp20-300"]
    prior = of_muscles(library, long, short)

    def told(model: Any, left_out: float | None, title: str) -> None:
        others = [y for y in runs if y != left_out]
        errors = [np.mean([rmse(model(run), run, "force") ** 2 for run in runs[y]]) for y in others]
        each = ", ".join(
            f"{y:g} mm {100 * e**0.5 / largest:.1f}" for y, e in zip(others, errors, strict=True)
        )
        print(f"{title}: {100 * np.mean(errors) ** 0.5 / largest:.1f} % ({each})")

    def of(block: Any) -> Any:
        return lambda run: block.simulate(run.select(["pressure", "displacement"]))["force"]

    def braid(run: Recording) -> Any:
        narrowed = long.narrowed(run["displacement"] / long.stroke)
        return run["pressure"] * long.area * narrowed

    def straight(run: Recording) -> Any:
        left = 1.0 - run["displacement"] / long.stroke
        return long.force * run["pressure"] / long.max_pressure_bar * left

    told(of(load_of(muscles.scaled(short.balance, short.sheet, long))), None, "scaled only")
    laws = {
        "the braid of Chou and Hannaford": braid,
        "the catalogue's straight line (Festo)": straight,
    }
    for title, law in laws.items():
        told(law, None, f"{title}, data sheet only")
    for y, same in runs.items():
        run = same[0]
        for title, law in laws.items():
            columns = np.column_stack([law(run), np.ones(len(run))])
            gain, offset = np.linalg.lstsq(columns, run["force"], rcond=None)[0]
            told(
                lambda one, law=law, g=gain, o=offset: g * law(one) + o,
                y,
                f"{title}, gain and offset by one inflation at {y:g} mm",
            )
        model = BalanceEstimator(prior=prior).fit(run).model_
        told(of(load_of(model)), y, f"balance, one inflation at {y:g} mm")


if __name__ == "__main__":
    for category in (DataWarning, ModelWarning):
        warnings.simplefilter("ignore", category)
    if len(sys.argv) > 1:
        held(Path(sys.argv[1]))
    left_out()
    for name in RIGS:
        free(name, SEEDS)
