"""Text tables in the forms that programs and laboratories write."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import mckibben
from mckibben import DataError, DataWarning, Recording
from mckibben.files import formats
from mckibben.files.cells import MISSING

N = 40
T = [k / 100 for k in range(N)]
P = [round(2.5 + math.sin(k / 6), 4) for k in range(N)]
X = [round(-3 * math.cos(k / 6), 4) for k in range(N)]
SIZES = [900 + 10 * k for k in range(N)]  # from the 11th on, a thousand and more


def lines(*columns: Sequence[object], separator: str = ",", mark: str = ".") -> str:
    """Return rows of cells, for a table of time, pressure and displacement by default."""
    rows = zip(*(columns or (T, P, X)), strict=True)
    return "".join(separator.join(str(c).replace(".", mark) for c in row) + "\n" for row in rows)


HEADER = "time_s,pressure_bar,displacement_mm\n"
PLAIN = HEADER + lines()


def file(folder: Path, content: bytes | str, name: str = "run.csv") -> Path:
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def read(folder: Path, content: bytes | str, name: str = "run.csv", **options: Any) -> Recording:
    (recording,) = mckibben.read(file(folder, content, name), **options)
    return recording


def refused(folder: Path, content: bytes | str, name: str = "run.csv", **options: Any) -> DataError:
    with pytest.raises(DataError) as caught:
        read(folder, content, name, **options)
    return caught.value


# Whole tables ----------------------------------------------------------------------------------------


@st.composite
def tables(draw: st.DrawFn) -> tuple[bytes, list[str], list[list[float]]]:
    """Draw a table in some form: its bytes, the names of its columns, and their numbers."""
    separator, mark = draw(st.sampled_from([(s, m) for s in ",;\t| " for m in ".," if s != m]))
    words = ["alpha", "betä", "gämma", "delta"]
    names = words[: draw(st.integers(2, 4))]
    number = st.floats(allow_nan=False, allow_infinity=False) | st.floats(-1e3, 1e3).map(
        lambda value: round(value, 4)
    )
    rows = draw(st.lists(st.lists(number, min_size=4, max_size=4), min_size=10, max_size=14))
    columns = [list(column) for column in zip(*rows, strict=True)][: len(names)]
    for column in columns:
        column[3] = 0.0625  # which shows that the mark is for decimals
    titles = draw(st.lists(st.sampled_from(["Bench 3", "Operator: A"]), max_size=3))
    body = [separator.join(names)]
    body += [
        separator.join(repr(c).replace(".", mark) for c in r) for r in zip(*columns, strict=True)
    ]
    for place in draw(st.lists(st.integers(1, len(body)), max_size=2)):
        body.insert(place, draw(st.sampled_from(["", "# pause"])))
    if separator == " ":
        titles = []  # whose words would be cells
    text = draw(st.sampled_from(["\n", "\r\n", "\r"])).join([*titles, *body, ""])
    coding = draw(st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be"]))
    return text.encode(coding), names, columns


@pytest.mark.filterwarnings("ignore:.*blank or commented")
@settings(deadline=None, max_examples=150)
@given(tables())
def test_a_table_in_any_form_is_read_to_the_last_bit(
    tmp_path_factory: pytest.TempPathFactory, table: tuple[bytes, list[str], list[list[float]]]
) -> None:
    content, names, columns = table
    path = tmp_path_factory.mktemp("law") / "run.csv"
    path.write_bytes(content)
    (found,) = formats.tables(path)
    assert [column.header for column in found.columns] == names
    for each, samples in zip(found.columns, columns, strict=True):
        assert each.values is not None
        assert each.values.tobytes() == np.array(samples).tobytes()


GERMAN = "Zeit [s];Druck [bar];Länge [mm]\n" + lines(separator=";", mark=",")
BLANKS = lines(separator="  ")
VARIANTS: dict[str, bytes | str] = {
    "a line that names the separator": "\ufeff\ufeffsep=;\r\n" + PLAIN.replace(",", ";"),
    "comments": f"# rig 3\n% date\n; rig, 3, muscles\n// day\n\n{PLAIN}# end\n",
    "a comment inside": PLAIN.replace("0.02,", "# pause\n0.02,"),
    "blank lines": PLAIN.replace("\n", "\n\n"),
    "no end of line": PLAIN.rstrip("\n"),
    "separators at the ends": PLAIN.replace("\n", ",\n"),
    "separators at the ends of rows alone": HEADER + lines(T, P, [f"{x}," for x in X]),
    "separators at the end of the header alone": HEADER.replace("\n", ",\n") + lines(),
    "rows of separators alone at the end": PLAIN + ",,\n,,\n",
    "titles": f"Pressure bench 3\noperator: A\n\n{PLAIN}",
    "titles of several cells": f"Date,2026-01-31\nRate,100,Hz\nRig\n{PLAIN}",
    "titles filled up with separators": f"Bench 3,,\nOperator,A,\n,,\n{PLAIN}",
    "more titles than samples": "key,1\n" * 100 + PLAIN,
    "quoted header": f'"time, s","Pressure, upstream [bar]","pos (mm)"\n{lines()}',
    "quoted cells": HEADER + lines([f'"{t}"' for t in T], P, [f'"{x}"' for x in X]),
    "blanks around cells": PLAIN.replace(",", " , "),
    "blanks between cells": "time_s pressure_bar displacement_mm\n" + BLANKS,
    "brackets between blanks": "t (s) Pressure (bar) Stroke (mm)\n" + BLANKS,
    "wide blanks": "Zeit in s  Druck in bar  Weg in mm\n" + BLANKS,
    "rows that begin with blanks": "  t(s) p(bar) disp(mm)\n" + "  " + BLANKS.replace("\n", "\n  "),
    "a header in a comment": f"# bench\n# t_s p_bar disp_mm\n{BLANKS}",
    "a header and units in comments": f"% time pressure disp\n% s bar mm\n{BLANKS}",
    "a line of units in brackets below titles": "a,b,c\nt,p,disp\n[s],(bar),[mm]\n" + lines(),
    "commas for decimals": GERMAN.replace("Länge", "Weg"),
    "Latin-1": GERMAN.encode("latin-1"),
    "Shift-JIS": ("時間(s),圧力(bar),変位(mm)\n" + lines()).encode("cp932"),
    "GB18030": ("时间/s,压力/bar,变形量/mm\n" + lines()).encode("gb18030"),
    "EUC-KR": ("시간[초],압력[bar],변위[mm]\n" + lines()).encode("cp949"),
    "UTF-16 without a mark": ("时间/s\t压力/bar\t位移/mm\n" + lines(separator="\t")).encode("utf-16-le"),
    "a minus of typesetters": PLAIN.replace("-", "−"),
    "cells with units": "t,p,disp\n" + lines([f"{t} s" for t in T], P, [f"{x}mm" for x in X]),
    "no-break spaces around": HEADER + lines(T, [f"\xa0{p}" for p in P], X),
}  # fmt: skip


@pytest.mark.filterwarnings("ignore:no unit is given")
@pytest.mark.parametrize("variant", VARIANTS)
def test_variant(tmp_path: Path, variant: str, recwarn: pytest.WarningsRecorder) -> None:
    options: dict[str, Any] = (
        {"units": {"pressure": "bar"}} if variant == "cells with units" else {}
    )
    recording = read(tmp_path, VARIANTS[variant], **options)
    samples = list(recording.channels.values())
    assert [column.tolist() for column in samples] == [P, X]
    assert (list(recording.units.values()), recording.sample_time) == (["bar", "mm"], 0.01)
    assert not recwarn.list


@pytest.mark.parametrize("name", ["a.tsv", "a.txt", "a.DAT"])
def test_one_column_with_decimal_commas_is_one_in_files_of_any_ending(
    tmp_path: Path, name: str
) -> None:
    content = "p_bar\n" + lines(P, mark=",")
    assert read(tmp_path, content, name)["pressure"].tolist() == P


def test_text_of_no_known_word_is_read_with_a_note(tmp_path: Path) -> None:
    with pytest.warns(DataWarning, match="encoding.*cp1252"):
        recording = read(tmp_path, ("Größe;Höhe\n" + lines(P, X, separator=";")).encode("cp1252"))
    assert list(recording.channels) == ["grösse", "höhe"]


def test_words_that_end_a_file_are_left_out_with_a_note_and_averages_refused(
    tmp_path: Path,
) -> None:
    with pytest.warns(DataWarning, match="row 43 .*'End of file'"):
        assert read(tmp_path, PLAIN + "\nEnd of file\n")["pressure"].tolist() == P
    assert refused(tmp_path, PLAIN + "mean,2.5,3.1\n").row == 42
    assert refused(tmp_path, PLAIN + "sum of 40\n").row == 42


def test_a_unit_of_the_header_and_one_of_the_row_below_are_both_there(tmp_path: Path) -> None:
    path = file(tmp_path, HEADER + "s,kPa,mm\n" + lines())
    column = formats.tables(path)[0].columns[1]
    assert (column.header, column.unit) == ("pressure_bar", "kPa")


def test_columns_without_numbers_are_listed(tmp_path: Path) -> None:
    content = "time_s,p_bar,phase,x,y\n" + lines(T, P, ["up"] * N, [""] * N, ["#N/A"] * N)
    (table,) = formats.tables(file(tmp_path, content))
    assert dict(table.unread) == {
        "phase": "text, such as 'up'",
        "x": "no number in it",
        "y": "no number in it",
    }


@pytest.mark.parametrize("row", ["0.02,1.5", "0.02,1.5,2.0,3.0", "0.02 1.5 2.0", "Rate,100"])
def test_a_row_of_other_cells_is_refused(tmp_path: Path, row: str) -> None:
    rows = PLAIN.splitlines()
    rows[20] = row
    assert refused(tmp_path, "\n".join(["Bench 3", *rows])).row == 22


# Cells that are no plain numbers ----------------------------------------------------------------------


def test_hexadecimal_columns(tmp_path: Path) -> None:
    cells = [f"0x{k:04X}" if k % 2 else f"{k:#x}" for k in range(N)]
    assert read(tmp_path, "x,p_bar\n" + lines(cells, P))["x"].tolist() == list(range(N))


@pytest.mark.parametrize("cell", ["OVER", "ERR", "0x1F", "1.2.3", "2.5 kPa", "#DIV/0!", "n.d."])
@pytest.mark.parametrize("place", [0, 1, 7, N - 1])
def test_a_cell_that_is_no_number_is_refused_by_its_row(
    tmp_path: Path, cell: str, place: int
) -> None:
    cells: list[object] = [*P]
    cells[place] = cell
    for content in (HEADER + lines(T, cells, X), "p_bar,disp_mm\n" + lines(cells, X)):
        error = refused(tmp_path, content)
        assert (error.channel, error.row) == ("pressure", place + 2)
        assert cell in error.problem


def test_a_number_of_four_digits_is_no_instant(tmp_path: Path) -> None:
    error = refused(tmp_path, HEADER + lines(T, ["1013.25", "OVER", *P[2:]], X))
    assert (error.channel, error.row) == ("pressure", 3)


@pytest.mark.parametrize("cell", ["", *MISSING])
def test_a_missing_sample_is_one(tmp_path: Path, cell: str) -> None:
    cells: list[object] = [*P]
    cells[7] = cell
    error = refused(tmp_path, "p_bar,disp_mm\n" + lines(cells, X))
    assert (error.channel, error.row, error.problem[:7]) == ("pressure", 9, "1 of 40")


@pytest.mark.parametrize("other", ["2.5 kPa", "2.5", "OVER"])
@pytest.mark.parametrize("usual", ["{} bar", "0x{:04X}"])
def test_cells_of_several_forms_are_refused(tmp_path: Path, usual: str, other: str) -> None:
    cells = [usual.format(k) for k in range(N)]
    cells[5] = other
    error = refused(tmp_path, "time_s,p\n" + lines(T, cells))
    assert (error.channel, error.row) == ("pressure", 7)


# Marks between digits ---------------------------------------------------------------------------------


def marked(folder: Path, header: str, cells: Sequence[object], separator: str = ";") -> Path:
    return file(folder, f"time_s{separator}{header}\n" + lines(T, cells, separator=separator))


@pytest.mark.parametrize("separator", [";", "\t", "|"])
@pytest.mark.parametrize("mark", [",", ".", "'", "’", " ", "\xa0", "\u2009", "\u202f", "_"])
@pytest.mark.parametrize("more", [0, 1000, 100_000])
def test_marks_of_thousands_are_not_read_as_anything(
    tmp_path: Path, separator: str, mark: str, more: int
) -> None:
    cells = [f"{size + more:,}".replace(",", mark) for size in SIZES]
    path = marked(tmp_path, "pressure (mbar)", cells, separator)
    if mark == "." and more:  # every number has three digits after the mark: decimals
        (recording,) = mckibben.read(path)  # and no note: the times show the mark
        assert recording["pressure"] == pytest.approx((np.array(SIZES) + more) / 1e6)
        return
    with pytest.raises(DataError) as caught:
        mckibben.read(path)
    assert (caught.value.channel, caught.value.row) == ("pressure", 2 if more else 12)


QUOTED = ("1,234,567", "1.234.567", "12,34,567", "1,234.5", "1.234,5")


@pytest.mark.parametrize("separator", [",", ";"])
@pytest.mark.parametrize("cell", ["", *QUOTED])
def test_marks_in_quoted_cells_are_refused(tmp_path: Path, separator: str, cell: str) -> None:
    cells = [f'"{cell or format(size, ",")}"' for size in SIZES]
    with pytest.raises(DataError, match=cell or "'1,000'") as caught:
        mckibben.read(marked(tmp_path, "pressure (mbar)", cells, separator))
    assert (caught.value.channel, caught.value.row) == ("pressure", 2 if cell else 12)


def test_a_channel_beside_those_needed_is_left_out_and_noted(tmp_path: Path) -> None:
    path = marked(tmp_path, "x;y", [f"{k}.5;{size:,}" for k, size in enumerate(SIZES)])
    with pytest.warns(DataWarning, match=r"y .*'1,000'"):
        (recording,) = mckibben.read(path)
    assert list(recording.channels) == ["x"]
    with pytest.raises(DataError) as caught:
        mckibben.read(path, channels=["y"])
    assert (caught.value.channel, caught.value.row) == ("y", 12)


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
    path = marked(tmp_path, "x", DECIMALS[form])
    path.write_text(path.read_text().replace(".", mark))
    (recording,) = mckibben.read(path)
    assert recording["x"].tolist() == [float(cell) for cell in DECIMALS[form]]  # and no warning


@pytest.mark.parametrize("place", [5, 5000])
@pytest.mark.parametrize("proof", [None, "2.5", "0.125", "1000.125", "7."])
def test_one_number_anywhere_shows_that_a_mark_is_for_decimals(
    tmp_path: Path, place: int, proof: str | None
) -> None:
    cells = [str(1 + k % 9) if k % 2 else f"{1 + k % 9}.125" for k in range(6000)]
    if proof is not None:
        cells[place] = proof
        assert read(tmp_path, "x\n" + lines(cells))["x"].tolist() == list(map(float, cells))
    else:
        error = refused(tmp_path, "x\n" + lines(cells), channels=["x"])
        assert (error.row, "'1.125'" in error.problem) == (2, True)


def test_a_mark_that_no_number_shows_is_noted(tmp_path: Path) -> None:
    content = "x;y\n" + "".join(f"{k + 1}.250;{k + 2}.500\n" for k in range(N))
    with pytest.warns(DataWarning, match="'x', 'y' have three digits after the mark '.'"):
        assert read(tmp_path, content)["x"].tolist() == [k + 1.25 for k in range(N)]


def test_rows_left_out_are_noted_where_there_is_no_time(tmp_path: Path) -> None:
    rows = lines(P, X).splitlines(keepends=True)
    with pytest.warns(DataWarning, match="blank or commented lines"):
        read(tmp_path, "p_bar,disp_mm\n" + "".join([*rows[:9], "\n", *rows[9:]]), rate=100)


# LabVIEW's files ------------------------------------------------------------------------------


def labview(clocks: str, mark: str, separator: str, shift: float = 0.0) -> str:
    """Return a file of LabVIEW with one segment; its first sample has a comment."""
    named = {"\t": "Tab", ",": "Comma", ";": "Semicolon"}[separator]
    names = ["X_Value", "pressure", *(["X_Value"] if clocks == "Multi" else []), "disp", "Comment"]
    times: dict[str, tuple[Sequence[object], ...]] = {
        "One": (T, P, X),
        "Multi": (T, P, [t + shift for t in T], X),
        "No": ([""] * N, P, X),
    }
    head = [
        *("LabVIEW Measurement|", f"Separator|{named}", f"Decimal_Separator|{mark}"),
        *(f"X_Columns|{clocks}", "Time_Pref|Relative", "***End_of_Header***|", "|"),
        *("Channels|2|", f"Samples|{N}|{N}", "Y_Unit_Label|bar|mm", "X_Dimension|Time|Time"),
        *(f"X0|0{mark}0|{shift}", f"Delta_X|0{mark}01|0{mark}01", "***End_of_Header***||"),
        "|".join(names),
    ]
    rows = lines(*times[clocks], separator=separator, mark=mark).splitlines()
    rows[0] += f"{separator}first"
    return "\n".join([*(line.replace("|", separator) for line in head), *rows]) + "\n"


@pytest.mark.parametrize("name", ["run.lvm", "run.txt"])
@pytest.mark.parametrize("clocks", ["One", "Multi", "No"])
@pytest.mark.parametrize(("mark", "separator"), [(",", "\t"), (".", ","), (",", ";")])
def test_files_of_labview(
    tmp_path: Path, clocks: str, mark: str, separator: str, name: str
) -> None:
    recording = read(tmp_path, labview(clocks, mark, separator), name)
    assert {key: value.tolist() for key, value in recording.channels.items()} == {
        "pressure": P,
        "displacement": X,
    }
    assert (recording.sample_time, recording.start_time) == (0.01, 0.0)


def test_segments_of_labview_are_recordings(tmp_path: Path) -> None:
    content = labview("One", ".", "\t")
    segment = content[content.index("Channels") :]
    first, second = mckibben.read(file(tmp_path, f"{content}\n{segment}", "run.lvm"))
    assert first["pressure"].tolist() == second["pressure"].tolist() == P
    assert (first.name, second.name) == ("run[1]", "run[2]")
    assert refused(tmp_path, content[: content.index("Channels")], "cut.lvm").remedy


def test_the_header_is_the_row_of_known_names(tmp_path: Path) -> None:
    above = '"TOA5","rig","CR1000X"\n"TIMESTAMP","Press","Disp"\n"TS","kPa","mm"\n"","Avg","Smp"\n'
    content = above + "".join(f'"2026-01-31 12:00:{k / 50:05.2f}",{k},{k}\n' for k in range(40))
    recording = read(tmp_path, content, "run.dat")
    assert list(recording.channels) == ["pressure", "displacement"]
    assert recording["pressure"].max() == pytest.approx(0.39)


def test_numbers_may_be_names(tmp_path: Path) -> None:
    recording = read(tmp_path, "x,1,2\nsecond,Volt,Volt\n" + lines())
    assert (list(recording.channels), recording.units["1"]) == (["1", "2"], "V")


def test_a_damaged_row_does_not_hide_those_before_it(tmp_path: Path) -> None:
    rows = lines().splitlines(keepends=True)
    error = refused(tmp_path, HEADER + rows[0] + "0.01,ERR,ERR\n" + "".join(rows[2:]))
    assert error.row == 3


def test_times_of_day_go_on_after_midnight(tmp_path: Path) -> None:
    clock = ["23:59:59", *(f"00:00:{k:02d}" for k in range(19))]
    content = "time,p_bar\n" + "".join(f"{each},{k}\n" for k, each in enumerate(clock))
    assert read(tmp_path, content).time.tolist() == list(range(20))


def test_a_footer_among_dates_is_refused_by_its_row(tmp_path: Path) -> None:
    rows = "".join(f"2026-01-31T12:00:{k:02d},{k}\n" for k in range(40))
    assert refused(tmp_path, f"stamp,p_bar\n{rows}Maximum,39\n").row == 42


def test_a_record_number_is_in_no_unit_of_force(tmp_path: Path) -> None:
    rows = "".join(f"{k},{k}\n" for k in range(20))
    assert read(tmp_path, f"RECORD,p\nRN,bar\n{rows}")["record"].max() == 19
