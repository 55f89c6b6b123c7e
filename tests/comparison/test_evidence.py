"""Testing on the training data, and recommending what noise gives or what ran away."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.io import savemat

import mckibben
from mckibben import GPI, DataError, Recording, characterize, compare, study
from mckibben.comparison import ranking
from mckibben.comparison.leaderboard import acceptable, recommended
from mckibben.signals import irregular_triangle, triangle
from tests.cli.conftest import cli as cli  # a fixture
from tests.refusals import refused

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
@pytest.mark.parametrize("ending", ["csv", "mat"])
def test_a_copy_in_another_format_is_no_test(tmp_path: Path, ending: str) -> None:
    mckibben.write(RUN, tmp_path / "a.csv")
    if ending == "mat":
        channels = {"time": RUN.time, **RUN.channels}
        savemat(tmp_path / "b.mat", {name: x.astype(np.float32) for name, x in channels.items()})
    else:
        mckibben.write(RUN, tmp_path / f"b.{ending}")
    (one,), (other,) = (mckibben.read(tmp_path / name) for name in ("a.csv", f"b.{ending}"))
    for asked in (compare, study):
        with refused(DataError, names="allow_shared"):
            asked(one, other, **QUICK)


def test_noise_is_not_recommended() -> None:
    assert compare(noise(1), **QUICK).best is None
    found = study(noise(0), **QUICK)
    board = found.leaderboard.to_dict()
    assert (board["chosen"], found.inverse) == (None, None)
    assert board["not_recommended"] == "validation"
    assert {row["model"] for row in board["rows"]} == {"pi", "p1", "constant"}


def test_a_narrow_loop_is_found_in_noise() -> None:
    time = np.arange(600) * STEP
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
    chosen, _ = recommended(board.rows, board.constant)
    assert (chosen is not None) == moves
    assert acceptable(board.rows[0], board.constant) == moves
    with refused(DataError, names="allow_shared"):
        compare(train, train[:1], models=["coupled-memory"], jobs=1)


def test_a_cross_validation_that_ran_away_is_not_chosen_by(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    honest = ranking.fit

    def run_away(data: Any, task: Any, tell: Any) -> Any:
        found = honest(data, task, tell)
        if task[0] != "p1":
            return found
        away = tuple(np.inf * one for one in found.predictions)
        return replace(found, predictions=away)

    monkeypatch.setattr(ranking, "fit", run_away)
    board = compare(RUN, OTHER, **QUICK)
    assert board.best is not None
    assert board.best.model == "pi"
    (other,) = (row for row in board.rows if row.model == "p1")
    assert other.validation_rmse is None
    assert other.validation_failed
