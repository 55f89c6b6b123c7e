"""Data, Look and Models without a browser: what is offered, drawn and changed by a click."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("nicegui")

from nicegui import ui
from nicegui.testing import User

from mckibben import PI, Recording
from mckibben.app import plots
from mckibben.app.desk import Desk
from mckibben.app.jobs import Jobs, note
from mckibben.app.work import fit
from mckibben.app.workspace import Workspace
from mckibben.arrays import Array
from mckibben.comparison.channels import Channels
from mckibben.comparison.splits import held_out
from mckibben.signals import triangle
from tests.app.simulated import (
    asked,
    filled,
    gone,
    later,
    modelled,
    only,
    quiet,
    swung,
    until,
    visit,
    wave,
    workspace_of,
)
from tests.report.studies_by_hand import two_muscles


def labels(element: ui.element) -> list[str]:
    return [str(one.text) for one in element.descendants() if isinstance(one, ui.label)]


def test_an_empty_and_a_damaged_workspace_can_be_walked_through(tmp_path: Path) -> None:
    async def look(user: User) -> None:
        await user.should_see(marker="example")
        for tab in ("look", "models", "compensate", "take"):
            user.find(marker=f"tab-{tab}").click()
        user.find(marker="tab-models").click()
        await until(user, "fit")
        user.find(marker="fit").click()

    visit(Workspace(tmp_path / "empty"), look)
    workspace = filled(tmp_path / "damaged")
    workspace.entry("run").path.write_text("pressure,displacement\n1,x\n")

    async def look_on(user: User) -> None:
        await until(user, "upload")
        for tab in ("look", "models"):
            user.find(marker=f"tab-{tab}").click()
        await until(user, "fit")
        assert workspace.names("jobs") == []

    visit(workspace, look_on)


# -- data ----------------------------------------------------------------------------------------


def test_recordings_of_several_zeros_get_one(tmp_path: Path) -> None:
    up = 2 - 2 * np.cos(np.arange(400) * 0.05)
    runs = {
        name: Recording({"pressure": up, "displacement": up + zero}, 0.05)
        for name, zero in (("one", 0.0), ("two", 30.0))
    }
    workspace = workspace_of(tmp_path, **runs)

    async def look(user: User) -> None:
        await until(user, "zeros")
        user.find(marker="zero-all").click()
        await gone(user, "zeros")

    visit(workspace, look)
    assert np.allclose(workspace.recording("two")["displacement"], up, atol=0.1)
    assert workspace.entry("two").steps[-1].do == "zero"
    workspace.undo()
    assert workspace.recording("two")["displacement"].min() > 29


def test_recordings_of_another_muscle_are_set_unused_and_then_models_are_offered(
    tmp_path: Path,
) -> None:
    time = np.arange(400) * 0.05
    inputs = {f"pressure_{k}": 2 + np.sin(k * time) for k in (1, 2, 3)}
    arm = Recording(inputs | {f"displacement_{k}": np.cos(k * time) for k in (1, 2)}, 0.05)
    up = 2 - 2 * np.cos(time)
    runs = {
        name: Recording({"pressure": up, "displacement": gain * up}, 0.05)
        for name, gain in (("one", 1.0), ("two", 1.01), ("other", 3.0))
    }
    workspace = workspace_of(tmp_path, **runs, arm=arm)

    async def look(user: User) -> None:
        user.find(marker="tab-models").click()
        fit = await until(user, "fit")
        await until(user, "aside-arm")
        await user.should_not_see(marker="model-pi")
        assert not fit.enabled
        user.find(marker="aside-arm").click()
        await until(user, "model-pi")
        assert fit.enabled
        user.find(marker="tab-data").click()
        await until(user, "unlike")
        user.find(marker="aside-other").click()
        await gone(user, "unlike")

    visit(workspace, look)
    roles = {entry.name: entry.role for entry in workspace.entries()}
    assert [roles[name] for name in ("one", "two", "other", "arm")] == [
        *("train", "train", "unused", "unused")
    ]
    workspace.undo()
    assert workspace.entry("other").role == "train"


def test_loads_in_names_are_given_by_one_click_and_constants_taken_out(tmp_path: Path) -> None:
    workspace = Workspace(tmp_path)
    for name in ("one_load200g", "two_load400g"):
        workspace.add(swung(10.0), origin="", call="", name=name)

    async def look(user: User) -> None:
        await until(user, "take-loads")
        user.find(marker="take-loads").click()
        await gone(user, "loads")
        assert workspace.recording("two_load400g")["force"] == pytest.approx(3.92266)
        workspace.undo()
        assert not any("force" in run for run in workspace.readable())
        user.find("How it was read").click()
        await until(user, "add-constant")
        user.find(marker="add-constant").click()
        await until(user, "constant-value-0")
        user.find(marker="constant-remove-0").click()
        await gone(user, "constant-value-0")

    visit(workspace, look)


# -- look ----------------------------------------------------------------------------------------


def arm() -> Recording:
    """Return an arm whose first output is moved by its third input alone."""
    time = np.arange(1200) * 0.1
    every = {f"pressure_{k + 1}": np.zeros(time.size) for k in range(3)}
    for k, pressure in enumerate(every.values()):  # one after another, the others held
        pressure[400 * k : 400 * k + 400] = triangle(time[:400], 10.0, 4.0)
    one, two, three = every.values()
    every |= {"displacement_1": 9 * three + 0.2 * one, "displacement_2": 5 * one - two}
    return Recording(every, 0.1)


def test_what_moves_an_output_most_is_drawn_and_what_it_does_is_no_creep(tmp_path: Path) -> None:
    first = arm().slice(0, 400)  # in which the first muscle moves alone

    async def look(user: User) -> None:
        user.find(marker="tab-look").click()
        await user.should_see("displacement_1 over pressure_3", retries=100)
        untold = await until(user, "untold")
        await later(lambda: any("load" in text for text in labels(untold)))
        assert not [text for text in labels(untold) if "still moves" in text]
        figures = [one.figure for one in user.find(ui.plotly).elements]
        small = [figure["layout"] for figure in figures if figure["config"].get("staticPlot")]
        assert len(small) == 6  # too small for the names of axes, which stand above
        assert {layout[axis]["title"] for layout in small for axis in ("xaxis", "yaxis")} == {""}
        chosen = only(user, "look-recording")
        chosen.set_value("first")
        await user.should_see("displacement_1 over pressure_1", retries=100)
        user.find(marker="pair-pressure_1-displacement_2").click()
        await user.should_see("displacement_2 over pressure_1", retries=100)
        chosen.set_value("arm")
        await user.should_see("Cycle, of 4", retries=100)
        await user.should_see("displacement_2 over pressure_1")

    visit(workspace_of(tmp_path, arm=arm(), first=first), look)


def test_small_swings_are_no_cycles_and_another_theme_draws_pictures_anew_only(
    tmp_path: Path,
) -> None:
    time = np.arange(1200) * 0.1
    pressure: Array = triangle(time, 30.0, 4.0) + triangle(time, 3.0, 0.6)
    every = {"pressure": pressure, "displacement": 3 * pressure, "count": np.mod(time, 5)}

    async def look(user: User) -> None:
        user.find(marker="tab-look").click()
        await user.should_see("Cycle, of 4; 0 for all", retries=100)
        colour = only(user, "loop-colour")
        assert "by count" in colour.options
        assert colour.value == "time"  # unasked, a counter colours nothing
        await user.should_see(kind=ui.table, retries=100)
        plot, tables = only(user, "loop-plot"), user.find(kind=ui.table).elements
        user.find(marker="theme").click()
        ink = plots.colours(True)["ink"]
        await later(lambda: plot.figure["layout"]["font"]["color"] == ink)
        assert user.find(marker="loop-plot").elements == {plot}
        assert user.find(kind=ui.table).elements == tables

    visit(workspace_of(tmp_path, run=Recording(every, 0.1)), look)


# -- models --------------------------------------------------------------------------------------


def test_models_of_several_muscles_have_their_errors_of_every_output(tmp_path: Path) -> None:
    workspace = workspace_of(tmp_path, one=two_muscles(5.0), two=two_muscles(4.5))
    workspace.set_role("two", "test")
    sides = {
        "input": ["pressure_1", "pressure_2"],
        "output": ["displacement_1", "displacement_2"],
    }
    for seed, name in enumerate(("first", "second")):
        fit(workspace, {"model": "coupled-memory", "name": name, "seed": seed} | sides, quiet)

    async def look(user: User) -> None:
        user.find(marker="tab-models").click()
        table = await until(user, "leaderboard")
        for model in ("balance", "coupled-memory"):
            assert (await until(user, f"model-{model}")).value
        assert {row["name"] for row in table.rows} == {"first", "second"}
        assert {row["inverse"] for row in table.rows} == {"none"}
        names = [column["label"] for column in table.columns]
        assert names.index("inverse") < names.index("worst [mm]")  # on screen, however many
        assert names[1:3] == ["validation RMSE [mm]", "test RMSE [mm]"]
        assert "test RMSE of displacement_2 [mm]" in names
        await until(user, "closer-5")

    visit(workspace, look)


def test_what_was_unticked_stays_so_when_the_data_change(tmp_path: Path) -> None:
    workspace = filled(tmp_path)
    result = {"status": "ok", "model": "pi", "input": "pressure", "output": "force"}
    workspace.write_json("results", "other", result)

    async def look(user: User) -> None:
        def boxes() -> set[Any]:
            return user.find(marker="model-pi").elements

        user.find(marker="tab-models").click()
        await until(user, "model-pi")
        await user.should_not_see(marker="leaderboard-other")
        before = boxes()
        user.find(marker="untick").click()
        turns = 2.0 + np.sin(np.arange(200_000) / 50)
        longer = Recording({"pressure": turns, "displacement": 2 * turns}, 0.1)
        workspace.add(longer, origin="", call="")  # with which fits take longer, as each says
        Desk(workspace, Jobs(workspace)).changed("recordings")
        await later(lambda: boxes().isdisjoint(before))
        assert not any(only(user, f"model-{model}").value for model in ("pi", "gpi", "mpi"))

    visit(workspace, look)


def test_ended_fits_are_listed_once_and_cleared(tmp_path: Path) -> None:
    workspace = filled(tmp_path)
    jobs = Jobs(workspace, at_once=1)
    jobs.at_once = 0  # none is started
    jobs.cancel(jobs.submit("fit", asked("pi", "one")).name)
    note(workspace, "fit-2", "fit", asked("pi", "two"), "failed", "there is no channel")

    async def look(user: User) -> None:
        user.find(marker="tab-models").click()
        assert labels(await until(user, "job-one")) == ["one", "cancelled"]
        user.find(marker="clear-fits").click()
        await gone(user, "fits")

    visit(workspace, look)
    assert workspace.names("jobs") == []


def shaded(figure: dict[str, Any]) -> list[tuple[float, float]]:
    shapes = figure["layout"]["shapes"]
    return [(one["x0"], one["x1"]) for one in shapes if one["type"] == "rect"]


@pytest.mark.parametrize(("tested", "current"), [(False, True), (True, True), (False, False)])
def test_what_was_held_out_is_shaded(tmp_path: Path, tested: bool, current: bool) -> None:
    workspace = modelled(tmp_path, a=PI.example())
    workspace.add(wave(), origin="", call="", name="run")
    if tested:
        workspace.add(wave(), origin="", call="", role="test", name="other")
    data = workspace.data() if current else "another"
    row = {"status": "ok", "model": "pi", "validation_rmse": 1.0, "data": data}
    workspace.write_json("results", "a", row)
    (part,) = held_out([wave()], Channels(("pressure",), ("displacement",))).train
    ends = wave().time[len(part)], wave().time[-1]

    async def look(user: User) -> None:
        user.find(marker="tab-models").click()
        await until(user, "closer-on")
        figures = [one.figure for one in user.find(kind=ui.plotly).elements]
        marked = [found for found in map(shaded, figures) if found]
        unseen = not tested and current
        assert marked == ([[pytest.approx(ends)]] * 2 if unseen else [])  # of what is over time

    visit(workspace, look)


def test_models_are_run_on_any_recording_and_have_their_error_on_it(tmp_path: Path) -> None:
    workspace = modelled(tmp_path, a=PI.example())
    for name in ("first", "second"):
        workspace.add(wave(), origin="", call="", name=name)
    off = wave().with_channels({}, displacement=wave()["displacement"] + 1000.0)
    workspace.add(off, origin="", call="", role="test", name="off")
    row = {"status": "ok", "model": "pi", "validation_rmse": 1.0, "data": workspace.data()}
    workspace.write_json("results", "a", row)

    async def look(user: User) -> None:
        user.find(marker="tab-models").click()
        await until(user, "closer-on")

        def error() -> float:
            return float(only(user, "closer-on").text.split(": a ")[-1].split()[0])

        assert list(only(user, "closer-run").options) == ["off", "first", "second"]
        assert error() > 900.0
        only(user, "closer-run").set_value("first")
        await later(lambda: error() < 100.0)

    visit(workspace, look)
