"""The pages, without a browser: they say what to do first, and show what there is."""

from __future__ import annotations

import asyncio
import os
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("nicegui")

from nicegui import Client, ui
from nicegui.testing import User, user_simulation

from mckibben import DataError, Recording
from mckibben.app import plots
from mckibben.app.desk import Desk
from mckibben.app.jobs import Jobs
from mckibben.app.motions import parsed, reference_recording
from mckibben.app.offering import offered
from mckibben.app.pages import data, judging
from mckibben.app.shell import build, load_the_rest
from mckibben.app.work import fit
from mckibben.app.workspace import Workspace
from mckibben.arrays import Array
from mckibben.registry import load
from mckibben.report import subjects
from tests.app.test_jobs import filled
from tests.app.test_jobs import fit as asked
from tests.comparison.test_several import run as two_muscles


def visit(workspace: Workspace, look: Callable[[User], Awaitable[None]]) -> None:
    """Open the workbench over a workspace, without a browser, and look at it."""

    load_the_rest()  # which a page that is opened would wait for

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
        await user.should_see("What these recordings cannot tell")
        await user.should_see("no input is ever held", retries=100)
        await user.should_see(marker="loop-plot")
        user.find(marker="tab-models").click()
        await user.should_see(marker="leaderboard")
        user.find(marker="tab-compensate").click()
        await user.should_see("Reference")
        user.find(marker="tab-take").click()
        await user.should_see(marker="script")

    visit(workspace, look)


def test_recordings_of_two_muscles_get_models_that_couple_them(tmp_path: Path) -> None:
    workspace = Workspace(tmp_path)
    workspace.add(two_muscles(5.0), origin="", call="", role="train")
    workspace.add(two_muscles(4.5), origin="", call="", role="test")
    desk = Desk(workspace, Jobs(workspace))
    desk.settle_channels()
    assert desk.inputs == ("pressure_1", "pressure_2")
    assert desk.channels["output"] == ["displacement_1", "displacement_2"]
    models = {"balance", "coupled-memory"}
    for seed, name in enumerate(("first", "second")):
        given = {"model": "coupled-memory", "name": name, "seed": seed}
        fit(workspace, given | desk.channels, lambda share, cost: None)

    async def look(user: User) -> None:
        user.find(marker="tab-models").click()
        await user.should_see(marker="leaderboard")
        await user.should_see("2 inputs (pressure_1, pressure_2); 2 outputs")
        for model in models:
            await user.should_see(marker=f"model-{model}", retries=100)
            (box,) = user.find(marker=f"model-{model}").elements
            assert isinstance(box, ui.checkbox)
            assert box.value
        for model in ("pi", "gpi", "arx", "coupled-pi"):
            await user.should_not_see(marker=f"model-{model}")
        await user.should_see("pressure_1 moves alone in no run")
        (table,) = user.find(marker="leaderboard").elements
        assert isinstance(table, ui.table)
        assert {row["name"] for row in table.rows} == {"first", "second"}
        labels = [column["label"] for column in table.columns]
        assert labels.index("inverse") < labels.index(
            "worst [mm]"
        )  # on screen, however many columns
        assert {row["inverse"] for row in table.rows} == {"none"}
        assert labels[1:3] == ["validation RMSE [mm]", "test RMSE [mm]"]
        assert "test RMSE of displacement_2 [mm]" in labels
        await user.should_see(marker="closer-5")

    visit(workspace, look)


def test_what_was_unticked_stays_so_when_the_data_change(tmp_path: Path) -> None:
    workspace = filled(tmp_path)

    async def look(user: User) -> None:
        def boxes() -> set[Any]:
            return user.find(marker="model-pi").elements

        user.find(marker="tab-models").click()
        await user.should_see(marker="model-pi", retries=100)
        before = boxes()
        user.find(marker="untick").click()
        turns = 2.0 + np.sin(np.arange(200_000) / 50)
        longer = Recording({"pressure": turns, "displacement": 2 * turns}, 0.1)
        workspace.add(longer, origin="", call="")  # with which fits take longer, as is told of each
        Desk(workspace, Jobs(workspace)).changed("recordings")
        for _ in range(100):
            if user.find(marker="model-pi").elements.isdisjoint(before):
                break
            await asyncio.sleep(0.05)
        assert boxes().isdisjoint(before)
        for model in ("pi", "gpi", "mpi"):
            (box,) = user.find(marker=f"model-{model}").elements
            assert isinstance(box, ui.checkbox)
            assert not box.value

    visit(workspace, look)


