"""The tool that compares golden cases: what it must notice, and what it must not."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.golden import stored as storage
from tests.golden.__main__ import answer, update, verdict
from tests.golden.case import Case, flat
from tests.golden.compare import moved
from tests.golden.stored import Stored, load, save

NUMBERS = np.array([1.0, -2.0, np.nan])


def found(folder: Path) -> Any:
    assert folder.is_dir()
    return {
        "rmse": 0.5,
        "best": "gpi",
        "pressure": NUMBERS,
        "zero": 0.0,
        "rows": [{"n": 3}],
        "notes": [],
    }


def raising(folder: Path) -> Any:
    raise ValueError(folder)


CASE = Case("room/case", "found()", found, {"rmse": 0.01, "*": 0.0})
LEAVES = flat(found(Path.cwd()))


def rows(**changed: Any) -> list[str]:
    leaves = LEAVES | {key.replace("_", "/"): value for key, value in changed.items()}
    return [row.leaf for row in moved(CASE, Stored(LEAVES, "", "here"), leaves, "here")]


def test_leaves_have_paths() -> None:
    assert set(LEAVES) == {"rmse", "best", "pressure", "zero", "rows/0/n", "notes"}


def test_what_is_as_stored_is_not_reported() -> None:
    assert rows() == []
    assert rows(rmse=0.504) == []


@pytest.mark.parametrize(
    "changed",
    [
        {"rmse": 0.506},
        {"rmse": np.nan},
        {"rmse": "0.5"},
        {"best": "pi"},
        {"pressure": NUMBERS * (1 + 1e-15)},
        {"pressure": NUMBERS[:2]},
        {"pressure": np.array([1.0, np.nan, -2.0])},
        {"pressure": NUMBERS.astype(np.float32)},
        {"zero": -0.0},
        {"rows_0_n": 3.0},
        {"rows_0_n": 4},
        {"rows_1_n": 3},
        {"notes_0": "one more"},
    ],
)
def test_what_moved_is_reported(changed: dict[str, Any]) -> None:
    assert rows(**changed)


def test_last_bits_count_on_the_machine_that_stored_them_only() -> None:
    nearly = LEAVES | {"pressure": NUMBERS * (1 + 1e-15)}
    assert moved(CASE, Stored(LEAVES, "", "here"), nearly, "here")
    assert not moved(CASE, Stored(LEAVES, "", "here"), nearly, "elsewhere")


@pytest.mark.parametrize(("value", "n"), [(1.9, 0), (2.1, 1), (float("nan"), 1)])
def test_a_bound_is_one(value: float, n: int) -> None:
    case = Case("room/bound", "", found)
    assert len(moved(case, Stored({"x": {"at most": 2.0}}, "", ""), {"x": value}, "")) == n


def test_cases_are_stored_compared_and_accepted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(storage, "DATA", tmp_path)
    assert verdict(CASE, answer(CASE), "here")[0] == "new"
    assert update([CASE], "first stored") == 0
    held = load(CASE.name)
    assert held is not None
    assert held.reason == "first stored"
    assert verdict(CASE, answer(CASE), held.machine)[0] == "same"
    broken = Case(CASE.name, "", raising)
    assert verdict(broken, answer(broken), held.machine)[0] == "raised"
    save(CASE.name, CASE.call, replace(held, leaves={**held.leaves, "best": "pi"}))
    word, rows, _ = verdict(CASE, answer(CASE), held.machine)
    assert (word, [row.leaf for row in rows]) == ("moved", ["best"])


def test_what_is_stored_twice_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(storage, "DATA", tmp_path)
    save(CASE.name, CASE.call, Stored(LEAVES, "", ""))
    place = tmp_path / "room/case.json"
    place.write_text(place.read_text().replace('"expected": {', '"expected": {"pressure": [1.0],'))
    with pytest.raises(ValueError, match="pressure"):
        load(CASE.name)
    with pytest.raises(ValueError, match="a/b"):
        flat({"a/b": 1, "a": {"b": 2}})
