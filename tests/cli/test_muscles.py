"""Several muscles from the command line: fit, invert, track, study."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from mckibben import PI, Recording, load, write
from mckibben.blocks.coupled.balance import Balance
from mckibben.rigs import record
from mckibben.signals import resample
from tests.cli.conftest import Cli

LEVELS = ("0.0", "1.2", "2.5")
SHORT = ("--set", "steps=2", "--set", "n_stops=2", "--set", "n_lags=0")
"""Settings that make a balance quick."""


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of runs of the soft arm at three stiffnesses."""
    folder = tmp_path_factory.mktemp("arm")
    names = [
        f"network-p0-{p0}-drive-{pattern}" for p0 in LEVELS for pattern in ("1", "2", "3", "123")
    ]
    roles = []
    for run, recording in record("sdchm", runs=names):
        write(recording.with_meta(notes=["its clock was mended"]), folder / f"{run.name}.csv")
        roles.append({"name": run.name, "role": run.role})
    reference = {f"displacement_{k}": np.full(400, 30.0) for k in (1, 2, 3)}
    reference["displacement_1"] = 30.0 + 4.0 * np.sin(np.linspace(0, 4 * np.pi, 400))
    reference["pressure_extensor"] = np.full(400, 1.2)
    (folder / "more").mkdir()
    write(Recording(reference, 0.05), folder / "more" / "reference.csv")
    return folder


@pytest.mark.long
def test_from_recordings_to_a_closed_loop(cli: Cli, arm: Path, tmp_path: Path) -> None:
    model, inverse, run = (tmp_path / name for name in ("model.json", "inverse.json", "run.csv"))
    result = cli("fit", "balance", *sorted(arm.glob("*.csv")), "-o", model, *SHORT, "--json")
    assert result.code == 0, result.err
    assert max(json.loads(result.out)["rmse_by_output"].values()) < 2.0
    first = next(iter(sorted(arm.glob("*drive-1.csv"))))
    result = cli("simulate", model, first, "-o", run, "--json")
    assert result.code == 0, result.err
    assert set(json.loads(result.out)["metrics"]) == {f"displacement_{k}" for k in (1, 2, 3)}
    assert cli("invert", model, "-o", inverse).code == 0
    reference = arm / "more" / "reference.csv"
    given = ["--rig", "soft-arm", "--reference", reference, "--json"]
    blind = cli("track", inverse, *given)
    seeing = cli("track", inverse, *given, "--controller", "feedforward-pid", "-o", run)
    for result in (blind, seeing):
        assert result.code == 0, result.err
    errors = [max(json.loads(result.out)["rmse"].values()) for result in (blind, seeing)]
    assert errors[1] < 0.5 * errors[0]
    assert "reference_displacement_1" in run.read_text().splitlines()[0]


@pytest.mark.long
def test_one_output_of_several_muscles_is_compared(cli: Cli, arm: Path, tmp_path: Path) -> None:
    runs = sorted(arm.glob("*drive-123.csv"))
    channel = ["--output", "displacement_1", "--models", "coupled-memory"]
    result = cli("compare", *runs[:2], "--test", runs[2], *channel, "-o", tmp_path / "out")
    assert result.code == 0, result.err
    first, *_ = json.loads((tmp_path / "out" / "leaderboard.json").read_text())["rows"]
    assert set(first["outputs"]) == {"displacement_1"}


@pytest.mark.long
def test_study_of_a_folder_closes_the_loop(cli: Cli, arm: Path, tmp_path: Path) -> None:
    out = tmp_path / "study"
    short = [f"balance.{word}" if "=" in word else word for word in SHORT]
    result = cli("study", arm, "-o", out, "--models", "balance,coupled-pi", *short, "--json")
    assert result.code == 0, result.err
    found = json.loads(result.out)
    board = found["leaderboard"]
    assert found["inverse"]["model"] == board["chosen"] == "balance"
    first, second, constant = board["rows"]
    assert constant["model"] == "constant"
    assert first["validation_rmse"] < second["validation_rmse"]
    assert set(first["outputs"]) == {f"displacement_{k}" for k in (1, 2, 3)}
    assert "1.2" in board["split"]
    noted = [note for note in board["notes"] if note.endswith("its clock was mended")]
    assert len(noted) == len(list(arm.glob("*.csv")))
    errors = {name: max(rmse.values()) for name, rmse in found["tracking"].items()}
    assert errors["balance inverse + PID"] < errors["balance inverse"]
    for name in ("report.html", "leaderboard.csv", "leaderboard.json", "inverse.json"):
        assert (out / name).is_file()


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["track", "nowhere.json", "--rig", "soft-arm", "--reference", "x.csv"], "nowhere.json"),
        (["track", "model.json", "--rig", "soft-arm", "--reference", "ref.csv"], "displacement_1"),
        (["invert", "pi.json", "--for", "force", "-o", "est.json"], "'pi'"),
        (["study", "empty", "-o", "x"], "empty"),
        (["fit", "pi", "three.csv", "-o", "x.json", "--validation", "three.csv"], "pi"),
        (["fit", "coupled-pi", "three.csv", "-o", "x.json", "--set", "luck=1"], "'luck'"),
        (["fit", "sdchm", "rest.csv", "-o", "x.json"], "displacement_1"),
        (["fit", "force-balance", "three.csv", "-o", "x.json"], "'balance'"),
        (["compare", "three.csv", "--models", "grey-box"], "'balance'"),
        (["study", "one.csv", "-o", "x", "--rig", "soft-arm"], "--rig"),
    ],
)
def test_bad_calls_leave_with_a_remedy(
    cli: Cli, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str], named: str
) -> None:
    monkeypatch.chdir(tmp_path)
    u = np.linspace(0, 3, 100)
    pressures = {f"pressure_{k}": np.sin(k * u) for k in (1, 2, 3)}
    moved = {f"displacement_{k}": 2 * np.sin(k * u) for k in (1, 2, 3)}
    write(Recording(pressures | moved, 0.1), "three.csv")
    others = {name: np.ones(100) for name in ("pressure_extensor", "force")}
    write(Recording(pressures | moved | others, 0.1), "ref.csv")
    write(Recording({"pressure": u, "displacement": 2 * u}, 0.1), "one.csv")
    write(Recording({"pressure": u, "force": 2 * u}, 0.1), "rest.csv")
    Path("empty").mkdir()
    PI.example().save("pi.json")
    Balance.example().inverse().save("model.json")
    before = {path for path in tmp_path.rglob("*") if path.is_file()}
    result = cli(*arguments)
    assert result.code == 2
    assert named in result.err
    assert "Remedy" in result.err
    assert {path for path in tmp_path.rglob("*") if path.is_file()} == before


