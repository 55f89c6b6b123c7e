"""The workspace keeps whole files, under safe names, inside its folder."""

from __future__ import annotations

import json
import os
import stat
import unicodedata
from collections.abc import Callable
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mckibben import DataError, Recording, write
from mckibben.app import undoing
from mckibben.app.door import door
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
    with pytest.raises(DataError):
        workspace.path("models", name)
    chosen = workspace.new_name("models", name)
    assert inside(workspace, workspace.path("models", f"{chosen}.json"))
    workspace.give_back("models", chosen)
    kept = workspace.keep_upload(f"{name}.csv", b"a,b\n1,2\n")
    assert inside(workspace, kept)
    assert kept.parent.name == "uploads"
    assert [path for path in sorted(tmp_path.rglob("*")) if path not in before] == [kept]


def test_recordings_come_back_as_they_were(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    workspace = Workspace(tmp_path / "ws")
    given = recording()
    entry = workspace.add(given, origin="a test", call="read(...)", role="test", name="run 1")
    assert (entry.name, entry.role) == ("run-1", "test")
    assert [workspace.add(given, origin="", call="", name="run 1").name for _ in range(2)] == [
        "run-1-2",
        "run-1-3",
    ]
    again = Workspace(tmp_path / "ws").recording("run-1")
    for channel in given.channels:
        np.testing.assert_array_equal(again[channel], given[channel])
    monkeypatch.setattr("mckibben.app.recordings.LONG", 20)
    assert workspace.add(given, origin="", call="").path.suffix == ".parquet"


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
    workspace.log("first", "call()")
    with (tmp_path / "log.jsonl").open("a") as file:
        file.write('{"time": "2026')
    assert workspace.logged()[-1]["did"] == "first"


def test_uploads_are_bounded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    workspace = Workspace(tmp_path)
    monkeypatch.setattr("mckibben.app.recordings.LARGEST_UPLOAD", 100)
    for content in (b"x" * 101, b""):
        with pytest.raises(DataError):
            workspace.keep_upload("some.csv", content)
    assert not list((tmp_path / "uploads").iterdir())


def test_a_place_that_cannot_be_a_workspace_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(DataError, match="file"):
        Workspace(tmp_path / "file")


def test_results_are_in_the_order_of_the_choice_and_damaged_ones_are_none(tmp_path: Path) -> None:
    workspace = Workspace(tmp_path)
    for name, status, content in (
        ("a", "ok", {"test": {"rmse": 2.0}, "validation_rmse": 0.2}),
        ("b", "ok", {"test": {"rmse": 1.0}, "validation_rmse": 0.3}),
        ("c", "failed", {}),
        ("d", "ok", {"test": {"rmse": 0.1}}),
        ("e", "ok", {"validation_rmse": -5.0}),
        ("f", "ok", {"test": {"rmse": -5.0}}),
        ("g", "ok", {"train": {"max_error": -1.0}}),
    ):
        workspace.write_json("results", name, {"status": status} | content)
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


@pytest.mark.parametrize(
    ("wish", "name"),
    [
        ("ünïcode", "ünïcode"),
        (unicodedata.normalize("NFD", "ü漢字 1"), "ü漢字-1"),
        ("con", "recording-con"),
        ("Lpt1", "recording-Lpt1"),
        ("console", "console"),
    ],
)
def test_names_keep_letters_of_any_script(wish: str, name: str, tmp_path: Path) -> None:
    workspace = Workspace(tmp_path)
    assert workspace.add(recording(), origin="", call="", name=wish).name == name
    assert [entry.name for entry in workspace.entries()] == [name]
    assert len(workspace.recording(name)) == 50
    assert workspace.keep_upload("a%22quote's%0A.csv", b"1").name == "a-quote-s.csv"


def test_files_of_a_person_stay_as_they_are(tmp_path: Path) -> None:
    (tmp_path / "models" / "sub").mkdir(parents=True)
    (tmp_path / "results").mkdir()
    own = [
        tmp_path / place
        for place in (
            "models/__init__.py",
            "models/weights.bin.part",
            "models/sub/a.json",
            "results/.gitkeep",
        )
    ]
    for path in own:
        path.write_text("")
    deep = [tmp_path / "models" / "sub", own[2]]
    for path in deep:
        path.chmod(0o755)
    ours = [tmp_path / "models" / ".mckibben-0123.part", tmp_path / "models" / "taken.json"]
    ours[0].write_text("half")
    ours[1].write_text("")
    assert Workspace(tmp_path).claim()
    assert all(path.exists() for path in own)
    assert not any(path.exists() for path in ours)
    if os.name == "posix":
        assert {stat.S_IMODE(path.stat().st_mode) for path in deep} == {0o755}


# -- changes as a whole ----------------------------------------------------------------------

CHANGES: list[Callable[[Workspace], Any]] = [
    lambda workspace: workspace.rename("a", "b"),
    lambda workspace: workspace.remove("a"),
    lambda workspace: workspace.set_role(["a", "keep"], "test"),
    lambda workspace: workspace.edit(
        "a", "split", *([Step(do="slice", start=k, stop=k + 25)] for k in (0, 25))
    ),
    lambda workspace: workspace.undo(),
]


def filled(folder: Path) -> Workspace:
    workspace = Workspace(folder)
    for name in ("a", "c", "keep"):
        workspace.add(recording(), origin="", call="", name=name)
    workspace.rename("c", "d")
    return workspace


def standing(folder: Path) -> list[Any]:
    workspace = Workspace(folder)
    return [entry.content() | {"name": entry.name} for entry in workspace.entries()]


class Killed(BaseException):
    """The end of a process."""


def kill(patch: pytest.MonkeyPatch, after: int) -> None:
    """End the process after it has renamed and removed so many files."""
    left = [after]

    def counted(of: Callable[..., Any]) -> Callable[..., Any]:
        def act(*given: Any, **more: Any) -> Any:
            left[0] -= 1
            if left[0] < 0:
                raise Killed
            return of(*given, **more)

        return act

    for way in ("replace", "unlink"):
        patch.setattr(Path, way, counted(getattr(Path, way)))


@pytest.mark.parametrize("change", CHANGES)
def test_a_process_killed_at_any_moment_of_a_change_loses_nothing(
    change: Callable[[Workspace], Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = standing(filled(tmp_path / "whole").folder)
    change(Workspace(tmp_path / "whole"))
    after = standing(tmp_path / "whole")
    for moment in count():
        folder = tmp_path / str(moment)
        workspace = filled(folder)
        with monkeypatch.context() as patch:
            kill(patch, moment)
            try:
                change(workspace)
            except Killed:
                pass
            else:
                break
        names = {each["name"] for each in standing(folder)}
        kept = {each["name"] for each in before} & {each["name"] for each in after}
        assert kept <= names
        assert names & {"a", "b"} or workspace.history()[0] == "remove a"
        again = Workspace(folder)
        assert again.claim()
        assert standing(folder) in (before, after)
        while again.undo():
            pass
        assert {e.name: len(again.recording(e.name)) for e in again.entries()} == dict.fromkeys(
            ("a", "c", "keep"), 50
        )
    assert moment > 3


@pytest.mark.parametrize("change", CHANGES)
def test_on_a_full_disk_a_change_is_not_begun(
    change: Callable[[Workspace], Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    workspace = filled(tmp_path)
    before, history = standing(tmp_path), workspace.history()
    files = sorted((tmp_path / "recordings").iterdir())
    writing, room = Path.write_text, undoing._text(workspace._history())

    def full(path: Path, text: str, *given: Any, **more: Any) -> int:
        if text.startswith(room[:8]):  # the history is what has no room
            raise OSError(28, "No space left on device")
        return writing(path, text, *given, **more)

    monkeypatch.setattr(Path, "write_text", full)
    with pytest.raises(DataError):
        change(workspace)
    monkeypatch.undo()
    assert standing(tmp_path) == before
    assert workspace.history() == history
    assert sorted((tmp_path / "recordings").iterdir()) == files


def test_undoing_overwrites_no_recording_that_came_meanwhile(tmp_path: Path) -> None:
    workspace = filled(tmp_path)
    new = workspace.add(recording(30), origin="a rig", call="", name="c")
    assert new.name == "c"
    with pytest.raises(DataError):
        workspace.undo()
    assert (len(workspace.recording("c")), len(workspace.recording("d"))) == (30, 50)


# -- what is on the disk ---------------------------------------------------------------------


def test_results_know_when_samples_change_on_the_disk(tmp_path: Path) -> None:
    workspace = filled(tmp_path)
    before = workspace.data()
    path = workspace.entry("a").path
    os.utime(path, (0, 0))  # as a copy of the folder
    assert workspace.data() == Workspace(tmp_path).data() == before
    other = recording()
    write(other.with_channels({}, pressure=other["pressure"] + 0.01), path)
    assert workspace.data() != before


def test_a_recording_without_samples_is_listed(tmp_path: Path) -> None:
    workspace = filled(tmp_path)
    before = workspace.data()
    workspace.entry("a").path.unlink()
    assert "a" in [entry.name for entry in workspace.entries()]
    assert workspace.data() != before
    assert list(workspace.used()) == ["d", "keep"]
    with pytest.raises(DataError, match=r"a\.csv"):
        workspace.with_role("train")
    workspace.remove("a")
    assert len(workspace.with_role("train")) == 2


def test_the_page_that_leads_in_goes_with_the_workbench(tmp_path: Path) -> None:
    folder = tmp_path / "<script>alert(1)<"
    folder.mkdir()
    address = "http://127.0.0.1:8750/a-token/"
    with door(folder, 8750, address) as page:
        assert page is not None
        text = page.read_text()
        assert address in text
        assert "<script>alert" not in text
    assert not page.exists()
    (folder / ".open-8750.html").write_text("of a workbench that was killed")
    assert Workspace(folder).claim()
    assert not list(folder.glob(".open-*"))
