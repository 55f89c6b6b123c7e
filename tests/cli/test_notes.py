"""What was assumed while reading reaches results and reports, and standard error once."""

import json
from pathlib import Path

import pytest

from mckibben import read, write
from tests.cli.conftest import Cli

ASSUMED = "pressure in bar, displacement in mm"


@pytest.fixture
def folder(files: tuple[Path, Path], tmp_path: Path) -> Path:
    """A folder of recordings whose units nobody wrote down."""
    folder = tmp_path / "runs"
    folder.mkdir()
    for name, file in zip(("a.csv", "b.csv"), files, strict=True):
        (folder / name).write_text(file.read_text().replace("time,", "time_s,", 1))
    return folder


def test_study_of_a_folder(cli: Cli, folder: Path, tmp_path: Path) -> None:
    done = cli("study", folder, "-o", tmp_path / "out", "--models", "pi", "--jobs", 1, "--json")
    assert done.code == 0, done.err
    printed = json.loads(done.out)
    for file in (folder / "a.csv", folder / "b.csv"):
        (note,) = printed["notes"][str(file)]
        assert ASSUMED in note
        assert f"{file}: {note}" in printed["leaderboard"]["notes"]
        assert done.err.count(f"{file}: {note}") == 1
        assert (tmp_path / "out" / "report.html").read_text().count(f"{file} was read: {note}") == 1


def test_compare_and_characterize(cli: Cli, folder: Path) -> None:
    files = [folder / "a.csv", folder / "b.csv"]
    board = cli("compare", files[0], "--models", "pi", "--jobs", 1, "--json")
    assert any(ASSUMED in note for note in json.loads(board.out)["notes"])
    described = cli("characterize", *files, "--json")
    assert list(json.loads(described.out)["notes"]) == list(map(str, files))
    spoken = cli("characterize", *files)
    assert spoken.out.count(ASSUMED) == spoken.err.count(ASSUMED) == 2
    assert ASSUMED in cli("info", files[0]).out


def test_several_zeros_are_taken_out(cli: Cli, files: tuple[Path, Path], tmp_path: Path) -> None:
    first = read(files[0])[0]
    moved = first.with_channels(displacement=first["displacement"] + 300.0)
    write(moved, tmp_path / "moved.csv")
    given = ("compare", files[0], tmp_path / "moved.csv", "--models", "pi", "--jobs", 1)
    errors = [
        json.loads(cli(*given, "--allow-shared", "--json", *zero).out)["rows"][0]["test"]["rmse"]
        for zero in ((), ("--zero", "displacement"))
    ]
    assert errors[1] < 1 < 10 < errors[0]
    assert "length" in cli(*given, "--zero", "length").err
