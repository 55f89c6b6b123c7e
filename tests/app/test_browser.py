"""What the workbench can do in a real browser, once each: files, parts, an arm, windows."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mckibben.app.workspace import Workspace
from tests.app.browsing import (
    SLOW,
    downloaded,
    holds,
    seen,
    upload,
    visited,
    workbench,
)

playwright = pytest.importorskip("playwright.sync_api")

pytestmark = pytest.mark.long


@pytest.fixture
def workspace(tmp_path: Path) -> Workspace:
    """Return an empty workspace."""
    return Workspace(tmp_path / "ws")


@pytest.fixture
def address(workspace: Workspace) -> Iterator[str]:
    with workbench(workspace.folder) as address:
        yield address


@pytest.fixture
def page(browser: Any, address: str) -> Iterator[Any]:
    with visited(browser, address) as page:
        yield page


def arm(phase: float) -> bytes:
    """Return a file of three muscles of one arm that lag behind their pressures."""
    t = np.arange(400) * 0.1
    columns = {"time_s": t}
    pressures = [
        2.5 - 1.5 * np.cos(t * (0.5 + 0.13 * k + 0.1 * phase) + phase * k) for k in range(3)
    ]
    for k, pressure in enumerate(pressures, 1):
        others = sum(pressures) - pressure
        lagging = pressure - 0.3 * np.sign(np.gradient(pressure)) - 0.1 * others
        columns[f"pressure_{k}_bar"] = pressure
        columns[f"displacement_{k}_mm"] = 6.0 * lagging
    rows = [",".join(f"{v:.5g}" for v in row) for row in zip(*columns.values(), strict=True)]
    return "\n".join([",".join(columns), *rows]).encode()


def choose(page: Any, field: str, option: str) -> None:
    seen(page, field).click()
    page.get_by_role("option").filter(has_text=option).first.click()


def test_a_file_that_needs_help_is_mapped_by_hand_and_read_otherwise(
    page: Any, workspace: Workspace
) -> None:
    t = np.arange(200) * 0.05
    rows = [f"{a:.3f};{300 + 100 * np.sin(a):.3f};{10 * np.cos(a):.3f}" for a in t]
    upload(page, "rig", ("t_s;P1;laser\n" + "\n".join(rows)).encode())
    seen(page, "problem")
    for place, channel, unit in ((1, "pressure", "kPa"), (2, "displacement", "mm")):
        choose(page, f"channel-{place}", channel)
        page.get_by_test_id(f"unit-{place}").fill(unit)
    seen(page, "read-again").click()
    seen(page, "recording-rig")
    first = workspace.recording("rig")
    assert first["pressure"].max() == pytest.approx(4.0, abs=0.01)
    page.get_by_label("How it was read: rig").click()
    seen(page, "sign-2").click()
    seen(page, "add-constant").click()
    seen(page, "constant-value-0").fill("200")
    seen(page, "constant-unit-0").fill("g")
    seen(page, "read-again").click()
    holds(page, lambda: "force" in workspace.recording("rig"))
    found = workspace.recording("rig")
    assert found["force"] == pytest.approx(1.96133)
    np.testing.assert_allclose(found["displacement"], -first["displacement"])
    page.get_by_test_id("read-again").wait_for(state="detached", timeout=SLOW)
    page.get_by_label("Remove rig").click()
    page.get_by_test_id("recording-rig").wait_for(state="detached", timeout=SLOW)
    page.keyboard.press("Control+z")
    seen(page, "recording-rig")


def test_a_part_is_cut_by_dragging_and_by_keys_and_taken_back(
    page: Any, workspace: Workspace
) -> None:
    seen(page, "example").click()
    name = "decaying-triangle"
    seen(page, f"recording-{name}")
    whole = len(workspace.recording(name))
    box = seen(page, "preview-plot").locator(".nsewdrag").first.bounding_box()
    page.mouse.move(box["x"] + 0.25 * box["width"], box["y"] + 0.5 * box["height"])
    page.mouse.down()
    page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 0.6 * box["height"], steps=5)
    page.mouse.up()
    page.wait_for_timeout(500)
    seen(page, "keep").click()
    seen(page, "steps")
    assert len(workspace.recording(name)) / whole == pytest.approx(0.25, abs=0.03)
    seen(page, "undo").click()
    seen(page, "steps").wait_for(state="detached")
    assert len(workspace.recording(name)) == whole
    seen(page, "select-part").focus()
    for key in ("ArrowRight", "Shift+ArrowRight", "ArrowLeft", "Enter"):
        page.keyboard.press(key)
    seen(page, "steps")
    assert len(workspace.recording(name)) / whole == pytest.approx(0.52, abs=0.01)


def test_an_arm_from_files_to_its_compensator(page: Any) -> None:
    models = ("balance", "coupled-memory")
    for name, phase in (("first", 0.4), ("second", 1.1)):
        upload(page, name, arm(phase))
        seen(page, f"recording-{name}")
    seen(page, "role-second").get_by_text("test", exact=True).click()
    seen(page, "tab-look").click()
    seen(page, "loop-plot")
    seen(page, "tab-models").click()
    for model in models:
        assert seen(page, f"model-{model}").get_attribute("aria-checked") == "true"
    seen(page, "untick").click()
    for model in models:
        seen(page, f"model-{model}").click()
    seen(page, "fit").click()
    for model in models:
        seen(page, "leaderboard").get_by_text(model).first.wait_for(timeout=SLOW)
    seen(page, "tab-compensate").click()
    seen(page, "wave").click()
    seen(page, "show-pressures").click()
    first = downloaded(page, "take-pressures").splitlines()[0]
    assert first == b"time_s,pressure_1_bar,pressure_2_bar,pressure_3_bar"
    seen(page, "run-loop").click()
    seen(page, "runs").get_by_text("balance-feedforward").first.wait_for(timeout=SLOW)
    seen(page, "loop-runs-3")
    seen(page, "tab-take").click()
    chosen = page.locator(".q-field", has=page.get_by_test_id("take-form"))
    chosen.get_by_text("compensator").wait_for(timeout=SLOW)
    taken = json.loads(downloaded(page, "take-json"))
    assert taken["kind"] == "balance"  # its inverse is the model


def test_two_windows_follow_each_other_and_panels_are_drawn_again(page: Any, address: str) -> None:
    seen(page, "example").click()
    run = "recording-irregular-triangle"
    seen(page, run)
    other = page.context.browser.new_page()
    other.goto(address)
    seen(other, run)
    page.get_by_label("Remove irregular-triangle").click()
    for window in (page, other):
        window.get_by_test_id(run).wait_for(state="detached", timeout=SLOW)
    seen(page, "tab-look").click()
    seen(page, "characterization").locator("li, td").first.wait_for(timeout=SLOW)
    other.get_by_label("Undo: remove").click()
    seen(other, run)
    seen(page, "data-gaps").locator("*").first.wait_for(timeout=SLOW)
    assert page.get_by_test_id("characterization").count() == 1
    seen(page, "tab-data").click()
    seen(page, run)
