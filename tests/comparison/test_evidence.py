"""Testing on the training data, recommending what noise gives, and recordings too long to compare."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.io import savemat

import mckibben
from mckibben import GPI, DataError, Recording, characterize, compare, study
from mckibben.comparison.recommending import acceptable, recommended
from mckibben.comparison.splits import held_out_tail
from mckibben.signals import irregular_triangle, made_manageable, triangle
from tests.cli.conftest import Cli
from tests.cli.conftest import cli as cli  # a fixture

STEP = 0.02
TIME = np.arange(0, 24, STEP)
QUICK: dict[str, Any] = {"models": ["pi", "p1"], "jobs": 1}


def recorded(u: np.ndarray, seed: int = 0, noise: float = 0.02) -> Recording:
    y = GPI.example().simulate(u) + noise * np.random.default_rng(seed).standard_normal(u.size)
    return Recording({"pressure": u, "displacement": y}, STEP, meta={"name": f"run {seed}"})


RUN = recorded(irregular_triangle(TIME, 12, 5.0, seed=3))
OTHER = recorded(irregular_triangle(TIME, 12, 5.0, seed=4), 1)


def noise(seed: int) -> Recording:
    rng = np.random.default_rng(seed)
    u = triangle(TIME, 4.0, 5.0)
    return Recording({"pressure": u, "displacement": rng.standard_normal(u.size)}, STEP)


@pytest.mark.filterwarnings("ignore:.*no unit is given")
@pytest.mark.parametrize("ending", ["csv", "parquet", "mat"])
def test_a_copy_in_another_format_is_no_test(tmp_path: Path, ending: str) -> None:
    mckibben.write(RUN, tmp_path / "a.csv")
    if ending == "mat":
        channels = {"time": RUN.time, **RUN.channels}
        savemat(tmp_path / "b.mat", {name: x.astype(np.float32) for name, x in channels.items()})
    else:
        mckibben.write(RUN, tmp_path / f"b.{ending}")
    (one,), (other,) = (mckibben.read(tmp_path / name) for name in ("a.csv", f"b.{ending}"))
    for asked in (compare, study):
        with pytest.raises(DataError, match="--allow-shared"):
            asked(one, other, **QUICK)


def test_one_file_thrice_and_overlapping_slices_are_refused() -> None:
    with pytest.raises(DataError, match=r"run 0.*--allow-shared"):
        compare([RUN, RUN, RUN], OTHER, **QUICK)
    with pytest.raises(DataError, match=r"run 0.*--allow-shared"):
        compare([RUN.slice(0, 700), RUN.slice(400, 1200)], **QUICK)


def test_who_insists_reads_it_in_every_result(cli: Cli, tmp_path: Path) -> None:
    mckibben.write(RUN, tmp_path / "run.csv")
    run, out = tmp_path / "run.csv", tmp_path / "out"
    given = ("study", run, "--test", run, "--models", "pi", "--jobs", 1, "-o", out)
    refused = cli(*given)
    assert refused.code == 2
    assert "--allow-shared" in refused.err
    done = cli(*given, "--allow-shared")
    assert done.code == 0, done.err
    (shared,) = json.loads((out / "leaderboard.json").read_text())["shared"]
    place = shared.partition(": ")[2].partition(" %")[0]
    assert place
    for name in ("leaderboard.csv", "report.html"):
        assert place in (out / name).read_text()
    assert place in " ".join(done.out.split())


def test_a_name_in_place_of_recordings_is_refused() -> None:
    given: Any = "x.csv"
    for asked in (lambda: compare(given), lambda: study([given]), lambda: compare(RUN, given)):
        with pytest.raises(DataError, match=r"mckibben\.read"):
            asked()


def test_noise_is_not_recommended() -> None:
    assert compare(noise(1), **QUICK).best is None
    found = study(noise(0), **QUICK)
    board = found.leaderboard.to_dict()
    assert (board["chosen"], found.inverse) == (None, None)
    assert board["not_recommended"]
    assert {row["model"] for row in board["rows"]} == {"pi", "p1", "constant"}


def test_noise_has_no_loop_gain_or_saturation() -> None:
    for found in (characterize(noise(seed)) for seed in range(3)):
        assert len(found.sentences) == 1
        assert found.loop_width is found.saturation is found.asymmetry is found.gain is None
        assert json.dumps(found.to_dict(), allow_nan=False)


def test_the_level_of_the_tests_is_kept_and_they_find_a_narrow_loop() -> None:
    """Of 200 recordings, 1 % of 200 is 2; 7 or more have a probability of 0.5 %."""
    time = np.arange(600) * STEP
    u = irregular_triangle(time, 8, 5.0, seed=1)
    curve = u + 2 * np.tanh(u - 2.5)
    dependent = looped = missed = 0
    for seed in range(200):
        white = np.random.default_rng(seed).standard_normal(u.size)
        nothing = characterize(Recording({"pressure": u, "displacement": white}, STEP))
        static = curve + 0.02 * np.ptp(curve) * white
        bent = characterize(Recording({"pressure": u, "displacement": static}, STEP))
        assert nothing.p_dependence is not None
        assert bent.p_loop is not None
        assert bent.p_dependence is not None
        dependent += nothing.p_dependence <= 0.01
        looped += bent.p_loop <= 0.01
        missed += bent.p_dependence > 0.01
    assert dependent < 7
    assert looped < 7
    assert missed == 0
    wave = triangle(time, 2.0, 5.0)
    play = np.empty(wave.size)
    place = 0.0
    for index, value in enumerate(wave):
        place = play[index] = min(max(place, value - 0.122), value + 0.122)  # 5 % of its range
    for seed in range(20):
        white = np.random.default_rng(seed).standard_normal(wave.size)
        noisy = play + 0.02 * np.ptp(play) * white
        found = characterize(Recording({"pressure": wave, "displacement": noisy}, STEP))
        assert found.has_loop


def test_a_curve_without_memory_is_said_to_be_one() -> None:
    u = triangle(TIME, 4.0, 5.0)
    y = 3 * u + 0.1 * np.random.default_rng(0).standard_normal(u.size)
    found = characterize(Recording({"pressure": u, "displacement": y}, STEP))
    assert not found.has_loop
    assert found.gain == pytest.approx(3, rel=0.05)


def test_a_model_that_fails_on_the_test_is_not_recommended() -> None:
    far = OTHER.with_channels(displacement=OTHER["displacement"][::-1] * -1)
    found = study(RUN, far, **QUICK)
    assert found.leaderboard.best is None
    assert found.inverse is None


def muscles(seed: int, moves: bool) -> Recording:
    rng = np.random.default_rng(seed)
    pressures = {f"pressure_{k}": triangle(TIME + k, 4.0 + seed, 5.0) for k in (1, 2)}
    outputs: dict[str, NDArray[Any]] = {
        f"displacement_{k}": 0.1 * rng.standard_normal(TIME.size)
        + moves * GPI.example().simulate(pressures[f"pressure_{k}"])
        for k in (1, 2)
    }
    return Recording(pressures | outputs, STEP)


@pytest.mark.parametrize("moves", [True, False])
def test_muscles_have_to_beat_the_constant_too(moves: bool) -> None:
    train, test = [muscles(0, moves), muscles(1, moves)], [muscles(2, moves)]
    board = compare(train, test, models=["coupled-memory"], jobs=1)
    chosen, _ = recommended(board.rows, board.constant, "mm")
    assert (chosen is not None) == moves
    assert acceptable(board.rows[0], board.constant) == moves
    with pytest.raises(DataError, match="--allow-shared"):
        compare(train, train[:1], models=["coupled-memory"], jobs=1)


def test_huge_recordings_are_cut_to_stretches_with_their_swings_in_shape() -> None:
    time = np.arange(1_200_000, dtype=np.float64) * 1e-3
    run = Recording({"pressure": triangle(time, 0.5, 5.0), "displacement": time}, 1e-3)
    train, test, notes = made_manageable([run], [], "pressure")
    assert test == []
    assert 20_000 < sum(map(len, train)) <= 40_000
    assert all(18 <= 0.25 / (part.sample_time or 1) <= 32 for part in train)
    assert all(part["pressure"].max() == run["pressure"].max() for part in train)
    assert notes
    split = held_out_tail(train, "pressure", 0.25)
    assert [len(part) for part in split.train] == [len(part) for part in train[:3]]
