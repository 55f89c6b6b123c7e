"""The grammar that scripts rely on, from a file to a checked inverse."""

from __future__ import annotations

import csv
import json
import re
from pathlib import Path

import numpy as np
import pytest

from mckibben import Recording, example, load, read, write
from mckibben.signals import irregular_triangle
from tests.cli.conftest import Cli
from tests.estimators.test_balance_prior import moved
from tests.refusals import mentions


def columns(path: Path) -> dict[str, np.ndarray]:
    with path.open() as file:
        rows = list(csv.DictReader(file))
    return {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}


@pytest.fixture
def model(cli: Cli, files: tuple[Path, Path], tmp_path: Path) -> Path:
    path = tmp_path / "model.json"
    settings = ["--set", "n_operators=5", "--seed", 0]
    channels = ["--input", "pressure", "--output", "displacement"]
    result = cli("fit", "gpi", files[0], *channels, "-o", path, *settings)
    assert result.code == 0, result.err
    block = load(path)
    assert len(block.weights) == 6  # type: ignore[attr-defined]
    shown = re.search(r"rising slope +(\d\S*) +(\d\S*) +1/bar", result.out)
    assert shown is not None
    value, error = map(float, shown.groups())
    assert value == pytest.approx(block.rising.slope, rel=1e-3)  # type: ignore[attr-defined]
    assert 0.0 < error < 0.1 * value
    return path


def test_inverse_then_forward_through_files_is_the_identity(
    cli: Cli, model: Path, tmp_path: Path
) -> None:
    inverse, reference = tmp_path / "inverse.json", tmp_path / "reference.csv"
    result = cli("invert", model, "-o", inverse, "--json")
    assert result.code == 0, result.err
    low, high = json.loads(result.out)["reachable"]["displacement"]
    t = np.arange(0, 10, 0.02)
    wave = 0.5 + 0.35 * np.sin(2 * t) + 0.1 * np.sin(9 * t)
    lines = [
        f"{a!r},{b!r}"
        for a, b in zip(t.tolist(), (low + (high - low) * wave).tolist(), strict=True)
    ]
    reference.write_text("time_s,displacement_mm\n" + "\n".join(lines) + "\n")
    wished, back = tmp_path / "wished.csv", tmp_path / "back.csv"
    assert cli("simulate", inverse, reference, "-o", wished).code == 0
    assert "pressure_model" in columns(wished)
    result = cli("simulate", model, wished, "--column", "pressure=pressure_model", "-o", back)
    assert result.code == 0, result.err
    found = columns(back)
    error = np.abs(found["displacement_model"] - found["displacement"]).max()
    assert error <= 1e-9 * (high - low)


def _driven(folder: Path) -> list[str]:
    """Return files of force where pressure and length both move."""
    time = np.arange(0, 20, 0.02)
    files = []
    for seed in (1, 2):
        u, length = (
            irregular_triangle(time, 8, most, seed=seed + more)
            for most, more in ((5.0, 0), (30.0, 4))
        )
        samples = {"pressure": u, "length": 170 + length, "force": u * (20 + 2 * length) + length}
        files.append(folder / f"driven{seed}.csv")
        write(Recording(samples, 0.02), files[-1])
    return [str(file) for file in files]


@pytest.mark.parametrize("asked", [(), ("--output", "force")])
def test_force_by_length_and_pressure_is_compared(
    cli: Cli, tmp_path: Path, asked: tuple[str, ...]
) -> None:
    train, test = _driven(tmp_path)
    done = cli(
        "compare", train, "--test", test, "--models", "force-bilinear,balance", *asked, "--json"
    )
    assert done.code == 0, done.err
    board = json.loads(done.out)
    rows = {row["model"]: row for row in board["rows"]}
    assert board["chosen"] == "force-bilinear"
    assert rows["force-bilinear"]["test"]["rmse"] < 0.1
    assert "length" in rows["balance"]["reason"]


@pytest.fixture
def folder(files: tuple[Path, Path], tmp_path: Path) -> Path:
    """A folder of recordings whose units nobody wrote down."""
    folder = tmp_path / "runs"
    folder.mkdir()
    for name, file in zip(("a.csv", "b.csv"), files, strict=True):
        (folder / name).write_text(file.read_text().replace("time,", "time_s,", 1))
    return folder


def test_what_was_assumed_while_reading_reaches_every_result(
    cli: Cli, folder: Path, tmp_path: Path
) -> None:
    done = cli("study", folder, "-o", tmp_path / "out", "--models", "pi", "--jobs", 1, "--json")
    assert done.code == 0, done.err
    printed = json.loads(done.out)
    for file in (folder / "a.csv", folder / "b.csv"):
        (note,) = printed["notes"][str(file)]
        assert mentions(note, ("pressure", "bar", "displacement", "mm"))
        assert f"{file}: {note}" in printed["leaderboard"]["notes"]
        start = f"{file}: {note.partition('`')[0]}"
        assert done.err.count(start) == 1
        assert (tmp_path / "out" / "report.html").read_text().count(start) == 1


def test_several_zeros_are_taken_out(cli: Cli, files: tuple[Path, Path], tmp_path: Path) -> None:
    run = read(files[0])[0]
    rests = {name: np.append(run[name], np.full(200, run[name][-1])) for name in run.channels}
    first = Recording(rests, run.sample_time)
    write(first, tmp_path / "first.csv")
    moved = first.with_channels(displacement=first["displacement"] + 300.0)
    write(moved, tmp_path / "moved.csv")
    given = (
        "compare",
        tmp_path / "first.csv",
        tmp_path / "moved.csv",
        "--models",
        "pi",
        "--jobs",
        1,
    )
    errors = [
        json.loads(cli(*given, "--allow-shared", "--json", *zero).out)["rows"][0]["test"]["rmse"]
        for zero in ((), ("--zero", "displacement"))
    ]
    assert errors[1] < 1 < 10 < errors[0]
    assert "length" in cli(*given, "--zero", "length").err


def test_example_writes_what_is_bundled_and_repeats(cli: Cli, tmp_path: Path) -> None:
    folder = tmp_path / "new" / "examples"
    for _ in range(2):
        assert cli("example", folder).code == 0
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == {
        path.name: path.read_bytes() for path in example.files()
    }
    (train,) = read(folder / "decaying-triangle.csv")
    assert set(train.channels) == {"pressure", "displacement"}
    (folder / "decaying-triangle.csv").write_text("mine")
    assert cli("example", folder, "--force").code == 0
    assert (folder / "decaying-triangle.csv").read_text() != "mine"


def test_a_fit_begins_from_a_muscle(cli: Cli, tmp_path: Path) -> None:
    write(moved(1, 5.0), tmp_path / "run.csv")
    asked = ["fit", "balance", tmp_path / "run.csv", "-o"]
    few = ["--set", "steps=2", "--set", "terms=[]"]
    plain, prior = tmp_path / "plain.json", tmp_path / "prior.json"
    assert cli(*asked, plain, *few).code == 0
    assert cli(*asked, prior, "--prior", "rail", *few).code == 0
    assert plain.read_text("utf-8") != prior.read_text("utf-8")
    sheet = tmp_path / "sheet.toml"
    sheet.write_text("diameter_mm = 20\nrest_length_mm = 200\nmax_force_N = 1500\n")
    for said in (["--prior", sheet], ["--set", f"prior={sheet}"]):
        assert cli(*asked, sheet, *said, "--force").code == 2
    assert sheet.read_text().startswith("diameter_mm")
