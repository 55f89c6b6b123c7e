"""The folder: recordings as raw files with steps."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mckibben.app.steps import LARGEST_UPLOAD, Reading, Step
from mckibben.app.workspace import Workspace
from mckibben.errors import DataError

N = 200


def table(n: int = N, *, header: str = "time,pressure,displacement") -> bytes:
    rows = (f"{k * 0.02:.2f},{1 + k % 50 * 0.1:.3f},{k % 50 * 0.2:.3f}" for k in range(n))
    return "\n".join([header, *rows, ""]).encode()


def received(workspace: Workspace, name: str, content: bytes) -> str:
    with workspace.receiving(name, len(content)) as (part, path):
        part.write_bytes(content)
    return path.name


@pytest.fixture
def workspace(tmp_path: Path) -> Workspace:
    return Workspace(tmp_path / "bench")


@pytest.fixture
def name(workspace: Workspace) -> str:
    (found,) = workspace.add(received(workspace, "run.csv", table()))
    return found


@pytest.mark.filterwarnings("ignore::mckibben.errors.DataWarning")
class TestRecordings:
    def test_steps_are_undone_one_by_one(self, workspace: Workspace, name: str) -> None:
        whole = workspace.recording(name)
        workspace.do(name, Step(do="slice", start=10, stop=110))
        cut = workspace.recording(name)
        workspace.do(name, Step(do="resample", sample_time=0.04))
        assert (len(whole), len(cut)) == (N, 100)
        assert workspace.recording(name).sample_time == 0.04
        undone = workspace.undo(name)
        assert undone is not None
        assert undone.do == "resample"
        assert workspace.recording(name) == cut
        workspace.undo(name)
        assert workspace.recording(name) == whole
        assert workspace.undo(name) is None

    def test_its_file_says_all_and_its_code_repeats_it(
        self, workspace: Workspace, name: str, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        import mckibben

        workspace.change(name, reading=Reading(units={"pressure": "kPa"}))
        workspace.do(name, Step(do="slice", start=10, stop=110))
        workspace.do(name, Step(do="low_pass", cutoff=5.0, channels=["pressure"]))
        again = Workspace(workspace.folder).recording(name)
        assert again == workspace.recording(name)
        assert again["pressure"].max() < 0.1
        monkeypatch.chdir(workspace.folder)
        repeated = eval(workspace.entry(name).code(), {"mckibben": mckibben})
        assert all(np.array_equal(repeated[one], again[one]) for one in again.channels)

    def test_a_change_that_cannot_be_leaves_all_as_it_was(
        self, workspace: Workspace, name: str
    ) -> None:
        before = workspace.entry(name)
        with pytest.raises(DataError):
            workspace.do(name, Step(do="low_pass", cutoff=1e9))
        with pytest.raises(DataError):
            workspace.change(name, reading=Reading(columns={"pressure": "no such"}))
        assert workspace.entry(name) == before

    def test_lines_header_encoding_sign_gaps(self, workspace: Workspace) -> None:
        head = "Prüfstand\na,b,c\nzeit,druck,weg\ns,bar,mm\nx,y,z\n".encode("cp1252")
        body = table().split(b"\n", 1)[1]
        rows = body.split(b"\n")
        upload = received(workspace, "a.csv", head + b"\n".join(rows[:100] + rows[110:]))
        reading = Reading(header=3, skip=2, encoding="cp1252", gaps="split")
        reading = replace(reading, calibration={"displacement": (-1.0, 0.0)})
        reading = replace(reading, units={"displacement": "mm"})
        with pytest.raises(DataError) as refused:
            workspace.add(upload, reading=replace(reading, gaps="error"))
        assert refused.value.row == 106  # of the file as it is
        names = workspace.add(upload, reading=reading)
        assert [len(workspace.recording(one)) for one in names] == [100, 90]
        assert workspace.recording(names[0])["displacement"].min() < -9

    def test_split_rename_remove_restore(self, workspace: Workspace, name: str) -> None:
        second = workspace.split(name, 120)
        assert [len(workspace.recording(one)) for one in (name, second)] == [120, 80]
        assert [workspace.entry(one).role for one in (name, second)] == ["train", "test"]
        other = workspace.rename(second, "../two words")
        assert other == "two-words"
        assert len(workspace.recording(other)) == 80
        workspace.remove(other)
        assert [one.name for one in workspace.entries()] == [name]
        workspace.restore(other)
        assert len(workspace.recording(other)) == 80

    def test_what_is_damaged_costs_itself_alone(self, workspace: Workspace, name: str) -> None:
        folder = workspace.folder / "recordings"
        (folder / "bad.json").write_text('{"role": "train", "steps": [{"do": "exec"}]}')
        (folder / "worse.json").write_bytes(b"\xff[[[")
        (folder / "lost.json").write_text('{"role": "train", "upload": "none.csv"}')
        (folder / "out.json").write_text('{"role": "train", "upload": "../../secret.csv"}')
        assert list(workspace.used()) == [name]
        assert workspace.channels() == ["pressure", "displacement"]

    def test_pieces_and_channels_of_one_run_are_joined(self, workspace: Workspace) -> None:
        header, *rows = [line.split(",") for line in table().decode().split()]

        def written(name: str, lines: list[list[str]], columns: tuple[int, ...]) -> str:
            each = [",".join(cells[k] for k in columns) for cells in (header, *lines)]
            return received(workspace, name, "\n".join([*each, ""]).encode())

        pieces = [written("a.csv", rows[:100], (0, 1, 2)), written("b.csv", rows[100:], (0, 1, 2))]
        for piece in pieces:
            workspace.add(piece)
        joint = workspace.join(pieces)
        assert list(workspace.used()) == [joint]
        loggers = [written("c.csv", rows, (0, 1)), written("d.csv", rows, (0, 2))]
        other = workspace.recording(workspace.join(loggers))
        assert all(np.allclose(other[n], workspace.recording(joint)[n]) for n in other)


class TestFiles:
    @pytest.mark.parametrize(
        ("given", "kept"),
        [
            ("../../etc/pass wd.csv", "pass-wd.csv"),
            ("C:\\data\\con.CSV", "upload-con.csv"),
            ("..csv", "upload.csv"),
            ("<script>.csv", "script.csv"),
        ],
    )
    def test_names_are_made_safe(self, workspace: Workspace, given: str, kept: str) -> None:
        assert received(workspace, given, b"x") == kept
        assert received(workspace, given, b"x") != kept  # nothing is written over

    @pytest.mark.parametrize(("name", "size"), [("a.csv", 0), ("a.csv", LARGEST_UPLOAD + 1)])
    def test_empty_and_large_files_are_refused(
        self, workspace: Workspace, name: str, size: int
    ) -> None:
        with pytest.raises(DataError), workspace.receiving(name, size):
            pass
        assert not list((workspace.folder / "uploads").iterdir())

    @pytest.mark.parametrize("name", ["../x", "a/b", ".hidden", "a..b", "", "x" * 90])
    def test_no_path_leads_out(self, workspace: Workspace, name: str) -> None:
        with pytest.raises(DataError):
            workspace.path("models", name)

    def test_links_are_refused(self, workspace: Workspace, tmp_path: Path) -> None:
        (workspace.folder / "models" / "m.json").symlink_to(tmp_path / "elsewhere.json")
        with pytest.raises(DataError):
            workspace.path("models", "m.json")
        assert workspace.names("models") == []

    def test_one_server_owns_a_folder(self, workspace: Workspace) -> None:
        workspace.claim()
        assert workspace.folder.stat().st_mode & 0o077 == 0
        with pytest.raises(DataError):
            Workspace(workspace.folder).claim()
