"""Recordings of different sample times are brought to one, as one change that can be undone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from nicegui import ui
from nicegui.testing import User

from mckibben import Recording
from mckibben.app.desk import Desk
from mckibben.app.jobs import Jobs, note
from mckibben.app.kept import Step
from mckibben.app.offering import offered
from mckibben.app.pages import apart
from mckibben.app.together import differing, obstacle, sample_times
from mckibben.app.workspace import Workspace
from tests.app.test_jobs import filled, swung
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


@pytest.mark.parametrize("load", [None, 20.0])
def test_recordings_of_several_zeros_get_one(tmp_path: Path, load: float | None) -> None:
    workspace = Workspace(tmp_path)
    time = np.arange(400) * 0.05
    for name, zero in (("one", 0.0), ("two", 30.0)):
        u = 2 - 2 * np.cos(time)
        told = {} if load is None else {"force": np.full(400, load + zero)}
        workspace.add(
            Recording({"pressure": u, "displacement": u + zero} | told, 0.05),
            origin="",
            call="",
            name=name,
        )

    async def look(user: User) -> None:
        await user.should_see(marker="zeros", retries=100)
        await user.should_see("where pressure is lowest")
        await user.should_see(
            "a sensor was zeroed" if load is None else "force that is told may be why"
        )
        user.find(marker="zero-all").click()
        await user.should_not_see(marker="zeros", retries=100)

    visit(workspace, look)
    assert np.allclose(workspace.recording("two")["displacement"], 2 - 2 * np.cos(time), atol=0.1)
    assert "zeroed" in workspace.entry("two").call or workspace.entry("two").steps[-1].do == "zero"
    assert workspace.undo() == "displacement zeroed"
    assert workspace.recording("two")["displacement"].min() > 29


def test_recordings_of_another_muscle_are_set_unused_at_once(tmp_path: Path) -> None:
    workspace = Workspace(tmp_path)
    u = 2 - 2 * np.cos(np.arange(400) * 0.05)
    for name, gain in (("one", 1.0), ("two", 1.01), ("other", 3.0)):
        run = Recording({"pressure": u, "displacement": gain * u}, 0.05)
        workspace.add(run, origin="", call="", name=name)

    async def look(user: User) -> None:
        await user.should_see(marker="unlike", retries=100)
        await user.should_see("Set 2 unused")
        user.find(marker="aside-other").click()
        await user.should_not_see(marker="unlike", retries=100)

    visit(workspace, look)
    assert [workspace.entry(n).role for n in ("one", "two", "other")] == [
        "train",
        "train",
        "unused",
    ]
    workspace.undo()
    assert workspace.entry("other").role == "train"


def arm(seed: float) -> Recording:
    time = np.arange(400) * 0.05
    given = {f"pressure_{k}": 2 + np.sin(k * time + seed) for k in (1, 2, 3)}
    return Recording(given | {f"displacement_{k}": np.cos(k * time) for k in (1, 2)}, 0.05)


def test_of_recordings_of_several_kinds_none_is_fitted(tmp_path: Path) -> None:
    workspace = Workspace(tmp_path)
    for name in ("one", "two", "three"):
        workspace.add(swung(7.0), origin="", call="", name=name)
    workspace.add(arm(0.0), origin="", call="", name="arm")

    async def look(user: User) -> None:
        user.find(marker="tab-models").click()
        await user.should_see("3 recordings of one muscle; 1 of 3 muscles", retries=100)
        await user.should_not_see(marker="model-pi")
        (fit,) = user.find(marker="fit").elements
        assert isinstance(fit, ui.button)
        assert not fit.enabled
        user.find(marker="tab-look").click()
        await user.should_see("3 recordings of one muscle; 1 of 3 muscles", retries=100)
        user.find(marker="tab-models").click()
        user.find(marker="aside-arm").click()
        await user.should_see(marker="model-pi", retries=100)
        assert fit.enabled

    visit(workspace, look)
    assert workspace.entry("arm").role == "unused"


def test_what_keeps_models_from_being_fitted_is_said(tmp_path: Path) -> None:
    workspace = Workspace(tmp_path)
    desk = Desk(workspace, Jobs(workspace))
    assert obstacle(desk) == ""
    time = np.arange(400) * 0.05
    channels = {"pressure": 2 + np.sin(time), "x": np.cos(time), "angle": np.sin(time)}
    units = {"pressure": "bar", "x": "mm", "angle": "rad"}
    workspace.add(Recording(channels, 0.05, units=units), origin="", call="", name="one")
    assert "There is no channel displacement" in obstacle(desk)
    desk.outputs = ("x", "angle")
    assert "mm and in rad" in obstacle(desk)
    desk.outputs = ("x",)
    assert obstacle(desk) == ""
    assert offered(desk).groups
    workspace.add(Recording(channels, 0.06, units=units), origin="", call="", name="two")
    assert "sample times from 0.05 to 0.06 s" in obstacle(desk)
    assert not offered(desk).groups
    desk.jobs.close()


def test_counts_keep_nobody_from_fitting_and_lacking_times_do(tmp_path: Path) -> None:
    workspace = Workspace(tmp_path)
    desk = Desk(workspace, Jobs(workspace))
    runs: dict[str, tuple[dict[str, str], float | None]] = {
        "level": ({"level": ""}, 0.1),
        "cycle": ({"cycle": ""}, 0.1),
        "pull": ({"force": "N"}, 0.1),
        "late": ({}, None),
    }
    for name, (more, step) in runs.items():
        run = swung(10.0)
        channels = dict(run.channels) | dict.fromkeys(more, run["pressure"])
        recording = Recording(channels, step, units=dict(run.units) | more)
        workspace.add(recording, origin="", call="", name=name)
    desk.settle_channels()
    workspace.set_role(["pull", "late"], "unused")
    assert not differing(desk)
    assert obstacle(desk) == ""
    workspace.set_role("pull", "train")
    assert len(differing(desk)) == 3
    workspace.set_role("pull", "unused")
    workspace.set_role("late", "train")
    assert "others have none (late)" in obstacle(desk)
    desk.jobs.close()


def test_ended_fits_are_cleared_at_once(tmp_path: Path) -> None:
    workspace = filled(tmp_path)
    for number in (1, 2):
        note(workspace, f"fit-{number}", "fit", {"model": "pi"}, "failed", "there is no channel")

    async def look(user: User) -> None:
        user.find(marker="tab-models").click()
        await user.should_see("0 done, 2 not, 0 to go", retries=100)
        user.find(marker="clear-fits").click()
        await user.should_not_see(marker="fits", retries=100)

    visit(workspace, look)
    assert workspace.names("jobs") == []
