"""What Compensate shows and runs is what is drawn there, of the model chosen there."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("nicegui")

from nicegui import ui
from nicegui.testing import User

from mckibben import PI, Banded, Recording, read
from mckibben.app.desk import Desk
from mckibben.app.following import compensated, kept_motion
from mckibben.app.jobs import Job, Jobs, note
from mckibben.app.motions import reference_recording
from mckibben.app.pages import closing, compensate, loops
from mckibben.app.recorded import reached
from mckibben.app.work import fit
from mckibben.app.workspace import Workspace
from mckibben.blocks.core.block import Block
from mckibben.blocks.core.fields import Channel
from mckibben.control import Twin, before
from mckibben.registry import load
from mckibben.rigs import rig_names
from tests.app.test_pages import visit
from tests.comparison.test_several import QUICKLY, hung

WEAKER = replace(PI.example(), weights=tuple(0.9 * weight for weight in PI.example().weights))


def arm(scale: float = 1.0) -> Block:
    """Return three muscles that move a tip in two coordinates."""
    muscles = tuple(
        replace(
            PI.example(),
            input=Channel(f"pressure_{k}", "bar"),
            output=Channel(f"shortening_{k}", "mm"),
        )
        for k in (1, 2, 3)
    )
    tip = tuple(Channel(f"displacement_{k}", "mm") for k in (1, 2))
    gains = ((0.5 * scale, 0.0), (-0.25, 0.4), (-0.25, -0.4))
    coupling = load("blocks", "coupling")(gains, tuple(one.output for one in muscles), tip)
    whole: Block = load("blocks", "series")((load("blocks", "per-channel")(muscles), coupling))
    return whole


def workspace_with(folder: Path, **models: Block) -> Workspace:
    workspace = Workspace(folder)
    for name, model in models.items():
        model.save(workspace.path("models", f"{name}.json"))
    return workspace


def only(user: User, marker: str) -> Any:
    """Return the one element of a name for tests."""
    (element,) = user.find(marker=marker).elements
    return element


def field(user: User, label: str) -> ui.number:
    (found,) = [one for one in user.find(ui.number).elements if one.props.get("label") == label]
    return found


async def until(user: User, marker: str) -> None:
    await user.should_see(marker=marker, retries=200)


async def later(true: Callable[[], bool]) -> None:
    """Wait until something is so."""
    for _ in range(200):
        if true():
            return
        await asyncio.sleep(0.05)
    raise AssertionError("it is not so")


async def drawn(user: User) -> None:
    """Open the page, and show the pressures for a sine."""
    user.find(marker="tab-compensate").click()
    await until(user, "wave")
    user.find(marker="wave").click()
    user.find(marker="show-pressures").click()
    await until(user, "pressure-plot")


async def turn(user: User, model: str) -> None:
    """Choose another model."""
    before = only(user, "show-pressures")
    only(user, "invert").set_value(model)
    await later(lambda: only(user, "show-pressures") is not before)


def held_back(
    monkeypatch: pytest.MonkeyPatch, model: str
) -> tuple[threading.Event, threading.Event]:
    """Have pressures of a model wait; return what says that they do, and what lets them go."""
    begun, go = threading.Event(), threading.Event()

    def slow(workspace: Workspace, name: str, *rest: Any) -> Any:
        found = compensated(workspace, name, *rest)
        if name == model:
            begun.set()
            assert go.wait(30.0)
        return found

    monkeypatch.setattr(compensate, "compensated", slow)
    return begun, go


@pytest.mark.parametrize("change", ["model", "motion", "compensator"])
def test_pressures_of_what_has_changed_meanwhile_are_not_shown(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, change: str
) -> None:
    workspace = workspace_with(tmp_path, a=PI.example(), b=WEAKER)
    begun, go = held_back(monkeypatch, "a")
    shown: list[str] = []
    pressures = compensate.Editor._pressures

    def noted(self: compensate.Editor, model: str, *rest: Any) -> None:
        shown.append(model)
        pressures(self, model, *rest)

    monkeypatch.setattr(compensate.Editor, "_pressures", noted)

    async def look(user: User) -> None:
        user.find(marker="tab-compensate").click()
        await until(user, "wave")
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
        visit(workspace, look)
    finally:
        go.set()


def test_what_runs_is_what_is_drawn(tmp_path: Path) -> None:
    workspace = workspace_with(tmp_path, a=PI.example(), b=WEAKER)
    run = {"model": "a", "plant": "b", "controller": "pid", "rmse": {"displacement": 1.0}}
    workspace.write_json("runs", "a-pid", run | {"reference": "earlier.csv"})

    async def look(user: User) -> None:
        await drawn(user)
        await until(user, "run-loop")
        (row,) = only(user, "runs").rows
        assert row["motion"] == "earlier, another"
        workspace.write_json("runs", "a-now", run | {"reference": "reference.csv"})
        user.find(marker="show-pressures").click()  # the same motion keeps its file
        await later(lambda: len(only(user, "runs").rows) == 2)
        motions = {row["name"]: row["motion"] for row in only(user, "runs").rows}
        assert motions == {"a-pid": "earlier, another", "a-now": "reference, as drawn"}
        assert "Errors compare only within a motion" in only(user, "motions").text
        user.find(marker="wave-triangle").click()
        await until(user, "wish-changed")
        await user.should_not_see(marker="run-loop")
        await user.should_not_see(marker="pressure-plot")
        await later(lambda: "as drawn" not in str(only(user, "runs").rows))
        user.find(marker="show-pressures").click()
        await until(user, "run-loop")
        assert {row["motion"] for row in only(user, "runs").rows} == {
            "earlier, another",
            "reference, another",
        }

    visit(workspace, look)


def test_the_same_motion_has_one_file(tmp_path: Path) -> None:
    workspace = workspace_with(tmp_path, a=PI.example())
    up, down = (
        reference_recording({"displacement": [(0.0, 1.0), (2.0, to)]}, 0.02) for to in (5.0, 0.5)
    )
    first = kept_motion(workspace, "a", up)
    assert kept_motion(workspace, "a", up, [first]) == first
    assert kept_motion(workspace, "a", down, [first]) != first
    workspace.write_json("runs", "a-pid", {"model": "a", "reference": first})
    assert kept_motion(workspace, "a", up) == first


def test_another_model_goes_on_with_the_motion_and_its_duration(tmp_path: Path) -> None:
    async def look(user: User) -> None:
        user.find(marker="tab-compensate").click()
        await until(user, "wave")
        field(user, "Duration [s]").set_value(120.0)
        user.find(marker="wave").click()
        before = only(user, "points").value
        assert "\n120 " in before
        await turn(user, "b")
        assert field(user, "Duration [s]").value == 120.0
        assert only(user, "points").value == before

    visit(workspace_with(tmp_path, a=PI.example(), b=WEAKER), look)


def test_where_no_model_is_recommended_the_pages_say_so(tmp_path: Path) -> None:
    workspace = workspace_with(tmp_path, a=PI.example(), b=WEAKER)
    why = "No model is recommended: on what was left out to validate them, none predicts better"
    row = {"status": "ok", "model": "pi", "validation_rmse": 1.0, "not_recommended": why}
    workspace.write_json("results", "a", row | {"skill_least": -0.1})

    async def look(user: User) -> None:
        user.find(marker="tab-take").click()
        await until(user, "take-model")
        await until(user, "not-recommended")
        said = user.find(kind=ui.label, marker="not-recommended").elements
        assert {one.text for one in said} == {f"{why}."}
        user.find(marker="tab-compensate").click()
        await until(user, "invert")
        assert only(user, "invert").value == "b"
        await turn(user, "a")
        reason = why.removeprefix("No model is recommended: ")
        doubts = {one.text for one in user.find(kind=ui.label, marker="not-recommended").elements}
        assert f"a is not recommended: {reason}." in doubts

    visit(workspace, look)
    better = {"skill_least": 0.5, "validation_rmse": 2.0, "not_recommended": ""}
    workspace.write_json("results", "b", row | better)

    async def look_again(user: User) -> None:
        user.find(marker="tab-compensate").click()
        await until(user, "invert")
        await user.should_not_see(marker="not-recommended")

    alone = workspace_with(tmp_path / "alone", a=PI.example())
    alone.write_json("results", "a", row | {"skill_least": -0.1})

    async def look_alone(user: User) -> None:
        user.find(marker="tab-compensate").click()
        await until(user, "not-recommended")
        assert "has an inverse" in only(user, "not-recommended").text

    visit(alone, look_alone)

    visit(workspace, look_again)


def test_controllers_that_cannot_run_on_an_arm_are_not_offered(tmp_path: Path) -> None:
    async def look(user: User) -> None:
        await drawn(user)
        await until(user, "run-loop")
        kinds = only(user, "controllers")
        assert set(kinds.options) == {"feedforward", "observer"}
        assert kinds.value == ["feedforward"]
        said = only(user, "law-refused").text
        assert "PID alone" in said
        assert "is driven by pressure_1, pressure_2, pressure_3 and gives displacement_1" in said

    visit(workspace_with(tmp_path, a=arm(), b=arm(0.9)), look)


def test_an_arm_is_followed_without_compensation_by_straight_lines() -> None:
    ends = [(0.0, 0.0), (2.0, 3.0)]
    wanted = reference_recording({f"displacement_{k}": ends for k in (1, 2)}, 0.02)
    weak = Twin(arm(), limits={f"pressure_{k}": (0.0, 5.0 if k > 1 else 2.0) for k in (1, 2, 3)})
    found = before(arm().inverse(), weak, wanted, approach=1.0)
    (other,) = found.notes
    assert "twin takes 0 to 2.00: the two models disagree there" in other
    assert found.tracked is not None
    run = found.tracked.recording
    assert (run["command_pressure_1"] <= 2.0 + 1e-9).all()
    own = before(arm().inverse(), Twin(arm()), wanted, approach=1.0).tracked
    assert own is not None
    assert all(error < 1e-4 for error in own.rmse.values())  # this arm is all straight lines


def test_under_dead_loads_a_person_gives_the_load_and_gets_pressures(tmp_path: Path) -> None:
    workspace = Workspace(tmp_path)
    for pull in (10.0, 20.0):
        workspace.add(hung(pull), origin="", call="", name=f"hung{pull:g}")
    desk = Desk(workspace, Jobs(workspace))
    desk.settle_channels()
    asked = {"model": "balance", "name": "balance", "settings": QUICKLY["balance"]}
    fit(workspace, asked | desk.channels, lambda share, cost: None)
    (row,) = desk.results()
    assert (row["name"], row["input"], row["load"]) == ("balance", "pressure", "force")
    taken: list[str] = []
    ends = [reached(workspace, "balance", {"force": pull}) for pull in (10.0, 20.0)]
    (_, above), (_, below) = (each["displacement"] for each in ends)
    assert above > below + 0.5

    async def look(user: User) -> None:
        await drawn(user)
        for pulled in (12.0, 18.0):
            field(user, "force [N]").set_value(pulled)
            await user.should_not_see(marker="take-pressures")
            user.find(marker="show-pressures").click()
            await until(user, "take-pressures")
            user.find(marker="take-pressures").click()
            taken.append((await user.download.next(timeout=20.0)).text)

    visit(workspace, look)
    assert [csv.splitlines()[0] for csv in taken] == ["time_s,pressure_bar"] * 2
    light, heavy = (np.loadtxt(csv.splitlines()[1:], delimiter=",")[:, 1] for csv in taken)
    assert heavy.mean() > light.mean() + 0.1


def test_the_compensator_shown_is_taken_away(tmp_path: Path) -> None:
    async def look(user: User) -> None:
        user.find(marker="tab-take").click()
        await until(user, "take-form")
        assert (only(user, "take-model").value, only(user, "take-form").value) == ("a", "inverse")
        user.find(marker="tab-compensate").click()
        await until(user, "wave")
        await turn(user, "b")
        await drawn(user)
        user.find(marker="tab-take").click()
        await later(lambda: only(user, "take-model").value == "b")
        await later(lambda: only(user, "take-form").value == "inverse")

    visit(workspace_with(tmp_path, a=PI.example(), b=WEAKER), look)


def test_what_is_taken_away_first_compensates(tmp_path: Path) -> None:
    oscillator = load("blocks", "duhem-oscillator").example()
    workspace = workspace_with(tmp_path, a=oscillator, b=PI.example())
    assert (workspace.ranked(), workspace.to_invert()) == (["a", "b"], ["b"])

    async def look(user: User) -> None:
        user.find(marker="tab-take").click()
        await until(user, "take-form")
        assert (only(user, "take-model").value, only(user, "take-form").value) == ("b", "inverse")
        await user.should_see("models/b.json")
        only(user, "take-model").set_value("a")
        await user.should_see("a has no inverse: it compensates nothing.", retries=200)
        await later(lambda: only(user, "take-form").value == "model")
        only(user, "take-model").set_value("b")
        await later(lambda: only(user, "take-form").value == "inverse")

    visit(workspace, look)


def test_a_motion_is_found_again_when_the_page_is_loaded_again(tmp_path: Path) -> None:
    workspace = workspace_with(tmp_path, a=PI.example())

    async def look(user: User) -> None:
        await drawn(user)
        await user.open("/")
        user.find(marker="tab-compensate").click()
        await until(user, "motion-again")
        user.find(marker="motion-again").click()
        await until(user, "pressure-plot")

    visit(workspace, look)
    files = (workspace.path("runs", f"{name}.csv") for name in ("reference", "reference-2"))
    (first,), (again,) = (read(file, informative=False) for file in files)
    np.testing.assert_array_equal(first["displacement"], again["displacement"])


def test_steps_and_motions_begin_as_the_training_recordings_were(tmp_path: Path) -> None:
    workspace = workspace_with(tmp_path, a=PI.example())
    wave = 5.0 - 5.0 * np.cos(2 * np.pi * np.arange(1200) / 400)
    run = Recording({"pressure": 0.3 * wave, "displacement": wave}, 0.1)
    workspace.add(run, origin="", call="", role="train")

    async def look(user: User) -> None:
        user.find(marker="tab-compensate").click()
        await until(user, "wave")
        assert field(user, "Time between steps [s]").value == 0.1
        assert field(user, "Duration [s]").value == 80.0

    visit(workspace, look)


def test_a_step_that_no_recording_tells_is_said_to_be_assumed(tmp_path: Path) -> None:
    async def look(user: User) -> None:
        user.find(marker="tab-compensate").click()
        await until(user, "wave")
        assert "assumed" in field(user, "Time between steps [s]").props["hint"]

    visit(workspace_with(tmp_path, a=PI.example()), look)


def test_the_first_is_so_far_while_fits_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    workspace = workspace_with(tmp_path, a=PI.example())
    workspace.write_json("results", "a", {"status": "ok", "model": "pi", "validation_rmse": 1.0})
    fitting = [Job("gpi", "fit", {})]
    monkeypatch.setattr(Jobs, "active", lambda self: list(fitting))

    async def look(user: User) -> None:
        user.find(marker="tab-compensate").click()
        await until(user, "wave")
        assert only(user, "invert").options["a"] == "a (first of the leaderboard so far)"

    visit(workspace, look)


@pytest.mark.parametrize("gain", [3.0, -3.0])
def test_ready_made_motions_begin_at_rest(tmp_path: Path, gain: float) -> None:
    workspace = workspace_with(tmp_path, a=PI.example())
    rising = np.linspace(0.0, 3.0, 50)
    run = Recording({"pressure": rising, "displacement": 17.0 + 2.0 * gain * (rising - 1.5)}, 0.1)
    workspace.add(run, origin="", call="", role="train")

    async def look(user: User) -> None:
        user.find(marker="tab-compensate").click()
        await until(user, "wave")
        first, other = (float(field(user, label).value) for label in ("From [mm]", "To [mm]"))
        assert (other - first) * gain > 0
        user.find(marker="wave").click()
        assert only(user, "points").value.startswith(f"0 {first:g}\n")

    visit(workspace, look)


@pytest.mark.parametrize(("tested", "useful"), [(2.0, True), (9.0, False), (None, True)])
def test_ones_own_muscle_is_chosen_before_a_rig_where_its_model_predicts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, tested: float | None, useful: bool
) -> None:
    workspace = workspace_with(tmp_path, a=PI.example(), b=WEAKER)
    for name, rmse in {"a": 1.0, "b": 2.0}.items():
        row = {"status": "ok", "model": "pi", "validation_rmse": rmse, "unit": "mm"}
        constant = {"validation_rmse": 8.0, "test": {"rmse": 8.0}}
        test = None if tested is None else {"rmse": tested}
        workspace.write_json("results", name, row | {"constant": constant, "test": test})
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
        error = "not tested" if tested is None else f"test RMSE {tested:.2f} mm"
        doubt = "" if useful else "no better than the mean of the output, "
        assert plant.options["model b"] == f"b: another model of your muscle, {doubt}{error}"
        if useful:
            assert "its validation RMSE is 2.00 mm, not 1.00 mm" in only(user, "weaker-plant").text
        go.set()
        await later(lambda: f"rig {rig}" in plant.options)
        first, last = f"rig {rig}", ["model a", "model b"]
        assert list(plant.options) == (["model b", first, "model a"] if useful else [first, *last])
        assert plant.value == next(iter(plant.options))
        assert plant.options[f"rig {rig}"] == f"{rig}: a virtual rig, another muscle of like size"
        if not useful:
            await user.should_not_see(marker="weaker-plant", retries=200)

    try:
        visit(workspace, look)
    finally:
        go.set()


def test_why_a_loop_failed_stays_until_it_is_run_again(tmp_path: Path) -> None:
    workspace = workspace_with(tmp_path, a=PI.example(), b=WEAKER)
    given = {"model": "a", "plant": "b", "controller": "pid", "name": "a-pid"}
    note(workspace, "loop-1", "loop", given, "failed", "there is no loop. Remedy: draw a motion")

    async def look(user: User) -> None:
        await drawn(user)
        await until(user, "failed-loop")
        assert only(user, "failed-loop").text == "a-pid: there is no loop. Remedy: draw a motion"

    visit(workspace, look)
    note(workspace, "loop-2", "loop", given, "done", "")

    async def look_again(user: User) -> None:
        await drawn(user)
        await until(user, "run-loop")
        await user.should_not_see(marker="failed-loop")

    visit(workspace, look_again)


def test_runs_that_gain_nothing_and_plants_that_scatter_are_said(tmp_path: Path) -> None:
    workspace = workspace_with(tmp_path, a=PI.example(), b=WEAKER)
    replace(Banded.example(), forward=WEAKER).save(workspace.path("banded", "b.json"))
    figures = (
        ("a-good", 0.5, "b", 0.1, 0.4),
        ("a-bad", 1.5, "c", 0.1, 0.0),
        ("a-off", 0.9, "d", -0.8, 0.1),
    )
    for name, rmse, plant, offset, scatter in figures:
        run = {"model": "a", "plant": plant, "controller": "pid", "rmse": {"displacement": rmse}}
        run |= {"offset": {"displacement": offset}, "scatter": {"displacement": scatter}}
        run |= {"units": {"displacement": "mm"}}
        workspace.write_json("runs", name, run | {"uncompensated": {"displacement": 1.0}})

    async def look(user: User) -> None:
        await drawn(user)
        await until(user, "runs")
        # what the compensator clips itself, where it does not say what it reaches, is said in a note
        assert "Steps at a limit or out of reach" in {
            one["label"] for one in only(user, "runs").columns
        }
        said = {one.text for one in user.find(kind=ui.label, marker="runs-remark").elements}
        assert said == {
            "pid on c: no better than without compensation.",
            "pid on b: the plant scatters as its band says, which no compensator foresees.",
            "pid on d: " + loops.OFFSET.format("−0.800\xa0mm"),
        }

    visit(workspace, look)


def test_what_is_commanded_is_called_what_it_is(tmp_path: Path) -> None:
    valve = replace(PI.example(), input=Channel("valve_voltage", "V"))

    async def look(user: User) -> None:
        await drawn(user)
        assert only(user, "show-pressures").text == "Show voltages"
        assert only(user, "take-pressures").text == "Voltages as CSV"
        await until(user, "run-loop")
        assert only(user, "controllers").options["feedforward"] == "Compensator alone (feedforward)"

    visit(workspace_with(tmp_path, a=valve, b=valve), look)


def test_a_model_that_forgets_the_gap_is_doubted_before_it_estimates(tmp_path: Path) -> None:
    estimator = load("blocks", "balance").example().inverse()
    workspace = workspace_with(tmp_path, a=estimator, b=estimator)
    channels = {c.name: np.linspace(1.0, 2.0, 50) for c in (*estimator.inputs, *estimator.outputs)}
    workspace.add(Recording(channels, 0.1), origin="", call="", role="train", name="run")
    for name, ratio in (("a", -0.013), ("b", 0.9)):
        result = {"status": "ok", "model": "balance", "memory": {"gap_ratio": ratio}}
        workspace.write_json("results", name, result)

    async def look(user: User) -> None:
        user.find(marker="tab-compensate").click()
        await until(user, "forces")
        only(user, "forces").open()
        await until(user, "force-doubt")
        assert "a keeps only −1.3 % of the gap" in only(user, "force-doubt").text
        only(user, "force-model").set_value("b")
        await user.should_not_see(marker="force-doubt")

    visit(workspace, look)


def test_a_force_is_estimated_first_of_what_nothing_was_trained_on(tmp_path: Path) -> None:
    estimator = load("blocks", "balance").example().inverse()
    workspace = workspace_with(tmp_path, a=estimator)
    channels = {c.name: np.linspace(1.0, 2.0, 50) for c in (*estimator.inputs, *estimator.outputs)}
    run = Recording(channels, 0.1)
    workspace.add(run, origin="", call="", role="train", name="first")
    workspace.add(run, origin="", call="", role="test", name="second")

    async def look(user: User) -> None:
        user.find(marker="tab-compensate").click()
        await until(user, "forces")
        only(user, "forces").open()
        await until(user, "force-recording")
        await later(lambda: only(user, "force-recording").value == "second")
        assert only(user, "force-recording").options == {
            "second": "second",
            "first": "first (trained on)",
        }

    visit(workspace, look)


def test_the_first_model_fitted_is_chosen_for_logs_too(tmp_path: Path) -> None:
    workspace = workspace_with(tmp_path)
    desks: list[Desk] = []
    build = compensate.build

    async def look(user: User) -> None:
        user.find(marker="tab-compensate").click()
        await until(user, "logs")
        only(user, "logs").open()
        assert only(user, "log-model").value is None
        PI.example().save(workspace.path("models", "a.json"))
        desks[0].changed("results")
        await later(lambda: only(user, "log-model").value == "a")

    def noted(desk: Desk) -> None:
        desks.append(desk)
        build(desk)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(compensate, "build", noted)
        visit(workspace, look)
