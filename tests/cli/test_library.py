"""What comes with the package, from the command line: recordings, muscles."""

from __future__ import annotations

import json
from pathlib import Path

from mckibben import example, muscles, read, write
from mckibben.muscles.library import FOLDER
from tests.cli.conftest import Cli
from tests.estimators.test_balance_prior import moved


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


def test_muscles_are_listed_and_shown(cli: Cli) -> None:
    listed = json.loads(cli("muscles", "list", "--json").out)
    assert {name: listed[name]["virtual"] for name in listed} == {
        muscle.name: muscle.virtual for muscle in muscles.list()
    }
    assert "rail" in cli("muscles", "list").out
    assert cli("muscles", "show", "rail").out == (FOLDER / "rail.toml").read_text("utf-8")
    shown = json.loads(cli("muscles", "show", "rail", "--json").out)
    assert shown["sheet"] == listed["rail"]["sheet"]


def test_a_fit_begins_from_a_muscle_or_says_what_is_wrong(cli: Cli, tmp_path: Path) -> None:
    write(moved(1, 5.0), tmp_path / "run.csv")
    asked = ["fit", "balance", tmp_path / "run.csv", "-o"]
    few = ["--set", "steps=2", "--set", "contact=false"]
    plain, prior = tmp_path / "plain.json", tmp_path / "prior.json"
    assert cli(*asked, plain, *few).code == 0
    assert cli(*asked, prior, "--prior", "rail", *few).code == 0
    assert plain.read_text("utf-8") != prior.read_text("utf-8")
    nobody = cli(*asked, tmp_path / "x.json", "--prior", "nobody")
    assert nobody.code == 2
    assert "'nobody'" in nobody.err
    sheet = tmp_path / "sheet.toml"
    sheet.write_text("diameter_mm = 20\nrest_length_mm = 200\nmax_force_N = 1500\n")
    for said in (["--prior", sheet], ["--set", f"prior={sheet}"]):
        onto = cli(*asked, sheet, *said, "--force")
        assert onto.code == 2
        assert "sheet.toml" in onto.err
    assert sheet.read_text().startswith("diameter_mm")
    other = cli("fit", "pi", tmp_path / "run.csv", "-o", tmp_path / "x.json", "--prior", "rail")
    assert other.code == 2
    assert "--prior" in other.err
