"""Compensators in the workbench: motions, loops, forces and logs, as jobs and in Chromium."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mckibben import PI, workflow
from mckibben.app import compensators, loops, modelling, motions
from mckibben.app.workspace import Workspace
from mckibben.errors import DataError
from mckibben.files import write
from mckibben.options import InvertOptions, TrackOptions
from mckibben.recording import Recording
from tests.app.browsing import SLOW, Workbench, seen, visited, workbench
from tests.app.simulated import with_example

pytestmark = pytest.mark.filterwarnings("ignore::mckibben.errors.DataWarning")


def silent(*_: Any) -> None:
    """Hear of no progress."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the example and two models of it, made without a browser."""
    return with_example(tmp_path_factory.mktemp("bench"), "pi", "p2z").folder


@pytest.fixture
def workspace(folder: Path) -> Workspace:
    return Workspace(folder)


def stored(workspace: Workspace, kind: str = "triangle") -> str:
    points = {"displacement": motions.ready_made_points(kind, 10.0, 5.0, 20.0, 1)}
    return loops.store_reference(
        workspace, motions.reference_from_points(points, {}, 0.02, {"displacement": "mm"})
    )


def test_a_fit_has_the_error_to_expect_of_its_compensator_or_why_there_is_none(
    tmp_path: Path,
) -> None:
    workspace = with_example(tmp_path)
    for model in ("gpi", "play-ridge"):
        modelling.fit(workspace, silent, model=model, inputs=["pressure"], outputs=["displacement"])
    rows = {row["model"]: row for row in workspace.results()}
    expected = rows["gpi"]["compensator"]
    assert expected["following_error"] == rows["gpi"]["test"]["rmse"]
    assert expected["following_error"] < 0.5 * expected["static_map_error"]
    assert rows["gpi"]["no_compensator"] == ""
    assert rows["play-ridge"]["compensator"] is None  # it has no inverse
    assert rows["play-ridge"]["no_compensator"]


def test_motions_are_between_their_ends_and_what_is_none_is_refused() -> None:
    for kind in motions.MOTIONS:
        times, values = np.transpose(motions.ready_made_points(kind, 12.0, 3.0, 9.0, 2))
        assert (times[0], times[-1], values[0]) == (0.0, 12.0, 3.0)
        assert (np.diff(times) > 0).all()
        assert values.min() >= 3.0
        assert 5.0 < values.max() <= 9.0
    run = motions.reference_from_points(
        {"a": [(0, 1), (2, 3)], "b": [(0, 0), (1, 1)]}, {"c": 5.0}, 0.5, {}
    )
    assert run.matrix(["a", "b", "c"])[[1, 4]].tolist() == [[1.5, 0.5, 5.0], [3.0, 1.0, 5.0]]
    for points in ([], [(0.0, 1.0), (0.0, 2.0)]):
        with pytest.raises(DataError):
            motions.reference_from_points({"a": points}, {}, 0.5, {})
    with pytest.raises(DataError):
        motions.ready_made_points("sine", 10.0, 1.0, 1.0, 2)
    with pytest.raises(DataError):
        motions.points_of_recording(run, ["d"])


def test_what_a_model_is_used_as_and_reaches(workspace: Workspace) -> None:
    assert compensators.models_usable_as(workspace, "inverse") == ["pi"]
    assert {"inverse", "adaptive", "predictive"} <= compensators.uses(workspace, "pi").keys()
    moved = np.concatenate([run["displacement"] for run in workspace.with_role("train")])
    ((low, high),) = motions.reach(workspace, "pi", {}).values()
    assert abs(low - moved.min()) < 0.2 * np.ptp(moved) > abs(high - moved.max())
    wish, inverse = motions.default_motion(workspace, "pi"), workspace.model("pi").inverse()
    asked = motions.reference_from_points(
        motions.motion_points(wish), wish["held"], wish["step"], {"displacement": "mm"}
    )
    assert np.ptp(asked["displacement"]) > 0.5 * np.ptp(moved)
    assert inverse.n_clipped(inverse.final_state(asked)) == 0
    first, second, *plants = loops.plants(workspace, "pi")
    assert (first, second) == ("model p2z", "model pi")  # other muscles last
    assert "rig soft-arm" not in plants
    assert "feedforward" in loops.laws(workspace, "pi", "model p2z")


