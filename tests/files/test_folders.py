"""Folders: described by channels.toml, and with recordings in several files."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mckibben
from mckibben import DataError, Recording
from mckibben.files.channels import NAME, described
from mckibben.files.sources import roles
from mckibben.measured.sets import split_of
from mckibben.outputs import claim
from tests.files.made import Cells, one, put, refused, several
from tests.refusals import mentions

N = 60
T = np.arange(N) / 50
P = 2 + np.sin(9 * T)
X = 3 * np.cos(9 * T)
RAW = 1 + 0.5 * np.sin(9 * T)
LASER = 2 * np.cos(9 * T)

# Descriptions ----------------------------------------------------------------------------

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
"""


def folder(path: Path, text: str = CHANNELS, header: str = "stamp,A0,A1") -> Path:
    """Describe a file in its folder, and return it."""
    (path / NAME).write_text(text)
    return put(path / "run.csv", header, 1000 * T, RAW, LASER)


@pytest.mark.parametrize(
    ("options", "channel", "right"),
    [
        ({"units": {"pressure": "bar"}}, "pressure", 2.5 * RAW - 1.25),
        ({"calibration": {"pressure": (10.0, 1.0)}}, "pressure", (10 * RAW + 1) * 0.0689475729),
        # what is described is of A0
        ({"columns": {"pressure": "A1"}, "units": {"pressure": "kPa"}}, "pressure", LASER / 100),
        ({"columns": {"force": "A1"}, "units": {"force": "kN"}}, "force", 1000 * LASER),
        ({"constants": {"force": (3.0, "kN")}}, "force", np.full(N, 3000.0)),
    ],
)
def test_options_go_before_what_is_described(
    tmp_path: Path, options: Any, channel: str, right: Any
) -> None:
    assert one(folder(tmp_path), **options)[channel] == pytest.approx(right)


def test_a_description_goes_before_headers_and_is_of_the_columns_that_it_names(
    tmp_path: Path,
) -> None:
    text = "[channels.pressure]\noffset = -10.0\n[channels.force]\nvalue = 5\nunit='N'\n"
    recording = one(folder(tmp_path, text, "time_ms,pressure_kPa,force_N"))
    assert recording["pressure"] == pytest.approx((RAW - 10) / 100)
    assert recording["force"].tolist() == [5.0] * N
    assert recording.meta["ignored_columns"] == ["force_N"]
    other = one(folder(tmp_path, header="stamp,pressure_bar,A1"))
    assert other["pressure"].tolist() == RAW.tolist()
    made = Recording({"pressure": RAW, "displacement": LASER}, 0.02)
    mckibben.write(made, tmp_path / "made.csv")
    assert one(tmp_path / "made.csv") == made


def test_a_recording_that_was_edited_is_refused(tmp_path: Path) -> None:
    path = folder(tmp_path, "[channels.pressure]\ngain=2.0\nunit='bar'", "time_ms,p,position_mm")
    recording = one(path, channels=["pressure"])
    mckibben.write(recording, path)
    assert one(path)["pressure"].tolist() == (2 * RAW).tolist()
    path.write_text("\n".join(path.read_text().splitlines()[:-10]))
    assert refused(path).file == path


def test_a_column_that_is_missing(tmp_path: Path) -> None:
    path = folder(tmp_path, header="stamp,A0,B1")
    error = refused(path, channels=["pressure", "displacement"])
    assert (error.file, error.channel) == (path, "displacement")
    assert "'A1'" in error.problem
    recording = one(path, channels=["pressure"])
    assert "displacement" not in recording.channels
    assert any("'A1'" in note for note in recording.notes)


@pytest.mark.parametrize(
    ("text", "named"),
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
        ("[[files]]\nsheet='a'", "join"),
        ("[[files]]\nmatch='a'\njoin=['b', 'c']", "join"),
        ("[[files]]\njoin=['u*.mat', 'y.mat']", "join"),
        ("[[files]]\njoin=['../u.mat', 'y.mat']", "files.0"),
        ("[[files]]\nmatch='*'\n[files.channels.force]\ngain=2", "gain"),
        ("split = 3", "split"),
    ],
)
def test_what_cannot_be_is_refused(tmp_path: Path, text: str | bytes, named: str) -> None:
    path = folder(tmp_path)
    (tmp_path / NAME).write_bytes(text if isinstance(text, bytes) else text.encode())
    error = refused(path)
    assert error.file == tmp_path / NAME
    assert named in error.problem


def test_what_the_documentation_shows_is_understood(tmp_path: Path) -> None:
    text = (Path(__file__).parents[2] / "docs" / "channels.md").read_text(encoding="utf-8")
    shown = re.findall(r"```toml\n(.*?)```", text, re.DOTALL)
    assert len(shown) == 3
    for example in shown:
        (tmp_path / NAME).write_text(example)
        found = described(tmp_path)
        assert found.files or split_of(found.split).title


