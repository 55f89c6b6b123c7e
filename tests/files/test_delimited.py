"""Text tables in the forms that programs write."""

import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import mckibben
from mckibben import DataWarning, Recording
from mckibben.files.dialect import detect
from mckibben.files.notices import is_plain

P = [0.0, 1.5, 2.25, 3.0, 4.125, 5.0, 4.0, 3.0, 2.0, 1.0, 0.5]
L = [0.0, -1.25, 12.5, 20.0, 21.0, 22.0, 1e-3, 3.5e2, 4.0, 2.0, 1.0]


def text(
    separator: str,
    decimal: str = ".",
    header: tuple[str, str] = ("pressure_bar", "displacement_mm"),
) -> str:
    rows = [separator.join(header)] + [f"{p!r}{separator}{x!r}" for p, x in zip(P, L, strict=True)]
    head, *body = rows
    return "\n".join([head, *[row.replace(".", decimal) for row in body]]) + "\n"


def read(tmp_path: Path, content: bytes | str, name: str = "a.csv", **options: Any) -> Recording:
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    (recording,) = mckibben.read(path, **options)
    return recording


@pytest.mark.parametrize("name", ["a.csv", "a.tsv", "a.txt", "a.DAT"])
@pytest.mark.parametrize(
    ("separator", "decimal"),
    [(s, d) for s in [",", ";", "\t", "|", " ", "   ", " \t"] for d in ".," if s != d],
)
def test_separator_and_decimal_mark(
    tmp_path: Path, separator: str, decimal: str, name: str
) -> None:
    recording = read(tmp_path, text(separator, decimal), name)
    assert recording["pressure"].tolist() == P
    assert recording["displacement"].tolist() == L


VARIANTS = {
    "bom": text(",").encode("utf-8-sig"),
    "line of a separator": ("sep=;\r\n" + text(";", ",")).encode(),
    "line of a separator after a bom": ("\ufeffsep=;\n" + text(";", ",")).encode(),
    "two boms": ("\ufeff\ufeff" + text(",")).encode(),
    "utf-16": text(",").encode("utf-16"),
    "crlf": text(",").replace("\n", "\r\n").encode(),
    "cr": text(",").replace("\n", "\r").encode(),
    "comments": ("# rig 3\n% date\n\n" + text(",") + "# end\n").encode(),
    "comment inside": text(",").replace("2.25,", "# pause\n2.25,").encode(),
    "quoted header": text(",", header=('"Pressure, upstream [bar]"', '"pos (mm)"')).encode(),
    "blank lines": text(",").replace("\n", "\n\n").encode(),
    "trailing separators": text(",").replace("\n", ",\n").encode(),
    "spaces": text(" , ").encode(),
    "brackets between blanks": text(" ", header=("Pressure (bar)", "Stroke (mm)")).encode(),
    "wide blanks": text("  ", header=("Druck in bar", "Weg in mm")).encode(),
    "line of units": text(",", header=("p", "disp")).replace("disp\n", "disp\nbar,mm\n").encode(),
    "no end of line": text(",").rstrip("\n").encode(),
    "quoted cells": text(",").replace("2.25", '"2.25"').encode(),
}


@pytest.mark.parametrize("variant", VARIANTS)
def test_variant(tmp_path: Path, variant: str) -> None:
    recording = read(tmp_path, VARIANTS[variant])
    assert [samples.tolist() for samples in recording.channels.values()] == [P, L]
    assert list(recording.units.values()) == ["bar", "mm"]


def test_latin_1(tmp_path: Path) -> None:
    recording = read(tmp_path, text(";", ",", header=("Druck_bar", "Winkel (°)")).encode("latin-1"))
    assert recording["angle"] == pytest.approx(np.deg2rad(L))


