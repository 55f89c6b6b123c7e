"""Text tables in the forms that programs and laboratories write."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.files.made import columns, one, place, refused, rows

N = 40
T = [k / 100 for k in range(N)]
P = [round(2.5 + math.sin(k / 6), 4) for k in range(N)]
X = [round(-3 * math.cos(k / 6), 4) for k in range(N)]
SIZES = [900 + 10 * k for k in range(N)]  # from the 11th on, a thousand and more


def file(folder: Path, content: bytes | str, name: str = "run.csv") -> Path:
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


# Whole tables ----------------------------------------------------------------------------------------


@st.composite
def tables(draw: st.DrawFn) -> tuple[bytes, list[str], list[list[float]]]:
    """Draw a table in some form: its bytes, the names of its columns, and their numbers."""
    separator, mark = draw(st.sampled_from([(s, m) for s in ",;\t| " for m in ".," if s != m]))
    names = ["alpha", "betä", "gämma", "delta"][: draw(st.integers(2, 4))]
    number = st.floats(allow_nan=False, allow_infinity=False) | st.floats(-1e3, 1e3).map(
        lambda value: round(value, 4)
    )
    drawn = draw(st.lists(st.lists(number, min_size=4, max_size=4), min_size=10, max_size=14))
    samples = [list(column) for column in zip(*drawn, strict=True)][: len(names)]
    for column in samples:
        column[3] = 0.0625  # which shows that the mark is for decimals
    titles = draw(st.lists(st.sampled_from(["Bench 3", "Operator: A"]), max_size=3))
    body = [separator.join(names), *rows(*samples, separator=separator, mark=mark).splitlines()]
    for at in draw(st.lists(st.integers(1, len(body)), max_size=2)):
        body.insert(at, draw(st.sampled_from(["", "# pause"])))
    if separator == " ":
        titles = []  # whose words would be cells
    text = draw(st.sampled_from(["\n", "\r\n", "\r"])).join([*titles, *body, ""])
    coding = draw(st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be"]))
    return text.encode(coding), names, samples


@pytest.mark.filterwarnings("ignore:.*lines are left out")
@settings(deadline=None, max_examples=150, suppress_health_check=list(HealthCheck))
@given(tables())
def test_a_table_in_any_form_is_read_to_the_last_bit(
    tmp_path: Path, drawn: tuple[bytes, list[str], list[list[float]]]
) -> None:
    content, names, samples = drawn
    found = columns(file(tmp_path, content))
    assert list(found) == names
    for each, expected in zip(found.values(), samples, strict=True):
        assert each.values is not None
        assert each.values.tobytes() == np.array(expected).tobytes()


HEADER = "time_s,pressure_bar,displacement_mm\n"
PLAIN = HEADER + rows(T, P, X)
BLANKS = rows(T, P, X, separator="  ")
CHINESE = "时间/s,压力/bar,变形量/mm\n" + rows(T, P, X)
EACH = list(zip(T, P, X, strict=True))
VARIANTS: dict[str, bytes | str] = {
    "a line that names the separator": "\ufeff\ufeffsep=;\r\n" + PLAIN.replace(",", ";"),
    "comments": f"# rig 3\n% date\n; rig, 3, muscles\n// day\n\n{PLAIN}# end\n",
    "separators at the ends": PLAIN.replace("\n", ",\n"),
    "separators at the ends of rows alone": HEADER + rows(T, P, [f"{x}," for x in X]),
    "separators at the end of the header alone": HEADER.replace("\n", ",\n") + rows(T, P, X),
    "rows of separators alone at the end": PLAIN + ",,\n,,\n",
    "titles of several cells": f"Date,2026-01-31\nRate,100,Hz\nRig\n{PLAIN}",
    "titles filled up with separators": f"Bench 3,,\nOperator,A,\n,,\n{PLAIN}",
    "more titles than samples": "key,1\n" * 100 + PLAIN,
    "quoted header": f'"time, s","Pressure, upstream [bar]","pos (mm)"\n{rows(T, P, X)}',
    "blanks around cells": PLAIN.replace(",", " , "),
    "brackets between blanks": "t (s) Pressure (bar) Stroke (mm)\n" + BLANKS,
    "wide blanks": "Zeit in s  Druck in bar  Weg in mm\n" + BLANKS,
    "rows that begin with blanks": "  t(s) p(bar) disp(mm)\n" + "  " + BLANKS.replace("\n", "\n  "),
    "a header and units in comments": f"% time pressure disp\n% s bar mm\n{BLANKS}",
    "a line of units in brackets": "a,b,c\nt,p,disp\n[s],(bar),[mm]\n" + rows(T, P, X),
    "GB18030": CHINESE.encode("gb18030"),
    "EUC-KR": ("시간[초],압력[bar],변위[mm]\n" + rows(T, P, X)).encode("cp949"),
    "UTF-16 without a mark": CHINESE.replace(",", "\t").encode("utf-16-le"),
    "cells with units": "t,p,disp\n" + rows([f"{t} s,{p} bar,{x}mm" for t, p, x in EACH]),
    "no-break spaces around": HEADER + rows(T, [f"\xa0{p}" for p in P], X),
}  # fmt: skip


@pytest.mark.parametrize("variant", VARIANTS)
def test_variant(tmp_path: Path, variant: str) -> None:
    recording = one(file(tmp_path, VARIANTS[variant]))
    assert [samples.tolist() for samples in recording.channels.values()] == [P, X]
    assert (list(recording.units.values()), recording.sample_time) == (["bar", "mm"], 0.01)
    assert not recording.notes


@pytest.mark.parametrize("name", ["a.tsv", "a.txt", "a.DAT"])
def test_one_column_with_decimal_commas_in_files_of_any_ending(tmp_path: Path, name: str) -> None:
    assert one(file(tmp_path, "p_bar\n" + rows(P, mark=","), name))["pressure"].tolist() == P


def test_text_of_no_known_word_is_read_with_a_note(tmp_path: Path) -> None:
    content = "Größe;Höhe\n" + rows(P, X, separator=";")
    recording = one(file(tmp_path, content.encode("cp1252")))
    assert list(recording.channels) == ["grösse", "höhe"]
    assert any("cp1252" in note for note in recording.notes)


def test_words_that_end_a_file_are_left_out_and_averages_refused(tmp_path: Path) -> None:
    recording = one(file(tmp_path, PLAIN + "\nEnd of file\n"))
    assert recording["pressure"].tolist() == P
    assert any("row 43" in note for note in recording.notes)
    for averages in ("mean,2.5,3.1\n", "sum of 40\n"):
        assert refused(file(tmp_path, PLAIN + averages)).row == 42
    dates = rows([f"2026-01-31T12:00:{k:02d}" for k in range(N)], P)
    assert refused(file(tmp_path, f"stamp,p_bar\n{dates}Maximum,39\n")).row == 42


def test_columns_without_numbers_are_listed(tmp_path: Path) -> None:
    words = ["up"] * N, [""] * N, ["#N/A"] * N
    recording = one(file(tmp_path, "time_s,p_bar,phase,x,y\n" + rows(T, P, *words)))
    assert recording.meta["ignored_columns"] == ["phase", "x", "y"]
    assert "phase (text, such as 'up')" in " ".join(recording.notes)


@pytest.mark.parametrize(
    "row", ["0.02,1.5", "0.02,1.5,2.0,3.0", "0.02 1.5 2.0", "Rate,100", "0.02,ERR,ERR"]
)
def test_the_first_row_of_other_cells_is_refused(tmp_path: Path, row: str) -> None:
    lines = PLAIN.splitlines()
    lines[20] = row
    assert refused(file(tmp_path, "\n".join(["Bench 3", *lines]))).row == 22


def test_the_header_is_the_row_of_known_names(tmp_path: Path) -> None:
    above = '"TOA5","rig","CR1000X"\n"TIMESTAMP","Press","Disp"\n"TS","kPa","mm"\n"","Avg","Smp"\n'
    times = [f'"2026-01-31 12:00:{k / 50:05.2f}"' for k in range(N)]
    recording = one(file(tmp_path, above + rows(times, P, X), "run.dat"))
    assert recording["pressure"] == pytest.approx(np.array(P) / 100)
    assert recording["displacement"].tolist() == X


def test_names_may_be_numbers_and_units_letters(tmp_path: Path) -> None:
    recording = one(file(tmp_path, "x,1,2\nsecond,Volt,Volt\n" + rows(T, P, X)))
    assert (list(recording.channels), recording.units["1"]) == (["1", "2"], "V")
    assert one(file(tmp_path, "RECORD,p\nRN,bar\n" + rows(range(20), P[:20])))["record"].max() == 19


# Cells that are no plain numbers ----------------------------------------------------------------------


def test_a_number_of_four_digits_is_no_instant(tmp_path: Path) -> None:
    content = HEADER + rows(T, ["1013.25", "OVER", *P[2:]], X)
    assert place(file(tmp_path, content)) == ("pressure", 3)


@pytest.mark.parametrize("other", ["2.5 kPa", "2.5", "OVER"])
@pytest.mark.parametrize("usual", ["{} bar", "0x{:04X}"])
def test_cells_of_several_forms_are_refused(tmp_path: Path, usual: str, other: str) -> None:
    cells = [usual.format(k) for k in range(N)]
    cells[5] = other
    assert place(file(tmp_path, "time_s,p\n" + rows(T, cells))) == ("pressure", 7)


# Marks between digits ---------------------------------------------------------------------------------


def marked(header: str, cells: Sequence[object], separator: str = ";") -> str:
    return f"time_s{separator}{header}\n" + rows(T, cells, separator=separator)


@pytest.mark.parametrize("separator", [";", "\t", "|"])
@pytest.mark.parametrize("mark", [",", ".", "'", "’", " ", "\xa0", "\u2009", "\u202f", "_"])
@pytest.mark.parametrize("more", [0, 1000, 100_000])
def test_marks_of_thousands_are_not_read_as_anything(
    tmp_path: Path, separator: str, mark: str, more: int
) -> None:
    cells = [f"{size + more:,}".replace(",", mark) for size in SIZES]
    content = marked("pressure (mbar)", cells, separator)
    if mark == "." and more:  # every number has three digits after the mark: decimals
        recording = one(file(tmp_path, content))
        assert recording["pressure"] == pytest.approx((np.array(SIZES) + more) / 1e6)
        assert not recording.notes  # the column of times shows which mark is of decimals
    else:
        assert place(file(tmp_path, content)) == ("pressure", 2 if more else 12)


@pytest.mark.parametrize("separator", [",", ";"])
@pytest.mark.parametrize("cell", ["", "1,234,567", "1.234.567", "12,34,567", "1,234.5", "1.234,5"])
def test_marks_in_quoted_cells_are_refused(tmp_path: Path, separator: str, cell: str) -> None:
    cells = [f'"{cell or format(size, ",")}"' for size in SIZES]
    error = refused(file(tmp_path, marked("pressure (mbar)", cells, separator)))
    assert (error.channel, error.row) == ("pressure", 2 if cell else 12)
    assert (cell or "1,000") in error.problem


DECIMALS = {
    "%.3f from zero": [f"{k / 100:.3f}" for k in range(N)],
    "%.3f to thousands": [f"{995 + k:.3f}" for k in range(N)],
    "%g of eighths": [f"{k / 8:g}" for k in range(8, 8 + N)],
    "%.2f": [f"{k / 7 + 1:.2f}" for k in range(N)],
    "integers": [str(k) for k in range(980, 980 + N)],
    "one zero": [f"{k}.0" for k in range(N)],
    "blanks around": [f"  {k / 100:.3f} " for k in range(N)],
    "exponents": [f"{1 + k / 1000:.3f}e2" for k in range(N)],
    "zeros": ["0.000", *(f"{k}.125" for k in range(1, N))],
}


@pytest.mark.parametrize("mark", ".,")
@pytest.mark.parametrize("form", DECIMALS)
def test_decimals_that_show_what_they_are_stay_so(tmp_path: Path, form: str, mark: str) -> None:
    recording = one(file(tmp_path, marked("x", DECIMALS[form]).replace(".", mark)))
    assert recording["x"].tolist() == [float(cell) for cell in DECIMALS[form]]
    assert not recording.notes


@pytest.mark.parametrize("at", [5, 5000])
@pytest.mark.parametrize("proof", [None, "2.5", "0.125", "1000.125", "7."])
def test_one_number_anywhere_shows_that_a_mark_is_for_decimals(
    tmp_path: Path, at: int, proof: str | None
) -> None:
    cells = [str(1 + k % 9) if k % 2 else f"{1 + k % 9}.125" for k in range(6000)]
    if proof is not None:
        cells[at] = proof
        assert one(file(tmp_path, "x\n" + rows(cells)))["x"].tolist() == list(map(float, cells))
    else:
        error = refused(file(tmp_path, "x\n" + rows(cells)), channels=["x"])
        assert (error.row, "'1.125'" in error.problem) == (2, True)


# Lines that are no samples ------------------------------------------------------------------


@pytest.mark.parametrize("below", ["Maximum;5,1;30", "Mean;2;3\nStd;1;1", "Prüfer: A. Muster"])
def test_what_is_below_a_table_is_left_out(tmp_path: Path, below: str) -> None:
    samples = rows(T, P, X, separator=";", mark=",")
    recording = one(file(tmp_path, f"Zeit (s);Druck (bar);Weg (mm)\n{samples}\n\n{below}\n"))
    assert recording.n_samples == N
    assert any(below[:4] in note for note in recording.notes)


def test_header_lines_after_it_and_encoding_can_be_given(tmp_path: Path) -> None:
    head = "Prüfstand\na,b\ndruck [bar],weg [mm]\nx,y\n\n".encode("cp1252")
    body = "\n".join(f"{p},{x}" for p, x in zip(P, X, strict=True))
    path = file(tmp_path, head + body.encode())
    found = one(path, header=3, skip=2, encoding="cp1252")
    assert found["pressure"].tolist() == P
    for wrong in ({"header": 1000}, {"skip": 1000}, {"encoding": "none"}, {"header": -1}):
        refused(path, **wrong)
