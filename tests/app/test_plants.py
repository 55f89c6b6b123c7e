"""The user's own models are plants of the compensate step."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mckibben import PI, Banded, Recording, read, write
from mckibben.app.following import loop
from mckibben.app.workspace import Workspace
from mckibben.registry import load

MODEL = PI.example()


def workspace_of(folder: Path) -> Workspace:
    workspace = Workspace(folder)
    bigger = replace(MODEL, weights=tuple(3 * weight for weight in MODEL.weights))
    unlimited = replace(MODEL, input_range=None)
    models = {"mine": MODEL, "mine-inverse": MODEL.inverse()}
    models |= {"bigger": bigger, "unlimited": unlimited, "arm": load("blocks", "balance").example()}
    for name, block in models.items():
        block.save(workspace.path("models", f"{name}.json"))
    replace(Banded.example(), forward=bigger).save(workspace.path("banded", "bigger.json"))
    t = np.arange(400) * 0.02
    (low,), (high,) = MODEL.reachable()
    wave = 0.5 * (low + high) + 0.4 * (high - low) * np.sin(t)
    write(Recording({"displacement": wave}, 0.02), workspace.path("runs", "reference.csv"))
    return workspace


def test_other_models_are_offered_before_the_one_inverted(tmp_path: Path) -> None:
    workspace = workspace_of(tmp_path)
    assert workspace.plants("mine") == ["bigger", "mine"]
    rising = np.asarray(np.linspace(0.5, 4.0, 50), dtype=np.float64)
    run = Recording({"pressure": rising, "displacement": 5.0 * rising}, 0.1)
    workspace.add(run, origin="", call="", role="train")  # tells the limits of what knows none
    assert workspace.plants("mine") == ["bigger", "unlimited", "mine"]
    assert workspace.twin("bigger").scatters
    assert not workspace.twin("mine").scatters
    assert tuple(workspace.twin("unlimited").limits("pressure")) == (0.5, 4.0)


def test_models_that_know_time_are_the_first_plants(tmp_path: Path) -> None:
    workspace = workspace_of(tmp_path)
    lagging = load("blocks", "process-model").example()
    assert lagging.rate_dependent
    lagging.save(workspace.path("models", "later.json"))
    rising = np.asarray(np.linspace(0.5, 4.0, 50), dtype=np.float64)
    run = Recording({"pressure": rising, "displacement": 5.0 * rising}, 0.1)
    workspace.add(run, origin="", call="", role="train")  # tells the limits of what knows none
    assert workspace.plants("mine") == ["later", "bigger", "unlimited", "mine"]


def test_models_that_predict_worse_are_the_last_plants_and_it_is_said(tmp_path: Path) -> None:
    workspace = workspace_of(tmp_path)
    replace(MODEL, weights=tuple(2 * w for w in MODEL.weights)).save(tmp_path / "models/close.json")
    load("blocks", "process-model").example().save(workspace.path("models", "later.json"))
    rising = np.linspace(0.5, 4.0, 50)
    run = Recording({"pressure": rising, "displacement": 5.0 * rising}, 0.1)
    workspace.add(run, origin="", call="", role="train")
    for name, rmse in {"mine": 0.5, "close": 0.55, "later": 3.125, "bigger": 0.4}.items():
        row = {"status": "ok", "model": "pi", "validation_rmse": rmse, "unit": "mm"}
        workspace.write_json("results", name, row)
    assert workspace.plants("mine") == ["bigger", "close", "unlimited", "later", "mine"]
    weaker = workspace.weaker("mine")
    assert set(weaker) == {"later"}
    assert "its validation RMSE is 3.12 mm, not 0.500 mm" in weaker["later"]


@pytest.mark.parametrize(
    ("plant", "words"), [("bigger", "are of two muscles"), ("mine", "right by construction")]
)
def test_a_loop_on_ones_own_model_is_kept_beside_no_compensation(
    tmp_path: Path, plant: str, words: str
) -> None:
    workspace = workspace_of(tmp_path)
    asked = {"model": "mine", "plant": plant, "controller": "feedforward", "name": "try"}
    loop(workspace, asked | {"reference": "reference.csv"}, lambda share, cost: None)
    run = workspace.runs("mine")["try"]
    assert (run.plant, run.rig) == (plant, "")
    assert words in " ".join(run.notes)
    assert run.uncompensated["displacement"] is not None
    (kept,) = read(workspace.path("runs", "try.csv"), informative=False)
    scored = kept.time >= 0
    error = kept["uncompensated_displacement"] - kept["reference_displacement"]
    rmse = float(np.sqrt(np.mean(error[scored] ** 2)))
    assert rmse == pytest.approx(run.uncompensated["displacement"], rel=1e-6)
