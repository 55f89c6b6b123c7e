from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from mckibben import PI
from mckibben.signals import triangle
from mckibben.system.locks import alone
from tests.cli.conftest import Cli
from tests.files.malformed import CASES, Case


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_malformed_files_leave_with_a_remedy_and_nothing_lost(
    cli: Cli, case: Case, tmp_path: Path
) -> None:
    path = case.write(tmp_path)
    out = tmp_path / "model.json"
    out.write_text("what was there before")
    result = cli("fit", "pi", path, "-o", out, "--force", *case.arguments)
    assert result.code == 2
    assert result.out == ""
    assert "Traceback" not in result.err
    if case.name == "policy.csv":  # refused as usage, before any file is looked at
        assert "Invalid value for '--gaps'" in result.err
    else:
        assert "Remedy:" in result.err
        assert path.name in result.err
    assert out.read_text() == "what was there before"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["fit", "spline", "FILE", "-o", "x.json"], "no estimator named 'spline'"),
        (["fit", "pi", "nowhere.csv", "-o", "x.json"], "nowhere.csv"),
        (["fit", "pi", "FILE", "-o", "nowhere/x.json"], "nowhere"),
        (["fit", "pi", "FILE", "-o", "x.json", "--set", "n_operator=3"], "no setting 'n_operator'"),
        (
            ["fit", "pi", "FILE", "-o", "x.json", "--set", "n_operators=many"],
            "n_operators is 'many'",
        ),
        (["fit", "pi", "FILE", "-o", "x.json", "--method", "luck"], "method is 'luck'"),
        (["fit", "pi", "FILE", "-o", "x.json", "--output", "force"], "force"),
        (["fit", "pi", "FILE", "-o", "x.json", "--output", "pressure"], "same channel"),
        (["fit", "pi", "FILE", "-o", "x.json", "--unit", "pressure"], "--unit 'pressure'"),
        (["fit", "pi", "FILE", "-o", "x.json", "--unit", "pressure=mm"], "mm"),
        (["fit", "pi", "FILE", "-o", "x.json", "--constant", "force=g"], "force=200 g"),
        (["fit", "pi", "FILE", "-o", "x.json", "--rate", "-5"], "rate"),
        (["compare", "FILE", "--models", "pi,what"], "no estimator named 'what'"),
        (["compare", "FILE", "--models", ","], "no models"),
        (["study", "FILE", "-o", "FILE"], "a file of that name"),
        (["simulate", "FILE", "FILE", "-o", "x.csv"], "this is a recording"),
        (["simulate", "nowhere.json", "FILE", "-o", "x.csv"], "nowhere.json"),
        (["invert", "nowhere.json", "-o", "x.json"], "nowhere.json"),
        (["invert", "FILE", "-o", "x.json", "--horizon", "5"], "add --predictive"),
        (["plot", "FILE", "-o", "x.bmp"], "bmp"),
        (["plot", "FILE", "-o", "x.png", "--kind", "pie"], "pie"),
        (["info"], "nothing to tell"),
    ],
)
def test_bad_arguments_leave_with_a_remedy(
    cli: Cli,
    files: tuple[Path, Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    arguments: list[str],
    said: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    result = cli(*(files[0] if word == "FILE" else word for word in arguments))
    assert result.code == 2
    assert said in result.err
    assert "Remedy:" in result.err
    assert len(result.err.strip().splitlines()) == 1


def test_usage_errors_leave_with_two(cli: Cli) -> None:
    assert cli("fit").code == 2
    assert cli("frobnicate").code == 2
    assert cli("--help").code == 0


def test_a_defect_is_reported_without_a_traceback(
    cli: Cli, files: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def broken(*arguments: object, **settings: object) -> None:
        raise RuntimeError("of all things")

    monkeypatch.setattr("mckibben.files.read", broken)
    result = cli("characterize", files[0])
    assert result.code == 1
    assert "Internal error" in result.err
    assert "Traceback" not in result.err


def test_help_loads_nothing_heavy() -> None:
    heavy = ["numba", "scipy", "pandas", "plotly", "sklearn", "matplotlib", "pint", "numpy"]
    code = f"import sys, mckibben.cli.main; print([m for m in {heavy} if m in sys.modules])"
    printed = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert json.loads(printed.stdout.replace("'", '"')) == []


def test_interrupt_while_fitting_keeps_the_best_so_far(
    cli: Cli, files: tuple[Path, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from mckibben.estimators.optimisers.tracker import Tracker

    seen = Tracker.saw

    def impatient(self: Tracker, point: object, cost: float) -> None:
        seen(self, point, cost)  # type: ignore[arg-type]
        if self.evaluations == 60:
            raise KeyboardInterrupt

    monkeypatch.setattr(Tracker, "saw", impatient)
    out = tmp_path / "model.json"
    result = cli("fit", "gpi", files[0], "-o", out, "--json")
    assert result.code == 0, result.err
    assert json.loads(result.out)["interrupted"] is True
    assert out.exists()


@pytest.mark.parametrize(
    "words",
    [("compare", "FILE", "--models", "pi"), ("study", "FILE"), ("reproduce", "field-models")],
)
def test_two_do_not_write_to_one_folder(
    cli: Cli, files: tuple[Path, Path], tmp_path: Path, words: tuple[str, ...]
) -> None:
    with alone(tmp_path):
        result = cli(*(files[0] if word == "FILE" else word for word in words), "-o", tmp_path)
    assert result.code == 2
    assert "another process is writing its results there" in result.err
    assert not list(tmp_path.iterdir())


def test_channels_without_telling_names_are_called_by_their_units(cli: Cli, tmp_path: Path) -> None:
    file = tmp_path / "wing.csv"
    command = np.concatenate([triangle(np.arange(120) / 10, 4.0, [3.0, 2.0, 1.0])] * 2)
    angle = 10 * PI.example().simulate(command)
    rows = [f"{u:.4f},{y:.4f}" for u, y in zip(command, angle, strict=True)]
    file.write_text("\n".join(["input_V,output_deg", *rows]))
    result = cli("compare", file, "--models", "pi", "-o", tmp_path / "out")
    assert result.code == 0, result.err
    assert "by their units, input is taken for voltage, output is taken for angle" in result.out
    assert "by their units" in cli("info", file).out
    named = ["--column", "pressure=input_V", "--column", "displacement=output_deg"]
    assert "by their units" not in cli("info", file, *named).out
    assert "by their units" not in cli("info", file, "--input", "input", "--output", "output").out
