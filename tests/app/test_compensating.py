"""Compensate and Take away without a browser: what is chosen at first, shown, run and taken."""

from __future__ import annotations

import asyncio
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("nicegui")

from nicegui import ui
from nicegui.testing import User

from mckibben import PI, Recording, read
from mckibben.app import forms
from mckibben.app.following import compensated
from mckibben.app.jobs import note
from mckibben.app.pages import closing, compensate, taking_code
from mckibben.app.workspace import Workspace
from mckibben.registry import load
from mckibben.rigs import rig_names
from tests.app.simulated import (
    WEAKER,
    drawn,
    field,
    gone,
    held,
    later,
    modelled,
    on_compensate,
    only,
    three_muscles,
    until,
    visit,
)


async def turn(user: User, model: str) -> None:
    """Choose another model."""
    before = only(user, "show-pressures")
    only(user, "invert").set_value(model)
    await later(lambda: only(user, "show-pressures") is not before)


def ranked(workspace: Workspace, name: str, rmse: float, **more: Any) -> None:
    row = {"status": "ok", "model": "pi", "validation_rmse": rmse, "unit": "mm"}
    workspace.write_json("results", name, row | more)


# -- what is shown and run -----------------------------------------------------------------------


@pytest.mark.parametrize("change", ["model", "motion", "compensator"])
def test_pressures_of_what_has_changed_meanwhile_are_not_shown(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, change: str
) -> None:
    begun, go, shown = threading.Event(), threading.Event(), list[str]()
    pressures = compensate.Editor._pressures

    def slow(workspace: Workspace, name: str, *rest: Any) -> Any:
        found = compensated(workspace, name, *rest)
        if name == "a":
            begun.set()
            assert go.wait(30.0)
        return found

    def noted(self: compensate.Editor, model: str, *rest: Any) -> None:
        shown.append(model)
        pressures(self, model, *rest)

    monkeypatch.setattr(compensate, "compensated", slow)
    monkeypatch.setattr(compensate.Editor, "_pressures", noted)

    async def look(user: User) -> None:
        await on_compensate(user)
        user.find(marker="wave").click()
        user.find(marker="show-pressures").click()
        await later(begun.is_set)
        if change == "model":
            await turn(user, "b")
            user.find(marker="show-pressures").click()
            await until(user, "pressure-plot")
        elif change == "motion":
            user.find(marker="wave-triangle").click()
            await until(user, "wish-changed")
        else:
            only(user, "compensator").set_options({"inverse": "", "predictive": ""})
            only(user, "compensator").set_value("predictive")
            await until(user, "wish-changed")
        go.set()
        await asyncio.sleep(0.5)
        assert shown == (["b"] if change == "model" else [])

    try:
        visit(modelled(tmp_path, a=PI.example(), b=WEAKER), look)
    finally:
        go.set()


def test_what_runs_is_what_is_drawn_and_what_failed_is_listed(tmp_path: Path) -> None:
    workspace = modelled(tmp_path, a=PI.example(), b=WEAKER)
    run = {"model": "a", "plant": "b", "controller": "pid", "rmse": {"displacement": 1.0}}
    workspace.write_json("runs", "a-pid", run | {"reference": "earlier.csv"})
    given = {"model": "a", "plant": "b", "controller": "pid", "name": "a-pid"}
    note(workspace, "loop-1", "loop", given, "failed", "there is no loop")

    async def look(user: User) -> None:
        await drawn(user)
        await until(user, "run-loop")
        assert (await until(user, "failed-loop")).text.startswith("a-pid: ")

        def motions() -> dict[str, bool]:
            """Return whether runs are of the motion that is drawn."""
            return {row["name"]: "as drawn" in row["motion"] for row in only(user, "runs").rows}

        assert motions() == {"a-pid": False}
        workspace.write_json("runs", "a-now", run | {"reference": "reference.csv"})
        user.find(marker="show-pressures").click()  # the same motion keeps its file
        await later(lambda: motions() == {"a-pid": False, "a-now": True})
        user.find(marker="wave-triangle").click()
        await until(user, "wish-changed")
        for name in ("run-loop", "pressure-plot"):
            await user.should_not_see(marker=name)
        await later(lambda: motions() == {"a-pid": False, "a-now": False})
        user.find(marker="show-pressures").click()
        await until(user, "run-loop")
        assert motions() == {"a-pid": False, "a-now": False}

    visit(workspace, look)


