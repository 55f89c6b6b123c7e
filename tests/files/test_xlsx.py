"""Spreadsheets."""

from __future__ import annotations

import datetime
import sys
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mckibben
from mckibben import DataError, DataWarning, Recording
from mckibben.files.channels import NAME

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


def put(row: int, column: int, cell: object) -> Rows:
    """Return a sound sheet with one cell, of a row counted from 1, replaced."""
    rows = [list(each) for each in SOUND]
    rows[row - 1][column] = cell
    return rows


def check(recording: Recording) -> None:
    assert recording.sample_time == 0.02
    assert recording["pressure"] == pytest.approx(P, rel=1e-12)
    assert recording["displacement"] == pytest.approx(X, rel=1e-12)


def test_numbers_are_read_to_the_last_bit(tmp_path: Path) -> None:
    recording = one(book(tmp_path / "a.xlsx", Data=SOUND))
    assert recording["pressure"].tolist() == P
    check(recording)


def test_numbers_that_text_would_make_doubtful_are_not(tmp_path: Path) -> None:
    rows = [
        ["time_s", "pressure_bar", "position_mm"],
        *([t, 1.234 + k % 3, 2] for k, t in enumerate(T)),
    ]
    assert one(book(tmp_path / "a.xlsx", Data=rows))["pressure"][1] == 2.234


def test_titles_blank_rows_and_units_of_their_own(tmp_path: Path) -> None:
    rows: Rows = [
        ["Muscle 7, load 2 kg"],
        [],
        ["t", "Druck", None, "Weg", "note"],
        ["s", "kPa", None, "cm", None],
        *([t, 100 * p, None, x / 10, "ok"] for t, p, x in zip(T, P, X, strict=True)),
    ]
    recording = one(book(tmp_path / "a.xlsx", Data=rows))
    check(recording)
    assert recording.meta["ignored_columns"] == ["note"]


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


def test_the_first_sheet_with_numbers_or_the_one_named(tmp_path: Path) -> None:
    other = [SOUND[0], *([t, 2 * p, x] for t, p, x in SOUND[1:])]
    path = book(tmp_path / "a.xlsx", Notes=[["by", "Jane"]], Run=SOUND, Second=other)
    with pytest.warns(
        DataWarning, match="sheet 'Run', the first with numbers, .*'Notes', 'Second'"
    ):
        check(one(path))
    (tmp_path / NAME).write_text('[[files]]\nmatch = "a.xlsx"\nsheet = "Second"\n')
    assert one(path)["pressure"] == pytest.approx(2 * np.array(P))
    (tmp_path / NAME).write_text('sheet = "Third"\n')
    with pytest.raises(DataError, match=r"no sheet 'Third'; there are Notes, Run, Second"):
        mckibben.read(path)


@pytest.mark.parametrize(
    ("rows", "channel", "row", "problem"),
    [
        ([["a", "b"], ["c", "d"]], None, None, "no sheet in it has numbers"),
        ([], None, None, "no sheet in it has numbers"),
        ([SOUND[0][:2], *(row[:2] for row in SOUND[1:])], "displacement", None, "no such channel"),
        (put(7, 1, None), "pressure", 7, "1 of 40 samples are missing"),
        (put(7, 1, "high"), "pressure", 7, "'high' is not a number"),
        (put(7, 1, "#DIV/0!"), "pressure", 7, "'#DIV/0!' is not a number"),
        (put(7, 0, T[4]), "time", 7, "is repeated"),
        (put(7, 0, 0.0), "time", 7, "the time goes back"),
        (put(7, 0, None), "time", 7, "the time is missing"),
        (SOUND[:9], None, None, "8 sample(s) are too few"),
    ],
)
def test_bad_sheets(
    tmp_path: Path, rows: Rows, channel: str | None, row: int | None, problem: str
) -> None:
    path = book(tmp_path / "a.xlsx", Data=rows)
    with pytest.raises(DataError) as caught:
        mckibben.read(path, channels=["pressure", "displacement"])
    assert problem in caught.value.problem
    assert (caught.value.file, caught.value.channel, caught.value.row) == (path, channel, row)


def rewritten(path: Path, part: str, old: str, new: str) -> Path:
    """Replace words in one part of a workbook."""
    with zipfile.ZipFile(path) as parts:
        contents = {info.filename: parts.read(info) for info in parts.infolist()}
    assert old.encode() in contents[part]
    contents[part] = contents[part].replace(old.encode(), new.encode(), 1)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as parts:
        for name, content in contents.items():
            parts.writestr(name, content)
    return path


SHEET = "xl/worksheets/sheet1.xml"


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ('<c r="C41"', '<c r="XFD41"', "goes on beyond row"),
        ('<row r="41"', '<row r="999999999"', "goes on beyond row"),
        ("<sheetData>", "<sheetData>" + " " * 2**25, "unpacks to more than is read"),
        ("</worksheet>", "", "damaged"),
        (
            "<worksheet",
            '<!DOCTYPE w [<!ENTITY a "aaaaaaaaaa">'
            + "".join(
                f'<!ENTITY {chr(98 + k)} "{"&" + chr(97 + k) + ";"}'
                f'{("&" + chr(97 + k) + ";") * 9}">'
                for k in range(12)
            )
            + "]><worksheet",
            "",
        ),
    ],
)
def test_hostile_sheets(tmp_path: Path, old: str, new: str, problem: str) -> None:
    path = rewritten(book(tmp_path / "a.xlsx", Data=SOUND), SHEET, old, new)
    if problem:
        with pytest.raises(DataError, match=problem):
            mckibben.read(path)
    else:  # what is defined and not used does no harm
        check(one(path))


def test_truncated(tmp_path: Path) -> None:
    path = book(tmp_path / "a.xlsx", Data=SOUND)
    whole = path.read_bytes()
    for length in (3, 100, len(whole) // 2, len(whole) - 10):
        path.write_bytes(whole[:length])
        with pytest.raises(DataError, match="damaged"):
            mckibben.read(path)


def test_missing_library_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = book(tmp_path / "a.xlsx", Data=SOUND)
    monkeypatch.setitem(sys.modules, "openpyxl", None)
    with pytest.raises(DataError, match=r"not installed. Remedy: pip install 'mckibben\[xlsx\]'"):
        mckibben.read(path)
