"""JSON as programs write it: records, columns, messages, pandas' layouts."""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import mckibben
from mckibben.blocks.hysteresis.play_operators import Play
from tests.files.made import columns, one, place, put, refused, table

K = np.arange(40)
T = (K / 50).round(6)
P = (100 + 50 * np.sin(K / 6)).round(6)
X = (2 * np.cos(K / 6)).round(6)
NAMED: dict[str, list[float]] = {"t_s": [*T], "p_kPa": [*P], "pos_cm": [*X]}
RECORDS = [dict(zip(NAMED, row, strict=True)) for row in zip(T, P, X, strict=True)]


def check(path: Path, **options: Any) -> None:
    recording = one(path, **options)
    assert recording.sample_time == pytest.approx(0.02)
    assert recording["pressure"] == pytest.approx(P / 100)
    assert recording["displacement"] == pytest.approx(10 * X)


def lines(path: Path, values: Sequence[object]) -> Path:
    path.write_text("".join(json.dumps(value) + "\n" for value in values))
    return path


CONTENTS: dict[str, Any] = {
    "columns": NAMED,
    "records": RECORDS,
    "in a group": {"meta": {"muscle": "a", "gains": [1, 2]}, "run": NAMED},
    "units beside": {"units": {"p": "kPa", "pos": "cm"}, "fs": 50, "p": [*P], "pos": [*X]},
    "a signal each": {
        "time": [*T], "pressure": {"unit": "kPa", "values": [*P]}, "pos": {"unit": "cm", "y": [*X]}},
    "rows under names": [[*NAMED], *zip(T, P, X, strict=True)],
    "fields in fields": [
        {"t_s": t, "p": {"value": p, "unit": "kPa"}, "pos": {"value": x, "unit": "cm"}}
        for t, p, x in zip(T, P, X, strict=True)],
    "numbers as texts": [
        {"t_s": str(t), "p": f"{p} kPa", "pos_cm": str(x)} for t, p, x in zip(T, P, X, strict=True)],
    "dates": [
        {"when": f"2026-01-31T12:00:{t:09.6f}Z", "p_kPa": p, "pos_cm": x}
        for t, p, x in zip(T, P, X, strict=True)],
}  # fmt: skip


@pytest.mark.parametrize("content", CONTENTS)
def test_what_programs_write(tmp_path: Path, content: str) -> None:
    (tmp_path / "a.json").write_text(json.dumps(CONTENTS[content], indent=1))
    check(tmp_path / "a.json")
    assert not table(tmp_path / "a.json").unread or content == "in a group"


FRAMES: dict[str, Callable[[pd.DataFrame], pd.DataFrame]] = {
    "plain": lambda frame: frame,
    "dates": lambda frame: frame.drop(columns="t_s").set_axis(
        pd.date_range("2026-01-31", periods=40, freq="20ms")
    ),
}


@pytest.mark.parametrize("index", FRAMES)
@pytest.mark.parametrize("orient", ["columns", "split", "records", "index"])
def test_layouts_of_pandas(tmp_path: Path, orient: Any, index: str) -> None:
    frame = FRAMES[index](pd.DataFrame(NAMED))
    if orient == "records":
        frame = frame if index == "plain" else frame.reset_index(names="time")
        frame.to_json(tmp_path / "a.jsonl", orient=orient, lines=True, date_format="iso")
        check(tmp_path / "a.jsonl")
    dates: list[Any] = ["iso", "epoch"]
    for date in dates:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # that dates since 1970 will not be written for long
            frame.to_json(tmp_path / "a.json", orient=orient, date_format=date)
        check(tmp_path / "a.json")


def test_a_matrix_has_numbered_columns_and_an_index_that_is_no_count_is_kept(
    tmp_path: Path,
) -> None:
    path = tmp_path / "a.json"
    path.write_text(json.dumps([*zip(T, P, X, strict=True)]))
    assert list(columns(path)) == ["data[1]", "data[2]", "data[3]"]
    pd.DataFrame(NAMED).set_index("t_s").to_json(path)
    check(path, columns={"time": "index"})


MESSAGES: dict[str, Callable[[str, float, float], Mapping[str, Any]]] = {
    "a field each": lambda name, t, value: {"timestamp": t, name: value},
    "a name each": lambda name, t, value: {"timestamp": t, "topic": name, "value": value},
    "a unit each": lambda name, t, value: {
        "timestamp": t, "sensor": name[:-4], "v": value, "unit": name[-3:-1]},
}  # fmt: skip
STAMPS: dict[str, Callable[[float], object]] = {
    "seconds": lambda t: t,
    "since 1970": lambda t: 1_767_225_600_000 + round(1000 * t),
    "dates": lambda t: f"2026-01-31T12:00:{t:09.6f}",
}


