"""Laws of what operations are made of: roles of data, order of steps, notes, and parts alone."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest

import mckibben
from mckibben import DataError, Recording, control
from mckibben.blocks.coupled.load_estimate import load_of
from mckibben.control import Twin
from mckibben.signals import cut, resample, zeroed
from tests.export.muscle import MUSCLE
from tests.golden.commands import call
from tests.workflow.calls import prepare


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with recordings and models."""
    found = tmp_path_factory.mktemp("roles")
    prepare(found)
    return found


def pair(folder: Path, name: str) -> Recording:
    """Return pressure and displacement of a recording."""
    return mckibben.read(folder / name)[0].select(["pressure", "displacement"])


def test_recordings_that_were_fitted_are_read_like_those_of_the_calibration(folder: Path) -> None:
    runs = [folder / "run.csv", folder / "two.csv"]
    for options in ({}, {"resample": 0.04}):
        with pytest.raises(DataError):
            mckibben.calibrate(folder / "model.json", runs, fitted=runs[:1], **options)  # type: ignore[arg-type]


def test_recordings_keep_their_roles(folder: Path) -> None:
    fit, test = pair(folder, "run.csv"), pair(folder, "two.csv")
    other = fit.with_channels(displacement=fit["displacement"] + np.sin(fit.time))
    given: dict[str, Any] = {"validation": other, "models": "pi", "jobs": 1}
    found, board = mckibben.study(fit, test, **given), mckibben.compare(fit, test, **given)
    assert (found.train, found.test) == ((fit,), (test,))
    for row, same in zip(found.leaderboard.rows, board.rows, strict=True):
        assert (row.test_error, row.validation_rmse) == (same.test_error, same.validation_rmse)
    assert board.rows[0].validation_rmse != pytest.approx(board.rows[0].test_error, rel=0.01)


def test_parts_of_a_study_are_those_of_operations_alone(folder: Path) -> None:
    fit, test = pair(folder, "run.csv"), pair(folder, "two.csv")
    wide = test.with_channels(pressure=1.8 * test["pressure"])
    found = mckibben.study(fit, wide, models="pi", jobs=1)
    gaps = mckibben.data_gaps(fit, tests=wide)
    assert found.data_gaps == gaps
    assert gaps != mckibben.data_gaps(fit)


def test_a_scheduling_channel_may_be_derived(folder: Path) -> None:
    """One that the rest length makes is answered like one that was recorded."""
    answers = []
    whole = pair(folder, "run.csv")
    longer = whole.with_channels(length=200.0 - whole["displacement"])
    for run, options in ((whole, {"rest_length": 200.0}), (longer, {})):
        found = mckibben.characterize(run, scheduling=("length",), **options)  # type: ignore[arg-type]
        answers.append((found.notes, found.mid_width, found.n_stretches))
    assert answers[0] == answers[1]


def test_steps_of_reading_follow_each_other() -> None:
    time = np.arange(0, 40, 0.02)
    turns, levels = [0, 4, 6, 9, 10, 14, 20, 24, 25, 40], [0, 0, 4, 4, 1, 1, 5, 5, 1, 1]
    pressure = np.interp(time, turns, levels)
    data: dict[str, Any] = {"time": time, "pressure": pressure, "displacement": 2 + 3 * pressure}
    run = Recording(data)
    (found,) = mckibben.read(run, between=(10.0, 40.0), resample=0.05, zero=("displacement",))
    wanted = zeroed(resample(cut(run, 10.0, 40.0), 0.05), ["displacement"], "pressure")
    assert np.array_equal(found["displacement"], wanted["displacement"])
    assert found["displacement"][0] == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize(("unit", "per_second"), [("s", 1.0), ("ms", 1e3), ("us", 1e6)])
def test_a_rate_is_compared_with_times_in_any_unit(unit: str, per_second: float) -> None:
    time = np.arange(0, 4, 0.02)
    data: dict[str, Any] = {
        f"time [{unit}]": per_second * time,
        "pressure [bar]": 2 + np.sin(3 * time),
    }
    data["displacement [mm]"] = 7 + 3 * np.sin(3 * time - 0.3)
    (run,) = mckibben.read(data, rate=50)
    assert run.sample_time == pytest.approx(0.02)
    with pytest.raises(DataError):
        mckibben.read(data, rate=50 / per_second if per_second > 1 else 20)


def test_what_lies_beyond_a_calibration_is_named_with_its_own_numbers(folder: Path) -> None:
    run = pair(folder, "run.csv")
    banded = mckibben.calibrate(folder / "model.json", [run])
    wide = run.with_channels(pressure=1.5 * run["pressure"])
    beyond = mckibben.simulate(banded, wide, interval=0.5).outside
    assert [channel.name for channel, *_ in beyond] == ["pressure", "displacement"]
    for channel, share, samples, (low, high) in beyond:
        assert low == pytest.approx(run[channel.name].min(), abs=1.0) or channel.name != "pressure"
        margin = 0.05 * (high - low)
        out = (samples < low - margin) | (samples > high + margin)
        assert share == pytest.approx(out.mean(), abs=0.02)


def test_the_price_of_a_format_is_that_of_its_model() -> None:
    time = np.arange(0, 40, 0.05)
    moved = {
        "pressure": 2.5 + 2.0 * np.sin(0.6 * time),
        "displacement": 10 + 6 * np.sin(0.23 * time),
    }
    block = load_of(MUSCLE)
    inputs = np.column_stack([moved[one.name] for one in block.inputs])
    force = block.simulate(inputs, sample_time=0.05)[:, 0]
    run = Recording({**moved, "force": force}, 0.05)
    found = mckibben.fit("balance", run, target="mjcf")
    assert found.price is not None
    block = load_of(found.model)
    names, (force_name,) = [one.name for one in block.inputs], [one.name for one in block.outputs]
    errors = block.simulate(run.matrix(names), sample_time=run.sample_time)[:, 0] - run[force_name]
    assert found.price.force_rmse == pytest.approx(math.sqrt(np.mean(errors**2)))


def test_both_loops_of_a_tracking_have_the_same_imperfections(folder: Path) -> None:
    model = mckibben.load(folder / "model.json")
    seen: dict[str, dict[str, Any]] = {}

    def spied(name: str) -> Any:
        real = getattr(control, name)

        def run(*given: Any, **named: Any) -> Any:
            seen[name] = {
                key: one for key, one in named.items() if key not in ("progress", "preview")
            }
            return real(*given, **named)

        return run

    given: dict[str, Any] = {"approach": 2.0, "settle": 1.0, "noise": 0.01, "delay": 2, "slew": 9.0}
    with (
        patch.object(control, "track", spied("track")),
        patch.object(control, "before", spied("before")),
    ):
        mckibben.track(
            mckibben.invert(model), pair(folder, "run.csv"), plant=Twin(model), seed=3, **given
        )
    assert seen["track"] == seen["before"]
    assert given | {"seed": 3} == {key: seen["track"][key] for key in (*given, "seed")}


def test_notes_of_a_result_are_printed_once(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    notes = mckibben.fit("pi", "run.csv").notes
    assert notes
    answer = call("fit", "pi", "run.csv", "-o", "noted.json")
    said = (answer.out + answer.err).replace("--input", "input")
    for note in notes:
        assert said.count(note.split(";")[0]) == 1
