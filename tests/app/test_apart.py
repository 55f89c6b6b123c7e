"""Recordings of different sample times are brought to one, as one change that can be undone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from nicegui.testing import User

from mckibben import Recording
from mckibben.app.desk import Desk
from mckibben.app.jobs import Jobs
from mckibben.app.kept import Step
from mckibben.app.pages import apart
from mckibben.app.together import sample_times
from mckibben.app.workspace import Workspace
from tests.app.test_pages import visit


def test_each_gets_one_step_more_and_one_undo_takes_all_back(tmp_path: Path) -> None:
    workspace = Workspace(tmp_path)
    desk = Desk(workspace, Jobs(workspace))
    for name, step in (("slow", 0.0169), ("fast", 0.0168)):
        time = np.arange(400) * step
        channels = {"pressure": 2 + np.sin(time), "displacement": np.cos(time)}
        workspace.add(Recording(channels, step), origin="a test", call="", name=name)
    times = sample_times(desk)
    assert times == pytest.approx((0.0168, 0.0169))
    assert times is not None
    wanted = apart.common(times)
    workspace.edit_each(["fast"], "all resampled", Step(do="resample", sample_time=wanted))
    assert workspace.recording("fast").sample_time == wanted
    assert sample_times(desk) is None
    assert len(workspace.entry("fast").steps) == 1
    assert workspace.undo() == "all resampled"
    assert sample_times(desk) == times
    desk.jobs.close()


def test_recordings_of_several_zeros_get_one(tmp_path: Path) -> None:
    workspace = Workspace(tmp_path)
    time = np.arange(400) * 0.05
    for name, zero in (("one", 0.0), ("two", 30.0)):
        u = 2 - 2 * np.cos(time)
        workspace.add(
            Recording({"pressure": u, "displacement": u + zero}, 0.05),
            origin="",
            call="",
            name=name,
        )

    async def look(user: User) -> None:
        await user.should_see(marker="zeros", retries=100)
        await user.should_see("where pressure is lowest")
        user.find(marker="zero-all").click()
        await user.should_not_see(marker="zeros", retries=100)

    visit(workspace, look)
    assert np.allclose(workspace.recording("two")["displacement"], 2 - 2 * np.cos(time), atol=0.1)
    assert "zeroed" in workspace.entry("two").call or workspace.entry("two").steps[-1].do == "zero"
    assert workspace.undo() == "displacement zeroed"
    assert workspace.recording("two")["displacement"].min() > 29
