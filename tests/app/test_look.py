"""Look: what moves what is found from the data, and told in plain words."""

from __future__ import annotations

import asyncio
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("nicegui")

from nicegui import ui
from nicegui.testing import User

from mckibben import Recording
from mckibben.app import plots
from mckibben.app.workspace import Workspace
from mckibben.arrays import Array
from mckibben.signals import triangle
from tests.app.test_pages import visit


def texts(user: User, marker: str) -> list[str]:
    """Return what all labels within an element say."""
    (place,) = user.find(marker=marker).elements
    return [str(one.text) for one in place.descendants() if isinstance(one, ui.label)]


def arm(folder: Path) -> Workspace:
    """Return a workspace with an arm whose first output is moved by its third input alone."""
    time = np.arange(1200) * 0.1
    every = {f"pressure_{k + 1}": np.zeros(time.size) for k in range(3)}
    for k, pressure in enumerate(every.values()):  # one after another, the others held
        pressure[400 * k : 400 * k + 400] = triangle(time[:400], 10.0, 4.0)
    one, two, three = every.values()
    every |= {"displacement_1": 9 * three + 0.2 * one, "displacement_2": 5 * one - two}
    workspace = Workspace(folder)
    workspace.add(Recording(every, 0.1), origin="a test", call="", name="arm")
    return workspace


def test_an_output_moved_by_another_input_does_not_creep(tmp_path: Path) -> None:
    async def look(user: User) -> None:
        user.find(marker="tab-look").click()
        await user.should_see("What a load does cannot be told", retries=100)
        assert not [said for said in texts(user, "untold") if "still moves" in said]

    visit(arm(tmp_path), look)


def test_words_and_picture_are_of_the_input_that_moves_an_output_most(tmp_path: Path) -> None:
    workspace = arm(tmp_path)
    workspace.add(workspace.recording("arm"), origin="a test", call="", name="again")

    async def look(user: User) -> None:
        user.find(marker="tab-look").click()
        await user.should_see("displacement_1 over pressure_3", retries=100)
        await user.should_see("At equal pressure_3,", retries=100)
        await user.should_see("At equal pressure_1,", retries=100)
        await user.should_see("Over all 2 recordings:", retries=100)
        await user.should_not_see("At equal pressure_2,")
        figures = [one.figure for one in user.find(ui.plotly).elements]
        small = [figure["layout"] for figure in figures if figure["config"].get("staticPlot")]
        assert len(small) == 6  # too small for the names of axes, which stand above
        assert {layout[axis]["title"] for layout in small for axis in ("xaxis", "yaxis")} == {""}

    visit(workspace, look)


def test_a_loop_is_drawn_over_an_input_that_moves_in_its_recording(tmp_path: Path) -> None:
    workspace = arm(tmp_path)
    first = workspace.recording("arm").slice(0, 400)  # in which the first muscle moves alone
    workspace.add(first, origin="a test", call="", name="first")

    async def look(user: User) -> None:
        user.find(marker="tab-look").click()
        await user.should_see("displacement_1 over pressure_3", retries=100)
        (chosen,) = user.find(marker="look-recording").elements
        assert isinstance(chosen, ui.select)
        chosen.set_value("first")
        await user.should_see("displacement_1 over pressure_1", retries=100)
        user.find(marker="pair-pressure_1-displacement_2").click()
        await user.should_see("displacement_2 over pressure_1", retries=100)
        chosen.set_value("arm")
        await user.should_see("Cycle, of 4", retries=100)
        await user.should_see("displacement_2 over pressure_1")

    visit(workspace, look)


def test_names_of_axes_that_stand_above_each_other_are_short(tmp_path: Path) -> None:
    async def look(user: User) -> None:
        await user.should_see(marker="preview-plot", retries=100)
        (plot,) = user.find(marker="preview-plot").elements
        assert isinstance(plot, ui.plotly)
        layout = plot.figure["layout"]
        titles = [axis["title"]["text"] for key, axis in layout.items() if key.startswith("yaxis")]
        assert titles[0] == "pressure_1<br>[bar]"
        assert len(titles) == 5

    visit(arm(tmp_path), look)


def test_another_theme_draws_pictures_anew_and_nothing_else(tmp_path: Path) -> None:
    async def look(user: User) -> None:
        user.find(marker="tab-look").click()
        await user.should_see("What a load does cannot be told", retries=100)
        (plot,) = user.find(marker="loop-plot").elements
        assert isinstance(plot, ui.plotly)
        tables = user.find(kind=ui.table).elements
        before = plot.figure["layout"]["font"]["color"]
        user.find(marker="theme").click()
        for _ in range(100):
            await asyncio.sleep(0.05)
            if plot.figure["layout"]["font"]["color"] != before:
                break
        assert plot.figure["layout"]["font"]["color"] == plots.colours(True)["ink"]
        assert user.find(marker="loop-plot").elements == {plot}
        assert user.find(kind=ui.table).elements == tables

    visit(arm(tmp_path), look)


def test_a_picture_in_which_nothing_is_selected_is_not_shaded_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It may not be there yet in the browser, which then complains."""
    asked: list[str] = []
    monkeypatch.setattr(ui.plotly, "run_plot_method", lambda self, name, *_: asked.append(name))

    async def look(user: User) -> None:
        await user.should_see(marker="preview-plot", retries=100)
        (plot,) = user.find(marker="preview-plot").elements
        assert isinstance(plot, ui.plotly)
        user.find(marker="theme").click()
        for _ in range(100):
            await asyncio.sleep(0.05)
            if plot.figure["layout"]["font"]["color"] == plots.colours(True)["ink"]:
                break
        assert asked == []

    visit(arm(tmp_path), look)


def test_small_swings_are_no_cycles_and_a_counter_colours_nothing_unasked(tmp_path: Path) -> None:
    time = np.arange(1200) * 0.1
    pressure: Array = triangle(time, 30.0, 4.0) + triangle(time, 3.0, 0.6)
    every: dict[str, Array] = {
        "pressure": pressure,
        "displacement": 3 * pressure,
        "count": np.mod(time, 5),
    }
    workspace = Workspace(tmp_path)
    workspace.add(Recording(every, 0.1), origin="a test", call="", name="run")

    async def look(user: User) -> None:
        user.find(marker="tab-look").click()
        await user.should_see("Cycle, of 4; 0 for all", retries=100)
        (colour,) = user.find(marker="loop-colour").elements
        assert isinstance(colour, ui.toggle)
        assert "by count" in colour.options
        assert colour.value == "time"

    visit(workspace, look)
