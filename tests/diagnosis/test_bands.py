"""Bands hold on new runs, follow the state of motion, and say what they cannot do."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
import pytest
from scipy.stats import binom

from mckibben import GPI, Banded, DataError, ModelError, PerChannel, Recording, calibrate, compare
from mckibben.blocks.fields import Channel
from mckibben.blocks.runs import FreeRun, run_of
from mckibben.blocks.saving import from_dict
from mckibben.diagnosis.bands import (
    FEWEST_UNITS,
    LEVEL,
    SHARES,
    TestedBand,
    find_band,
    n_branches,
    outside,
)
from mckibben.signals import random_wave, triangle
from tests.refusals import refused

MODEL = GPI.example()
STEP = 0.1


def noisy(seed: int, n: int = 150, calm: float = 1.0) -> Recording:
    """Return a run whose error is five times as large above half of the pressure as below, or calm."""
    rng = np.random.default_rng([seed, 77])
    u = random_wave(STEP * np.arange(n), 0.3, 5.0, seed=seed)
    size = np.where(u > 2.5, 0.5, 0.1 / calm) * rng.uniform(0.7, 1.3)
    y = MODEL.simulate(u) + size * rng.standard_normal(n)
    return Recording({"pressure": u, "displacement": y}, STEP)


def inside(banded: Banded, run: Recording) -> np.ndarray:
    ends = banded.simulate(run)
    return np.asarray(
        (ends["displacement_lower"] <= run["displacement"])
        & (run["displacement"] <= ends["displacement_upper"])
    )


@pytest.fixture(scope="module")
def banded() -> Banded:
    return calibrate(MODEL, [noisy(seed) for seed in range(40)]).model


@pytest.mark.parametrize("unit", ["run", "block"])
def test_a_new_run_is_held_as_often_as_asked(unit: Literal["run", "block"]) -> None:
    found = []
    for trial in range(6):
        runs = [noisy(100 * trial + seed, 80) for seed in range(24)]
        band = calibrate(MODEL, runs[:19], exchangeable=unit).at(0.8)
        found += [inside(band, run)[1:].mean() for run in runs[19:]]
    # 30 runs, whose shares vary by some 5 %
    assert np.mean(found) > 0.8 - 3 * np.std(found) / np.sqrt(len(found))
    assert np.mean(found) < 0.95


def test_no_more_runs_than_chance_are_missed_where_a_run_is_off_as_a_whole() -> None:
    """Of runs whose error is one number each, the level is a share of runs: which is binomial."""
    rng = np.random.default_rng(5)
    u = random_wave(STEP * np.arange(40), 0.3, 5.0, seed=0)
    modelled = MODEL.simulate(u)[:, None]
    missed, trials, per = 0, 40, 5
    for _ in range(trials):
        offs = rng.standard_t(3, 39 + per)
        held = []
        for off in offs:
            pressed = Recording({"pressure": u, "displacement": modelled[:, 0] + off})
            run = run_of(pressed, ["pressure"], ["displacement"])
            held.append(FreeRun.of(run, modelled))
        band = find_band(MODEL, held[:39], "run").band
        for one in held[39:]:
            ends = band.simulate(one.modelled)
            missed += not (ends[0, 1] <= one.y[0] <= ends[0, 2])
    assert missed <= binom.ppf(0.999, trials * per, 0.1)
    assert missed > 0


@pytest.mark.parametrize("n", [9, 11, 15, 24, 40])
def test_a_level_bounds_that_share_of_the_runs_and_one_more(n: int) -> None:
    """A new run is as likely as each of n to be the worst: it counts as one of n + 1."""
    u = random_wave(STEP * np.arange(40), 0.3, 5.0, seed=0)
    modelled = MODEL.simulate(u)[:, None]
    held = []
    for off in 1.0 + np.arange(n):  # each run is off by its number
        recording = Recording({"pressure": u, "displacement": modelled[:, 0] + off}, STEP)
        held.append(FreeRun.of(run_of(recording, ["pressure"], ["displacement"]), modelled))
    model = find_band(MODEL, held, "run").model
    for level in (0.5, 0.75, 0.8, 0.9):
        ends = model.at(level).simulate(Recording({"pressure": u}, STEP))
        half = 0.5 * (ends["displacement_upper"] - ends["displacement_lower"])
        assert half == pytest.approx(np.ceil(level * (n + 1)))


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


def test_runs_are_units_from_nine_on_and_long_blocks_below() -> None:
    few = found = calibrate(MODEL, [noisy(seed) for seed in range(4)])
    many = calibrate(MODEL, [noisy(seed) for seed in range(9)])
    assert (few.band.unit, many.band.unit, many.band.units) == ("block", "run", 9)
    assert few.band.units > 4
    assert found.runs == 4
    assert few.band.level == LEVEL


@pytest.mark.parametrize("late", [0.0, 0.08])
def test_a_band_is_wider_at_speed_only_where_that_is_narrower(late: float) -> None:
    """A model that is late is off by its delay times the speed."""
    runs = []
    for seed in range(12):
        u = random_wave(STEP * np.arange(300), 0.3, 5.0, seed=seed)
        y = MODEL.simulate(u)
        grid = np.arange(300.0)
        y = np.interp(grid - late / STEP, grid, y)
        y += 0.005 * np.random.default_rng(seed).standard_normal(300)
        runs.append(Recording({"pressure": u, "displacement": y}, STEP))
    found = calibrate(MODEL, runs)
    banded = found.model
    assert (banded.band.widening[0] > 0) == (late > 0)
    assert (found.over_constant[0] < 0.95) == (late > 0)
    ends = banded.simulate(runs[0])
    width = ends["displacement_upper"] - ends["displacement_lower"]
    assert (np.ptp(width) > 0.5 * width.mean()) == (late > 0)
    stream = banded.stream(STEP)
    stepped = np.array([stream.step([u]).copy() for u in runs[0]["pressure"]])
    at_rest = banded.simulate(runs[0]["pressure"], sample_time=STEP)
    np.testing.assert_array_equal(stepped, at_rest)
    np.testing.assert_array_equal(
        ends["displacement"], MODEL.simulate(runs[0])["displacement"]
    )  # with or without its band, the model begins alike


def test_outputs_have_bands_of_their_own_and_angles_too() -> None:
    angled = replace(MODEL, output=Channel("angle", "rad"))
    shorter = replace(MODEL, input=Channel("pressure_2", "bar"))
    model = PerChannel((angled, shorter))
    rng, runs, sizes = np.random.default_rng(0), [], np.array([0.1, 0.4])
    for seed in range(30):
        u = np.column_stack(
            [random_wave(STEP * np.arange(200), 0.3, 5.0, seed=2 * seed + k) for k in (0, 1)]
        )
        y = model.simulate(u) + sizes * rng.standard_normal((200, 2))
        names = ["pressure", "pressure_2", "angle", "displacement"]
        units = {"angle": "rad", "pressure_2": "bar"}
        runs.append(Recording(dict(zip(names, np.hstack([u, y]).T, strict=True)), STEP, units))
    found = calibrate(model, runs)
    banded = found.model
    np.testing.assert_allclose(found.widths, 2 * 1.7 * sizes, rtol=0.15)
    assert [c.unit for c in banded.outputs] == ["rad"] * 3 + ["mm"] * 3


def test_samples_beyond_the_calibration_are_counted(banded: Banded) -> None:
    band = banded.band
    low, high = np.array(band.ends)
    samples = np.linspace(low, high, 100)
    assert outside(band, samples) == {}
    samples[:25, 0] = high[0] + 0.5 * (high[0] - low[0])
    assert outside(band, samples) == {"pressure": 0.25}


def test_a_band_of_an_older_shape_is_refused_with_the_remedy(banded: Banded) -> None:
    saved = banded.to_dict()
    saved["band"] = saved["band"] | {"bells": [], "sharpness": 1.0}
    with refused(ModelError, parameter="bells", names="calibrate"):
        from_dict(saved)


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
    banded = calibrate(forces.inverse(), runs).model
    assert inside(banded, runs[0]).mean() > 0.8


def test_what_it_cannot_calibrate_on_is_refused(banded: Banded) -> None:
    runs = [noisy(seed) for seed in range(3)]
    slower = Recording(dict(runs[0].channels), 2 * STEP)
    still = runs[0].with_channels({"displacement": "mm"}, displacement=np.zeros(len(runs[0])))
    drift = MODEL.simulate(runs[0]["pressure"]) + np.linspace(0.0, 5.0, len(runs[0]))
    for bad, fields in (
        ([], {"parameter": "recordings"}),
        ([runs[0], slower], {"options": ({"resample": 2 * STEP},)}),
        ([runs[0].select(["pressure"])], {"channel": "displacement"}),
        ([runs[0].select(["displacement"])], {"channel": "pressure"}),
        ([runs[0], runs[0], runs[1]], {"names": "twice"}),
        ([runs[0].with_channels(displacement=drift)], {}),
    ):
        with refused(DataError, **fields):
            calibrate(MODEL, bad)
    with pytest.raises(ModelError):
        calibrate(MODEL, [still])
    with refused(DataError, names="fitted"):
        calibrate(MODEL, runs, fitted=[runs[1]])
    with pytest.raises(ModelError):
        calibrate(MODEL.inverse(), runs)
    with pytest.raises(ModelError):
        banded.inverse()


def test_a_motion_that_is_repeated_adds_no_branch() -> None:
    time, rng = STEP * np.arange(1000), np.random.default_rng(0)
    same = triangle(time, 10.0, [5.0]) + 0.02 * rng.standard_normal((2, 1000))
    falling = triangle(time, 10.0, [5.0, 4.2, 3.4, 2.6, 1.8, 1.0])
    n = n_branches([same[:1].T])
    assert n <= 3
    assert n_branches([same[:1].T, same[1:].T]) == n
    assert n_branches([same.T]) == n
    assert n_branches([np.column_stack([same[0], falling])]) == n_branches([falling[:, None]]) > n
    assert n_branches([np.ones((50, 1))]) == 1


def recorded(u: np.ndarray, seed: int, factor: float = 1.0) -> Recording:
    """Return the output of a model under an input, with white noise of 0.1 mm times a factor."""
    noise = 0.1 * factor * np.random.default_rng(seed).standard_normal(u.size)
    return Recording({"pressure": u, "displacement": MODEL.simulate(u) + noise}, STEP)


def chosen(train: Recording, *tests: Recording) -> tuple[TestedBand, object]:
    best = compare(train, tests, models=["gpi"], jobs=1).best
    assert best is not None
    assert best.band is not None
    return best.band, best.banded


def test_a_band_of_training_is_known_where_each_test_recording_has_its_share_inside() -> None:
    def wave(seed: int, factor: float = 1.0, n: int = 600) -> Recording:
        return recorded(random_wave(STEP * np.arange(n), 0.3, 5.0, seed=seed), seed, factor)

    train = wave(0, n=1200)
    band, banded = chosen(train, wave(1), wave(2))
    assert band.unknown is None
    assert band.level == LEVEL
    assert min(band.units, band.branches) >= FEWEST_UNITS
    assert SHARES[0] <= band.lowest <= band.coverage["displacement"] <= band.highest <= SHARES[1]
    assert isinstance(banded, Banded)
    assert banded.band.widening[0] > 0
    for factor, unknown in ((3.0, "narrow"), (0.2, "wide")):
        band, banded = chosen(train, wave(1), wave(2, factor))
        assert (band.unknown, banded) == (unknown, None)


def test_a_band_of_few_branches_or_blocks_is_not_known() -> None:
    u = triangle(STEP * np.arange(1200), 10.0, [5.0])
    band, banded = chosen(recorded(u, 0), recorded(u[:600], 1))
    assert (band.unknown, banded) == ("branches", None)
    assert band.units >= FEWEST_UNITS > band.branches
    assert band.coverage["displacement"] == pytest.approx(LEVEL, abs=0.05)
    time = STEP * np.arange(400)
    run = recorded(random_wave(time, 1.0, 5.0, seed=0), 0, 0.1)
    drifting = run.with_channels(displacement=run["displacement"] + np.sin(0.3 * time))
    band, _ = chosen(drifting, recorded(random_wave(time, 1.0, 5.0, seed=1), 1))
    assert band.unknown == "blocks"
    assert band.units < FEWEST_UNITS <= band.branches
