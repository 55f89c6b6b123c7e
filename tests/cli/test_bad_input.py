from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from mckibben import load
from mckibben.system.locks import alone
from tests.cli.conftest import Cli

GOOD = "time_s,pressure_bar,displacement_mm\n" + "".join(
    f"{k / 10},{2 + k % 7},{k % 5}\n" for k in range(30)
)


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("nan.csv", GOOD.replace("0.5,7,", "0.5,NaN,"), []),
        ("column.csv", GOOD, ["--column", "pressure=P9"]),
        ("unit.csv", GOOD, ["--unit", "pressure=blub"]),
        ("rate.csv", GOOD, ["--rate", 50]),
        ("gap.csv", GOOD.replace("2.9,", "99.9,"), ["--gaps", "error"]),
        ("text.mat", GOOD, []),
    ],
)
def test_malformed_files_leave_with_a_remedy_and_nothing_lost(
    cli: Cli, tmp_path: Path, name: str, content: str, words: list[object]
) -> None:
    """What else is malformed: tests/files/test_malformed.py."""
    path, out = tmp_path / name, tmp_path / "model.json"
    path.write_text(content)
    out.write_text("what was there before")
    result = cli("fit", "pi", path, "-o", out, "--force", *words)
    assert (result.code, result.out) == (2, "")
    assert "Remedy:" in result.err
    assert name in result.err
    assert out.read_text() == "what was there before"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["fit", "spline", "FILE", "-o", "x.json"], "'spline'"),
        (["fit", "pi", "FILE", "-o", "nowhere/x.json"], "nowhere"),
        (["fit", "pi", "FILE", "-o", "x.json", "--set", "n_operator=3"], "'n_operator'"),
        (
            ["fit", "pi", "FILE", "-o", "x.json", "--set", "n_operators=many"],
            "n_operators is 'many'",
        ),
        (["fit", "pi", "FILE", "-o", "x.json", "--method", "luck"], "method is 'luck'"),
        (["fit", "pi", "FILE", "-o", "x.json", "--output", "force"], "force"),
        (["fit", "pi", "FILE", "-o", "x.json", "--output", "pressure"], "pressure"),
        (["fit", "pi", "FILE", "-o", "x.json", "--unit", "pressure"], "--unit 'pressure'"),
        (["fit", "pi", "FILE", "-o", "x.json", "--constant", "force=g"], "force=200 g"),
        (["compare", "FILE", "--models", "pi,what"], "'what'"),
        (["study", "FILE", "-o", "FILE"], "train.csv"),
        (["simulate", "FILE", "FILE", "-o", "x.csv"], "train.csv"),
        (["simulate", "nowhere.json", "FILE", "-o", "x.csv"], "nowhere.json"),
        (["invert", "FILE", "-o", "x.json", "--horizon", "5"], "--predictive"),
        (["plot", "FILE", "-o", "x.bmp"], "bmp"),
        (["plot", "FILE", "-o", "x.png", "--kind", "pie"], "pie"),
        (["info"], "--models"),
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
    assert str(tmp_path) in result.err
    assert not list(tmp_path.iterdir())


def test_columns_without_telling_names_need_no_options(cli: Cli, tmp_path: Path) -> None:
    time = np.arange(600) * 0.05
    volts = 2.0 - 2.0 * np.cos(time)
    wing, model = tmp_path / "wing.csv", tmp_path / "model.json"
    table = np.column_stack([time, volts, 8 * volts])
    np.savetxt(wing, table, "%.5f", ",", header="time_s,input_V,output_deg", comments="")
    for asked, names in (
        ((), ("voltage", "angle")),
        (("--input", "input", "--output", "output"), ("input", "output")),
    ):
        result = cli("fit", "pi", wing, *asked, "-o", model, "--force")
        assert result.code == 0, result.err
        block = load(model)
        assert (block.inputs[0].name, block.outputs[0].name) == names
        assert cli("simulate", model, wing, "-o", tmp_path / "run.csv", "--force").code == 0
    arm = tmp_path / "arm.csv"
    table = np.column_stack([time, volts, 4 - volts, volts])
    np.savetxt(arm, table, "%.5f", ",", header="time_s,u1_V,u2_V,y1_mm", comments="")
    result = cli("fit", "pi", arm, "-o", model, "--force")
    assert result.code == 2
    assert "voltage_1, voltage_2, displacement_1" in result.err