def test_header_in_a_comment_as_numpy_saves_it(tmp_path: Path) -> None:
    buffer = io.StringIO()
    np.savetxt(buffer, np.column_stack([P, L]), header="p_bar l_mm")
    recording = read(tmp_path, buffer.getvalue(), "a.txt")
    assert recording["pressure"].tolist() == P
    assert recording["length"].tolist() == L


def test_without_names_columns_are_numbered(tmp_path: Path) -> None:
    body = text(",").partition("\n")[2]
    with pytest.warns(DataWarning, match="column_1.*column_2"):
        recording = read(
            tmp_path,
            body,
            columns={"pressure": "column_1", "displacement": "column_2"},
            units={"pressure": "kPa", "displacement": "mm"},
        )
    assert recording["pressure"] == pytest.approx(np.array(P) / 100)


def test_text_columns_are_left_out_and_said(tmp_path: Path) -> None:
    lines = text(",").splitlines()
    rows = [f"{line},up" for line in lines[1:]]
    recording = read(tmp_path, "\n".join([lines[0] + ",branch", *rows]))
    assert recording.meta["ignored_columns"] == ["branch"]
    assert list(recording.channels) == ["pressure", "displacement"]


def test_own_meta_of_a_foreign_file(tmp_path: Path) -> None:
    import hashlib

    content = text(",").encode()
    recording = read(tmp_path, content)
    assert recording.meta == {
        "file": str(tmp_path / "a.csv"),
        "sha256": hashlib.sha256(content).hexdigest(),
    }
    assert recording.name == "a"


cells = st.floats(allow_nan=False, allow_infinity=False)


@settings(deadline=None, max_examples=50)
@given(
    st.lists(st.tuples(cells, cells, cells), min_size=10, max_size=15),
    st.sampled_from([(",", "."), (";", ","), ("\t", ","), ("|", "."), (" ", ",")]),
)
def test_numbers_are_read_to_the_last_bit(
    tmp_path_factory: pytest.TempPathFactory,
    rows: list[tuple[float, float, float]],
    form: tuple[str, str],
) -> None:
    separator, decimal = form
    lines = [separator.join(repr(cell).replace(".", decimal) for cell in row) for row in rows]
    path = tmp_path_factory.mktemp("bits") / "a.csv"
    path.write_text(separator.join("abc") + "\n" + "\n".join(lines))
    (recording,) = mckibben.read(path)
    for name, samples in zip("abc", zip(*rows, strict=True), strict=True):
        assert recording[name].tobytes() == np.array(samples).tobytes()


lines = st.text(st.characters(exclude_characters="\r\n"), max_size=30)


@given(st.lists(lines, min_size=1, max_size=5))
def test_any_lines_have_some_dialect(lines: list[str]) -> None:
    dialect = detect(lines)
    assert all(isinstance(dialect.split(line), list) for line in lines)


def test_composite_units_are_read_whole(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text(
        "time_s,flow_l/min,q_deg/s,velocity_m/s,torque_N_m,flow_Nl/min\n"
        + "".join(f"{0.1 * k:.1f},60,180,0.5,2,3\n" for k in range(20))
    )
    (found,) = mckibben.read(path)
    units = {"flow": "l/min", "q": "deg/s", "velocity": "mm/s", "torque_n_m": "", "flow_nl_min": ""}
    assert found.units == units
    assert [float(found[name][1]) for name in units] == [60.0, 180.0, 500.0, 2.0, 3.0]


def test_three_decimals_everywhere_are_plain_where_another_column_shows_the_mark(
    tmp_path: Path,
) -> None:
    rows = [f"{k % 9 + 1}.000,{1.5 + k % 4}" for k in range(30)]
    for content, plain in (
        (["pressure_bar,displacement_mm", *rows], True),
        (["pressure_bar", *(row[:5] for row in rows)], False),
    ):
        with pytest.warns(DataWarning, match="1000"):
            found = read(tmp_path, "\n".join(content))
        assert found["pressure"][1] == 2.0
        assert [is_plain(note) for note in found.notes] == [plain]
