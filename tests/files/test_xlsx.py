"""Spreadsheets."""

from __future__ import annotations

import datetime
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mckibben
from mckibben import Recording

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


def test_numbers_are_read_to_the_last_bit(tmp_path: Path) -> None:
    recording = one(book(tmp_path / "a.xlsx", Data=SOUND))
    assert recording["pressure"].tolist() == P
    check(recording)


@pytest.mark.parametrize(
    "instant",
    [
        lambda k: datetime.datetime(2026, 1, 31, 12) + datetime.timedelta(milliseconds=20 * k),
        lambda k: (datetime.datetime(2026, 1, 31, 12) + datetime.timedelta(seconds=k / 50)).time(),
        lambda k: datetime.timedelta(milliseconds=20 * k),
        lambda k: f"2026-01-31T12:00:{k / 50:06.3f}",
        lambda k: f"31.01.2026 12:00:{k / 50:06.3f}",
    ],
)
@pytest.mark.filterwarnings("ignore:.*no unit is given:mckibben.DataWarning")
def test_dates_are_times(tmp_path: Path, instant: Any) -> None:
    rows = [["time", "p_bar", "Weg_mm"], *([instant(k), P[k], X[k]] for k in range(N))]
    check(one(book(tmp_path / "a.xlsx", Data=rows)))
