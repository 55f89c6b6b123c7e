"""The pages, without a browser: they say what to do first, and show what there is."""

from __future__ import annotations

import asyncio
import os
from collections.abc import Awaitable, Callable
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("nicegui")

from nicegui import Client
from nicegui.testing import User, user_simulation

from mckibben import DataError
from mckibben.app import plots, scripts
from mckibben.app.jobs import Jobs
from mckibben.app.pages.compensate import _points
from mckibben.app.server import _load_the_rest, build
from mckibben.app.work import reference_recording
from mckibben.app.workspace import Workspace
from mckibben.registry import load
from mckibben.report import subjects
from tests.app.test_jobs import filled


def visit(workspace: Workspace, look: Callable[[User], Awaitable[None]]) -> None:
    """Open the workbench over a workspace, without a browser, and look at it."""

    _load_the_rest()  # which a page that is opened would wait for

    async def run() -> None:
        def root() -> None:
            build(workspace, Jobs(workspace))

        async with user_simulation(root) as user:
            try:
                await user.open("/")
                await look(user)
            finally:
                for client in Client.instances.values():
                    client.outbox.stop()  # it can swallow a cancellation, and then would wait for ever

    kept = dict(os.environ)
    asyncio.run(run())
    os.environ.clear()
    os.environ.update(kept)


def test_an_empty_workspace_says_what_to_do_first(tmp_path: Path) -> None:
    async def look(user: User) -> None:
        await user.should_see("Nothing here yet.")
        await user.should_see(marker="example")
        for tab, text in (
            ("tab-look", "Add recordings with an input and an output first"),
            ("tab-models", "Fit models to see them compared here."),
            ("tab-compensate", "Fit a model that can be inverted first"),
            ("tab-take", "Fit a model first"),
        ):
            user.find(marker=tab).click()
            await user.should_see(text)

    visit(Workspace(tmp_path), look)


def test_what_is_there_is_shown(tmp_path: Path) -> None:
    workspace = filled(tmp_path)
    load("blocks", "pi").example().save(workspace.path("models", "mine.json"))
    figures = {"rmse": 0.5, "r2": 0.99, "rmse_interval": [0.4, 0.6]}
    workspace.write_json(
        "results", "mine", {"status": "ok", "model": "pi", "test": figures, "train": figures}
    )

    async def look(user: User) -> None:
        await user.should_see(marker="recording-run")
        user.find(marker="tab-look").click()
        await user.should_see("What the muscle does")
        await user.should_see(marker="loop-plot")
        user.find(marker="tab-models").click()
        await user.should_see(marker="leaderboard")
        user.find(marker="tab-compensate").click()
        await user.should_see("Reference")
        user.find(marker="tab-take").click()
        await user.should_see(marker="script")

    visit(workspace, look)


def test_a_damaged_recording_is_told_and_harms_nothing_else(tmp_path: Path) -> None:
    workspace = filled(tmp_path)
    workspace.entry("run").path.write_text("pressure,displacement\n1,x\n")

    async def look(user: User) -> None:
        await user.should_see("Remedy")
        user.find(marker="tab-look").click()
        await user.should_see("Add recordings with an input and an output first")
        user.find(marker="tab-models").click()
        user.find(marker="fit").click()

    visit(workspace, look)


def test_fitting_without_a_recording_is_answered(tmp_path: Path) -> None:
    async def look(user: User) -> None:
        user.find(marker="tab-models").click()
        user.find(marker="fit").click()
        await user.should_see("There is no recording to train on.")

    visit(Workspace(tmp_path), look)


def test_cutting_needs_a_selection(tmp_path: Path) -> None:
    async def look(user: User) -> None:
        await user.should_see(marker="keep")
        user.find(marker="keep").click()
        await user.should_see("nothing is selected")

    visit(filled(tmp_path), look)


def test_the_script_runs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    workspace = filled(tmp_path)
    workspace.write_json("results", "mine", {"status": "ok", "model": "pi", "settings": {}})
    text = scripts.script(workspace, ["mine"], ("pressure", "displacement"))
    here = Path.cwd()
    os.chdir(tmp_path)
    try:
        exec(compile(text, "script.py", "exec"), {})
    finally:
        os.chdir(here)
    assert "pi" in capsys.readouterr().out
    assert (tmp_path / "inverse.json").is_file()


def test_figures_hold_plain_numbers_and_colours(tmp_path: Path) -> None:
    recording = filled(tmp_path).recording("run")
    for dark in (False, True):
        (figure,) = plots.figures(subjects.loop([recording], "pressure", "displacement"), dark=dark)
        trace = figure["data"][0]
        assert isinstance(trace["x"], list)
        assert trace["line"]["color"].startswith("#")
        assert "--" not in str(figure["layout"])
    assert plots.colours(True) != plots.colours(False)


def test_a_window_of_a_long_recording_is_thinned_anew(tmp_path: Path) -> None:
    recording = filled(tmp_path).recording("run")
    (whole,) = plots.window(recording, ["pressure"], -1e9, 1e9)
    (part,) = plots.window(recording, ["pressure"], 10.0, 20.0)
    assert len(whole["x"]) == len(recording)
    assert 9.8 <= part["x"][0] <= 10.0
    assert 20.0 <= part["x"][-1] <= 20.2
    (beyond,) = plots.window(recording, ["pressure"], 1e6, 1e7)
    assert len(beyond["x"]) >= 2


def test_points_are_read_and_become_a_reference() -> None:
    points = _points("0 10\n\n 2; 20\n4,10")
    assert points == [(0.0, 10.0), (2.0, 20.0), (4.0, 10.0)]
    reference = reference_recording(points, 0.5, "displacement")
    np.testing.assert_allclose(reference["displacement"][[0, 2, 4, 8]], [10, 15, 20, 10])


@pytest.mark.parametrize("text", ["1", "a b", "1 2 3"])
def test_points_that_are_none_are_named(text: str) -> None:
    with pytest.raises(DataError, match="write two numbers a line"):
        _points(text)


@pytest.mark.parametrize("points", [[], [(0.0, 1.0)], [(0.0, 1.0), (0.0, 2.0)], [(0, 1), (1e9, 2)]])
def test_references_that_cannot_be_are_refused(points: list[tuple[float, float]]) -> None:
    with pytest.raises(DataError, match=r"Remedy:"):
        reference_recording(points, 0.01, "displacement")
