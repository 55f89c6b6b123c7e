"""Text tables in the forms that programs write."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import mckibben
from mckibben import Recording

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
