"""One cell that no sensor measured is refused or told; pulses, steps and noise are not."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest

from mckibben import DataError, read
from mckibben.arrays import Array
from mckibben.errors import DataWarning

TIME = 0.02 * np.arange(1000)
PRESSURE: Array = 2.5 - 2.4 * np.cos(TIME)
ROW = 501


def written(path: Path, at: float | None, column: int, n: int = 1) -> Path:
    """Return a file, some cells of one column of which are something else."""
    table = np.column_stack([TIME, PRESSURE, 5 * PRESSURE])
    if at is not None:
        table[ROW - 2 : ROW - 2 + n, column] = at
    np.savetxt(
        path, table, "%.6g", ",", header="t [s],pressure [bar],displacement [mm]", comments=""
    )
    return path


@pytest.mark.parametrize(("at", "column"), [(999.0, 1), (-20.0, 1), (-9999.0, 2), (65535.0, 2)])
def test_what_cannot_be_is_refused_by_its_row(tmp_path: Path, at: float, column: int) -> None:
    path = written(tmp_path / "run.csv", at, column)
    with pytest.raises(DataError, match=f"row {ROW}") as caught:
        read(path)
    assert caught.value.channel == ("pressure", "displacement")[column - 1]


@pytest.mark.parametrize("n", [1, 3])
def test_what_stands_alone_is_told(tmp_path: Path, n: int) -> None:
    with pytest.warns(DataWarning, match=f"displacement, row {ROW}: .*100 mm"):
        (found,) = read(written(tmp_path / "run.csv", 100.0, 2, n))
    assert any("100 mm" in note for note in found.notes)


def test_what_lasts_and_what_is_usual_is_not(tmp_path: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        read(written(tmp_path / "run.csv", None, 1))
        read(written(tmp_path / "step.csv", 100.0, 2, n=20))
        read(written(tmp_path / "within.csv", 30.0, 2))
