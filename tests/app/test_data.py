"""The page of recordings, in a real browser: no click and nothing typed is lost, and all is said."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mckibben import Recording, write
from mckibben.app.kept import Step
from mckibben.app.workspace import Workspace
from tests.app.browsing import SLOW, idle, opened, seen, visited, workbench

pytest.importorskip("playwright.sync_api")

RUNS = [f"run-{k}" for k in range(9)]


def recording(seed: int) -> Recording:
    t = np.arange(300) * 0.02
    pressure = 2 + np.sin(t + seed)
    names = ("flow", "temperature", "voltage", "force", "displacement")
    others = {name: pressure * k for k, name in enumerate(names, start=1)}
    return Recording({"pressure": pressure} | others, 0.02)


@pytest.fixture
def workspace(tmp_path: Path) -> Workspace:
    workspace = Workspace(tmp_path / "ws")
    for seed, name in enumerate(RUNS):
        workspace.add(recording(seed), origin="a test", call="", name=name)
    return workspace


@pytest.fixture
def page(browser: Any, workspace: Workspace) -> Iterator[Any]:
    with workbench(workspace.folder) as address, visited(browser, address) as page:
        yield page


def until(page: Any, holds: Any) -> None:
    """Wait until something holds."""
    for _ in range(SLOW // 100):
        if holds():
            return
        page.wait_for_timeout(100)
    raise AssertionError("it never held:\n" + page.inner_text("body"))


def test_clicks_count_and_typed_values_stay_while_others_change(
    page: Any, workspace: Workspace
) -> None:
    for name in RUNS:
        seen(page, f"role-{name}")
    seen(page, "sample-time").fill("0.01")
    page.evaluate(
        """([gone, ...names]) => {
            document.querySelector(`[aria-label="Remove ${gone}"]`).click()
            for (const name of names) {
                const role = document.querySelector(`[data-testid="role-${name}"]`)
                const buttons = [...role.querySelectorAll("button")]
                buttons.find((button) => button.innerText.toLowerCase() === "unused").click()
            }
        }""",
        RUNS[::-1],
    )
    page.get_by_test_id("recording-run-8").wait_for(state="detached", timeout=SLOW)
    until(page, lambda: {entry.role for entry in workspace.entries()} == {"unused"})
    assert seen(page, "sample-time").input_value() == "0.01"
    page.get_by_text("Resample", exact=True).click()
    seen(page, "steps").get_by_text("resampled to 0.01 s").wait_for(timeout=SLOW)


def test_a_row_stays_while_what_it_tells_changes(page: Any, workspace: Workspace) -> None:
    """What is clicked on the way must not be taken away: a click on what is gone is lost."""
    role = seen(page, "role-run-3").element_handle()
    workspace.edit_each(RUNS, "halved", Step(do="resample", sample_time=0.04))
    seen(page, "recording-run-3").get_by_text("150 samples").wait_for(timeout=SLOW)
    role.query_selector("button:nth-of-type(2)").click()
    until(page, lambda: workspace.entry("run-3").role == "test")


def test_what_is_driven_and_moves_is_drawn_and_the_rest_is_named(page: Any) -> None:
    plot = seen(page, "preview-plot")
    for name in ("pressure", "displacement"):
        plot.get_by_text(name).first.wait_for(timeout=SLOW)
    assert (
        seen(page, "not-drawn").inner_text() == "Not drawn: flow, force"
    )  # flow is without a unit
    seen(page, "draw-channels").click()
    page.get_by_role("option", name="force").click()
    page.get_by_text("Not drawn: flow", exact=True).wait_for(timeout=SLOW)
    plot.get_by_text("force").first.wait_for(timeout=SLOW)


def test_what_came_from_no_file_is_read_otherwise_and_a_load_is_told(
    page: Any, workspace: Workspace
) -> None:
    def ask(name: str) -> None:
        idle(page)
        page.get_by_role("button", name=f"How it was read: {name}").click()
        seen(page, "add-constant")

    ask("run-3")
    seen(page, "rename").fill("mine")
    seen(page, "read-again").click()
    seen(page, "recording-mine")
    ask("mine")
    seen(page, "add-constant").click()
    seen(page, "constant-value-0").fill("200")
    seen(page, "constant-unit-0").fill("g")
    seen(page, "read-again").click()
    seen(page, "problem").get_by_text("a constant are to be force").wait_for(timeout=SLOW)
    seen(page, "channel-4").click()
    page.get_by_role("option").filter(has_text="(left out)").click()
    seen(page, "read-again").click()
    until(page, lambda: np.ptp(workspace.recording("mine")["force"]) == 0)
    assert workspace.recording("mine")["force"] == pytest.approx(1.96133)
    page.get_by_test_id("read-again").wait_for(state="detached", timeout=SLOW)
    ask("mine")
    assert seen(page, "constant-value-0").input_value() == "200"
    assert seen(page, "constant-unit-0").input_value() == "g"


def test_of_files_that_come_slowly_there_is_one_summary(page: Any, workspace: Workspace) -> None:
    seen(page, "upload")
    late: list[Any] = []

    def hold(route: Any) -> None:
        """Let all but the last file in at once, and that when the others have long been read."""
        late.append(route)
        if len(late) < 6:
            route.continue_()

    page.route("**/upload/**", hold)
    names = [f"photo{k}.jpg" for k in range(6)]
    page.locator("input[type=file]").first.set_input_files(
        [{"name": name, "mimeType": "image/jpeg", "buffer": b"\xff\xd8"} for name in names]
    )
    until(page, lambda: len(late) == 6)
    page.wait_for_timeout(1500)
    assert page.get_by_test_id("not-read").count() == 0
    late[-1].continue_()
    said = seen(page, "not-read").inner_text()
    assert "6 file(s) were not read" in said
    assert page.get_by_test_id("not-read").count() == 1


def test_a_rig_is_told_in_words_and_its_runs_are_found_by_a_part_of_their_names(page: Any) -> None:
    seen(page, "rig").click()
    seen(page, "protocol").click()
    page.get_by_role("option").filter(has_text="soft arm of three muscles").click()
    page.get_by_text("143 runs").wait_for(timeout=SLOW)
    seen(page, "runs").fill("network-p0-0.0-drive-1")
    options = page.get_by_role("option")
    options.filter(has_text="network-p0-0.0-drive-1").first.wait_for(timeout=SLOW)
    assert options.filter(has_text="gpi").count() == 0


def test_the_open_page_stays_when_it_is_loaded_again(page: Any) -> None:
    opened(page, "take")
    page.wait_for_url("**?tab=Take+away")
    page.reload()
    selected = page.get_by_test_id("tab-take").and_(page.locator("[aria-selected=true]"))
    selected.wait_for(timeout=SLOW)
    page.get_by_text("Fit a model first").first.wait_for(timeout=SLOW)
    opened(page, "data")
    seen(page, "recording-run-0")


def test_a_file_is_dropped_again_after_it_was_removed(
    page: Any, workspace: Workspace, tmp_path: Path
) -> None:
    path = tmp_path / "again.csv"
    write(recording(1), path)
    chooser = page.locator("input[type=file]").first
    for _ in range(2):
        chooser.set_input_files(path)
        seen(page, "recording-again")
        idle(page)
        page.get_by_role("button", name="Remove again").click()
        page.get_by_test_id("recording-again").wait_for(state="detached", timeout=SLOW)
    assert not page.get_by_text("MiB").count()