def test_runs_that_gain_nothing_scatter_or_are_offset_are_remarked(tmp_path: Path) -> None:
    workspace = modelled(tmp_path, a=PI.example(), b=WEAKER)
    for plant, rmse, offset, scatter in (
        ("good", 0.5, 0.1, 0.0),
        ("scatters", 0.5, 0.1, 0.4),
        ("gains-nothing", 1.5, 0.1, 0.0),
        ("offset", 0.9, -0.8, 0.1),
    ):
        run = {"model": "a", "plant": plant, "controller": "pid", "rmse": {"displacement": rmse}}
        run |= {"offset": {"displacement": offset}, "scatter": {"displacement": scatter}}
        run |= {"units": {"displacement": "mm"}, "uncompensated": {"displacement": 1.0}}
        workspace.write_json("runs", f"a-{plant}", run)

    async def look(user: User) -> None:
        await drawn(user)
        await until(user, "runs")
        found = {one.text for one in user.find(kind=ui.label, marker="runs-remark").elements}
        about = sorted(text.partition(":")[0].removeprefix("pid on ") for text in found)
        assert about == ["gains-nothing", "offset", "scatters"]
        assert len({text.partition(":")[2] for text in found}) == 3

    visit(workspace, look)


# -- what is chosen at first ---------------------------------------------------------------------


@pytest.mark.parametrize("gain", [3.0, -3.0])
def test_motions_begin_at_rest_and_take_as_long_as_the_training_recordings(
    tmp_path: Path, gain: float
) -> None:
    wave = 5.0 - 5.0 * np.cos(2 * np.pi * np.arange(1200) / 400)
    moved = 17.0 + gain * (0.2 * wave - 1.0)
    run = Recording({"pressure": 0.3 * wave, "displacement": moved}, 0.1)
    workspace = modelled(tmp_path, a=PI.example(), b=WEAKER)
    workspace.add(run, origin="", call="", role="train")

    async def look(user: User) -> None:
        await on_compensate(user)
        assert field(user, "Time between steps [s]").value == 0.1
        assert field(user, "Duration [s]").value == 80.0
        first, other = (float(field(user, label).value) for label in ("From [mm]", "To [mm]"))
        assert (other - first) * gain > 0
        field(user, "Duration [s]").set_value(120.0)
        user.find(marker="wave").click()
        points = only(user, "points").value
        assert points.startswith(f"0 {first:g}\n")
        assert "\n120 " in points
        await turn(user, "b")  # which goes on with the motion
        assert field(user, "Duration [s]").value == 120.0
        assert only(user, "points").value == points

    visit(workspace, look)


def test_what_is_not_recommended_is_not_chosen_first_and_is_marked(tmp_path: Path) -> None:
    workspace = modelled(tmp_path / "two", a=PI.example(), b=WEAKER)
    why = "No model is recommended: none predicts better"
    ranked(workspace, "a", 1.0, not_recommended=why, skill_least=-0.1)

    async def look(user: User) -> None:
        user.find(marker="tab-take").click()
        await until(user, "not-recommended")
        await on_compensate(user)
        assert only(user, "invert").value == "b"
        await turn(user, "a")
        marks = {one.text for one in user.find(kind=ui.label, marker="not-recommended").elements}
        assert any(text.startswith("a ") for text in marks)

    visit(workspace, look)
    ranked(workspace, "b", 2.0, not_recommended="", skill_least=0.5)

    async def look_again(user: User) -> None:
        await on_compensate(user)
        await user.should_not_see(marker="not-recommended")

    visit(workspace, look_again)


@pytest.mark.parametrize(("tested", "useful"), [(2.0, True), (9.0, False)])
def test_ones_own_muscle_is_the_plant_before_a_rig_where_its_model_predicts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, tested: float, useful: bool
) -> None:
    workspace = modelled(tmp_path, a=PI.example(), b=WEAKER)
    constant = {"validation_rmse": 8.0, "test": {"rmse": 8.0}}
    for name, rmse in {"a": 1.0, "b": 2.0}.items():
        ranked(workspace, name, rmse, constant=constant, test={"rmse": tested})
    go, rig = threading.Event(), rig_names()[0]

    def found(*_: Any) -> list[str]:
        assert go.wait(30.0)
        return [rig]

    monkeypatch.setattr(closing, "fitting_rigs", found)

    async def look(user: User) -> None:
        await drawn(user)
        await until(user, "run-loop")
        plant = only(user, "loop-plant")
        assert list(plant.options) == [f"model {name}" for name in ("ba" if useful else "ab")]
        assert f"{tested:.2f} mm" in plant.options["model b"]
        if useful:
            await until(user, "weaker-plant")
        go.set()
        await later(lambda: f"rig {rig}" in plant.options)
        first, last = f"rig {rig}", ["model a", "model b"]
        assert list(plant.options) == (["model b", first, "model a"] if useful else [first, *last])
        assert plant.value == next(iter(plant.options))
        if not useful:
            await gone(user, "weaker-plant")

    try:
        visit(workspace, look)
    finally:
        go.set()


