"""mckibben calibrate, and simulate --interval."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from mckibben import GPI, load, read, write
from mckibben.signals import random_wave
from tests.cli.conftest import Cli, recorded


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("runs")
    paths = []
    for seed in range(6):
        u = random_wave(0.02 * np.arange(400), 1.0, 5.0, seed=seed)
        paths.append(folder / f"run-{seed}.csv")
        write(recorded(u, seed), paths[-1])
    return paths


@pytest.fixture
def model(tmp_path: Path) -> Path:
    GPI.example().save(tmp_path / "model.json")
    return tmp_path / "model.json"


def test_a_band_is_written_and_holds(
    cli: Cli, model: Path, runs: list[Path], tmp_path: Path
) -> None:
    banded, out = tmp_path / "banded.json", tmp_path / "out.csv"
    result = cli("calibrate", model, *runs[:5], "-o", banded, "--json")
    assert result.code == 0, result.err
    told = json.loads(result.out)
    assert told["unit"] == "block"
    one, two = tmp_path / "one.csv", tmp_path / "two.csv"  # without an interval it is the model
    assert cli("simulate", banded, runs[5], "-o", one).code == 0
    assert cli("simulate", model, runs[5], "-o", two).code == 0
    assert one.read_text() == two.read_text()
    assert told["highest_level"] == pytest.approx(told["units"] / (told["units"] + 1))
    result = cli("simulate", banded, runs[5], "-o", out, "--interval", "0.9", "--json")
    assert result.code == 0, result.err
    figures = json.loads(result.out)["metrics"]["displacement"]
    (written,) = read(out)
    given = load(banded).at(0.9).simulate(read(runs[5])[0])  # type: ignore[attr-defined]
    for end in ("lower", "upper"):
        assert written[f"displacement_{end}"] == pytest.approx(given[f"displacement_{end}"])
    low, high = written["displacement_lower"], written["displacement_upper"]
    share = np.mean((low <= written["displacement"]) & (written["displacement"] <= high))
    assert figures["coverage"] == pytest.approx(share)
    assert 0.8 < share < 0.97
    assert figures["band_width"] == pytest.approx(np.mean(high - low))


def test_bad_input_is_refused(cli: Cli, model: Path, runs: list[Path], tmp_path: Path) -> None:
    banded, out = tmp_path / "banded.json", tmp_path / "out.csv"
    assert cli("calibrate", model, *runs[:5], "-o", banded, "--exchangeable", "run").code == 0
    inverse = tmp_path / "inverse.json"
    GPI.example().inverse().save(inverse)
    for words, named in (
        (["simulate", model, runs[0], "-o", out, "--interval", "0.9"], "model.json"),
        (["simulate", banded, runs[0], "-o", out, "--interval", "0.9"], "83.3 %"),
        (["simulate", banded, runs[0], "-o", out, "--interval", "1.5"], "1.5"),
        (
            ["simulate", banded, runs[0], "-o", out, "--interval", "0.5", "--horizon", "3"],
            "--horizon",
        ),
        (["invert", banded, "-o", out], "banded"),
        (["calibrate", inverse, runs[0], "-o", tmp_path / "b.json"], "inverse"),
        (["calibrate", model, runs[0], "--fitted", runs[0], "-o", tmp_path / "b.json"], "run-0"),
        (["calibrate", model, model, "-o", tmp_path / "b.json"], "model.json"),
    ):
        result = cli(*words)
        assert result.code == 2, (words, result.out, result.err)
        assert named in result.err, (words, result.err)
