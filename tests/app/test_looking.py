"""Look in Chromium: what a recording shows, and a plan of the next one."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mckibben
from mckibben.app.workspace import Workspace
from tests.app.browsing import NARROW, SLOW, seen, visited, workbench

pytestmark = pytest.mark.filterwarnings("ignore::mckibben.errors.DataWarning")


def arm(folder: Path) -> Workspace:
    """Return a folder with an arm of two muscles, of which the first moves the first output most."""
    workspace, noise = Workspace(folder), np.random.default_rng(0)
    for name, role in (("slow", "train"), ("fast", "test")):
        t = 0.05 * np.arange(800)
        u = [2 + np.sin((1 + (name == "fast")) * (k + 1) * 0.7 * t) for k in range(2)]
        y = [5 * u[0] - 2 * u[1], 3 * u[1] + 0.01 * noise.standard_normal(t.size)]
        channels = {"pressure_1": u[0], "pressure_2": u[1], "displacement_1": y[0]}
        run = mckibben.Recording(channels | {"displacement_2": y[1]}, 0.05)
        workspace.add_recording(run, name=name, role=role)  # type: ignore[arg-type]
    return workspace


@pytest.mark.filterwarnings("ignore")
def test_several_muscles_are_looked_at_and_a_next_recording_is_planned(
    browser: Any, tmp_path: Path
) -> None:
    workspace = arm(tmp_path / "bench")
    with workbench(tmp_path / "bench") as bench, visited(browser, bench) as page:
        seen(page, "over-time")
        page.get_by_test_id("tab-look").click()
        cell = seen(page, "pair-pressure_2-displacement_1")
        assert float(cell.inner_text().replace("−", "-").split()[0]) == pytest.approx(-4, abs=0.1)
        cell.click()
        page.get_by_text("displacement_1 over pressure_2").first.wait_for(timeout=SLOW)
        seen(page, "look-loop")
        seen(page, "show-fast").click()  # leaves one recording, which is drawn by age
        page.locator(".legendtext", has_text="0 to").first.wait_for(timeout=SLOW)
        page.get_by_role("button", name="Over time").click()
        seen(page, "look-time")
        seen(page, "words").get_by_text("Characterization").click()
        page.get_by_text("reversals", exact=True).first.wait_for(timeout=SLOW)
        seen(page, "plan").click()
        seen(page, "option-minutes").fill("1")
        seen(page, "option-limits").fill("pressure_1=1:2.5")
        seen(page, "plan-it").click()
        seen(page, "planned")
        with page.expect_download() as download:
            seen(page, "commands").click()
        table = download.value.path().read_text().splitlines()
        at = next(k for k, name in enumerate(table[0].split(",")) if "pressure_1" in name)
        assert "pressure_2" in table[0]
        assert len(table) == pytest.approx(60 / 0.05, rel=0.1)
        assert max(float(line.split(",")[at]) for line in table[1:]) <= 2.5
        assert workspace.read("takeaway", "next-recording")
        seen(page, "choose-models").click()
        seen(page, "page-models")


def test_an_empty_folder_says_what_to_do_and_a_narrow_page_fits(
    browser: Any, tmp_path: Path
) -> None:
    with (
        workbench(tmp_path / "bench") as bench,
        visited(browser, bench) as page,
        visited(browser, bench, **NARROW) as other,
    ):
        for one in (page, other):
            one.get_by_test_id("tab-look").click()
            one.get_by_text("Nothing to look at yet").wait_for(timeout=SLOW)
        page.get_by_test_id("tab-data").click()
        seen(page, "example").click()
        seen(other, "look-loop")  # the other window shows it without a click
        seen(other, "gaps")
        seen(other, "words").get_by_text("Characterization").wait_for(timeout=SLOW)
        assert other.evaluate("document.documentElement.scrollWidth") <= 400
