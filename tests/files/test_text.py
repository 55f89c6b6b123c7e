"""Text tables in the forms that programs and laboratories write."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mckibben.files.lines import LARGEST_SHARE_SKIPPED
from tests.files.made import columns, one, place, refused, rows, several, table
from tests.refusals import mentions

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


def test_words_and_averages_that_end_a_file_are_left_out(tmp_path: Path) -> None:
    recording = one(file(tmp_path, PLAIN + "\nEnd of file\n"))
    assert recording["pressure"].tolist() == P
    assert any(mentions(note, 43) for note in recording.notes)
    recording = one(file(tmp_path, PLAIN + "mean,2.5,3.1\n"))
    assert recording["pressure"].tolist() == P
    assert any(mentions(note, 42) for note in recording.notes)
    dates = rows([f"2026-01-31T12:00:{k:02d}" for k in range(N)], P)
    assert refused(file(tmp_path, f"stamp,p_bar\n{dates}Maximum,39\n")).row == 42


def test_columns_without_numbers_are_listed(tmp_path: Path) -> None:
    words = ["up"] * N, [""] * N, ["#N/A"] * N
    recording = one(file(tmp_path, "time_s,p_bar,phase,x,y\n" + rows(T, P, *words)))
    assert recording.meta["ignored_columns"] == ["phase", "x", "y"]
    assert mentions(" ".join(recording.notes), ("phase", "'up'"))


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
@pytest.mark.parametrize("cell", ["", "1,234,567", "1.234.567", "12,34,567", "1.234,5"])
def test_marks_in_quoted_cells_are_refused(tmp_path: Path, separator: str, cell: str) -> None:
    cells = [f'"{cell or format(size, ",")}"' for size in SIZES]
    error = refused(file(tmp_path, marked("pressure (mbar)", cells, separator)))
    assert (error.channel, error.row) == ("pressure", 2 if cell else 12)
    assert (cell or "1,000") in error.problem


@pytest.mark.parametrize("mark", [".", "'", " ", "\xa0"])
def test_thousands_before_the_decimal_mark_of_the_table_are_read(tmp_path: Path, mark: str) -> None:
    values = [995.5 + k for k in range(N)]
    cells = [f"{value:,.1f}".translate({ord(","): mark, ord("."): ","}) for value in values]
    times = [f"{t:.2f}".replace(".", ",") for t in T]
    found = one(file(tmp_path, "time_s;pressure (mbar)\n" + rows(times, cells, separator=";")))
    assert found["pressure"] == pytest.approx(np.array(values) / 1000)


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


JUNK = [
    ["rig> "], ["[INFO] ready"], ["WARN: p=1.2 high, d=3"], ["I (123) main: boot"], ["[INFO],ready,1"],
    ["ESP-ROM:esp32s3-20210327", "rst:0x1 (POWERON),boot:0x8", ""], HEADER.splitlines(), ["", "OK", ""],
    ["0.2"], ["0.2,1.5"], ["0.2,1.50.21,1.5,2.0"], ["0.2 1.5 2.0"], ["Rate,100"], ["\x1b[2K\x07> \b"],
    ["1" * 2_000_000],
]  # fmt: skip


@pytest.mark.parametrize("junk", JUNK, ids=lambda lines: (lines[0] or lines[1])[:30])
@pytest.mark.parametrize("at", [1, 21, 30])
def test_lines_between_samples_are_left_out_and_counted(
    tmp_path: Path, junk: list[str], at: int
) -> None:
    lines = PLAIN.splitlines()
    recording = one(file(tmp_path, "\n".join([*lines[:at], *junk, *lines[at:], ""])))
    assert recording["pressure"].tolist() == P
    assert recording["displacement"].tolist() == X
    number = len([line for line in junk if line])
    row = at + 1 + (not junk[0])
    if at > 1:  # what is above the first sample is above the table
        assert any(mentions(n, (number, row)) for n in recording.notes)


@pytest.mark.filterwarnings("ignore::mckibben.DataWarning")
def test_a_line_that_is_cut_off_shifts_no_column(tmp_path: Path) -> None:
    lines, whole = PLAIN.splitlines(), {*zip(T, P, X, strict=True)}
    for length in range(1, len(lines[20])):
        text = "\n".join([*lines[:20], lines[20][:length], *lines[21:]])
        found = [one.values for one in table(file(tmp_path, text)).columns]
        read = [*zip(*(np.full(N, np.nan) if v is None else v for v in found), strict=True)]
        assert {row[:2] for row in read} <= {row[:2] for row in whole} | {(T[19], math.nan)} or any(
            one.flaw for one in table(file(tmp_path, text)).columns
        )
        assert len({*read} & whole) == N - 1


def test_a_file_with_many_other_lines_is_refused(tmp_path: Path) -> None:
    lines = PLAIN.splitlines()
    for share in (LARGEST_SHARE_SKIPPED / 2, 2 * LARGEST_SHARE_SKIPPED):
        other = [f"{line},7" if k % round(1 / share) == 1 else line for k, line in enumerate(lines)]
        if share > LARGEST_SHARE_SKIPPED:
            assert refused(file(tmp_path, "\n".join(other))).row == 2
        else:
            one(file(tmp_path, "\n".join(other)))


def test_damaged_samples_without_times_are_missing(tmp_path: Path) -> None:
    lines = ("p_bar,d_mm\n" + rows(P, X)).splitlines()
    path = file(tmp_path, "\n".join([*lines[:20], "2.", *lines[21:]]))
    assert place(path) == ("p", 21) or refused(path).row == 21
    assert one(path, gaps="interpolate").n_samples == N


def test_repeats_of_a_row_are_left_out_where_the_time_is_the_same(tmp_path: Path) -> None:
    lines = PLAIN.splitlines()
    recording = one(file(tmp_path, "\n".join([*lines[:20], *lines[18:20], *lines[20:]]).replace(
        lines[19] + "\n" + lines[18], lines[19] + "\n" + lines[19])))  # fmt: skip
    assert recording["pressure"].tolist() == P
    other = lines[19].rpartition(",")[0] + ",9.5"
    assert place(file(tmp_path, "\n".join([*lines[:20], other, *lines[20:]]))) == ("time", 21)
    same = "p_bar,d_mm\n" + rows([2.5, *P[1:]], [1.0] * N) + "2.0,1.0\n" * 3
    assert one(file(tmp_path, same), channels=["pressure"]).n_samples == N + 3


CONTROLS = {
    "colours": [f"\x1b[32m{line}\x1b[0m" for line in PLAIN.splitlines()],
    "a title": ["\x1b]0;rig\x07", *PLAIN.splitlines()],
    "ends of strings": [line.replace(",", "\0,") + "\0" for line in PLAIN.splitlines()],
    "bells": [line + "\x07" for line in PLAIN.splitlines()],
    "zeros at the end": [*PLAIN.splitlines(), "\0" * 3000],
}


@pytest.mark.parametrize("kind", CONTROLS)
def test_what_terminals_write_is_left_out(tmp_path: Path, kind: str) -> None:
    recording = one(file(tmp_path, "\n".join(CONTROLS[kind])))
    assert recording["pressure"].tolist() == P
    assert len(recording.notes) == 1


def test_a_number_with_a_control_character_within_is_damaged(tmp_path: Path) -> None:
    for mark in "\0\a\b\x01":
        text = PLAIN.replace("\n0.1,3.4", f"\n0.1,3{mark}.4")
        assert place(file(tmp_path, text)) == ("pressure", 12)


# Tables of other forms ---------------------------------------------------------------------------

TIMED, UNTIMED = (
    {"pressure": ("bar", P), "displacement": ("mm", X)},
    {"ch1": ("V", P), "ch2": ("V", X)},
)
BARE = {"p": ("", P), "x": ("", X)}
NO, F = [""] * N, range(1, N + 1)
MARKED = {f"m{k}_{axis}": ("mm", X if (k, axis) in ((1, "x"), (2, "z")) else P)
          for k in (1, 2) for axis in "xyz"}  # fmt: skip
SIX = (X, P, P, P, P, X)
QUALISYS = "NO_OF_FRAMES\t40\nNO_OF_MARKERS\t2\nFREQUENCY\t100\nDATA_INCLUDED\t3D\n"
MOTIVE = (
    "Format Version,1.23,Take Name,a,Capture Frame Rate,100.000000,Length Units,Meters\n\n"
    ",,Rigid Body,Rigid Body,Rigid Body,Rigid Body\n,,A,A,B,B\n"
    f",,{','.join(['FC2B3B0D11111111'] * 2 + ['FC2B3B0D22222222'] * 2)}\n"
    ",,Rotation,Position,Rotation,Position\nFrame,Time (Seconds),X,X,X,X\n"
)
SCOPE = "X,CH1,CH2,Start,Increment\nSequence,Volt,Volt,-2.0e+00,1.0e-02\n"
STACK = "".join(f"{t},pressure,{p},bar\n{t},displacement,{x},mm\n" for t, p, x in EACH)
PAIRS = [
    "t={};p={};x={};",
    "t:{},p:{},x:{}",
    "t: {}  p: {}  x: {}",
    '{{"t": {}, "p": {}, "x": {}}}',
]
OTHERS: dict[str, tuple[str, dict[str, tuple[str, list[float]]]]] = {
    "cells of the header without samples": (SCOPE + rows(range(N), P, X, NO), UNTIMED),
    "and without a separator": (SCOPE + rows(range(N), P, X), UNTIMED),
    "a comment that was never made": ("t_s,p_bar,Weg_mm,note\n" + rows(T, P, X), TIMED),
    "a separator below": (HEADER + rows(T, P, X, NO), TIMED),
    "a separator above": (HEADER.replace("\n", ",\n") + rows(T, P, X), TIMED),
    "a comma in a name": ("t (s),level (a, b),Weg (mm)\n" + rows(T, P, X), {"displacement": ("mm", X)}),
    "Vicon": ("Trajectories\n100\n,,a:M1,,,a:M2,,\nFrame,Sub Frame,X,Y,Z,X,Y,Z\n,,mm,mm,mm,mm,mm,mm\n"
        + rows(F, [0] * N, *SIX), MARKED),
    "Motive": (MOTIVE + rows(F, T, P, [x / 1000 for x in X], P, [x / 1000 for x in X]),
        {"a_position_x": ("mm", X), "b_rotation_x": ("", P)}),
    "Qualisys": (QUALISYS + "MARKER_NAMES\tM1\tM2\n" + rows(*SIX, separator="\t"),
        {name: ("", values) for name, (_, values) in MARKED.items()}),
    "a rate above": ("# Sampling rate: 0.1 kHz\np_bar,Weg_mm\n" + rows(P, X), TIMED),
    "a full-width rate": ("# サンプリング周波数：100Hz\np_bar,Weg_mm\n" + rows(P, X), TIMED),
    "an interval above": ("Sample Interval,1.0E-02\nPoints,40\n\nCH1 (V),CH2 (V)\n"
        + rows(P, X), UNTIMED),
    "units alone": ("sec,bar,mm\n" + rows(T, P, X), TIMED),
    "units alone in brackets": ("[s];[bar];[mm]\n" + rows(T, P, X, separator=";"), TIMED),
    "units two rows below": ("t,p,Weg\nA1,B1,C1\ns,bar,mm\n" + rows(T, P, X), TIMED),
    **{f"names in each line: {form}": ("".join(form.format(*each) + "\n" for each in EACH),
        {"pressure": ("bar", P), "x": ("", X)}) for form in PAIRS},
    "a logger's lines": ("".join(
        f"2026-01-31 12:00:{t:06.3f} [{'INFO' if p < 3 else 'WARNING'}] rig: p={p} x={x}\n"
        for t, p, x in EACH), {"pressure": ("bar", P), "x": ("", X)}),
    "a serial monitor": ("".join(f"12:00:{t:06.3f} -> {p},{x}\n" for t, p, x in EACH),
        {"column_2": ("", P), "column_3": ("", X)}),
    "names and units in each line": ("boot\n" + "".join(
        f"12:00:{t:05.2f} -> P: {p} bar  D: {x} mm\n" for t, p, x in EACH), TIMED),
    "Fortran": (HEADER + "".join(
        f"{t:.4E},{p:.6E},{x:.6E}\n".replace("E", "D") for t, p, x in EACH), TIMED),
    "a column with the other mark": (HEADER + "".join(
        f'{t},"{p}",{x}\n'.replace(f'"{p}"', f'"{p}"'.replace(".", ",")) for t, p, x in EACH), TIMED),
    "long": ("time_s,name,value,unit\n" + STACK, TIMED),
    "long of one unit": ("t;signal;value\n" + "".join(
        f"{t};p_bar;{p}\n{t};Weg_mm;{x}\n" for t, p, x in EACH), TIMED),
}  # fmt: skip


@pytest.mark.parametrize("name", OTHERS)
def test_other_forms(tmp_path: Path, name: str) -> None:
    text, expected = OTHERS[name]
    recording = one(file(tmp_path, text))
    assert recording.sample_time == 0.01
    assert recording.start_time == (-2.0 if text.startswith(SCOPE) else 0.0)
    assert expected.keys() <= recording.channels.keys()
    for channel, (unit, values) in expected.items():
        assert (recording[channel].tolist(), unit) == (
            pytest.approx(values),
            recording.units[channel],
        )


@pytest.mark.parametrize("stamp", ["{:.3f}", "2026-01-31T12:00:{:06.3f}"])
def test_signals_of_the_long_format_have_times_of_their_own(tmp_path: Path, stamp: str) -> None:
    lines = [
        f"{stamp.format(t + late)},{name},{t + late}\n"
        for t in T
        for name, late in (("p_bar", 0), ("force_N", 0.003))
    ]
    recording = one(file(tmp_path, "time,name,value\n" + "".join(lines)))
    assert recording["pressure"] == pytest.approx(recording["force"])


def test_the_frequency_of_an_experiment_is_no_rate(tmp_path: Path) -> None:
    assert (
        one(file(tmp_path, "# Frequency: 0.5 Hz\np_bar,Weg_mm\n" + rows(P, X))).sample_time is None
    )


# LabVIEW -----------------------------------------------------------------------------------------


def lvm(x: str, mark: str, *segments: tuple[float, range]) -> str:
    """Return a measurement file with segments, each with X0 and numbers of samples."""
    text = (
        f"LabVIEW Measurement\t\nWriter_Version\t2\nSeparator\tTab\nDecimal_Separator\t{mark}\n"
        f"Multi_Headings\tYes\nX_Columns\t{x}\nTime\t12:00:00,1\n***End_of_Header***\t\n\t\n"
    )
    for start, numbers in segments:
        each: list[tuple[Any, ...]] = [(T[k] if x != "No" else "", P[k], X[k]) for k in numbers]
        names = "X_Value\tPressure\tWeg\tComment"
        if x == "Multi":
            names, each = (
                "X_Value\tPressure\tX_Value\tWeg\tComment",
                [(t, p, t, d) for t, p, d in each],
            )
        text += (
            f"Channels\t2\t\t\nSamples\t9\t9\t\nY_Unit_Label\tbar\tmm\t\nX_Dimension\tTime\tTime\t\n"
            f"X0\t{start}\t{start}\t\nDelta_X\t0.010000\t0.010000\t\n***End_of_Header***\t\t\t\n"
            f"{names}\n{rows(*zip(*each, strict=True), separator=chr(9))}\n"
        )
    return (
        text if mark == "." else text.replace(".", mark).replace("Separator\t,\n", "Separator\t,\n")
    )


@pytest.mark.parametrize("mark", ".,")
@pytest.mark.parametrize("x", ["One", "Multi", "No"])
def test_labview_measurements(tmp_path: Path, x: str, mark: str) -> None:
    whole = lvm(x, mark, (0.0, range(N)))
    goes_on = lvm(x, mark, (0.0, range(20)), (0.2, range(20, N)))
    for text in (whole, goes_on):
        recording = one(file(tmp_path, text, "run.lvm"))
        assert {
            name: (recording.units[name], recording[name].tolist()) for name in recording.channels
        } == TIMED
        assert recording.sample_time == 0.01
    again = several(file(tmp_path, lvm(x, mark, *[(0.0, range(20))] * 3), "run.lvm"))
    assert [one["pressure"].tolist() for one in again] == [P[:20]] * 3
