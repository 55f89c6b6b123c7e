"""The workspace keeps whole files, under safe names, inside its folder."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from mckibben import DataError, Recording
from mckibben.app.kept import Step
from mckibben.app.workspace import Workspace
from mckibben.registry import load

HOSTILE = [
    "../../etc/passwd",
    "..",
    "/etc/passwd",
    "a/b",
    "a\\b",
    "..\\..\\x",
    ".hidden",
    "",
    "nul\0byte",
    "a\nb",
    "<script>alert(1)</script>",
    "x" * 500,
    "ü漢字",
    "con.json/..",
]


def recording(n: int = 50) -> Recording:
    t = np.arange(n) * 0.1
    return Recording({"pressure": 2 + np.sin(t), "displacement": 10 + np.cos(t)}, 0.1)


def inside(workspace: Workspace, path: Path) -> bool:
    return workspace.folder in path.resolve().parents


@pytest.mark.parametrize("name", HOSTILE)
def test_no_name_leaves_the_folder(name: str, tmp_path: Path) -> None:
    workspace = Workspace(tmp_path / "ws")
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(DataError, match="cannot be a name here"):
        workspace.path("models", name)
    chosen = workspace.new_name("models", name)
    assert inside(workspace, workspace.path("models", f"{chosen}.json"))
    workspace.give_back("models", chosen)
    kept = workspace.keep_upload(f"{name}.csv", b"a,b\n1,2\n")
    assert inside(workspace, kept)
    assert kept.parent.name == "uploads"
    assert [path for path in sorted(tmp_path.rglob("*")) if path not in before] == [kept]


def test_recordings_come_back_as_they_were(tmp_path: Path) -> None:
    workspace = Workspace(tmp_path / "ws")
    given = recording()
    entry = workspace.add(given, origin="a test", call="read(...)", role="test", name="run 1")
    assert (entry.name, entry.role) == ("run-1", "test")
    again = Workspace(tmp_path / "ws").recording("run-1")
    for channel in given.channels:
        np.testing.assert_array_equal(again[channel], given[channel])


def test_long_recordings_are_kept_as_parquet(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("mckibben.app.recordings.LONG", 20)
    entry = Workspace(tmp_path).add(recording(), origin="", call="")
    assert entry.path.suffix == ".parquet"


def test_names_that_repeat_are_numbered(tmp_path: Path) -> None:
    workspace = Workspace(tmp_path)
    names = [workspace.add(recording(), origin="", call="", name="run").name for _ in range(3)]
    assert names == ["run", "run-2", "run-3"]


def test_roles_and_removal(tmp_path: Path) -> None:
    workspace = Workspace(tmp_path)
    workspace.add(recording(), origin="", call="", name="run")
    assert len(workspace.with_role("train")) == 1
    workspace.set_role("run", "unused")
    assert workspace.with_role("train") == []
    assert workspace.channels() == []
    workspace.remove("run")
    assert workspace.entries() == []
    assert workspace.undo() == "remove run"
    assert [entry.role for entry in workspace.entries()] == ["unused"]


def test_damaged_files_are_passed_over(tmp_path: Path) -> None:
    workspace = Workspace(tmp_path)
    workspace.add(recording(), origin="", call="", name="good")
    load("blocks", "pi").example().save(workspace.path("models", "pi.json"))
    for text in ("", "{", "[]", '{"role": "admin"}', '{"role": "train", "file": "../../x"}'):
        (tmp_path / "recordings" / "bad.json").write_text(text)
        (tmp_path / "models" / "bad.json").write_text(text)
        (tmp_path / "results" / "bad.json").write_text(text)
        assert [entry.name for entry in workspace.entries()] == ["good"]
        assert workspace.models() == ["pi"]
        assert workspace.results() == []


def test_uploads_are_bounded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    workspace = Workspace(tmp_path)
    monkeypatch.setattr("mckibben.app.recordings.LARGEST_UPLOAD", 100)
    with pytest.raises(DataError, match="more than"):
        workspace.keep_upload("big.csv", b"x" * 101)
    with pytest.raises(DataError, match="is empty"):
        workspace.keep_upload("none.csv", b"")
    assert not list((tmp_path / "uploads").iterdir())


def test_the_log_survives_a_line_cut_short(tmp_path: Path) -> None:
    workspace = Workspace(tmp_path)
    workspace.log("first", "call()")
    with (tmp_path / "log.jsonl").open("a") as file:
        file.write('{"time": "2026')
    assert [entry["did"] for entry in workspace.logged()] == ["first"]


def test_a_place_that_cannot_be_a_workspace_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(DataError, match="cannot be a workspace"):
        Workspace(tmp_path / "file")


def test_results_are_in_the_order_of_the_choice(tmp_path: Path) -> None:
    workspace = Workspace(tmp_path)
    for name, tested, validated in (("a", 2.0, 0.2), ("b", 1.0, 0.3), ("d", 0.1, None)):
        content = {"status": "ok", "test": {"rmse": tested}, "validation_rmse": validated}
        workspace.write_json("results", name, content)
    workspace.write_json("results", "c", {"status": "failed"})
    assert [row["name"] for row in workspace.results()] == ["a", "b", "d"]
    assert json.loads((tmp_path / "results" / "a.json").read_text())["test"]["rmse"] == 2.0


def test_models_of_recordings_changed_since_are_not_ranked_with_the_others(tmp_path: Path) -> None:
    workspace = Workspace(tmp_path)
    for name in ("one", "two"):
        workspace.add(recording(), origin="", call="", name=name)
    before = workspace.data()
    for name, validated in (("a", 0.2), ("b", 0.3)):
        content = {"status": "ok", "validation_rmse": validated, "data": before}
        workspace.write_json("results", name, content)
    workspace.rename("two", "three")
    assert workspace.data() == before
    assert all(row["current"] for row in workspace.results())
    for change in (
        lambda: workspace.set_role("one", "test"),
        lambda: workspace.edit("three", "cut", [Step(do="slice", start=0, stop=20)]),
        lambda: workspace.remove("one"),
    ):
        change()
        assert workspace.data() != before
        content = {"status": "ok", "validation_rmse": 0.9, "data": workspace.data()}
        workspace.write_json("results", "c", content)
        found = [(row["name"], row["current"]) for row in workspace.results()]
        assert found == [("c", True), ("a", False), ("b", False)]
        workspace.undo()
        assert workspace.data() == before


def test_notes_of_reading_stay_with_a_recording(tmp_path: Path) -> None:
    workspace = Workspace(tmp_path)
    given = recording().with_meta(notes=["the step was assumed"])
    assert workspace.add(given, origin="", call="", name="run").notes == ("the step was assumed",)
    workspace.set_role("run", "test")
    assert Workspace(tmp_path).entry("run").notes == ("the step was assumed",)
