"""Bands hold on new runs, follow the state of motion, and say what they cannot do."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom

from mckibben import GPI, Banded, DataError, ModelError, ModelWarning, Recording, calibrate
from mckibben.bands.finding import find_band
from mckibben.bands.held import Held
from mckibben.bands.scale import SHAPES
from mckibben.blocks.fields import Channel
from mckibben.signals import random_wave

MODEL = GPI.example()
STEP = 0.1


def noisy(seed: int, n: int = 150, calm: float = 1.0) -> Recording:
    """Return a run whose error is five times as large above half of the pressure as below, or calm."""
    rng = np.random.default_rng([seed, 77])
    u = random_wave(STEP * np.arange(n), 0.3, 5.0, seed=seed)
    size = np.where(u > 2.5, 0.5, 0.1 / calm) * rng.uniform(0.7, 1.3)
    y = MODEL.simulate(u) + size * rng.standard_normal(n)
    return Recording({"pressure": u, "displacement": y}, STEP)


def quietly(*arguments: object, **named: object) -> Banded:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ModelWarning)
        return calibrate(*arguments, **named)  # type: ignore[arg-type]


def inside(banded: Banded, run: Recording) -> np.ndarray:
    ends = banded.simulate(run)
    return np.asarray(
        (ends["displacement_lower"] <= run["displacement"])
        & (run["displacement"] <= ends["displacement_upper"])
    )


@pytest.fixture(scope="module")
def banded() -> Banded:
    return quietly(MODEL, [noisy(seed) for seed in range(40)])


@pytest.mark.parametrize("unit", ["run", "block"])
def test_a_new_run_is_held_as_often_as_asked(unit: str) -> None:
    found = []
    for trial in range(6):
        runs = [noisy(100 * trial + seed, 80) for seed in range(24)]
        band = quietly(MODEL, runs[:19], exchangeable=unit).at(0.8)
        found += [inside(band, run)[1:].mean() for run in runs[19:]]
    # 30 runs, whose shares vary by some 5 %
    assert np.mean(found) > 0.8 - 3 * np.std(found) / np.sqrt(len(found))
    assert np.mean(found) < 0.95


def test_no_more_runs_than_chance_are_missed_where_a_run_is_off_as_a_whole() -> None:
    """Of runs whose error is one number each, the level is a share of runs: which is binomial."""
    rng = np.random.default_rng(5)
    u = random_wave(STEP * np.arange(40), 0.3, 5.0, seed=0)
    modelled = MODEL.simulate(u)[:, None]
    counts = np.ones(40, dtype=bool)
    missed, trials, per = 0, 40, 5
    for _ in range(trials):
        offs = rng.standard_t(3, 39 + per)
        held = [Held(u[:, None], modelled, modelled + off, counts, None) for off in offs]
        band = find_band(MODEL, held[:39], "run", SHAPES[:1]).band
        for one in held[39:]:
            ends = band.simulate(np.hstack([one.inputs, one.modelled]))
            missed += not (ends[0, 1] <= one.measured[0, 0] <= ends[0, 2])
    assert missed <= binom.ppf(0.999, trials * per, 0.1)
    assert missed > 0


def test_higher_levels_are_wider_and_hold_the_value(banded: Banded) -> None:
    run = noisy(1001)
    before = 0.0
    for level in (0.5, 0.8, 0.9, 0.95):
        ends = banded.at(level).simulate(run)
        width = ends["displacement_upper"] - ends["displacement_lower"]
        assert (ends["displacement_lower"] <= ends["displacement"]).all()
        assert (ends["displacement"] <= ends["displacement_upper"]).all()
        assert width.mean() > before
        before = width.mean()
    assert np.array_equal(ends["displacement"], MODEL.simulate(run)["displacement"])


def test_runs_off_as_a_whole_count_once_each() -> None:
    runs = [noisy(seed) for seed in range(5)]
    offs = np.arange(5.0)
    runs = [
        Recording({**run.channels, "displacement": run["displacement"] + off}, STEP)
        for run, off in zip(runs, offs, strict=True)
    ]
    with pytest.warns(ModelWarning, match="83.3 %"):
        banded = calibrate(MODEL, runs)
    assert (banded.band.unit, banded.band.units) == ("run", 5)
    assert quietly(MODEL, runs, exchangeable="block").band.units > 5


def test_a_model_that_is_solved_for_displacement_is_calibrated() -> None:
    """Not every inverse is a compensator."""
    forces = replace(MODEL, input=MODEL.output, output=Channel("force", "N"))
    runs = []
    for seed in range(6):
        y = random_wave(STEP * np.arange(150), 0.3, 5.0, seed=seed)
        off = 0.1 * np.random.default_rng(seed).standard_normal(150)
        runs.append(
            Recording({"displacement": y + off, "force": forces.simulate(y)}, STEP, {"force": "N"})
        )
    banded = quietly(forces.inverse(), runs)
    assert inside(banded, runs[0]).mean() > 0.8


def test_what_it_cannot_calibrate_on_is_refused(banded: Banded) -> None:
    runs = [noisy(seed) for seed in range(3)]
    slower = Recording(dict(runs[0].channels), 2 * STEP)
    still = runs[0].with_channels({"displacement": "mm"}, displacement=np.zeros(len(runs[0])))
    drift = MODEL.simulate(runs[0]["pressure"]) + np.linspace(0.0, 5.0, len(runs[0]))
    for bad, said in (
        ([], None),
        ([runs[0].slice(0, 10)], "10"),
        ([runs[0], slower], "sample times"),
        ([runs[0].select(["pressure"])], "displacement"),
        ([runs[0].select(["displacement"])], "pressure"),
        ([runs[0], runs[0], runs[1]], "twice"),
        ([still], "displacement"),
        ([runs[0].with_channels(displacement=drift)], None),
    ):
        with pytest.raises(DataError, match=said):
            quietly(MODEL, bad)
    with pytest.raises(DataError, match="fitted to"):
        quietly(MODEL, runs, fitted=[runs[1]])
    with pytest.raises(ModelError):
        quietly(MODEL.inverse(), runs)
    with pytest.raises(ModelError):
        banded.inverse()
