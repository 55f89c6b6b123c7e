"""Leaderboards: what is ranked, held out, refused, and gone on with."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mckibben import GPI, DataError, Recording, registry
from mckibben.channels import Channels
from mckibben.comparison.leaderboard import Leaderboard, order, recommended
from mckibben.comparison.ranking import compare
from mckibben.estimators.core.estimator import Estimator
from mckibben.metrics import USEFUL
from mckibben.signals import irregular_triangle, triangle
from mckibben.splits import held_out_part
from tests.refusals import refused

CHANNELS = Channels(("pressure",), ("displacement",))
TIME = np.arange(0, 24, 0.02)


def recorded(u: np.ndarray, seed: int = 0, start: float = 0.0) -> Recording:
    noise = 0.02 * np.random.default_rng(seed).standard_normal(u.size)
    y = GPI.example().simulate(u) + noise
    return Recording({"pressure": u, "displacement": y}, 0.02, start_time=start)


@pytest.fixture(scope="module")
def train() -> Recording:
    return recorded(triangle(TIME, 4.0, [5.0, 4.2, 3.4, 2.6, 1.8, 1.0]))


@pytest.fixture(scope="module")
def test_set() -> Recording:
    return recorded(irregular_triangle(TIME, 12, 5.0, seed=3), seed=1)


def without_times(board: Any) -> list[dict[str, Any]]:
    rows = board.to_dict()["rows"]
    return [{k: v for k, v in row.items() if k not in ("fit_seconds", "step_ns")} for row in rows]


def test_errors_are_those_of_free_runs_within_their_intervals(
    train: Recording, test_set: Recording
) -> None:
    board = compare(train, test_set, models=["pi", "gpi"], jobs=1)
    assert [row.model for row in board.rows] == ["gpi", "pi"]
    assert json.loads(json.dumps(board.to_dict(), allow_nan=False)) == board.to_dict()
    for row in board.rows:
        assert row.block is not None
        assert row.test is not None
        assert row.rmse_interval is not None
        error = row.block.simulate(test_set)["displacement"] - test_set["displacement"]
        assert row.test.rmse == pytest.approx(np.sqrt(np.mean(error**2)), rel=1e-9)
        assert row.rmse_interval[0] <= row.test.rmse <= row.rmse_interval[1]


def test_a_model_that_fails_is_a_row_with_its_reason(
    train: Recording, test_set: Recording, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: Any, **__: Any) -> None:
        raise ZeroDivisionError("NOTHING")

    monkeypatch.setattr(registry.load("estimators", "gpi"), "fit", fail)
    first, failed = compare(train, test_set, models=["gpi", "pi"], jobs=1).rows
    assert (first.model, failed.model) == ("pi", "gpi")
    assert "NOTHING" in str(failed.reason)


def test_the_choice_is_the_same_whatever_the_test(train: Recording, test_set: Recording) -> None:
    backwards = test_set.with_channels(displacement=test_set["displacement"][::-1])
    boards = [
        compare(train, test, models=["pi", "mpi", "maxwell-slip"], jobs=1)
        for test in (test_set, backwards, recorded(test_set["pressure"][::-1].copy(), 7))
    ]
    assert len({tuple(row.model for row in board.rows) for board in boards}) == 1
    assert len({tuple(row.validation_rmse for row in board.rows) for board in boards}) == 1
    assert len({tuple(row.test_rank for row in board.rows) for board in boards}) > 1


def test_test_outputs_are_never_looked_at_while_fitting(
    train: Recording, test_set: Recording
) -> None:
    spoilt = test_set["displacement"].copy()
    spoilt[1:] += 50 * np.sin(np.arange(spoilt.size - 1))
    models = ["gpi"]
    clean = compare(train, test_set, models=models, jobs=1)
    other = compare(train, test_set.with_channels(displacement=spoilt), models=models, jobs=1)
    assert clean.rows[0].block == other.rows[0].block


def test_held_out_tail_is_never_looked_at(train: Recording) -> None:
    spoilt = {name: samples.copy() for name, samples in train.channels.items()}
    start = len(held_out_part([train], CHANNELS, 0.25).train[0])
    for samples in spoilt.values():
        samples[start:] = samples[start:][::-1]
    clean = compare(train, models=["gpi"], jobs=1)
    other = compare(replace(train, channels=spoilt), models=["gpi"], jobs=1)
    assert clean.rows[0].block == other.rows[0].block
    assert clean.n_train == start
    assert clean.n_test == len(train) - start


def test_what_cannot_be_compared_is_refused_at_once(train: Recording) -> None:
    few: dict[str, Any] = {"models": ["gpi"], "most_samples": 3}
    for given, how, fields in (
        ([train], {"models": ["spline"]}, {"names": "'spline'"}),
        ([train], {"outputs": "force"}, {"channel": "force"}),
        ([train.slice(0, 12)], {"models": ["pi"]}, {"parameter": "test", "names": 12}),
        ([train], {"test": [train], "models": ["pi"]}, {"names": "allow_shared"}),
        ([train], few, {"parameter": "most_samples", "names": 3}),
        ([], {}, {"parameter": "recordings"}),
    ):
        with refused(**fields):
            compare(given, jobs=1, **how)


def test_going_on_recomputes_nothing_that_was_finished(
    train: Recording, test_set: Recording, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def impatient(board: Leaderboard) -> None:
        if len(board.rows) == 2:
            raise KeyboardInterrupt

    models = ["pi", "maxwell-slip", "mpi"]
    how: dict[str, Any] = {"models": models, "jobs": 1, "folder": tmp_path}
    whole = compare(train, test_set, **how)
    assert not list(tmp_path.iterdir())
    stopped = compare(train, test_set, found=impatient, **how)
    assert len(stopped.rows) == 2
    (left,) = stopped.pending
    fits: list[str] = []
    fit = Estimator.fit

    def counted(self: Any, *args: Any, **kwargs: Any) -> Any:
        fits.append(type(self).__name__)
        return fit(self, *args, **kwargs)

    monkeypatch.setattr(Estimator, "fit", counted)
    gone_on = compare(train, test_set, **how)
    assert set(fits) == {registry.load("estimators", left).__name__}
    assert without_times(gone_on) == without_times(whole)
    assert [row.block for row in gone_on.rows] == [row.block for row in whole.rows]
    assert not list(tmp_path.iterdir())


def test_what_was_kept_of_other_data_or_settings_is_not_used(
    train: Recording, test_set: Recording, tmp_path: Path
) -> None:
    def impatient(board: Leaderboard) -> None:
        raise KeyboardInterrupt

    how: dict[str, Any] = {"models": ["pi", "mpi"], "jobs": 1}
    compare(train, test_set, folder=tmp_path, found=impatient, **how)
    other = {"pi": {"thresholds": (0.0, 0.5)}}
    changed = compare(train, test_set, folder=tmp_path, settings=other, **how)
    assert changed.to_dict() != compare(train, test_set, **how).to_dict()
    assert without_times(changed) == without_times(compare(train, test_set, settings=other, **how))
    compare(train, test_set, folder=tmp_path, found=impatient, **how)


def test_a_recording_that_is_too_short_has_no_part_to_hold_out(train: Recording) -> None:
    with refused(DataError, parameter="test", names=20):
        held_out_part([train.slice(0, 20)], CHANNELS, 0.25)


def test_held_out_tail_is_a_quarter_of_the_travel_and_not_the_rest_after_it() -> None:
    u = np.concatenate([triangle(TIME, 4.0, 5.0), np.zeros(2000)])
    noisy = u + 0.01 * np.random.default_rng(0).standard_normal(u.size)
    split = held_out_part([recorded(noisy)], CHANNELS, 0.25)
    assert len(split.train[0]) == pytest.approx(0.75 * TIME.size, rel=0.02)


def test_whole_recordings_are_held_out_where_there_are_many(train: Recording) -> None:
    many = [train.slice(100 * k, 100 * (k + 1)) for k in range(12)]
    split = held_out_part(many, CHANNELS, 0.25)
    assert 6 <= len(split.train) <= 10
    assert all(recording in many for recording in split.test)
    kept = sum(len(recording) for recording in split.train)
    assert kept + sum(int(rows.sum()) for rows in split.test_rows) >= len(train) - len(split.test)


@dataclass(frozen=True)
class Ranked:
    """A row, as far as recommending looks at it."""

    model: str
    test_error: float
    reason: str | None = None
    skill_least: float | None = 0.5


@pytest.mark.parametrize("share", [0.5, 0.99 * USEFUL, 1.01 * USEFUL, 2.0])
def test_a_model_hardly_better_than_the_mean_is_not_recommended(share: float) -> None:
    rows, constant = [Ranked("pi", share)], Ranked("constant", 1.0)
    assert recommended(rows, constant)[1] == (None if share < USEFUL else "test")
    useless = [Ranked("pi", share, skill_least=0.0)]
    assert recommended(useless, constant) == (None, "validation")


def test_a_caution_does_not_outweigh_an_error_of_half() -> None:
    errors = {"gpi": 1.0, "narx": 0.49, "narx-network": 0.51, "arx": 1.1}

    def key(model: str) -> Any:
        return order(model, errors[model], None, 0.5, doubted=model.startswith("narx"))

    ranked = sorted(errors, key=key)
    assert ranked == ["narx", "gpi", "narx-network", "arx"]


@pytest.mark.parametrize("runs", [1, 5])
def test_a_part_in_which_the_output_hardly_moves_is_not_the_test(runs: int) -> None:
    u = np.concatenate([triangle(TIME, 6.0, 5.0), 1.0 + triangle(TIME, 0.5, 0.3)])
    whole = recorded(u)
    ends = np.linspace(0, len(whole), runs + 1).round().astype(int)
    pieces = [whole.slice(*pair) for pair in pairwise(ends)]
    split = held_out_part(pieces, CHANNELS, 0.25)
    parts = zip(split.test, split.test_rows, strict=True)
    tested = [one["displacement"][rows] for one, rows in parts]
    moving = whole["displacement"].std()
    assert np.concatenate(tested).std() > 0.2 * moving > whole["displacement"][1300:].std()
    fitted = {id(one) for one in split.train}
    assert not fitted & {id(one) for one in split.test}
    kept = sum(len(one) for one in split.train) + sum(int(rows.sum()) for rows in split.test_rows)
    assert len(whole) - 2 * runs <= kept <= len(whole)