def test_controllers_that_cannot_run_on_an_arm_are_not_offered(tmp_path: Path) -> None:
    async def look(user: User) -> None:
        await drawn(user)
        await until(user, "run-loop")
        kinds = only(user, "controllers")
        assert set(kinds.options) == {"feedforward", "observer"}
        assert kinds.value == ["feedforward"]
        assert "pressure_1, pressure_2, pressure_3" in only(user, "law-refused").text

    visit(modelled(tmp_path, a=three_muscles(), b=three_muscles(0.9)), look)


def test_a_motion_is_found_again_when_the_page_is_loaded_again(tmp_path: Path) -> None:
    workspace = modelled(tmp_path, a=PI.example())

    async def look(user: User) -> None:
        await drawn(user)
        await user.open("/")
        await on_compensate(user)
        await until(user, "motion-again")
        user.find(marker="motion-again").click()
        await until(user, "pressure-plot")

    visit(workspace, look)
    files = (workspace.path("runs", f"{name}.csv") for name in ("reference", "reference-2"))
    (first,), (again,) = (read(file, informative=False) for file in files)
    np.testing.assert_array_equal(first["displacement"], again["displacement"])


def test_a_force_is_estimated_of_what_was_not_trained_on_by_a_doubted_model(tmp_path: Path) -> None:
    estimator = load("blocks", "balance").example().inverse()
    workspace = modelled(tmp_path, a=estimator, b=estimator)
    t = np.arange(600) * 0.05
    channels = (*estimator.inputs, *estimator.outputs)
    for number in range(3):
        run = {c.name: np.sin(t + k + number) + 2.0 for k, c in enumerate(channels)}
        recorded = Recording(run, 0.05, {c.name: c.unit for c in channels})
        workspace.add(recorded, origin="", call="", role="train", name=f"run{number}")
    for name, ratio in (("a", -0.013), ("b", 0.9)):
        result = {"status": "ok", "model": "balance", "memory": {"gap_ratio": ratio}}
        workspace.write_json("results", name, result)

    async def look(user: User) -> None:
        await on_compensate(user)
        await until(user, "forces")
        only(user, "forces").open()
        await later(lambda: only(user, "force-recording").value == "run2")  # as it is held out
        assert list(only(user, "force-recording").options) == ["run2", "run0", "run1"]
        assert "−1.3 %" in (await until(user, "force-doubt")).text
        only(user, "force-model").set_value("b")
        await gone(user, "force-doubt")

    visit(workspace, look)


# -- take away -----------------------------------------------------------------------------------


def test_what_is_taken_is_what_compensates_and_was_chosen_at_the_click(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    oscillator = load("blocks", "duhem-oscillator").example()  # has no inverse
    workspace = modelled(tmp_path, a=oscillator, b=PI.example(), c=WEAKER)

    async def look(user: User) -> None:
        def chosen() -> tuple[str, str]:
            return only(user, "take-model").value, only(user, "take-form").value

        with held(monkeypatch, taking_code, "pace") as pace:
            user.find(marker="tab-take").click()
            await until(user, "take-form")
            await later(pace.begun.is_set)
            field(user, "Time between steps [s]").set_value(0.007)
            pace.go.set()
            await later(lambda: chosen() == ("b", "inverse"))
            assert field(user, "Time between steps [s]").value == 0.007
        only(user, "take-model").set_value("a")
        await later(lambda: chosen() == ("a", "model"))
        await on_compensate(user)
        await turn(user, "c")
        await drawn(user)
        user.find(marker="tab-take").click()
        await later(lambda: chosen() == ("c", "inverse"))
        only(user, "take-form").set_value("model")
        with held(monkeypatch, forms, "made") as made:
            user.find(marker="take-json").click()
            await later(made.begun.is_set)
            only(user, "take-model").set_value("b")
            made.go.set()
            taken = (await user.download.next(timeout=20.0)).text
        assert taken == workspace.path("models", "c.json").read_text("utf-8")
        assert workspace.path("takeaway", "c.json").read_text("utf-8") == taken

    visit(workspace, look)
