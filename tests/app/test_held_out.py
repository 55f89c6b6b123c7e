"""Pictures and lists say what models were not fitted to, also where nobody chose what to test on."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("nicegui")

from nicegui import ui
from nicegui.testing import User

from mckibben import PI, Recording
from mckibben.app.workspace import Workspace
from mckibben.comparison.channels import Channels
from mckibben.comparison.splits import held_out
from mckibben.registry import load
from tests.app.test_compensate import later, only, until, workspace_with
from tests.app.test_pages import visit

T = np.arange(600) * 0.05


def moved() -> Recording:
    pressure = 2.0 - 2.0 * np.cos(0.7 * T)
    return Recording({"pressure": pressure, "displacement": 4.0 * pressure}, 0.05)


def shaded(figure: dict[str, Any]) -> list[tuple[float, float]]:
    shapes = figure["layout"]["shapes"]
    return [(one["x0"], one["x1"]) for one in shapes if one["type"] == "rect"]


@pytest.mark.parametrize("tested", [False, True])
@pytest.mark.parametrize("current", [True, False])
def test_what_was_held_out_is_shaded_and_called_so(
    tmp_path: Path, tested: bool, current: bool
) -> None:
    workspace = workspace_with(tmp_path, a=PI.example())
    workspace.add(moved(), origin="", call="", role="train", name="run")
    if tested:
        workspace.add(moved(), origin="", call="", role="test", name="other")
    data = workspace.data() if current else "another"
    row = {"status": "ok", "model": "pi", "validation_rmse": 1.0, "data": data}
    workspace.write_json("results", "a", row)
    (part,) = held_out([moved()], Channels(("pressure",), ("displacement",))).train
    ends = T[len(part)], T[-1]

    async def look(user: User) -> None:
        user.find(marker="tab-models").click()
        await until(user, "closer-on")
        said = only(user, "closer-on").text
        figures = [one.figure for one in user.find(kind=ui.plotly).elements]
        marked = [found for found in map(shaded, figures) if found]
        if tested or not current:
            assert marked == []
            used = ", a test recording" if current else ""
            assert said.startswith(f"On {'other' if tested else 'run'}{used}. RMSE: a ")
        else:
            assert said.startswith("On run, in part held out to test. RMSE of that part: a ")
            assert marked == [[pytest.approx(ends)]] * 2  # of what is over time
            words = [one["text"] for figure in figures for one in figure["layout"]["annotations"]]
            assert words.count("held out to test") == 2

    visit(workspace, look)


def test_models_are_run_on_any_recording_and_their_error_is_said(tmp_path: Path) -> None:
    workspace = workspace_with(tmp_path, a=PI.example())
    for name in ("first", "second"):
        workspace.add(moved(), origin="", call="", role="train", name=name)
    off = moved().with_channels({}, displacement=moved()["displacement"] + 1000.0)
    workspace.add(off, origin="", call="", role="test", name="off")
    row = {"status": "ok", "model": "pi", "validation_rmse": 1.0, "data": workspace.data()}
    workspace.write_json("results", "a", row)

    async def look(user: User) -> None:
        user.find(marker="tab-models").click()
        await until(user, "closer-on")
        run = only(user, "closer-run")
        assert list(run.options.values()) == [
            "off, a test recording",
            "first, trained on",
            "second, trained on",
        ]
        far = float(only(user, "closer-on").text.split("a ")[-1].split()[0])
        assert far > 900.0
        run.set_value("first")
        await later(lambda: "first, trained on" in only(user, "closer-on").text)
        assert float(only(user, "closer-on").text.split(": a ")[-1].split()[0]) < 100.0

    visit(workspace, look)


def test_recordings_that_were_held_out_are_not_called_trained_on(tmp_path: Path) -> None:
    estimator = load("blocks", "balance").example().inverse()
    workspace: Workspace = workspace_with(tmp_path, a=estimator)
    channels = (*estimator.inputs, *estimator.outputs)
    for number in range(3):
        run = {c.name: np.sin(T + k + number) + 2.0 for k, c in enumerate(channels)}
        recorded = Recording(run, 0.05, {c.name: c.unit for c in channels})
        workspace.add(recorded, origin="", call="", role="train", name=f"run{number}")

    async def look(user: User) -> None:
        user.find(marker="tab-compensate").click()
        await until(user, "forces")
        only(user, "forces").open()
        await until(user, "force-recording")
        await later(
            lambda: only(user, "force-recording").value == "run2"
        )  # every third is held out
        assert only(user, "force-recording").options == {
            "run2": "run2",
            "run0": "run0 (trained on)",
            "run1": "run1 (trained on)",
        }

    visit(workspace, look)
