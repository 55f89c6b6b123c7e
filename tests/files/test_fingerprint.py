"""Rows that were read twice are found, whatever was done to the recordings since."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import mckibben
from mckibben import DataError, Recording
from mckibben.comparison.shared_stretches import shared_stretches, told
from mckibben.files.fingerprint import shared_rows
from mckibben.recording import ROWS
from mckibben.signals import irregular_triangle, low_pass, resample, zeroed

STEP = 0.02
TIME = np.arange(0, 60, STEP)
DRIVEN = irregular_triangle(TIME, 12, 5.0, seed=3)
INPUT, OUTPUT = ["pressure"], ["displacement"]


def measured(seed: int) -> np.ndarray:
    """Rows of time, pressure and displacement, as a sensor of 12 bits gives them."""
    rng = np.random.default_rng(seed)
    moved = mckibben.GPI.example().simulate(DRIVEN) + 0.02 * rng.standard_normal(TIME.size)
    return np.column_stack([TIME, DRIVEN, np.round(moved / 0.01) * 0.01])


ROWS_READ = measured(0)


def written(path: Path, rows: np.ndarray, jitter: int | None = None) -> Path:
    time = rows[:, 0]
    if jitter is not None:
        time = time + 0.0015 * np.random.default_rng(jitter).uniform(-1, 1, time.size)
    table = np.column_stack([time, rows[:, 1:]])
    np.savetxt(
        path,
        table,
        "%.7g",
        delimiter=",",
        header="time [s],pressure [bar],displacement [mm]",
        comments="",
    )
    return path


def read(path: Path) -> Recording:
    (found,) = mckibben.read(path)
    return found


CHANGES: dict[str, Callable[[Recording], Recording]] = {
    "resampled": lambda one: resample(one, 0.03),
    "zeroed": lambda one: zeroed(one, OUTPUT, "pressure"),
    "filtered": lambda one: low_pass(one, 5.0),
}


@pytest.mark.filterwarnings("ignore:.*not uniform:mckibben.DataWarning")
@pytest.mark.parametrize("change", [*CHANGES, "jittered"])
def test_shared_rows_are_found_after_every_sample_was_changed(tmp_path: Path, change: str) -> None:
    jittered = change == "jittered"
    fitted = read(written(tmp_path / "fitted.csv", ROWS_READ[:2000], 1 if jittered else None))
    tested = read(written(tmp_path / "tested.csv", ROWS_READ[1200:], 2 if jittered else None))
    if not jittered:
        fitted, tested = CHANGES[change](fitted), CHANGES[change](tested)
    (found,) = shared_stretches([fitted, tested], ["pressure"], OUTPUT)
    assert found.start == pytest.approx(TIME[1200], abs=2)
    assert found.begins == pytest.approx(found.start, abs=0.01)
    assert found.share == pytest.approx(800 / 1800, abs=0.1)
    with pytest.raises(DataError, match="fitted"):
        told({"fit": [fitted], "test": [tested]}, ["pressure"], OUTPUT)


@pytest.mark.parametrize("calibration", [(-1.0, 0.0), (2.0, 3.0)])
def test_they_are_found_whatever_gain_and_offset_were_read_with(
    tmp_path: Path, calibration: tuple[float, float]
) -> None:
    path = written(tmp_path / "a.csv", ROWS_READ)
    (turned,) = mckibben.read(path, calibration={"displacement": calibration})
    assert not np.array_equal(turned["displacement"], read(path)["displacement"])
    found = shared_rows(read(path), turned, INPUT, OUTPUT)
    assert found is not None
    assert found.share == 1.0
    assert turned.meta[ROWS] == read(path).meta[ROWS]


def test_parts_of_one_recording_that_do_not_overlap_share_nothing(tmp_path: Path) -> None:
    whole = resample(read(written(tmp_path / "whole.csv", ROWS_READ)), 0.03)
    assert shared_rows(whole.slice(0, 1200), whole.slice(1200, len(whole)), INPUT, OUTPUT) is None
    assert shared_rows(whole.slice(0, 1200), whole.slice(1100, len(whole)), INPUT, OUTPUT)


def test_runs_of_the_same_commands_share_nothing(tmp_path: Path) -> None:
    runs = [read(written(tmp_path / f"{seed}.csv", measured(seed))) for seed in range(4)]
    assert not [
        (k, m) for k in range(4) for m in range(k) if shared_rows(runs[k], runs[m], INPUT, OUTPUT)
    ]


def test_what_a_model_gave_in_place_of_what_was_read_has_no_rows(tmp_path: Path) -> None:
    whole = read(written(tmp_path / "whole.csv", ROWS_READ))
    simulated = mckibben.GPI.example().simulate(whole)
    assert shared_rows(whole, simulated, INPUT, OUTPUT) is None
    assert shared_rows(whole, whole, INPUT, OUTPUT)
