"""Bands hold on new runs, follow the state of motion, and say what they cannot do."""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import binom

from mckibben import GPI, Banded, DataError, ModelError, ModelWarning, Recording, calibrate, load
from mckibben.bands.finding import STEPS, _calibrated, find_band
from mckibben.bands.held import Held, memory_of, off_as_a_whole
from mckibben.bands.scale import SHAPES, Terms, scale_of
from mckibben.blocks.bands.band import check_level
from mckibben.blocks.core.fields import Channel
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
    for trial in range(12):
        runs = [noisy(100 * trial + seed, 80) for seed in range(24)]
        band = quietly(MODEL, runs[:19], exchangeable=unit).at(0.8)
        found += [inside(band, run)[1:].mean() for run in runs[19:]]
    # 60 runs, whose shares vary by some 5 %
    assert np.mean(found) > 0.8 - 3 * np.std(found) / np.sqrt(len(found))
    assert np.mean(found) < 0.93


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


def test_it_is_narrow_where_the_model_is_good(banded: Banded) -> None:
    ends = banded.simulate(noisy(1000))
    width, high = ends["displacement_upper"] - ends["displacement_lower"], ends["pressure"] > 2.5
    assert np.median(width[high]) > 2.5 * np.median(width[~high])


def test_it_is_the_same_everywhere_where_the_model_is_as_good_everywhere() -> None:
    rng = np.random.default_rng(0)
    runs = []
    for seed in range(12):
        u = random_wave(STEP * np.arange(200), 0.3, 5.0, seed=seed)
        y = MODEL.simulate(u) + 0.1 * rng.standard_normal(200)
        runs.append(Recording({"pressure": u, "displacement": y}, STEP))
    ends = quietly(MODEL, runs).simulate(runs[0])
    assert np.ptp(ends["displacement_upper"] - ends["displacement_lower"]) < 1e-9


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


def test_it_streams_and_saves_to_the_bit(banded: Banded, tmp_path: Path) -> None:
    u = noisy(1002)["pressure"]
    whole = banded.simulate(u, sample_time=STEP)
    stream = banded.stream(STEP)
    assert np.array_equal([stream.step(x).copy() for x in u], whole)
    banded.save(tmp_path / "banded.json")
    again = load(tmp_path / "banded.json")
    assert again == banded
    assert np.array_equal(again.simulate(u, sample_time=STEP), whole)


def test_it_knows_no_future(banded: Banded) -> None:
    u = np.array(noisy(1003)["pressure"])
    other = u.copy()
    other[80:] = u[80:][::-1]
    one, two = (banded.simulate(v, sample_time=STEP) for v in (u, other))
    assert np.array_equal(one[:80], two[:80])


def test_mirrored_errors_give_a_mirrored_band() -> None:
    counts, held = np.ones(150, dtype=bool), []
    for seed in range(10):
        run = noisy(seed)
        u, y = run["pressure"][:, None], run["displacement"][:, None]
        held.append(Held(u, MODEL.simulate(u), y, counts, STEP))
    mirrored = [replace(run, measured=2 * run.modelled - run.measured) for run in held]
    given = np.hstack([held[0].inputs, held[0].modelled])
    one, two = (
        find_band(MODEL, runs).band.simulate(given, sample_time=STEP) for runs in (held, mirrored)
    )
    assert one[:, 2] - one[:, 0] == pytest.approx(two[:, 0] - two[:, 1], rel=1e-6, abs=1e-9)
    assert one[:, 0] - one[:, 1] == pytest.approx(two[:, 2] - two[:, 0], rel=1e-6, abs=1e-9)


def test_beyond_what_calibration_saw_it_widens(banded: Banded) -> None:
    rising = banded.simulate(np.linspace(0.0, 8.0, 200), sample_time=STEP)
    width = rising[:, 2] - rising[:, 1]
    assert width[-1] > 4 * width[:110].max()


def test_so_many_runs_allow_so_much() -> None:
    check_level(0.9, 9, "run")
    with pytest.raises(ModelError, match=r"at most 88.9 %.*at least 9 runs"):
        check_level(0.9, 8, "run")


def test_few_units_are_asked_for_more_than_many() -> None:
    """The score of which 90 % of a normal error are held, as units get more: from above to 1.645."""
    rng = np.random.default_rng(11)
    u = np.zeros((10, 1))
    found = []
    for n in (9, 40, 2000):
        reached = []
        for _ in range(8 if n < 100 else 1):
            held = [
                Held(u, u, u + off, np.ones(10, dtype=bool), None) for off in rng.standard_normal(n)
            ]
            band = find_band(MODEL, held, "run", SHAPES[:1]).band
            ends = band.simulate(np.zeros((1, 2)))
            reached.append(float(ends[0, 2]))
        found.append(float(np.median(reached)))
    assert min(found[:2]) > 0.95 * found[2]
    assert found[2] == pytest.approx(1.645, rel=0.06)


@pytest.mark.parametrize("level", [0.0, 1.0, -1.0, 7.0, float("nan")])
def test_a_level_that_is_none_is_refused(banded: Banded, level: float) -> None:
    with pytest.raises(ModelError, match="level"):
        banded.at(level)


