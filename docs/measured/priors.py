"""What priors from the library are worth: python docs/measured/priors.py [FOLDER].

The virtual MAS-20, 10 s with its data sheet and a library that lacks it beside 90 s without; and, from
FOLDER (measured recordings, festo_isometric_20mm in it), a muscle of 300 mm from one of 150 mm.
"""

from __future__ import annotations

import sys
import warnings
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

import mckibben
from mckibben import Recording, muscles
from mckibben.blocks.coupled.load_estimate import load_of
from mckibben.errors import DataWarning, ModelWarning
from mckibben.estimators.coupled.balance import BalanceEstimator
from mckibben.muscles import Sheet
from mckibben.muscles import prior as process
from mckibben.muscles.prior import of_muscles
from mckibben.muscles.traits import PLACES
from mckibben.signals.broadband import random_wave

STEP, LITTLE, MUCH = 0.02, 10.0, 90.0
LOW, HIGH, FASTEST = 1.0, 5.5, 0.3
SEEDS, TESTS = range(5), range(100, 105)

MAS20 = Sheet(
    diameter_mm=20.0,
    rest_length_mm=200.0,
    max_force_N=1500.0,
    max_pressure_bar=6.0,
    max_contraction=0.25,
)
"""Of the maker's catalogue."""


def random_motion(seed: int, seconds: float) -> Recording:
    """Return the virtual MAS-20 under random pressures, which begin at rest at their lowest."""
    time = np.arange(round(seconds / STEP) + 1) * STEP
    wave = random_wave(time, FASTEST, HIGH, LOW, seed=seed)
    pressure = LOW + (wave - LOW) * np.clip(time / 2.0, 0.0, 1.0)
    rig = mckibben.load_rig("mas20-hanging")
    return rig.run(Recording({"pressure": pressure}, STEP), seed=seed)


def mas20() -> None:
    """Print errors on random motion that no model saw."""
    tests = [random_motion(seed, 60.0) for seed in TESTS]
    library = [muscle for muscle in muscles.list() if muscle.name != "mas20-hanging"]
    priors = {"leaving it out": of_muscles(library, MAS20), "itself in the library":
              muscles.prior_of("mas20-hanging")}  # fmt: skip
    found: dict[str, list[float]] = {}
    for seed in SEEDS:
        run = random_motion(seed, MUCH).select(["pressure", "displacement"])
        short = Recording(
            {name: run[name][: round(LITTLE / STEP) + 1] for name in run.channels}, STEP
        )
        for title, data, prior in (
            ("90 s", run, None),
            ("10 s", short, None),
            *((f"10 s, prior {name}", short, prior) for name, prior in priors.items()),
            ("90 s, prior leaving it out", run, priors["leaving it out"]),
        ):
            model = BalanceEstimator(prior=prior).fit(data).model_
            errors = [rmse(model.simulate(one)["displacement"], one) for one in tests]
            found.setdefault(title, []).append(float(np.median(errors)))
    for case, errors in found.items():
        ratio = np.array(errors) / np.array(found["90 s"])
        print(
            f"{case}: {np.median(errors):.3f} mm ({min(errors):.3f} to {max(errors):.3f}), "
            f"{np.median(ratio):.2f} x ({ratio.min():.2f} to {ratio.max():.2f})"
        )


def left_out() -> None:
    """Print how likely muscles are by the others, for settings of the process."""
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
    """Return the logarithm of a muscle's likelihood by the others, but for the wall's stretch."""
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
    mas20()
