"""What channels.toml says: columns, units, calibrations, constants, and files that are otherwise."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mckibben
from mckibben import DataError, DataWarning, Recording
from mckibben.files.channels import NAME, described
from mckibben.measured.splits import split_of

N = 60
T = np.arange(N) / 50
RAW = 1 + 0.5 * np.sin(9 * T)
LASER = 2 * np.cos(9 * T)
PSI = 6894.757293168361 / 1e5

CHANNELS = """
[time]
column = "stamp"
unit = "ms"
[channels.pressure]
column = "A0"
unit = "psi"
gain = 2.5
offset = -1.25
[channels.displacement]
column = "A1"
unit = "mm"
[channels.force]
value = 1.962
unit = "N"
[[files]]
match = "*load400g*"
[files.channels.force]
value = 3.924
[split]
test = ["*400g*"]
rule = {by = "peak"}
"""

Folder = Callable[..., Path]


@pytest.fixture
def folder(tmp_path: Path) -> Folder:
    """Write a folder with channels.toml and two files, and return it."""

    def make(said: str = CHANNELS, header: str = "stamp,A0,A1", **more: Any) -> Path:
        (tmp_path / NAME).write_text(said)
        columns = ((1000 * T).tolist(), RAW.tolist(), LASER.tolist())
        rows = "\n".join(",".join(map(repr, row)) for row in zip(*columns, strict=True))
        for name in ("run_load200g.csv", "run_load400g.csv"):
            (tmp_path / name).write_text(f"{header}\n{rows}\n")
        return tmp_path

    return make


def one(path: Path, **options: Any) -> Recording:
    (recording,) = mckibben.read(path, **options)
    return recording


def test_an_offset_moves_what_the_header_states(folder: Folder) -> None:
    path = folder("[channels.pressure]\noffset = -10.0\n", "time_ms,pressure_kPa,position_mm")
    assert one(path / "run_load200g.csv")["pressure"] == pytest.approx((RAW - 10) / 100)


def test_what_the_caller_says_goes_before(folder: Folder) -> None:
    path = folder() / "run_load200g.csv"
    assert one(path, units={"pressure": "bar"})["pressure"] == pytest.approx(2.5 * RAW - 1.25)
    other = one(path, columns={"pressure": "A1"}, units={"pressure": "kPa"})
    assert other["pressure"] == pytest.approx(LASER / 100)  # what is described is of A0
    measured = one(path, columns={"force": "A1"}, units={"force": "kN"})
    assert measured["force"] == pytest.approx(1000 * LASER)


@pytest.mark.filterwarnings("ignore::mckibben.DataWarning")
def test_a_constant_goes_before_a_column_of_that_name(folder: Folder) -> None:
    path = folder("[channels.force]\nvalue = 5\nunit='N'\n", "time_ms,p_bar,force_N")
    recording = one(path / "run_load200g.csv")
    assert recording["force"].tolist() == [5.0] * N
    assert recording.meta["ignored_columns"] == ["force_N"]


def test_what_this_package_wrote_stands_as_it_is(folder: Folder) -> None:
    made = Recording({"pressure": RAW, "displacement": LASER}, 0.02)
    path = folder() / "made.csv"
    mckibben.write(made, path)
    assert one(path) == made


def test_a_column_that_is_missing(folder: Folder) -> None:
    path = folder(header="stamp,A0,B1") / "run_load200g.csv"
    with pytest.raises(DataError, match=r"'A1'.*channels\.toml") as caught:
        mckibben.read(path, channels=["pressure", "displacement"])
    assert (caught.value.file, caught.value.channel) == (path, "displacement")
    with pytest.warns(DataWarning, match="'displacement'.*'A1'"):
        assert "displacement" not in one(path, channels=["pressure"])


@pytest.mark.parametrize(
    ("said", "named"),
    [
        (b"\xff\xfe\x00", ""),
        ("[channels", ""),
        ("a = " + "[" * 20_000, ""),
        ("[chanels.pressure]\nunit='bar'", "chanels"),
        ("[channels.pressure]\ngains=2.0", "channels.pressure.gains"),
        ("[channels.pressure]\ngain='two'", "channels.pressure.gain"),
        ("[channels.pressure]\ngain=nan", "channels.pressure.gain"),
        ("[channels.pressure]\ngain=inf\nunit='bar'", "channels.pressure.gain"),
        ("[channels.pressure]\ngain=0\nunit='bar'", "gain"),
        ("[channels.pressure]\ngain=2", "gain"),
        ("[channels.pressure]\nvalue=2\ncolumn='A0'", "value"),
        ("[channels.time]\ncolumn='A0'", "[time]"),
        ("[time]\nsample_time=0", "time.sample_time"),
        ("[time]\nsample_time='fast'", "time.sample_time"),
        ("[[files]]\nsheet='a'", "match and join"),
        ("[[files]]\nmatch='a'\njoin=['b', 'c']", "match and join"),
        ("[[files]]\njoin=['u*.mat', 'y.mat']", "join"),
        ("[[files]]\njoin=['../u.mat', 'y.mat']", "files.0"),
        ("[[files]]\nmatch='*'\n[files.channels.force]\ngain=2", "gain"),
        ("split = 3", "split"),
    ],
)
def test_what_cannot_be_is_refused(folder: Folder, said: str | bytes, named: str) -> None:
    path = folder()
    (path / NAME).write_bytes(said if isinstance(said, bytes) else said.encode())
    with pytest.raises(DataError) as caught:
        mckibben.read(path / "run_load200g.csv")
    assert named in caught.value.problem
    assert caught.value.file == path / NAME
    assert caught.value.remedy


def test_what_the_documentation_shows_is_understood(tmp_path: Path) -> None:
    text = (Path(__file__).parents[2] / "docs" / "files.md").read_text(encoding="utf-8")
    shown = re.findall(r"```toml\n(.*?)```", text, re.DOTALL)
    assert len(shown) == 3
    for example in shown:
        (tmp_path / NAME).write_text(example)
        said = described(tmp_path)
        assert said.files or split_of(said.split).title