def test_a_loop_is_beside_no_compensation(workspace: Workspace) -> None:
    name = stored(workspace)
    given: dict[str, Any] = {"model": "pi", "form": "inverse", "settings": {}, "reference": name}
    options = {"noise": 0.1, "approach": 5.0}
    loops.loop(
        workspace, silent, name="a",
        asked=given | {"controller": "feedforward-pid", "plant": "model p2z", "options": options},
    )  # fmt: skip
    one = loops.newest(workspace, "runs")["a"]
    assert one["rmse"]["displacement"] < one["uncompensated"]["rmse"]["displacement"]
    assert {"reference_displacement", "uncompensated_displacement", "command_pressure"} <= {
        *loops.read_run(workspace, "a.csv").channels
    }
    assert modelling.restored(one)


def test_a_log_is_reviewed_and_a_force_estimated(workspace: Workspace) -> None:
    given: dict[str, Any] = {"model": "pi", "form": "inverse", "settings": {}}
    given["reference"] = stored(workspace, "sine")
    loops.loop(
        workspace, silent, name="c",
        asked=given | {"controller": "feedforward", "plant": "model p2z", "options": {}},
    )  # fmt: skip
    write(loops.read_run(workspace, "c.csv"), workspace.path("uploads", "log.csv"))
    loops.review(workspace, silent, name="log", asked=given | {"log": "log.csv"})
    one = loops.newest(workspace, "reviews")["log"]
    assert one["outputs"][0]["achieved"] == pytest.approx(
        loops.newest(workspace, "runs")["c"]["rmse"]["displacement"], rel=0.3
    )
    assert {item.kind for item in modelling.restored(one) if item} == {"text", "figure"}

    time = np.arange(500) * 0.02
    force = PI.example().simulate(Recording({"pressure": 2 + np.sin(time)}, 0.02))["displacement"]
    channels = {"pressure": 2 + np.sin(time), "force": force}
    workspace.add_recording(Recording(channels, 0.02), name="isometric", role="unused")
    fitted = workflow.fit(
        "pi", [workspace.recording("isometric")], input=("pressure",), output=("force",)
    )
    fitted.model.save(workspace.path("models", "of-force.json"))
    assert "of-force" in compensators.models_usable_as(workspace, "force")
    found = compensators.estimate_force(workspace, "of-force", "isometric")
    assert found.metrics["force"]["rmse"] < 0.2 * np.ptp(force)
    workspace.delete("models", "of-force")
    workspace.remove("isometric")


def test_options_are_asked_for_by_their_dataclasses() -> None:
    pytest.importorskip("nicegui")
    from mckibben.app.forms import given

    filled = {"horizon": 30.0, "pressures": "0.5 4", "rate_limit": None, "noise": ""}
    assert given(InvertOptions, filled) == {"horizon": 30, "pressures": (0.5, 4.0)}
    assert given(TrackOptions, {"noise": 0.0, "delay": 3.0, "pressure_loop": False}) == {
        "delay": 3,
        "pressure_loop": False,
    }
    with pytest.raises(DataError):
        given(InvertOptions, {"pressures": "low"})


@pytest.fixture
def bench(folder: Path) -> Iterator[Workbench]:
    pytest.importorskip("nicegui")
    with workbench(folder) as found:
        yield found


def test_a_motion_is_followed_in_chromium_and_the_commands_taken(
    browser: Any, bench: Workbench, workspace: Workspace
) -> None:
    for name in loops.newest(workspace, "runs"):
        workspace.delete("runs", name)
    with visited(browser, bench) as page:
        seen(page, "tab-compensate").click()
        seen(page, "nothing-yet")
        assert page.evaluate("document.documentElement.scrollHeight") <= 1350
        page.get_by_test_id("field-other").fill("15")
        seen(page, "run").click()
        runs = seen(page, "runs").locator("tbody tr")
        page.wait_for_function(
            "() => document.querySelectorAll('[data-testid=runs] tbody tr').length == 2",
            timeout=SLOW,
        )
        assert "command_pressure" in seen(page, "motion-plot").inner_text()
        made = loops.newest(workspace, "runs")
        assert {one["controller"] for one in made.values()} == {"feedforward", "feedforward-pid"}
        (reference,) = {one["reference"] for one in made.values()}
        wanted = loops.read_run(workspace, reference)["displacement"]
        assert wanted.max() == pytest.approx(15.0, abs=0.1)
        page.reload()
        seen(page, "runs")  # what was done is there again
        with page.expect_download() as taken:
            runs.first.get_by_role("button").first.click()
        assert taken.value.path().read_text().splitlines()[0].count("reference_displacement") == 1
