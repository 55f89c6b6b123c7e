"""Folders: of files with one signal each, which are one recording, and of several recordings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mckibben
from mckibben import DataError, DataWarning, Recording
from mckibben.files.channels import NAME
from mckibben.files.sources import roles

N = 60
T = np.arange(N) / 50
P = 2 + np.sin(9 * T)
X = 3 * np.cos(9 * T)


def put(path: Path, columns: Mapping[str, Sequence[float] | np.ndarray[Any, Any]]) -> None:
    rows = zip(*(np.asarray(column).tolist() for column in columns.values()), strict=True)
    text = [",".join(columns), *(",".join(map(repr, row)) for row in rows)]
    path.write_text("\n".join(text))


def one(path: Path, **options: Any) -> Recording:
    (recording,) = mckibben.read(path, **options)
    return recording


def test_files_named_as_channels_are_one_recording(tmp_path: Path) -> None:
    put(tmp_path / "pressure.csv", {"time_s": T, "value [kPa]": 100 * P})
    put(tmp_path / "displacement_cm.csv", {"time_s": T, "value": X / 10})
    recording = one(tmp_path, channels=["pressure", "displacement"])
    assert recording["pressure"] == pytest.approx(P)
    assert recording["displacement"] == pytest.approx(X)
    assert recording.sample_time == 0.02
    assert recording.name == tmp_path.name
    assert roles(tmp_path) == {"train": [tmp_path]}


def test_clocks_of_their_own_become_the_slowest(tmp_path: Path) -> None:
    slow = T[::5] + 0.003
    put(tmp_path / "pressure_bar.csv", {"time_s": T, "value": 5 * T})
    put(tmp_path / "displacement_mm.csv", {"time_ms": 1000 * slow, "value": slow})
    with pytest.warns(DataWarning, match=r"displacement 10, pressure 50.*'displacement'"):
        recording = one(tmp_path)
    assert recording.sample_time == pytest.approx(0.1)
    assert recording.time == pytest.approx(slow)
    assert recording["pressure"] == pytest.approx(5 * slow)
    assert recording["displacement"] == pytest.approx(slow)
    with pytest.warns(DataWarning, match="100"):
        assert one(tmp_path, rate=100).sample_time == pytest.approx(0.01)


def test_a_gap_of_the_faster_channel_is_not_bridged_unasked(tmp_path: Path) -> None:
    kept = np.delete(np.arange(N), np.arange(20, 40))
    put(tmp_path / "pressure_bar.csv", {"time_s": T[kept], "value": P[kept]})
    put(tmp_path / "displacement_mm.csv", {"time_s": T[::2], "value": X[::2]})
    with pytest.warns(DataWarning), pytest.raises(DataError, match="10 of 30") as caught:
        mckibben.read(tmp_path)
    assert (caught.value.channel, caught.value.row) == ("pressure", 11)
    with (
        pytest.warns(DataWarning, match="displacement 25, pressure 50"),
        pytest.warns(DataWarning, match=": 10 "),
    ):
        assert one(tmp_path, gaps="interpolate").n_samples == 30


@pytest.mark.parametrize(
    "headers",
    [
        {"a": "q", "b": "r"},
        {"1_pressure": "value", "1_stroke": "value", "2_pressure": "value"},
    ],
)
def test_what_cannot_be_told_is_asked(tmp_path: Path, headers: dict[str, str]) -> None:
    for name, header in headers.items():
        put(tmp_path / f"{name}.csv", {"time_s": T, header: P})
    with pytest.raises(DataError, match=r"join = \["):
        mckibben.read(tmp_path)
    with pytest.raises(DataError, match=r"join = \["):
        roles(tmp_path)


def test_join_tells_which_belong_together(tmp_path: Path) -> None:
    for run in (1, 2):
        put(tmp_path / f"{run}_pressure.csv", {"time_s": T, "value [bar]": run * P})
        put(tmp_path / f"{run}_stroke.csv", {"time_s": T, "value [mm]": X})
    (tmp_path / NAME).write_text('[[files]]\njoin = ["*_pressure.csv", "*_stroke.csv"]\n')
    first, second = mckibben.read(tmp_path)
    assert second["pressure"].tolist() == (2 * first["pressure"]).tolist()
    assert second["displacement"].tolist() == X.tolist()
    assert one(tmp_path / "2_pressure.csv") == second
    assert roles(tmp_path)["train"] == [tmp_path / "1_pressure.csv", tmp_path / "2_pressure.csv"]


def test_nothing_that_is_read_with_a_path_is_written_to(tmp_path: Path) -> None:
    from mckibben.outputs import claim, never

    put(tmp_path / "a_u.csv", {"time_s": T, "value": P})
    put(tmp_path / "a_y.csv", {"time_s": T, "value": X})
    (tmp_path / NAME).write_text('[[files]]\njoin = ["*_u.csv", "*_y.csv"]\n')
    for read in (tmp_path, tmp_path / "a_u.csv"):
        for written in ("a_y.csv", NAME):
            with pytest.raises(DataError, match="it is read from"):
                claim(tmp_path / written, never, inputs=[read], force=True)
        claim(tmp_path / "new.csv", never, inputs=[read])


@pytest.mark.filterwarnings("ignore::mckibben.DataWarning")
@pytest.mark.parametrize(
    ("columns", "channel", "row"),
    [
        ({"value": X}, "time", None),
        ({"time_s": T, "t": T, "value": X}, "time", None),
        ({"time_s": T + 100, "value": X}, "pressure", None),
        ({"time_s": T[::-1], "value": X}, "time", 3),
        ({"time_s": T, "value": [*X[:5], np.nan, *X[6:]]}, "displacement", 7),
    ],
)
def test_bad_files_of_signals(tmp_path: Path, columns: Any, channel: str, row: int | None) -> None:
    put(tmp_path / "pressure.csv", {"time_s": T, "value": P})
    put(tmp_path / "displacement.csv", columns)
    with pytest.raises(DataError) as caught:
        mckibben.read(tmp_path)
    assert (caught.value.channel, caught.value.row) == (channel, row)
    assert tmp_path in (caught.value.file, getattr(caught.value.file, "parent", None))
    assert caught.value.remedy


def test_a_part_that_is_missing_or_no_signal_or_shorter(tmp_path: Path) -> None:
    (tmp_path / NAME).write_text('[[files]]\njoin = ["a.csv", "b.csv"]\n')
    put(tmp_path / "a.csv", {"time_s": T, "pressure_bar": P})
    with pytest.raises(DataError, match=r"b\.csv") as caught:
        mckibben.read(tmp_path)
    assert caught.value.file == tmp_path / "b.csv"
    put(tmp_path / "b.csv", {"time_s": T, "force_N": P, "displacement_mm": X})
    with pytest.raises(DataError, match=r"b\.csv.* 2 "):
        mckibben.read(tmp_path / "a.csv")
    for name in "ab":
        put(tmp_path / f"{name}.csv", {"value": P[: 60 - ord(name) % 2]})
    with pytest.raises(DataError, match=r"a.csv 59, b.csv 60"):
        mckibben.read(tmp_path)
