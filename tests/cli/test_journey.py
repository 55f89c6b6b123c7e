"""The grammar that scripts rely on, from a file to a checked inverse."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from mckibben import Affine, Recording, load, read, write
from mckibben.blocks.compose import Series
from mckibben.signals import irregular_triangle
from tests.cli.conftest import Cli


def columns(path: Path) -> dict[str, np.ndarray]:
    with path.open() as file:
        rows = list(csv.DictReader(file))
    return {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}


@pytest.fixture
def model(cli: Cli, files: tuple[Path, Path], tmp_path: Path) -> Path:
    path = tmp_path / "model.json"
    settings = ["--set", "n_operators=5", "--method", "ls", "--seed", 0]
    channels = ["--input", "pressure", "--output", "displacement"]
    result = cli("fit", "gpi", files[0], *channels, "-o", path, *settings)
    assert result.code == 0, result.err
    assert len(load(path).weights) == 6  # type: ignore[attr-defined]
    return path


@pytest.mark.parametrize("kind", ["gpi", "balance"])
def test_fit_counts_no_recording_twice(
    cli: Cli, files: tuple[Path, Path], tmp_path: Path, kind: str
) -> None:
    out = tmp_path / "twice.json"
    result = cli("fit", kind, files[0], files[0], "-o", out)
    assert result.code == 2
    assert "train" in result.err
    assert not out.exists()


def test_simulate_writes_the_inputs_the_modelled_and_the_measured_output(
    cli: Cli, model: Path, files: tuple[Path, Path], tmp_path: Path
) -> None:
    out = tmp_path / "out.csv"
    result = cli("simulate", model, files[1], "-o", out, "--json")
    assert result.code == 0, result.err
    found, given = columns(out), columns(files[1])
    assert list(found) == ["time", "pressure", "displacement_model", "displacement"]
    np.testing.assert_array_equal(found["pressure"], given["pressure"])
    expected = load(model).simulate(given["pressure"])
    np.testing.assert_array_equal(found["displacement_model"], expected)
    rmse = np.sqrt(np.mean((expected - given["displacement"]) ** 2))
    metrics = json.loads(result.out)["metrics"]["displacement"]
    assert metrics["rmse"] == pytest.approx(rmse, rel=1e-12)
    assert {"mae", "r2", "max_error"} <= set(metrics)


def test_simulate_tells_where_it_extrapolates(
    cli: Cli, model: Path, files: tuple[Path, Path], tmp_path: Path
) -> None:
    series, out = tmp_path / "series.json", tmp_path / "out.csv"
    Series((load(model), Affine.example())).save(series)
    (known,) = read(files[0])
    for share, told in ((1.03, 0), (2.0, 1)):  # noise leaves the range too, and is not told
        beyond = tmp_path / f"{share}.csv"
        write(known.with_channels({}, pressure=share * known["pressure"]), beyond)
        for path in (model, series):
            result = cli("simulate", path, beyond, "-o", out, "--force")
            assert result.code == 0, result.err
            assert result.out.count("it extrapolates") == told


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


def test_study_writes_everything(cli: Cli, files: tuple[Path, Path], tmp_path: Path) -> None:
    folder = tmp_path / "study"
    options = ["--models", "pi,gpi", "--jobs", 1, "--json"]
    result = cli("study", files[0], "--test", files[1], "-o", folder, *options)
    assert result.code == 0, result.err
    printed = json.loads(result.out)
    assert printed["inverse"]["model"] == "gpi"
    assert printed["inverse"]["error"] <= 1e-9
    written = {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}
    assert written == {
        *("report.html", "characterization.json", "inverse.json"),
        *("validation.json", "banded.json"),
        *("leaderboard.csv", "leaderboard.json", "results.sha256"),
        *("models/pi.json", "models/gpi.json"),
    }
    assert load(folder / "inverse.json").inverse() == load(folder / "models" / "gpi.json")


@pytest.mark.parametrize("suffix", [".png", ".svg", ".pdf"])
def test_plot_writes_figures(
    cli: Cli, files: tuple[Path, Path], model: Path, tmp_path: Path, suffix: str
) -> None:
    loop, fit = tmp_path / f"loop{suffix}", tmp_path / f"fit{suffix}"
    assert cli("plot", files[0], "-o", loop).code == 0
    assert cli("plot", files[1], "--model", model, "--kind", "residuals", "-o", fit).code == 0
    assert min(loop.stat().st_size, fit.stat().st_size) > 1000


def test_of_held_lengths_the_force_is_compared(cli: Cli, tmp_path: Path) -> None:
    time = np.arange(0, 20, 0.02)
    u = irregular_triangle(time, 8, 5.0, seed=1)
    for place, held in enumerate((0.0, 10.0, 20.0)):
        samples = {
            "pressure": u,
            "displacement": np.full(u.size, held),
            "force": 40 * u - 2 * held,
        }
        write(Recording(samples, 0.02), tmp_path / f"held{place}.csv")
    files = [str(tmp_path / f"held{place}.csv") for place in range(3)]
    given = ("--test", files[1], "--models", "balance-force", "--json")
    done = cli("compare", files[0], files[2], *given)
    assert done.code == 0, done.err
    assert json.loads(done.out)["output"] == "force"


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


def test_a_length_that_no_model_of_force_is_told_is_named(cli: Cli, tmp_path: Path) -> None:
    train, test = _driven(tmp_path)
    asked = ("--input", "pressure", "--output", "force", "--models", "pi", "--json")
    done = cli("compare", train, "--test", test, *asked)
    assert any("length" in note for note in json.loads(done.out)["notes"])


def test_a_pressure_beyond_training_is_told_of_force_by_length(cli: Cli, tmp_path: Path) -> None:
    train, test = _driven(tmp_path)
    (run,) = read(test)
    beyond = tmp_path / "beyond.csv"
    changed = {name: run[name] for name in ("length", "force")} | {"pressure": 2 * run["pressure"]}
    write(Recording(changed, 0.02), beyond)
    done = cli("compare", train, "--test", beyond, "--models", "force-bilinear", "--json")
    assert any("pressure" in note for note in json.loads(done.out)["notes"])
