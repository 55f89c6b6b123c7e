"""Models: what is on offer, what jobs write, and fits in Chromium from the drawer to the leaderboard."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from mckibben.app import compensators, loops, modelling, motions
from mckibben.app.modelling import comparable, offered, sides_of
from mckibben.app.workspace import Workspace
from mckibben.errors import DataError
from tests.app.browsing import NARROW, SLOW, seen, visited, workbench
from tests.app.simulated import with_example

pytestmark = pytest.mark.filterwarnings("ignore::mckibben.errors.MckibbenWarning")

GIVEN: dict[str, Any] = {"inputs": ["pressure"], "outputs": ["displacement"]}


def silent(*_: Any) -> None:
    pass


@pytest.fixture
def workspace(tmp_path: Path) -> Workspace:
    """Return a folder with the example: one recording to train on, one to test on."""
    return with_example(tmp_path / "bench")


def test_offers_follow_the_recordings(workspace: Workspace) -> None:
    sides = sides_of(workspace, ["pressure"], ["displacement"])
    found = offered(workspace, sides)
    assert {"pi", "gpi", "arx"} <= {*found.quick} < {*found.models}
    assert all(found.others.values())
    for entry in workspace.entries():
        workspace.change(entry.name, role="test")
    with pytest.raises(DataError) as raised:
        offered(workspace, sides)
    assert raised.value.remedy


def test_models_of_other_recordings_stay_and_come_last(workspace: Workspace) -> None:
    modelling.fit(workspace, silent, model="gpi", **GIVEN)
    first = workspace.path("models", "gpi.json").read_bytes()
    train = next(entry.name for entry in workspace.entries() if entry.role == "train")
    workspace.split(train, len(workspace.recording(train)) // 2)
    modelling.fit(workspace, silent, model="gpi", **GIVEN)
    assert workspace.path("models", "gpi.json").read_bytes() == first
    assert compensators.models_usable_as(workspace, "inverse") == ["gpi-2", "gpi"]
    for entry in workspace.entries():
        workspace.remove(entry.name)
    assert (
        compensators.models_usable_as(workspace, "inverse") == []
    )  # no recording has its channels
    assert motions.reach(workspace, "gpi", {})  # of what it was identified on


def test_commands_are_tried_on_models_that_they_drive(workspace: Workspace) -> None:
    modelling.fit(workspace, silent, model="gpi", **GIVEN)
    written = workspace.path("models", "gpi.json").read_text(encoding="utf-8")
    for name in ("first", "second"):
        of_command = written.replace('"pressure"', '"command_pressure"')
        workspace.path("models", f"{name}.json").write_text(of_command, encoding="utf-8")
    assert workspace.model("first").inputs[0].name == "command_pressure"
    assert "model first" in loops.plants(workspace, "first")
    assert "model second" in loops.plants(workspace, "first")


def test_jobs_write_results_that_compare(workspace: Workspace) -> None:
    sides = sides_of(workspace, ["pressure"], ["displacement"])
    modelling.fit(workspace, silent, model="pi", **GIVEN)
    modelling.fit(workspace, silent, model="gpi", **GIVEN)
    rows = comparable(workspace, sides)
    assert {row["name"] for row in rows} == {"pi", "gpi"}
    errors = [row["validation_rmse"] for row in rows]
    assert errors == sorted(errors)
    assert errors[-1] < rows[0]["constant"]["validation_rmse"]
    assert modelling.against(rows) == ""
    modelling.fit(workspace, silent, model="gpi", **GIVEN)  # takes the place of the first
    assert len(comparable(workspace, sides)) == 2

    modelling.check(workspace, silent, name="pi")
    row = next(row for row in comparable(workspace, sides) if row["name"] == "pi")
    assert row["check"]["on"] == "test"
    assert {one.kind for one in modelling.restored(row["check"]) if one} >= {
        "text",
        "table",
        "figure",
    }
    modelling.fit(workspace, silent, model="pi", **GIVEN)
    assert "check" not in (workspace.read("results", "pi") or {})

    test = next(entry.name for entry in workspace.entries() if entry.role == "test")
    assert next(iter(modelling.parts(workspace, sides))) == test
    workspace.change(test, role="unused")
    assert not any(row["current"] for row in comparable(workspace, sides))
    (part,) = modelling.parts(workspace, sides).values()
    assert part[1] is not None  # its last part is held out
    assert comparable(workspace, sides_of(workspace, ["displacement"], ["pressure"])) == []


def test_a_model_no_better_than_the_mean_is_not_recommended() -> None:
    row = {"name": "pi", "model": "pi", "unit": "mm", "current": True, "skill_least": -0.1}
    row |= {"validation_rmse": 2.0, "test": {"rmse": 2.0}}
    row["constant"] = {"validation_rmse": 1.0, "test": {"rmse": 1.0}}
    assert modelling.against([row])
    assert not modelling.against([row | {"skill_least": 0.5, "test": {"rmse": 0.5}}])
    assert not modelling.against([row | {"current": False}])


def test_models_are_chosen_fitted_and_seen_closer_in_two_windows(
    browser: Any, workspace: Workspace, tmp_path: Path
) -> None:
    with (
        workbench(tmp_path / "bench") as bench,
        visited(browser, bench) as page,
        visited(browser, bench, **NARROW) as other,
    ):
        for one in (page, other):
            seen(one, "over-time")
            one.get_by_test_id("tab-models").click()
            seen(one, "fit-models")
        page.get_by_test_id("fit-models").click()
        seen(page, "tick-none").click()
        page.get_by_text("Fit 0 models").wait_for(timeout=SLOW)
        for model in ("pi", "gpi", "mpi"):
            seen(page, f"model-{model}").click()
        seen(page, "fit").click()
        for one in (page, other):
            board = seen(one, "leaderboard")
            board.locator("tr.choosable").nth(2).wait_for(timeout=SLOW)
        names = [row["name"] for row in workspace.results()]
        assert {*names} == {"pi", "gpi", "mpi"}
        for one in (page, other):  # the best, in whatever order the fits ended
            one.get_by_test_id("closer").get_by_text(f"· {names[0]}").wait_for(timeout=SLOW)
        page.locator("tr.choosable").nth(1).click()
        for one in (page, other):
            one.get_by_test_id("closer").get_by_text(f"· {names[1]}").wait_for(timeout=SLOW)
        page.locator("tr.choosable").nth(2).focus()
        page.keyboard.press("Enter")
        page.get_by_test_id("closer").get_by_text(f"· {names[2]}").wait_for(timeout=SLOW)
        for tab in ("time", "residual"):
            page.get_by_test_id(f"tab-{tab}").click()
            seen(page, f"closer-{tab}")
        page.get_by_test_id("tab-parameters").click()
        seen(page, "parameters")
        page.get_by_test_id("tab-check").click()
        seen(page, "check").click()
        seen(other, "verdict")
        assert other.evaluate("document.documentElement.scrollWidth") <= 400
        page.reload()
        seen(page, "verdict")
        seen(page, "delete-model").click()
        seen(page, "delete-sure").click()
        page.locator("tr.choosable").nth(2).wait_for(state="detached", timeout=SLOW)
        assert len(workspace.names("models")) == 2


def test_a_fit_is_cancelled_and_one_that_fails_says_why(
    browser: Any, workspace: Workspace, tmp_path: Path
) -> None:
    failed = {"kind": "fit", "state": "failed", "message": "too few samples"}
    workspace.write("jobs", "fit-narx", failed | {"given": {"model": "narx", "title": "narx"}})
    with workbench(tmp_path / "bench") as bench, visited(browser, bench) as page:
        seen(page, "over-time")
        page.get_by_test_id("tab-models").click()
        seen(page, "fits").get_by_text("too few samples").wait_for(timeout=SLOW)
        page.get_by_test_id("fit-models").click()
        seen(page, "tick-all").click()
        seen(page, "fit").click()
        seen(page, "cancel-all").click()
        page.get_by_test_id("fits").wait_for(state="detached", timeout=SLOW)
        assert not workspace.names("jobs") or len(workspace.names("models")) < 5
