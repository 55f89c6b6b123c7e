"""Spreadsheets."""

from __future__ import annotations

import datetime
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mckibben
from mckibben import DataError, Recording
from mckibben.files import formats

N = 40
T = (np.arange(N) / 50).tolist()
P = np.round(2 + np.sin(np.arange(N) / 5), 14).tolist()  # OpenPyXL writes 16 digits
X = (3 * np.cos(np.arange(N) / 5)).tolist()
SOUND: list[list[Any]] = [
    ["time_s", "pressure_bar", "displacement_mm"],
    *map(list, zip(T, P, X, strict=True)),
]

Rows = Sequence[Sequence[Any]]


def book(path: Path, **sheets: Rows) -> Path:
    import openpyxl

    made = openpyxl.Workbook(write_only=True)
    for name, rows in sheets.items():
        sheet = made.create_sheet(name)
        for row in rows:
            sheet.append(row)
    made.save(path)
    return path


def one(path: Path, **options: Any) -> Recording:
    (recording,) = mckibben.read(path, **options)
    return recording


def check(recording: Recording) -> None:
    assert recording.sample_time == 0.02
    assert recording["pressure"] == pytest.approx(P, rel=1e-12)
    assert recording["displacement"] == pytest.approx(X, rel=1e-12)


@pytest.mark.parametrize(
    "instant",
    [
        lambda k: datetime.datetime(2026, 1, 31, 12) + datetime.timedelta(milliseconds=20 * k),
        lambda k: (datetime.datetime(2026, 1, 31, 12) + datetime.timedelta(seconds=k / 50)).time(),
        lambda k: datetime.timedelta(milliseconds=20 * k),
        lambda k: f"31.01.2026 12:00:{k / 50:06.3f}",
    ],
)
@pytest.mark.filterwarnings("ignore:.*no unit is given:mckibben.DataWarning")
def test_dates_are_times(tmp_path: Path, instant: Any) -> None:
    rows = [["time", "p_bar", "Weg_mm"], *([instant(k), P[k], X[k]] for k in range(N))]
    check(one(book(tmp_path / "a.xlsx", Data=rows)))


@pytest.mark.parametrize(
    "above",
    [
        [["operator", "A", "run", 3]],
        [["Load (kg)", 5], ["Date", datetime.datetime(2026, 1, 31)], []],
        [["a bench", None, "of nobody"], ["pressure", "in", "steps"]],
    ],
)
@pytest.mark.parametrize("units", [None, ["[s]", "(bar)", None], [None, "bar"]])
@pytest.mark.filterwarnings("ignore:.*no unit is given:mckibben.DataWarning")
def test_titles_are_passed_over_and_units_are_read(
    tmp_path: Path, above: Rows, units: list[Any] | None
) -> None:
    names = SOUND[:1] if units is None else [["t", "p", "Weg"], units]
    check(one(book(tmp_path / "a.xlsx", Data=[*above, *names, *SOUND[1:]])))


def test_titles_are_no_names_and_other_sheets_are_listed(tmp_path: Path) -> None:
    path = book(tmp_path / "a.xlsx", Notes=[["pressure"]], Run=[["pressure"], [], *SOUND[1:]])
    (table,) = formats.tables(path)
    assert len(table.columns) == 3
    assert list(table.unread) == ["Notes"]


@pytest.mark.parametrize("cell", ["1,5", "1.234", "1'000", "off"])
@pytest.mark.parametrize("row", [1, 20])
def test_text_that_may_be_several_numbers_is_refused(tmp_path: Path, cell: str, row: int) -> None:
    rows = [list(each) for each in SOUND]
    rows[row][1] = cell
    rows[10][1] = str(P[9])  # which is a number
    with pytest.raises(DataError, match=cell) as caught:
        one(book(tmp_path / "a.xlsx", Data=rows))
    assert (caught.value.channel, caught.value.row) == ("pressure", row + 1)
    rows[row][1] = P[row - 1]
    sound = one(book(tmp_path / "a.xlsx", Data=rows))
    check(sound)
    assert sound["pressure"].tolist() == P  # to the last bit
