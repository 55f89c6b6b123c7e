"""Recordings that are made alike, and what drives and moves in all of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mckibben import Recording
from mckibben.app import sample_times
from mckibben.app.jobs import Jobs
from mckibben.app.state import State
from mckibben.app.workspace import Workspace


def test_other_rates_are_brought_to_one(tmp_path: Path) -> None:
    workspace = Workspace(tmp_path)
    for step in (0.1, 0.11):
        time = np.linspace(0.0, 20.0, round(20.0 / step))
        one = Recording({"pressure": time, "displacement": 2 * time}, step)
        workspace.add_recording(one, name=f"run-{step}")
    assert sample_times.sample_times(workspace) == (0.1, 0.11)
    sample_times.resample(workspace, 0.11)
    assert sample_times.sample_times(workspace) is None
    assert len(workspace.entry("run-0-11").steps) == 0


def test_channels_that_no_name_recognises_are_chosen_one_after_another(tmp_path: Path) -> None:
    pytest.importorskip("nicegui")
    workspace = Workspace(tmp_path)
    workspace.add_recording(Recording(dict.fromkeys(("dist", "forc"), np.zeros(9))), name="a")
    state = State(workspace, Jobs(workspace))
    state.settle()
    assert (state.inputs, state.outputs) == ([], [])
    state.inputs = ["dist"]
    state.settle()
    assert (state.inputs, state.outputs) == (["dist"], [])
    state.outputs = ["forc"]
    state.settle()
    assert (state.inputs, state.outputs) == (["dist"], ["forc"])