@pytest.mark.long
def test_study_under_loads_ranks_one_model_for_all(cli: Cli, tmp_path: Path) -> None:
    folder = tmp_path / "rail"
    folder.mkdir()
    names = ["status-1", "status-2", "training-pulls-100N", "status-4"]
    for run, recording in record("mpi-narmax", runs=names):
        write(resample(recording, 0.05), folder / f"{run.name}.csv")
    (folder / "protocol.json").write_text(
        json.dumps(
            {
                "runs": [
                    {"name": name, "role": "test" if name == "status-4" else "train"}
                    for name in names
                ]
            }
        )
    )
    given = ["--models", "balance", "--load", "force", "-o", tmp_path / "out", "--json"]
    result = cli("study", folder, *given)
    assert result.code == 0, result.err
    rows = json.loads(result.out)["leaderboard"]["rows"]
    assert rows[0]["model"] == "balance"
    assert any("98.5 N" in row["model"] for row in rows[1:])
    result = cli("study", folder, "--load", "weight", "-o", tmp_path / "out")
    assert result.code == 2
    assert "weight" in result.err


def test_loads_are_estimated_by_what_is_measured(cli: Cli, tmp_path: Path) -> None:
    model, estimate, known, told = (
        tmp_path / name for name in ("model.json", "estimate.json", "known.csv", "told.csv")
    )
    muscles = Balance.example()
    muscles.save(model)
    time = np.arange(400)
    inputs = {
        channel.name: 1.0 - np.cos(0.05 * rate * time)
        for rate, channel in enumerate(muscles.inverse().inputs, start=1)
    }
    inputs["force"] *= 12.0  # from nothing, as an estimate takes it where it rests
    run = muscles.inverse().simulate(Recording(inputs, 0.05))
    units = {channel.name: channel.unit for channel in muscles.inputs + muscles.outputs}
    write(Recording({name: run[name] for name in units}, 0.05, units=units), known)
    result = cli("invert", model, "--for", "force", "-o", estimate, "--json")
    assert result.code == 0, result.err
    assert "force" not in json.loads(result.out)["inputs"]
    result = cli("simulate", estimate, known, "-o", told, "--json")
    assert result.code == 0, result.err
    assert json.loads(result.out)["metrics"]["force"]["rmse"] < 1e-5  # numbers as text are rounded


def test_one_muscle_is_told_which_input_was_taken_and_what_lies_beyond(
    cli: Cli, tmp_path: Path
) -> None:
    time = np.arange(400) * 0.05
    pressure = 2.0 - 2.0 * np.cos(time)
    given = {
        "voltage": 2.0 * pressure,
        "pressure": pressure,
        "displacement": 5.0 * pressure,
        "force": 20.0 - 20.0 * np.cos(1.7 * time),
    }
    run, model = tmp_path / "run.csv", tmp_path / "model.json"
    write(Recording(given, 0.05), run)
    result = cli("fit", "balance", run, *SHORT, "-o", model)
    assert result.code == 0, result.err
    assert "voltage" in result.out
    assert load(model).inputs[0].name == "pressure"
    result = cli("fit", "balance", run, *SHORT, "--input", "pressure", "-o", model, "--force")
    assert "voltage" not in result.out
    result = cli("simulate", model, run, "-o", tmp_path / "out.csv")
    assert "extrapolates" not in result.out
    write(Recording({**given, "force": 2.0 * given["force"]}, 0.05), tmp_path / "heavy.csv")
    result = cli("simulate", model, tmp_path / "heavy.csv", "-o", tmp_path / "out.csv", "--force")
    assert "extrapolates" in result.out


@pytest.mark.long
def test_a_comparison_that_leaves_no_model_ends_with_an_error(cli: Cli, arm: Path) -> None:
    runs = sorted(arm.glob("*drive-123.csv"))
    result = cli("compare", *runs[:2], "--test", runs[2], "--models", "pi,gpi", "--jobs", 1)
    assert result.code == 1
    models = ("pi", "coupled-memory")
    result = cli("compare", *runs[:2], "--test", runs[2], "--models", ",".join(models), "--jobs", 1)
    assert result.code == 0
