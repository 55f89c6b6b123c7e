"""The command that says what to record next."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from mckibben import GPI, PI, read
from tests.cli.conftest import Cli


@pytest.fixture
def model(tmp_path: Path) -> Path:
    place = tmp_path / "model.json"
    PI.example().save(place)
    return place


@pytest.mark.long
def test_a_plan_is_written_and_a_rig_plays_it(cli: Cli, tmp_path: Path, model: Path) -> None:
    out = tmp_path / "next.csv"
    asked = ("--rig", "mas20-hanging", "--limits", "pressure=2:4:2", "--minutes", "0.5")
    told = cli("plan", *asked, "--model", model, "-o", out)
    assert told.code == 0, told.err
    assert "--set start.pressure=2" in told.out
    (found,) = read(out, channels=["pressure"], informative=False)
    assert 2.0 - 1e-9 <= found["pressure"].min() < found["pressure"].max() <= 4.0 + 1e-9
    command = told.out.partition("mckibben ")[2].split()
    command[-1] = str(tmp_path / "recorded.csv")
    played = cli(*command, "--json")
    assert played.code == 0, played.err
    assert json.loads(played.out)["saturated"] == {}


def test_json_says_all(cli: Cli, tmp_path: Path, files: tuple[Path, Path], model: Path) -> None:
    out = tmp_path / "next.csv"
    asked = ("--model", model, "--minutes", "0.5", "--for", "weights 1", "--seed", "2", "--json")
    told = cli("plan", files[0], *asked, "-o", out)
    assert told.code == 0, told.err
    found = json.loads(told.out)
    assert {"errors", "parameters", "steps", "sentence", "start", "notes"} <= set(found)
    names = {one["name"] for one in found["parameters"]}
    assert "weights 1" in names
    assert found["errors"]["displacement"]["after"] <= found["errors"]["displacement"]["now"]
    again = cli("plan", files[0], *asked, "-o", tmp_path / "other.csv")
    assert json.loads(again.out)["steps"] == found["steps"]
    assert (tmp_path / "other.csv").read_bytes() == out.read_bytes()


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["--limits", "pressure=4:1"], "pressure"),
        (["--limits", "pressure"], "CHANNEL=LOW:HIGH"),
        (["--limits", "force=0:5"], "force"),
        (["--minutes", "0.01"], "--minutes"),
        (["--for", "nonsense"], "nonsense"),
        (["--rig", "rail"], "voltage"),
        (["--muscle", "rail"], "--muscle"),
    ],
)
def test_the_impossible_is_refused(
    cli: Cli, tmp_path: Path, files: tuple[Path, Path], model: Path, words: list[str], named: str
) -> None:
    out = tmp_path / "next.csv"
    refused = cli("plan", files[0], "--model", model, *words, "-o", out)
    assert refused.code == 2
    assert named in refused.err
    assert not out.exists()


SHEET = """
diameter_mm = 20.0
rest_length_mm = 200.0
max_force_N = 1500.0
max_pressure_bar = 6.0
"""


@pytest.mark.long
@pytest.mark.parametrize("muscle", ["rail", "sheet.toml"])
def test_a_muscle_or_its_data_sheet_is_enough(
    cli: Cli, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, muscle: str
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("sheet.toml").write_text(SHEET)
    told = cli("plan", "--muscle", muscle, "--minutes", "0.5", "--json", "-o", "next.csv")
    assert told.code == 0, told.err
    found = json.loads(told.out)
    error = found["errors"]["displacement"]
    assert error["after"] < 0.8 * error["now"]
    (commands,) = read("next.csv", informative=False)
    assert np.ptp(commands["pressure"]) > 0.5 * commands["pressure"].max()


def test_a_stopped_plan_is_written(
    cli: Cli, tmp_path: Path, files: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    from mckibben.excitation import search

    place = tmp_path / "model.json"
    GPI.example().save(place)
    tried = 0
    chosen = vars(search)["stretches"]

    def stopping(*given: object) -> object:
        nonlocal tried
        tried += 1
        if tried == 3:
            raise KeyboardInterrupt
        return chosen(*given)

    monkeypatch.setattr(search, "stretches", stopping)
    out = tmp_path / "next.csv"
    told = cli("plan", files[0], "--model", place, "--minutes", "0.5", "-o", out)
    assert told.code == 0, told.err
    (found,) = read(out, channels=["pressure"], informative=False)
    assert np.ptp(found["pressure"]) > 1.0