# Files with one signal each -----------------------------------------------------------------


def join(folder: Path, *names: str) -> None:
    (folder / NAME).write_text(f"[[files]]\njoin = {list(names)}\n")


def signal(path: Path, time: Cells, samples: Cells, header: str = "time_s,value") -> Path:
    return put(path, header, time, samples)


def test_files_that_this_package_wrote_are_put_on_one_clock(tmp_path: Path) -> None:
    mckibben.write(Recording({"pressure": P}, 0.02), tmp_path / "pressure.csv")
    mckibben.write(Recording({"displacement": X[5:]}, 0.02, start_time=0.1), tmp_path / "x.csv")
    join(tmp_path, "pressure.csv", "x.csv")
    recording = one(tmp_path)
    assert recording.start_time == pytest.approx(0.1)
    assert recording["pressure"] == pytest.approx(P[5:])
    assert recording["displacement"] == pytest.approx(X[5:])


def test_a_gap_of_the_faster_channel_is_not_bridged_unasked(tmp_path: Path) -> None:
    whole = np.delete(np.arange(N), np.arange(20, 40))
    signal(tmp_path / "pressure_bar.csv", T[whole], P[whole])
    signal(tmp_path / "displacement_mm.csv", T[::2], X[::2])
    join(tmp_path, "pressure_bar.csv", "displacement_mm.csv")
    error = refused(tmp_path)
    assert (error.channel, error.row, error.problem[:8]) == ("pressure", 11, "10 of 30")
    recording = one(tmp_path, gaps="interpolate")
    assert (recording.n_samples, recording.bridged.sum()) == (30, 10)


def test_join_names_those_that_belong_together(tmp_path: Path) -> None:
    dates = [f"2026-01-31 12:00:{t:05.2f}" for t in T]
    for run in (1, 2):
        signal(tmp_path / f"{run}_pressure.csv", dates, run * P, "time,value [bar]")
        signal(tmp_path / f"{run}_stroke.csv", dates, X, "time,value [mm]")
    (tmp_path / NAME).write_text('[[files]]\njoin = ["*_pressure.csv", "*_stroke.csv"]\n')
    first, second = several(tmp_path)
    assert second["pressure"].tolist() == (2 * first["pressure"]).tolist()
    assert second["displacement"].tolist() == X.tolist()
    assert one(tmp_path / "2_pressure.csv") == second
    firsts = [tmp_path / f"{run}_pressure.csv" for run in (1, 2)]
    assert roles(tmp_path)["train"] == firsts
    for read in (tmp_path, firsts[0]):  # nothing that is read with a path is written to
        for written in ("1_stroke.csv", NAME):
            with pytest.raises(DataError) as caught:
                claim(tmp_path / written, inputs=[read], force=True)
            assert caught.value.file == tmp_path / written
        claim(tmp_path / "new.csv", inputs=[read])


@pytest.mark.parametrize(
    ("header", "columns", "channel", "row"),
    [
        ("value", (X,), "time", None),
        ("time_s,t,value", (T, T, X), "time", None),
        ("time_s,value", (T + 100, X), "pressure", None),
        ("time_s,value", (T[::-1], X), "time", 3),
        ("time_s,value", (T, [*X[:5], np.nan, *X[6:]]), "displacement", 7),
    ],
)
def test_bad_files_of_signals(
    tmp_path: Path, header: str, columns: Any, channel: str, row: int | None
) -> None:
    signal(tmp_path / "pressure.csv", T, P)
    put(tmp_path / "displacement.csv", header, *columns)
    join(tmp_path, "pressure.csv", "displacement.csv")
    error = refused(tmp_path)
    assert (error.channel, error.row) == (channel, row)
    assert tmp_path in (error.file, getattr(error.file, "parent", None))


def test_a_part_that_is_missing_or_no_signal_or_shorter(tmp_path: Path) -> None:
    (tmp_path / NAME).write_text('[[files]]\njoin = ["a.csv", "b.csv"]\n')
    put(tmp_path / "a.csv", "time_s,pressure_bar", T, P)
    assert refused(tmp_path).file == tmp_path / "b.csv"
    put(tmp_path / "b.csv", "time_s,force_N,displacement_mm", T, P, X)
    assert "b.csv" in str(refused(tmp_path / "a.csv"))
    put(tmp_path / "a.csv", "value", P[:59])
    put(tmp_path / "b.csv", "value", P)
    assert mentions(refused(tmp_path).problem, ("a.csv", 59, "b.csv", 60))
