"""How a file is read can be changed later, and what is done to a recording is taken back."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mckibben
from mckibben import DataError, DataWarning, Recording, read
from mckibben.app import adding, edits, scripts
from mckibben.app import reading as app_reading
from mckibben.app.desk import Desk
from mckibben.app.jobs import Jobs
from mckibben.app.kept import Reading, Step
from mckibben.app.pages import editing
from mckibben.app.reading import columns, read_upload
from mckibben.app.workspace import Workspace
from mckibben.errors import TooLargeError
from mckibben.files import formats

pytestmark = pytest.mark.filterwarnings("ignore::mckibben.DataWarning")

TABLE = "level,p_kPa,displacement_mm,branch\n" + "\n".join(
    f"{k % 20},{300 + max(k % 40 - 20, 0)},{k % 7 - 1},up" for k in range(60)
)


def taken(workspace: Workspace, reading: Reading | None = None) -> Recording:
    path = workspace.keep_upload("rig.csv", TABLE.encode())
    (recording,) = read_upload(path, reading or Reading())
    workspace.add(recording, origin="file rig.csv", call="", name="rig", upload=path.name)
    return recording


def repeated(workspace: Workspace) -> Recording:
    """Return the training recording that the script reads."""
    (line, *_) = scripts._reads(workspace, "train")
    found: Recording = eval(line, {"mckibben": mckibben})
    return found


def again(workspace: Workspace, reading: Reading, name: str = "rig") -> Recording:
    """Read a file otherwise."""
    path = workspace.path("uploads", workspace.entry(name).upload)
    workspace.read_again({name: (read_upload(path, reading), "")}, reading)
    return Workspace(workspace.folder).recording(name)


def test_columns_are_recognised(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "rig.csv"
    path.write_text(TABLE)
    found = {one.header: (one.channel, one.unit) for one in columns(path, Reading())}
    assert found["p_kPa"] == ("pressure", "kPa")
    assert found["branch"][0] == ""
    assert [c.channel for c in columns(path, Reading(channels=["pressure"]))].count("") == 3
    (level, *_) = columns(path, Reading(columns={"force": "level"}, channels=["force"]))
    assert (level.channel, level.unasked) == ("force", "level")
    monkeypatch.setattr(app_reading, "MOST_CELLS", 20)
    with pytest.raises(TooLargeError, match="20"):
        read_upload(path)


def test_a_file_is_read_otherwise_and_steps_are_done_anew(tmp_path: Path) -> None:
    workspace = Workspace(tmp_path)
    first = taken(workspace)
    assert first.sample_time is None
    workspace.edit("rig", "cut", [Step(do="slice", start=10, stop=30)])
    reading = Reading(
        rate=10.0,
        calibration={"displacement": (-1.0, 2.0)},
        channels=["pressure", "displacement"],
    )
    found = again(workspace, reading)
    assert found.sample_time == 0.1
    assert list(found.channels) == ["pressure", "displacement"]
    np.testing.assert_allclose(found["displacement"], 2 - first["displacement"][10:30])
    assert repeated(workspace)["displacement"].tolist() == found["displacement"].tolist()
    assert workspace.undo()
    assert workspace.recording("rig").sample_time is None


def test_steps_follow_their_channels_to_other_names(tmp_path: Path) -> None:
    workspace = Workspace(tmp_path)
    taken(workspace)
    both = ["pressure", "displacement"]
    steps = [Step(do="zero", channels=["displacement"], over="pressure")]
    steps += [Step(do="detrend", channels=["pressure"]), Step(do="detrend", channels=both)]
    workspace.edit("rig", "steps", steps)
    before = workspace.recording("rig")
    swapped = Reading(
        columns={"pressure": "displacement_mm", "push": "p_kPa"}, units={"pressure": "bar"}
    )
    renamed = Reading(columns={"push": "p_kPa"})
    for reading, now in ((renamed, "displacement"), (swapped, "pressure")):
        after, entry = again(workspace, reading), workspace.entry("rig")
        assert [step.channels for step in entry.steps] == [[now], ["push"], ["push", now]]
        assert entry.steps[0].over == "push"
        np.testing.assert_array_equal(after["push"], before["pressure"])
        np.testing.assert_array_equal(after[now], before["displacement"])
        assert repeated(workspace)["push"].tolist() == after["push"].tolist()
        assert workspace.undo()
    again(workspace, Reading(channels=["displacement", "level"]))
    assert [step.channels for step in workspace.entry("rig").steps] == [["displacement"]]


def test_everything_is_undone_and_done_again(tmp_path: Path) -> None:
    workspace = Workspace(tmp_path)
    whole = taken(workspace)
    pieces = [[Step(do="slice", start=0, stop=20)], [Step(do="slice", start=20, stop=60)]]
    assert workspace.edit("rig", "split", *pieces) == ["rig", "rig-2"]
    workspace.set_role(["rig", "rig-2"], "test")
    assert workspace.rename("rig", "<b>'a'\n") == "b-a"
    workspace.remove("b-a", "rig-2")
    workspace = Workspace(tmp_path)  # also after a new start
    undone = 0
    while workspace.undo():
        undone += 1
    assert undone == 4
    assert [entry.name for entry in workspace.entries()] == ["rig"]
    np.testing.assert_array_equal(workspace.recording("rig")["pressure"], whole["pressure"])
    while workspace.redo():
        undone -= 1
    assert undone == 0
    assert workspace.entries() == []


def test_a_part_keeps_its_time_when_an_earlier_step_is_taken_back(tmp_path: Path) -> None:
    workspace = Workspace(tmp_path / "ws")
    name = workspace.add_example()[0]
    cut = Step(do="slice", start=100, stop=150)
    for before, ends in (
        (Step(do="resample", sample_time=0.1), (10.0, 14.9)),
        (Step(do="slice", start=1000, stop=2000), (22.0, 22.98)),
    ):
        workspace.edit(name, "cut", [before, cut])
        time = workspace.recording(name).time
        assert (time[0], time[-1]) == pytest.approx(ends)
        left = workspace.take_back(name, "back", [before, cut], 0)
        time = workspace.recording(name).time
        assert (time[0], time[-1]) == pytest.approx(ends)
        assert workspace.entry(name).steps == left
    with pytest.raises(DataError, match=name):
        workspace.take_back(name, "back", [cut], 0)
    assert workspace.take_back(name, "back", left, 0) == ()
    assert workspace.recording(name).time[0] == 0.0


def test_what_is_changed_during_an_edit_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    workspace = Workspace(tmp_path / "ws")
    workspace.add_example()
    name, other = (entry.name for entry in workspace.entries())
    applied = edits.applied
    meanwhile: list[Callable[[], object]] = []

    def slow(*given: Any) -> Recording:
        meanwhile.pop()()
        return applied(*given)

    monkeypatch.setattr(edits, "applied", slow)
    step = Step(do="low_pass", cutoff=2.0)
    meanwhile[:] = [lambda: workspace.set_role(name, "unused")]
    workspace.edit(name, "filter", [step])
    assert (workspace.entry(name).role, workspace.entry(name).steps) == ("unused", (step,))
    files = set((tmp_path / "ws" / "recordings").glob("*.csv"))
    for change in (
        lambda: workspace.remove(name),
        lambda: workspace.rename(name, "renamed"),
    ):
        meanwhile[:] = [change]
        with pytest.raises(DataError, match="filter again"):
            workspace.edit_each([name], "filter again", step)
        assert name not in [entry.name for entry in workspace.entries()]
        workspace.undo()
        assert workspace.entry(name).steps == (step,)
    left = set((tmp_path / "ws" / "recordings").glob("*.csv"))
    assert {path.stem for path in left - files} <= {"renamed"}
    assert workspace.entry(other).steps == ()


def test_a_part_of_what_is_not_there_any_more_is_not_cut(tmp_path: Path) -> None:
    workspace = Workspace(tmp_path)
    taken(workspace)
    desk, first = Desk(workspace, Jobs(workspace)), Step(do="slice", start=10, stop=30)

    async def cut() -> None:
        await editing.do(desk, "rig", first, seen=())
        with pytest.raises(DataError):
            await editing.do(desk, "rig", first, seen=())

    asyncio.run(cut())
    assert workspace.entry("rig").steps == (first,)
    assert len(workspace.recording("rig")) == 20


def test_files_of_one_channel_each_are_joined(tmp_path: Path) -> None:
    workspace = Workspace(tmp_path / "ws")
    desk = Desk(workspace, Jobs(workspace))
    rng = np.random.default_rng(0)
    sent: dict[str, Recording] = {}
    for name, channel, n in (("u1", "force", 40), ("u2", "force", 30), ("y1", "displacement", 40)):
        sent[name] = Recording({channel: rng.normal(size=n)}, 0.1)
        workspace.add(sent[name], origin="", call="", name=name)
    assert adding.pairs(workspace) == [("u1", "y1")]
    sent["y2"] = Recording({"displacement": rng.normal(size=30)}, 0.1)
    workspace.add(sent["y2"], origin="", call="", name="y2", role="test")
    workspace.set_role("u2", "test")
    pairs = adding.pairs(workspace)
    assert pairs == [("u1", "y1"), ("u2", "y2")]
    for pair in pairs:
        adding.join(desk, pair)
    assert [(e.name, e.role) for e in workspace.entries()] == [
        ("u1-y1", "train"),
        ("u2-y2", "test"),
    ]
    whole = workspace.recording("u1-y1")
    assert np.allclose(whole["force"], sent["u1"]["force"])
    assert np.allclose(whole["displacement"], sent["y1"]["displacement"])
    assert adding.pairs(workspace) == []


def test_stretches_that_are_not_cut_out_any_more_go(tmp_path: Path) -> None:
    workspace = Workspace(tmp_path / "ws")
    desk = Desk(workspace, Jobs(workspace))
    times = [0.1 * k + 5.0 * (k >= 30) + 5.0 * (k >= 60) for k in range(90)]
    rows = "".join(f"{t:g},{k % 7},{k % 5}\n" for k, t in enumerate(times))
    path = workspace.keep_upload("rig.csv", f"time_s,p_bar,displacement_mm\n{rows}".encode())
    with pytest.raises(DataError):
        adding.add(desk, path.name, "rig.csv", Reading())
    assert workspace.entries() == []
    adding.add(desk, path.name, "rig.csv", Reading(gaps="split"))
    names = [entry.name for entry in workspace.entries()]
    assert len(names) == 3
    with pytest.warns(DataWarning):
        adding.replaced(desk, [names[1]], Reading(gaps="interpolate"))
    assert [entry.name for entry in workspace.entries()] == [names[1]]
    assert len(workspace.recording(names[1])) == 190
    assert workspace.undo()
    assert [entry.name for entry in workspace.entries()] == names
    assert workspace.undo() == "add rig.csv"
    assert workspace.entries() == []


def test_steps_are_repeated_by_their_calls() -> None:
    t = np.arange(400) * 0.01
    recording = Recording({"pressure": t + np.sin(t), "displacement": np.cos(9 * t)}, 0.01)
    steps = [
        Step(do="low_pass", cutoff=5.0, channels=["pressure"]),
        Step(do="detrend", channels=["displacement"]),
        Step(do="resample", sample_time=0.02),
        Step(do="slice", start=5, stop=50),
    ]
    called = eval(edits.call("x", steps), {"mckibben": mckibben, "x": recording})
    assert called == edits.applied(recording, steps)
    with pytest.raises(DataError, match="low_pass"):
        edits.applied(recording, [Step(do="low_pass")])


def test_a_file_that_changes_while_it_is_read_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "rig.csv"
    path.write_text(TABLE)
    reading = formats.read

    def growing(*given):  # type: ignore[no-untyped-def]
        found = reading(*given)
        with path.open("a") as file:
            file.write("\n1,2,3,up")
        return found

    monkeypatch.setattr(formats, "read", growing)
    with pytest.raises(DataError):
        read(path)


def test_others_see_that_something_has_changed(tmp_path: Path) -> None:
    mine, other = Workspace(tmp_path), Workspace(tmp_path)
    taken(mine)
    before = other.stamp()
    mine.set_role("rig", "test")
    assert other.stamp() != before
    assert other.entry("rig").role == "test"


def held(desk: Desk, constants: dict[str, tuple[float, str]], **other: Any) -> Recording:
    """Read the only recording otherwise, as the dialog does."""
    (entry,) = desk.workspace.entries()
    adding.replaced(desk, [entry.name], Reading(constants=constants, **other))
    return desk.workspace.recording(entry.name)


def test_a_load_that_is_in_no_column_is_said_changed_and_undone(tmp_path: Path) -> None:
    workspace = Workspace(tmp_path / "ws")
    desk = Desk(workspace, Jobs(workspace))
    before = taken(workspace)
    assert held(desk, {"force": (200.0, "g")})["force"] == pytest.approx(1.96133)
    found = held(desk, {"force": (0.4, "kg")}, channels=["pressure", "displacement", "force"])
    assert list(found.channels) == ["pressure", "displacement", "force"]
    assert found.units["force"] == "N"
    assert found["force"] == pytest.approx(3.92266)
    assert Workspace(workspace.folder).entry("rig").reading.constants == {"force": (0.4, "kg")}
    assert repeated(workspace)["force"] == pytest.approx(found["force"])
    assert workspace.undo()
    assert workspace.recording("rig")["force"] == pytest.approx(1.96133)
    assert workspace.undo()
    assert list(workspace.recording("rig").channels) == list(before.channels)
    with pytest.raises(DataError):
        held(desk, {"time": (1.0, "s")})
    with pytest.raises(DataError, match="mm"):
        held(desk, {"force": (1.0, "mm")})
