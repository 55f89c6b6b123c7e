"""Calls that are shown run as they stand, and the script does again what is on the leaderboard."""

from __future__ import annotations

import ast
import os
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("nicegui")

import mckibben
from mckibben import PI, Recording
from mckibben.app import forms, scripts
from mckibben.app.kept import Step
from mckibben.app.work import fit
from mckibben.app.workspace import Workspace
from mckibben.files import write
from mckibben.registry import load
from mckibben.rigs import load_rig
from mckibben.rigs import record as recorded
from tests.app.test_jobs import filled, swung

CHANNELS = {"input": "pressure", "output": "displacement"}


def fitted(workspace: Workspace, name: str, model: str = "pi", **given: Any) -> None:
    """Fit a model as the workbench does."""
    fit(workspace, {"model": model, "name": name} | CHANNELS | given, lambda share, cost: None)


def run(workspace: Workspace, folder: Path, chosen: Any = None) -> str:
    """Run the script in a process of its own, and return what it prints."""
    path = folder / "script.py"
    path.write_text(scripts.script(workspace, workspace.results(), CHANNELS, chosen))
    done = subprocess.run(
        [sys.executable, path.name], cwd=folder, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert (folder / "inverse.json").is_file()
    return done.stdout


def asked(workspace: Workspace) -> dict[str, Any]:
    """Return what the script asks `compare` for."""
    text = scripts.script(workspace, workspace.results(), CHANNELS)
    calls = [node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Call)]
    (call,) = [call for call in calls if ast.unparse(call.func) == "mckibben.compare"]
    return {str(key.arg): ast.literal_eval(key.value) for key in call.keywords}


@pytest.fixture
def workspace(tmp_path: Path) -> Workspace:
    """Return one of two recordings, one of which was changed in every way."""
    found = filled(tmp_path / "ws")
    found.add(swung(8.0), origin="a test", call="", name="other", role="test")
    steps = (
        Step(do="low_pass", cutoff=1.0, channels=["pressure"]),
        Step(do="detrend", channels=["displacement"]),
        Step(do="resample", sample_time=0.1),
        Step(do="slice", start=0, stop=500),
    )
    found.edit("run", "changed", steps)
    return found


def test_the_script_fits_each_model_once_as_its_best_fit_was(
    workspace: Workspace, tmp_path: Path
) -> None:
    fitted(workspace, "coarse", settings={"n_operators": 1})
    fitted(workspace, "fine", settings={"n_operators": 12})
    best, worse = workspace.results()
    assert best["validation_rmse"] < worse["validation_rmse"]
    assert asked(workspace)["models"] == ["pi"]
    assert asked(workspace)["settings"] == {"pi": best["settings"]}
    run(workspace, tmp_path)
    assert mckibben.load(tmp_path / "pi.json") == workspace.model(best["name"])


def test_the_script_makes_the_compensator_that_was_chosen(
    workspace: Workspace, tmp_path: Path
) -> None:
    fitted(workspace, "coarse", settings={"n_operators": 1})
    fitted(workspace, "fine", settings={"n_operators": 12})
    PI.example().save(workspace.path("models", "brought.json"))
    chosen: tuple[tuple[str, str, dict[str, Any]], ...] = (
        ("coarse", "adaptive", {"time": 30.0}),
        ("fine", "predictive", {"rate_limit": 5.0, "horizon": None}),
        ("brought", "inverse", {}),
    )
    for name, form, settings in chosen:
        run(workspace, tmp_path, (name, form, settings, 0.02))
        assert mckibben.load(tmp_path / "inverse.json") == forms.made(
            workspace, name, form, settings
        )


def test_the_script_goes_on_where_recordings_share_data(tmp_path: Path) -> None:
    workspace = filled(tmp_path / "ws")
    workspace.add(swung(10.0), origin="", call="", name="same", role="test")
    fitted(workspace, "pi", allow_shared=True)
    assert asked(workspace)["allow_shared"] is True
    run(workspace, tmp_path)


def test_the_script_is_of_the_recordings_in_use(workspace: Workspace) -> None:
    fitted(workspace, "before", "gpi")
    workspace.edit("run", "whole", ())
    text = scripts.script(workspace, workspace.results(), CHANNELS)
    assert "other data" in text
    fitted(workspace, "after")
    assert asked(workspace)["models"] == ["pi"]
    assert "other data" not in scripts.script(workspace, workspace.results(), CHANNELS)


@pytest.mark.parametrize("form", [form for form in forms.FORMS if form not in ("band", "force")])
@pytest.mark.parametrize("law", ["feedforward", "pid"])
def test_calls_of_loops_run(form: str, law: str, workspace: Workspace) -> None:
    load("blocks", "pi").example().save(workspace.path("models", "mine.json"))
    wave = 2.0 * np.sin(0.5 * np.arange(200) * 0.1)
    channels = {"pressure": 2.5 + wave} if form == "model" else {"displacement": 17.0 + 3.0 * wave}
    reference = Recording(channels, 0.1)
    write(reference, workspace.path("runs", "reference.csv"))
    settings = {"time": 30.0, "rate_limit": 5.0, "horizon": 3}
    compensator = forms.written(workspace, "mine", form, settings)
    commands = [line for line in compensator.splitlines() if line.startswith("#")]
    assert len(commands) == (form in ("adaptive", "predictive"))
    calls = [compensator]
    if form in ("model", "inverse"):
        calls.append(scripts.simulate_call(compensator, "runs/reference.csv"))
    if form in forms.COMPENSATORS:
        twin = scripts.twin_call(workspace, "mine")
        for plant in (twin, "mckibben.load_rig('mas20-hanging')"):
            calls.append(scripts.track_call(law, compensator, plant, "runs/reference.csv"))
    here = Path.cwd()
    os.chdir(workspace.folder)
    try:
        for command in commands:
            words = command.removeprefix("# in a shell: mckibben ").split()
            subprocess.run([sys.executable, "-m", "mckibben.cli.main", *words], check=True)
        for call in calls:
            exec(call, {"mckibben": mckibben})
    finally:
        os.chdir(here)


@pytest.mark.parametrize(("kind", "sides"), [("time", ("pressure", "displacement")), ("loops", ())])
def test_the_command_of_a_figure_runs(
    kind: str, sides: tuple[str, ...], workspace: Workspace
) -> None:
    fitted(workspace, "pi")
    command = scripts.plot_call(workspace, "train", "pi", kind, sides, "figure.svg")
    words = shlex.split(command.removeprefix("mckibben "))
    whole = [sys.executable, "-m", "mckibben.cli.main", *words]
    subprocess.run(whole, check=True, cwd=workspace.folder)
    assert (workspace.folder / "figure.svg").is_file()


def test_names_in_calls_are_of_the_package() -> None:
    from mckibben import control, example, signals

    assert mckibben.example is example
    assert mckibben.signals is signals
    assert mckibben.control is control
    assert mckibben.rigs.record is recorded
    assert mckibben.rigs.load_rig is load_rig