def test_memory_is_that_of_a_known_process() -> None:
    rng = np.random.default_rng(3)
    white = [rng.standard_normal(4000) for _ in range(4)]
    kept = [np.zeros(4000) for _ in range(4)]
    for noise, errors in zip(white, kept, strict=True):
        for t in range(1, 4000):
            errors[t] = 0.9 * errors[t - 1] + noise[t]
    assert memory_of(white) == pytest.approx(1.0, abs=0.3)
    assert memory_of(kept) == pytest.approx((1 + 0.9) / (1 - 0.9), rel=0.25)
    assert memory_of([errors + 100.0 for errors in kept]) == pytest.approx(memory_of(kept))


def test_few_runs_are_cut_into_blocks_and_that_is_said() -> None:
    with pytest.warns(ModelWarning, match="blocks of them"):
        banded = calibrate(MODEL, [noisy(seed) for seed in range(5)])
    assert banded.band.unit == "block"
    assert banded.band.units > 5
    assert quietly(MODEL, [noisy(seed) for seed in range(5)], exchangeable="run").band.units == 5


def test_runs_are_told_from_blocks_that_differ_no_more_than_chance() -> None:
    rng = np.random.default_rng(8)
    pieces, trials = [4] * 6, 300
    alike = sum(
        off_as_a_whole([rng.standard_normal(80) for _ in pieces], pieces) for _ in range(trials)
    )
    assert alike <= binom.ppf(0.999, trials, 0.01)
    off = [rng.standard_normal(80) + 2.0 * k for k in range(6)]
    assert off_as_a_whole(off, pieces)
    assert not off_as_a_whole(off, [1] * 6)
    assert not off_as_a_whole(off[:1], [4])


def test_runs_off_as_a_whole_count_once_each() -> None:
    runs = [noisy(seed) for seed in range(5)]
    offs = np.arange(5.0)
    runs = [
        Recording({**run.channels, "displacement": run["displacement"] + off}, STEP)
        for run, off in zip(runs, offs, strict=True)
    ]
    with pytest.warns(ModelWarning, match=r"off as a whole .* 83.3 %"):
        banded = calibrate(MODEL, runs)
    assert (banded.band.unit, banded.band.units) == ("run", 5)
    assert quietly(MODEL, runs, exchangeable="block").band.units > 5


def test_a_scale_is_one_on_average_however_much_is_missed() -> None:
    rng = np.random.default_rng(2)
    seen = rng.uniform(0.0, 1.0, (400, 2))
    terms, units = Terms.of(seen)(seen), np.arange(400) // 40
    missed = rng.standard_normal(400) * (0.1 + seen[:, 0])
    for shape in SHAPES[:2]:
        small, large = (
            scale_of(terms, size * missed, units, shape, 2, terms.mean(axis=0)).at(terms)[1]
            for size in (1.0, 100.0)
        )
        assert large == pytest.approx(small, rel=1e-9)
        assert np.log(small).mean() == pytest.approx(0.0, abs=0.02)


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
    with pytest.raises(ModelError, match="calibrate the model"):
        quietly(MODEL.inverse(), runs)


def test_what_it_cannot_calibrate_on_is_refused() -> None:
    runs = [noisy(seed) for seed in range(3)]
    slower = Recording(dict(runs[0].channels), 2 * STEP)
    for bad, match in (
        ([], "nothing"),
        ([runs[0].slice(0, 10)], "too few"),
        ([runs[0], slower], "sample times"),
        ([runs[0].select(["pressure"])], "displacement"),
        ([runs[0].select(["displacement"])], "pressure"),
    ):
        with pytest.raises(DataError, match=match):
            quietly(MODEL, bad)
    with pytest.raises(DataError, match="fitted to"):
        quietly(MODEL, runs, fitted=[runs[1]])
    with pytest.raises(ModelError, match="calibrate the model"):
        quietly(MODEL.inverse(), runs)


def test_an_error_that_outlasts_the_run_is_said() -> None:
    u = random_wave(STEP * np.arange(100), 0.3, 5.0, seed=1)
    drifting = MODEL.simulate(u) + np.linspace(0.0, 5.0, 100)
    with pytest.raises(DataError, match="stay alike"):
        quietly(MODEL, Recording({"pressure": u, "displacement": drifting}, STEP))


def test_copies_are_refused() -> None:
    run = noisy(1)
    with pytest.raises(DataError, match="count twice"):
        calibrate(MODEL, [run, run, noisy(2)])


def test_a_stuck_output_is_refused() -> None:
    run = noisy(1)
    stuck = run.with_channels({"displacement": "mm"}, displacement=np.zeros(len(run)))
    with pytest.raises(DataError, match="stuck"):
        calibrate(MODEL, stuck)


def test_a_band_has_no_inverse(banded: Banded) -> None:
    with pytest.raises(ModelError, match="invert the model"):
        banded.inverse()


@pytest.mark.parametrize("n", [9, 10, 19, 20, 25, 30, 40])
def test_runs_that_differ_as_a_whole_are_held_at_any_number(n: int) -> None:
    """Of runs that are off by one number each, the band holds a new one as often as its level says."""
    scores, of = np.linspace(1.0, n, n), np.arange(n)
    reached = _calibrated(scores, of)
    for level in (0.7, 0.8, 0.9):
        rank = reached[int(np.ceil(level * STEPS - 1e-9))]
        assert level - 1e-9 <= rank / (n + 1) <= level + 2 / n
