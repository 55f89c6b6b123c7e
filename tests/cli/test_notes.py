"""What was assumed while reading reaches results and reports, and standard error once."""

import json
from pathlib import Path

import pytest

from mckibben import read, write
from tests.cli.conftest import Cli

ASSUMED = "no unit is given, so these are assumed: pressure in bar, displacement in mm"


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
        assert note.startswith(ASSUMED)
        assert f"{file}: {note}" in printed["leaderboard"]["notes"]
        assert done.err.count(f"Note: {file}: {note}") == 1
        page = (tmp_path / "out" / "report.html").read_text()
        assert page.count(f"When {file} was read: {note}") == 1
        assert f"<li>{file}: " not in page


def test_compare_and_characterize(cli: Cli, folder: Path) -> None:
    told = f"{folder / 'a.csv'}: {ASSUMED}"
    board = cli("compare", folder / "a.csv", "--models", "pi", "--jobs", 1, "--json")
    assert any(note.startswith(told) for note in json.loads(board.out)["notes"])
    files = [folder / "a.csv", folder / "b.csv"]
    described = cli("characterize", *files, "--json")
    assert list(json.loads(described.out)["notes"]) == list(map(str, files))
    spoken = cli("characterize", *files)
    assert f"Note: {told}" in spoken.out
    assert spoken.err.count(told) == 1
    assert f"Note: {ASSUMED}" in cli("info", folder / "a.csv").out


def test_several_zeros_are_told_and_taken_out(
    cli: Cli, files: tuple[Path, Path], tmp_path: Path
) -> None:
    first = read(files[0])[0]
    moved = first.with_channels(displacement=first["displacement"] + 300.0)
    write(moved, tmp_path / "moved.csv")
    given = ("compare", files[0], tmp_path / "moved.csv", "--models", "pi", "--jobs", 1)
    rests = "displacement rests at"
    assert rests in cli(*given, "--allow-shared").out
    assert rests not in cli(*given, "--allow-shared", "--zero", "displacement").out
    assert "no such channel" in cli(*given, "--zero", "length").err


def test_a_reason_for_which_several_models_fail_is_said_once(
    cli: Cli, files: tuple[Path, Path]
) -> None:
    done = cli("compare", *files, "--models", "pi,multistate,multistate-11", "--jobs", 1)
    assert "multistate, multistate-11: failed, it maps length to force" in done.out
    assert done.out.count("it maps length to force") == 1