@pytest.mark.parametrize("stamp", STAMPS)
@pytest.mark.parametrize("form", MESSAGES)
def test_messages_of_one_signal_each_have_their_own_times(
    tmp_path: Path, form: str, stamp: str
) -> None:
    late = np.arange(0.004, 0.8, 0.04)
    sent = [("pressure (mm)", t, v) for t, v in zip(T, T, strict=True)]
    sent += [("position (cm)", t, v) for t, v in zip(late, late, strict=True)]
    messages = [
        MESSAGES[form](name.replace("(mm", "(Pa"), STAMPS[stamp](t), v)  # type: ignore[arg-type]
        for name, t, v in sorted(sent, key=lambda message: message[1])
    ]
    recording = one(lines(tmp_path / "a.ndjson", messages))
    assert recording.sample_time == pytest.approx(0.04, rel=1e-6)
    # both are the time, in other units: interpolation of a line is as exact as times since 1970
    assert recording["pressure"] * 1e5 == pytest.approx(recording["displacement"] / 10, abs=1e-6)
    assert recording["displacement"] == pytest.approx(10 * late)


def test_rows_of_a_text_table_that_each_have_one_signal_are_messages(tmp_path: Path) -> None:
    cells = [[str(k / 7) if k % 2 == odd else "" for k in K] for odd in (0, 1)]
    path = put(tmp_path / "a.csv", "t_s,p_bar,pos_mm", T, *cells)
    recording = one(path)
    assert recording.sample_time == pytest.approx(0.04)
    assert recording["pressure"] == pytest.approx(recording["displacement"], abs=1e-9)


def test_missing_samples_are_no_messages(tmp_path: Path) -> None:
    records: list[dict[str, Any]] = [dict(each) for each in RECORDS]
    del records[7]["p_kPa"]
    records[9]["p_kPa"] = None
    path = lines(tmp_path / "a.jsonl", records)
    assert place(path) == ("pressure", 8)
    assert len(one(path, gaps="interpolate")) == 40


def test_a_first_line_about_the_others_has_their_units(tmp_path: Path) -> None:
    records = [{"t_s": t, "p": p, "pos": x} for t, p, x in zip(T, P, X, strict=True)]
    head = {"rig": "a", "rest_length": 200.0, "units": {"p": "kPa", "pos": "cm"}}
    path = lines(tmp_path / "a.jsonl", [head, *records])
    check(path)


@pytest.mark.parametrize("name", ["a.jsonl", "a.json"])
def test_what_is_no_json_is_refused_by_its_line(tmp_path: Path, name: str) -> None:
    path = lines(tmp_path / name, RECORDS)
    check(path)  # whatever the ending
    text = path.read_text()
    path.write_text(text + '{"t_s": 0.8, "p_k')
    assert refused(path).row == 41
    path.write_text(text.replace("}\n", ",}\n", 1))
    assert refused(path).row == 1
    path.write_text('{"a": [1, 2],\n "b": [3, 4]\n "c": []}')
    assert refused(path).row == 3


@pytest.mark.parametrize(
    "text",
    ["", "1", "[]", "{}", '"a"', "null", "[[]]", '[{"a": 1}, 2]', '{"a": {}, "a": {}}', "[1e999]",
     '[{"p": 1}, {"p": [1]}]', "[" * 9999, '{"x": 1' + "0" * 5000 + "}", '[[1, 2], [3]]',
     '{"columns": ["a"], "data": [[1, 2]]}', '{"columns": [[]], "data": [1]}', "\0\1\2"],
)  # fmt: skip
def test_other_json_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "a.json").write_text(text)
    assert refused(tmp_path / "a.json").file == tmp_path / "a.json"


def test_what_this_package_writes_is_no_recording(tmp_path: Path) -> None:
    model, run = tmp_path / "model.json", tmp_path / "run.csv"
    Play(threshold=0.5).save(model)
    put(run, ",".join(NAMED), *NAMED.values())
    mckibben.write(one(run), run)
    for path in (model, Path(f"{run}-metadata.json")):
        assert "saved" in refused(path).problem
    assert len(mckibben.read(tmp_path)) == 1  # and not sought in folders
