"""Nothing is overwritten: no input, no file of somebody's, nothing that a link leads to."""

from __future__ import annotations

import errno
import json
import os
import shutil
from pathlib import Path
from typing import Any

import pytest

from mckibben.errors import DataError
from mckibben.outputs import RUN as LISTED
from mckibben.system.atomic import PART, digest, write_text
from tests.cli.calls import CALLS, INVERSE, MODEL, RIG, RUN, call_of, files
from tests.cli.conftest import Cli

FILES = [name for name, call in CALLS.items() if call.words and call.words[-1].startswith("out.")]
"""Commands that write a file."""

READING = {name: call for name, call in CALLS.items() if call.reads} | {
    f"rig run --inputs {RUN}": call_of(f"{RIG} -o out.csv", RIG, RUN),
    f"track {INVERSE}": call_of(
        f"--rig {RIG} --reference {RUN} --controller-out out.json", INVERSE, RUN, RIG
    ),
}
"""Commands that read files by name, and write."""

FOLDERS = [name for name, call in CALLS.items() if call.own]
"""Commands that write a folder."""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with one file of every kind, which is the current one."""
    monkeypatch.chdir(tmp_path)
    files(tmp_path)
    return tmp_path


def held(folder: Path) -> dict[str, bytes]:
    """Return every file below a folder."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


@pytest.mark.parametrize("way", ["itself", "another spelling", "a second name", "a link"])
@pytest.mark.parametrize("command", READING)
def test_no_command_writes_over_what_it_reads(
    cli: Cli, folder: Path, command: str, way: str
) -> None:
    *words, out = READING[command].words
    for given in READING[command].reads:
        onto = Path(given)
        if way == "another spelling":
            (folder / "sub").mkdir(exist_ok=True)
            onto = Path("sub", "..", given)
        elif way != "itself":
            onto = Path(f"second-{Path(given).stem}{Path(out).suffix}")
            onto.unlink(missing_ok=True)
            (os.link if way == "a second name" else os.symlink)(given, onto)
        before = held(folder)
        for force in ((), ("--force",)):
            result = cli(*command.split(), *words, onto, *force)
            assert result.code == 2, result.out
            assert onto.name in result.err
        assert held(folder) == before


@pytest.mark.parametrize("command", FILES)
def test_a_file_of_somebody_s_needs_force_and_ours_does_not(
    cli: Cli, folder: Path, command: str
) -> None:
    words, out = (*command.split(), *CALLS[command].words), folder / CALLS[command].words[-1]
    out.write_text("mine\n")
    refused = cli(*words)
    assert refused.code == 2
    assert "--force" in refused.err
    assert out.read_text() == "mine\n"
    done = cli(*words, "--force")
    assert done.code == 0, done.err
    assert out.read_bytes() != b"mine\n"
    assert cli(*words).code == 0
    if out.suffix not in (".json", ".png"):  # what is edited is still a model, or a figure
        changed = out.read_bytes()[:-1]
        out.write_bytes(changed)
        assert cli(*words).code == 2
        assert out.read_bytes() == changed


@pytest.mark.parametrize("command", FOLDERS)
def test_a_file_of_somebody_s_in_a_folder_stays(cli: Cli, folder: Path, command: str) -> None:
    out = folder / "out"
    out.mkdir()
    (out / CALLS[command].own).write_text("mine")
    refused = cli(*command.split(), *CALLS[command].words)
    assert refused.code == 2
    assert "out" in refused.err
    left = held(out)
    left.pop("protocol.json", None)  # what a recording of a rig is for
    assert left == {CALLS[command].own: b"mine"}


@pytest.mark.parametrize("command", FILES)
def test_a_full_disk_is_reported_with_the_file_and_costs_nothing(
    cli: Cli, folder: Path, command: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(self: Path, target: object) -> Any:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    before = held(folder)
    monkeypatch.setattr(Path, "replace", full)
    result = cli(*command.split(), *CALLS[command].words)
    assert result.code == 2
    assert CALLS[command].words[-1] in result.err
    assert os.strerror(errno.ENOSPC) in result.err
    assert held(folder) == before


@pytest.mark.skipif(
    not Path("/proc/self").is_dir(), reason="has no folder that nobody can write to"
)
@pytest.mark.parametrize("command", [name for name in FILES if not name.startswith("export")])
def test_a_folder_that_cannot_be_written_to_is_refused_before_any_work(
    cli: Cli, folder: Path, command: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("mckibben.files.read", None)
    *words, out = CALLS[command].words
    result = cli(*command.split(), *words, f"/proc/mine{Path(out).suffix}")
    assert result.code == 2
    assert "/proc/mine" in result.err


# Descriptions and folders of results -------------------------------------------------------------------


def test_a_description_beside_the_output_is_guarded_too(cli: Cli, folder: Path) -> None:
    beside, own = folder / "out.csv-metadata.json", folder / "run.csv-metadata.json"
    beside.write_text('{"notes": "mine"}')
    assert cli("simulate", MODEL, RUN, "-o", "out.csv").code == 2
    assert beside.read_text() == '{"notes": "mine"}'
    before = own.read_bytes()
    assert cli("fit", "pi", RUN, "-o", own, "--force").code == 2
    assert own.read_bytes() == before


def test_models_of_an_earlier_study_go_and_what_was_changed_stays(cli: Cli, folder: Path) -> None:
    words = ["study", RUN, "--test", "two.csv", "--jobs", "1", "-o", "out", "--models"]
    assert cli(*words, "pi").code == 0
    out = folder / "out"
    shutil.copy(MODEL, out / "models" / "kept-by-hand.json")
    assert cli(*words, "arx").code == 0
    models = sorted(path.name for path in (out / "models").iterdir())
    assert models == ["arx.json", "kept-by-hand.json"]
    listed = json.loads((out / LISTED).read_text())["files"]
    assert "models/arx.json" in listed
    assert "models/pi.json" not in listed
    assert all(digest((out / name).read_bytes()) == one for name, one in listed.items())
    (out / "report.html").write_text("my own words")
    assert cli(*words, "pi").code == 2
    assert (out / "report.html").read_text() == "my own words"
    assert (out / "models" / "arx.json").exists()


def test_results_are_not_written_over_recordings_in_the_same_folder(cli: Cli, folder: Path) -> None:
    runs = folder / "runs"
    runs.mkdir()
    for name in ("a.csv", "leaderboard.csv"):
        shutil.copy(RUN, runs / name)
    before = held(runs)
    for force in ((), ("--force",)):
        result = cli("compare", "runs", "-o", "runs", "--models", "pi", *force)
        assert result.code == 2
        assert "leaderboard.csv" in result.err
    assert held(runs) == before


def test_planted_links_are_not_written_through_and_rights_stay(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "victim").write_text("mine")
    for name in (f"{PART}{'00' * 8}.part", "out"):
        (tmp_path / name).symlink_to(tmp_path / "victim")
    write_text(tmp_path / "out", "new")
    assert not (tmp_path / "out").is_symlink()
    assert (tmp_path / "out").read_text() == "new"
    (tmp_path / "out").chmod(0o600)
    write_text(tmp_path / "out", "newer")
    assert (tmp_path / "out").stat().st_mode & 0o777 == 0o600
    monkeypatch.setattr("mckibben.system.atomic.secrets.token_hex", lambda n: "00" * n)
    with pytest.raises(DataError):  # even if the name were guessed
        write_text(tmp_path / "out", "newest")
    assert (tmp_path / "victim").read_text() == "mine"
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(DataError):
        write_text(tmp_path / "pipe", "three")
    assert (tmp_path / "pipe").is_fifo()
