"""All tabs without a browser: what is chosen at first, offered, drawn and changed by a click."""

from __future__ import annotations

import asyncio
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("nicegui")

from nicegui import ui
from nicegui.testing import User

from mckibben import PI, Recording
from mckibben.app.busy import SOON, Answer, under_way
from mckibben.app.work import fit
from mckibben.app.workspace import Workspace
from mckibben.registry import load
from mckibben.signals import triangle
from tests.app.simulated import (
    WEAKER,
    drawn,
    field,
    filled,
    gone,
    later,
    modelled,
    on_compensate,
    only,
    quiet,
    simulated,
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


def test_a_second_click_does_nothing_twice_and_what_runs_is_listed() -> None:
    done: list[str] = []

    def root() -> None:
        async def slow() -> None:
            await asyncio.sleep(3 * SOON)
            done.append("slow")

        ui.button("Draw it", on_click=Answer(slow))

    async def look(user: User) -> None:
        assert user.client is not None
        for _ in range(3):
            user.find("Draw it").click()
        await asyncio.sleep(2 * SOON)
        (button,) = user.find("Draw it").elements
        assert [str(one) for one in under_way(user.client)] == ["Draw it"]
        assert "loading" in button.props
        await asyncio.sleep(3 * SOON)
        assert done == ["slow"]
        assert under_way(user.client) == []
        assert "loading" not in button.props
        user.find("Draw it").click()
        await later(lambda: done == ["slow", "slow"])

    simulated(root, look)


# -- data ----------------------------------------------------------------------------------------


def test_recordings_of_several_zeros_get_one(tmp_path: Path) -> None:
    time = np.arange(400) * 0.05
    up = np.where(time < 4 * np.pi, 2 - 2 * np.cos(time), 0.0)  # it rests at the end
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


def test_recordings_of_other_channels_are_set_unused_and_then_models_are_offered(
    tmp_path: Path,
) -> None:
    time = np.arange(400) * 0.05
    inputs = {f"pressure_{k}": 2 + np.sin(k * time) for k in (1, 2, 3)}
    arm = Recording(inputs | {f"displacement_{k}": np.cos(k * time) for k in (1, 2)}, 0.05)
    up = 2 - 2 * np.cos(time)
    runs = {
        name: Recording({"pressure": up, "displacement": gain * up}, 0.05)
        for name, gain in (("one", 1.0), ("two", 1.01))
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

    visit(workspace, look)
    roles = {entry.name: entry.role for entry in workspace.entries()}
    assert [roles[name] for name in ("one", "two", "arm")] == ["train", "train", "unused"]
    workspace.undo()
    assert workspace.entry("arm").role == "train"


def test_loads_in_names_are_given_by_one_click(tmp_path: Path) -> None:
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

    visit(workspace, look)


# -- look ----------------------------------------------------------------------------------------


def test_what_moves_an_output_most_is_drawn(tmp_path: Path) -> None:
    time = np.arange(1200) * 0.1
    every = {f"pressure_{k + 1}": np.zeros(time.size) for k in range(3)}
    for k, pressure in enumerate(every.values()):  # one after another, the others held
        pressure[400 * k : 400 * k + 400] = triangle(time[:400], 10.0, 4.0)
    one, two, three = every.values()
    every |= {"displacement_1": 9 * three + 0.2 * one, "displacement_2": 5 * one - two}
    arm = Recording(every, 0.1)

    async def look(user: User) -> None:
        user.find(marker="tab-look").click()
        await user.should_see("displacement_1 over pressure_3", retries=100)
        only(user, "look-recording").set_value("first")  # in which the first muscle moves alone
        await user.should_see("displacement_1 over pressure_1", retries=100)
        user.find(marker="pair-pressure_1-displacement_2").click()
        await user.should_see("displacement_2 over pressure_1", retries=100)

    visit(workspace_of(tmp_path, arm=arm, first=arm.slice(0, 400)), look)


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


async def turn(user: User, model: str) -> None:
    """Choose another model."""
    before = only(user, "show-pressures")
    only(user, "invert").set_value(model)
    await later(lambda: only(user, "show-pressures") is not before)


# -- compensate ----------------------------------------------------------------------------------


@pytest.mark.parametrize("gain", [3.0, -3.0])
def test_motions_begin_at_rest(tmp_path: Path, gain: float) -> None:
    workspace = modelled(tmp_path, a=PI.example())
    rising = np.linspace(0.0, 3.0, 50)
    run = Recording({"pressure": rising, "displacement": 17.0 + 2.0 * gain * (rising - 1.5)}, 0.1)
    workspace.add(run, origin="", call="", role="train")

    async def look(user: User) -> None:
        await on_compensate(user)
        first, other = (float(field(user, label).value) for label in ("From [mm]", "To [mm]"))
        assert (other - first) * gain > 0
        user.find(marker="wave").click()
        assert only(user, "points").value.startswith(f"0 {first:g}\n")

    visit(workspace, look)


def test_motions_take_as_long_as_the_training_recordings(tmp_path: Path) -> None:
    wave = 5.0 - 5.0 * np.cos(2 * np.pi * np.arange(1200) / 400)
    run = Recording({"pressure": 0.3 * wave, "displacement": 14.0 + 0.6 * wave}, 0.1)
    workspace = modelled(tmp_path, a=PI.example(), b=WEAKER)
    workspace.add(run, origin="", call="", role="train")

    async def look(user: User) -> None:
        await on_compensate(user)
        assert field(user, "Time between steps [s]").value == 0.1
        assert field(user, "Duration [s]").value == 80.0
        field(user, "Duration [s]").set_value(120.0)
        user.find(marker="wave").click()
        assert "\n120 " in only(user, "points").value

    visit(workspace, look)


def test_what_is_not_recommended_is_not_chosen_first_and_is_marked(tmp_path: Path) -> None:
    workspace = modelled(tmp_path, a=PI.example(), b=WEAKER)
    row = {"status": "ok", "model": "pi", "validation_rmse": 1.0, "unit": "mm"}
    doubted = {"not_recommended": "validation", "skill_least": -0.1}
    workspace.write_json("results", "a", row | doubted)

    async def look(user: User) -> None:
        user.find(marker="tab-take").click()
        await until(user, "not-recommended")
        await on_compensate(user)
        assert only(user, "invert").value == "b"

    visit(workspace, look)


def test_a_force_is_estimated_of_what_was_not_trained_on(tmp_path: Path) -> None:
    estimator = load("blocks", "balance").example().inverse()
    workspace = modelled(tmp_path, a=estimator)
    t = np.arange(600) * 0.05
    channels = (*estimator.inputs, *estimator.outputs)
    for number in range(3):
        run = {c.name: np.sin(t + k + number) + 2.0 for k, c in enumerate(channels)}
        recorded = Recording(run, 0.05, {c.name: c.unit for c in channels})
        workspace.add(recorded, origin="", call="", role="train", name=f"run{number}")

    async def look(user: User) -> None:
        await on_compensate(user)
        await until(user, "forces")
        only(user, "forces").open()
        await later(lambda: only(user, "force-recording").value == "run2")  # as it is held out
        assert list(only(user, "force-recording").options) == ["run2", "run0", "run1"]

    visit(workspace, look)


# -- take away -----------------------------------------------------------------------------------


def test_what_is_taken_is_what_compensates(tmp_path: Path) -> None:
    oscillator = load("blocks", "duhem-oscillator").example()  # has no inverse
    workspace = modelled(tmp_path, a=oscillator, b=PI.example(), c=WEAKER)

    async def look(user: User) -> None:
        def chosen() -> tuple[str, str]:
            return only(user, "take-model").value, only(user, "take-form").value

        user.find(marker="tab-take").click()
        await until(user, "take-form")
        await later(lambda: chosen() == ("b", "inverse"))
        only(user, "take-model").set_value("a")
        await later(lambda: chosen() == ("a", "model"))
        await on_compensate(user)
        await turn(user, "c")
        await drawn(user)
        user.find(marker="tab-take").click()
        await later(lambda: chosen() == ("c", "inverse"))
        only(user, "take-form").set_value("model")
        user.find(marker="take-json").click()
        taken = (await user.download.next(timeout=20.0)).text
        assert taken == workspace.path("models", "c.json").read_text("utf-8")

    visit(workspace, look)
