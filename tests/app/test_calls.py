"""Calls that are shown run as they stand, and the script does again what is on the leaderboard."""

from __future__ import annotations

import ast
import shlex
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
from tests.app.simulated import CHANNELS, filled, quiet, swung
from tests.golden.commands import call


def fitted(workspace: Workspace, name: str, model: str = "pi", **given: Any) -> None:
    """Fit a model as the workbench does."""
    fit(workspace, {"model": model, "name": name} | CHANNELS | given, quiet)


def run(workspace: Workspace, folder: Path, chosen: Any = None) -> None:
    """Run the script in a folder."""
    text = scripts.script(workspace, workspace.results(), CHANNELS, chosen)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        exec(compile(text, "script.py", "exec"), {"__name__": "__main__"})
    assert (folder / "inverse.json").is_file()


def asked_for(workspace: Workspace) -> dict[str, Any]:
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


@pytest.fixture
def tuned(workspace: Workspace) -> Workspace:
    """Return one of two fits of a model and one that was brought."""
    fitted(workspace, "coarse", settings={"n_operators": 1})
    fitted(workspace, "fine", settings={"n_operators": 12})
    PI.example().save(workspace.path("models", "brought.json"))
    return workspace


def test_the_script_fits_each_model_once_as_its_best_fit_was(
    tuned: Workspace, tmp_path: Path
) -> None:
    best, worse = tuned.results()
    assert best["validation_rmse"] < worse["validation_rmse"]
    assert asked_for(tuned)["models"] == ["pi"]
    assert asked_for(tuned)["settings"] == {"pi": best["settings"]}
    run(tuned, tmp_path)
    assert mckibben.load(tmp_path / "pi.json") == tuned.model(best["name"])


@pytest.mark.parametrize(
    ("name", "form", "settings"),
    [
        ("coarse", "adaptive", {"time": 30.0}),
        ("fine", "predictive", {"rate_limit": 5.0, "horizon": None}),
        ("brought", "inverse", {}),
    ],
)
def test_the_script_makes_the_compensator_that_was_chosen(
    name: str, form: str, settings: dict[str, Any], tuned: Workspace, tmp_path: Path
) -> None:
    run(tuned, tmp_path, (name, form, settings, 0.02))
    made = forms.made(tuned, name, form, settings)
    assert mckibben.load(tmp_path / "inverse.json") == made


def test_the_script_is_of_the_recordings_in_use_also_where_they_share_data(
    workspace: Workspace,
) -> None:
    fitted(workspace, "before", "gpi")
    workspace.edit("run", "whole", ())
    fitted(workspace, "after")
    assert asked_for(workspace)["models"] == ["pi"]
    workspace.add(swung(10.0), origin="", call="", name="same", role="test")
    fitted(workspace, "again", allow_shared=True)
    assert asked_for(workspace)["allow_shared"] is True


@pytest.mark.parametrize("form", [form for form in forms.FORMS if form not in ("band", "force")])
@pytest.mark.parametrize("law", ["feedforward", "pid"])
def test_calls_of_loops_run(
    form: str, law: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    workspace = Workspace(tmp_path)
    PI.example().save(workspace.path("models", "mine.json"))
    wave = 2.0 * np.sin(0.5 * np.arange(200) * 0.1)
    channels = {"pressure": 2.5 + wave} if form == "model" else {"displacement": 17.0 + 3.0 * wave}
    write(Recording(channels, 0.1), workspace.path("runs", "reference.csv"))
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
    monkeypatch.chdir(workspace.folder)
    for command in commands:
        assert call(*shlex.split(command.removeprefix("# in a shell: mckibben "))).code == 0
    for each in calls:
        exec(each, {"mckibben": mckibben})
