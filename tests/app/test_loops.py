"""Closed loops are called by what they were, and those that are ticked are drawn."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("nicegui")

from nicegui.testing import User

from mckibben import Recording
from mckibben.app.following import kept_motion, loop
from mckibben.app.motions import reference_recording
from mckibben.app.workspace import Workspace
from mckibben.registry import load
from tests.app.test_compensate import drawn, later, only, until, workspace_with
from tests.app.test_pages import visit


def quiet(share: float, cost: float) -> None:
    """Tell nobody."""


def laden(folder: Path) -> Workspace:
    """Return a workspace of two models of an arm that is stiffened and pulled at."""
    muscles = load("blocks", "balance").example().inverse()
    workspace = workspace_with(folder, a=muscles, b=muscles)
    t = np.arange(60) * 0.05
    channels = (*muscles.inputs, *muscles.outputs)
    values = {c.name: 1.0 + np.sin(t + k) for k, c in enumerate(channels)}
    recorded = Recording(values, 0.05, {c.name: c.unit for c in channels})
    workspace.add(recorded, origin="", call="", role="train")
    return workspace


def follow(workspace: Workspace, name: str, pull: float) -> str:
    """Run a short loop under a force, and keep it; return what it is to be called."""
    ends = {"displacement_1": [(0.0, 0.0), (0.5, 1.0)], "displacement_2": [(0.0, 0.0), (0.5, 0.0)]}
    held, units = (
        {"force": pull, "pressure_extensor": 1.0},
        {"force": "N", "pressure_extensor": "bar"},
    )
    file = kept_motion(workspace, "a", reference_recording(ends, 0.05, held, units))
    given = {"model": "a", "plant": "b", "controller": "feedforward", "reference": file}
    loop(workspace, given | {"name": name}, quiet)
    return f"feedforward on b, force {pull:.1f}\xa0N, pressure_extensor 1.00\xa0bar"


def test_runs_are_called_by_what_was_held_and_those_ticked_are_drawn(tmp_path: Path) -> None:
    workspace = laden(tmp_path)
    light, heavy = (follow(workspace, f"run-{pull:g}", pull) for pull in (10.0, 20.0))

    def traces(user: User) -> list[str]:
        figure = only(user, "loop-runs").figure
        return [one["name"] for one in figure["data"] if one["name"].startswith("feedforward")]

    async def look(user: User) -> None:
        await drawn(user)
        await until(user, "loop-runs")
        table = only(user, "runs")
        assert {row["title"] for row in table.rows} == {light, heavy}
        assert traces(user) == [heavy]  # the newest, and what compares with it
        rows = [row for row in table.rows if row["title"] == light]
        user.find(marker="runs").trigger("selection", {"added": True, "rows": rows, "keys": []})
        await later(lambda: traces(user) == [heavy, light])  # one motion, in one picture
        rows = [row["name"] for row in table.rows if row["title"] == heavy]
        user.find(marker="runs").trigger("selection", {"added": False, "rows": [], "keys": rows})
        await later(lambda: traces(user) == [light])
        newer = follow(workspace, "run-30", 30.0)
        user.find(marker="show-pressures").click()
        # what was ticked stays so, and what is newer comes beside
        await later(lambda: len(only(user, "runs").rows) == 3 and traces(user) == [newer, light])

    visit(workspace, look)