def test_a_channel_is_on_one_side(tmp_path: Path) -> None:
    workspace = filled(tmp_path)
    desk = Desk(workspace, Jobs(workspace))
    desk.settle_channels()
    assert (desk.inputs, desk.outputs) == (("pressure",), ("displacement",))
    desk.choose("outputs", ["pressure"])
    assert (desk.inputs, desk.outputs) == (("displacement",), ("pressure",))
    desk.choose("inputs", ["displacement", "pressure"])
    assert (desk.inputs, desk.outputs) == (("displacement",), ("pressure",))


def test_models_of_other_channels_are_not_compared(tmp_path: Path) -> None:
    workspace = filled(tmp_path)
    figures = {"rmse": 0.5}
    for name, output in (("mine", "displacement"), ("other", "force")):
        result = {"status": "ok", "model": "pi", "input": "pressure", "output": output}
        workspace.write_json("results", name, result | {"test": figures, "train": figures})
    desk = Desk(workspace, Jobs(workspace))
    assert [result["name"] for result in desk.results()] == ["mine"]
    desk.outputs = ("force",)
    assert [result["name"] for result in desk.results()] == ["other"]


def test_a_model_of_data_that_were_is_not_kept_chosen(tmp_path: Path) -> None:
    workspace = filled(tmp_path)
    for name, seen in {"old": "other", "new": workspace.data()}.items():
        workspace.write_json("results", name, {"status": "ok", "model": "pi", "data": seen})
    desk = Desk(workspace, Jobs(workspace))
    assert desk.model_to_show("old", ["new", "old"]) == "new"
    assert desk.model_to_show("own", ["new", "own"]) == "own"  # of which nothing is known
    assert desk.model_to_show("gone", ["new", "old"]) == "new"
    assert desk.model_to_show("old", ["older", "old"]) == "older"
    workspace.write_json("results", "older", {"status": "ok", "model": "pi", "data": "another"})
    assert desk.model_to_show("old", ["older", "old"]) == "old"


def test_models_that_are_of_other_channels_are_told_of(tmp_path: Path) -> None:
    workspace = filled(tmp_path)
    result = {"status": "ok", "model": "pi", "input": "pressure", "output": "force"}
    workspace.write_json("results", "other", result)

    async def look(user: User) -> None:
        user.find(marker="tab-models").click()
        await user.should_see("chosen under Data: pressure to force.", retries=100)

    visit(workspace, look)


def test_a_damaged_recording_is_told_and_harms_nothing_else(tmp_path: Path) -> None:
    workspace = filled(tmp_path)
    workspace.entry("run").path.write_text("pressure,displacement\n1,x\n")

    async def look(user: User) -> None:
        await user.should_see("Remedy")
        user.find(marker="tab-look").click()
        await user.should_see("Add recordings with an input and an output first")
        user.find(marker="tab-models").click()
        await user.should_see(marker="fit")
        user.find(marker="fit").click()

    visit(workspace, look)


def test_fitting_without_a_recording_is_answered(tmp_path: Path) -> None:
    async def look(user: User) -> None:
        user.find(marker="tab-models").click()
        await user.should_see(marker="fit")
        user.find(marker="fit").click()
        await user.should_see("There is no recording to train on.")

    visit(Workspace(tmp_path), look)


def test_cutting_needs_a_selection(tmp_path: Path) -> None:
    async def look(user: User) -> None:
        await user.should_see(marker="keep")
        user.find(marker="keep").click()
        await user.should_see("nothing is selected")

    visit(filled(tmp_path), look)


def test_what_was_cancelled_is_said_once(tmp_path: Path) -> None:
    workspace = Workspace(tmp_path)
    jobs = Jobs(workspace, at_once=1)
    jobs.at_once = 0  # none is started
    for name in ("one", "two"):
        jobs.cancel(jobs.submit("fit", asked("pi", name)).name)
    old = jobs.submit("fit", asked("pi", "old")).name
    jobs.cancel(old)
    told = workspace.read_json("jobs", old) or {}
    workspace.write_json("jobs", old, told | {"message": "cancelled"})  # as it was once kept

    async def look(user: User) -> None:
        user.find(marker="tab-models").click()
        for name in ("one", "two", "old"):
            await user.should_see(marker=f"job-{name}", retries=100)
            (line,) = user.find(marker=f"job-{name}").elements
            said = [one.text for one in line.descendants() if isinstance(one, ui.label)]
            assert said == [name, "cancelled"]

    visit(workspace, look)


def test_figures_hold_plain_numbers_and_colours(tmp_path: Path) -> None:
    recording = filled(tmp_path).recording("run")
    (plain,) = plots.figures(subjects.loop([recording], "pressure", "displacement"))
    for dark in (False, True):
        figure = plots.coloured(plain, dark)
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
    points = parsed("0 10\n\n 2; 20\n4,10")
    assert points == [(0.0, 10.0), (2.0, 20.0), (4.0, 10.0)]
    reference = reference_recording({"displacement": points}, 0.5)
    np.testing.assert_allclose(reference["displacement"][[0, 2, 4, 8]], [10, 15, 20, 10])


@pytest.mark.parametrize("text", ["1", "a b", "1 2 3"])
def test_points_that_are_none_are_named(text: str) -> None:
    with pytest.raises(DataError, match="write two numbers a line"):
        parsed(text)


@pytest.mark.parametrize("points", [[], [(0.0, 1.0)], [(0.0, 1.0), (0.0, 2.0)], [(0, 1), (1e9, 2)]])
def test_references_that_cannot_be_are_refused(points: list[tuple[float, float]]) -> None:
    with pytest.raises(DataError, match=r"Remedy:"):
        reference_recording({"displacement": points}, 0.01)


def test_the_kinds_of_files_are_those_that_are_read_here(monkeypatch: pytest.MonkeyPatch) -> None:
    assert "Excel (.xlsx)" in data.taken()
    monkeypatch.setattr(data, "find_spec", lambda name: None if name == "openpyxl" else object())
    assert data.taken() == ["CSV", "TSV", *(kind for kind in data.KINDS if "Excel" not in kind)]


def test_of_one_channel_no_model_is_offered(tmp_path: Path) -> None:
    workspace = Workspace(tmp_path)
    workspace.add(
        Recording({"pressure": np.sin(np.arange(200))}, 0.1), origin="", call="", name="a"
    )
    desk = Desk(workspace, Jobs(workspace), inputs=("pressure",), outputs=("pressure",))
    found = offered(desk)
    assert found.groups == []
    assert found.recognised.startswith("pressure would be input and output")
    desk.jobs.close()


def test_ticks_between_decades_are_whole_numbers() -> None:
    seconds, costs = np.array([[0.0, 1.0, 2.0], [0.5, 0.3, 0.2]], dtype=np.float64)
    figure = plots.lines(
        [("cost", seconds, costs, "series-1")], x="time [s]", y="cost", logarithmic=True
    )
    axis = figure["layout"]["yaxis"]
    assert (axis["type"], axis["tickformat"]) == ("log", "~g")


def test_a_model_that_fails_on_the_test_alone_is_named() -> None:
    def result(name: str, validated: float, tested: float) -> dict[str, Any]:
        constant = {"test": {"rmse": 38.0}, "validation_rmse": 38.0}
        return {
            "name": name,
            "current": True,
            "chosen_by": "cross-validation",
            "shared": [],
            "split": "last 80 samples of run to test, all before to fit",
            "test": {"rmse": tested},
            "validation_rmse": validated,
            "constant": constant,
            "skill_least": 0.9,
            "not_recommended": None,
        }

    rows = [result("good", 1.0, 2.0), result("unlike", 1.2, 36.0), result("poor", 35.0, 36.0)]
    (said,) = [text for text in judging.judged(rows) if "more than half" in text]
    assert said.startswith("unlike: ")
    assert not any("more than half" in text for text in judging.judged(rows[:1]))
    assert judging.judged(rows)[0] == "Last 80 samples of run to test, all before to fit."
    # what was not validated is not unlike its validation, and it is said why there is none
    alone = [rows[1] | {"validation_rmse": None, "validation_failed": "too few cycles"}]
    assert not any("more than half" in text for text in judging.judged(alone))
    assert "(too few cycles)" in judging.unvalidated(alone)
    assert judging.unvalidated(rows) == ""
    early = [row | {"start": {"said": "half of it lies early"}} for row in rows[:2]]
    assert "good, unlike: half of it lies early." in judging.judged(early)


def test_a_band_is_shaded_behind_the_curves() -> None:
    t: Array = np.arange(3, dtype=float)
    figure = plots.lines([("model", t, t, "series-1")], x="time [s]", y="displacement [mm]")
    plots.shaded(figure, t, (t - 1, t + 1), "series-1", "band of model")
    band, model = figure["data"]
    assert (band["name"], band["fill"], model["name"]) == ("band of model", "toself", "model")
    assert band["x"] == [0, 1, 2, 2, 1, 0]
    assert band["y"] == [-1, 0, 1, 3, 2, 1]
