"""The workbench in Chromium: from a file to a recording that can be used, in two windows, and again."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from mckibben.app.workspace import Workspace
from tests.app.browsing import SLOW, Workbench, seen, upload, visited, workbench

pytestmark = pytest.mark.filterwarnings("ignore::mckibben.errors.DataWarning")

NARROW: dict[str, Any] = {"viewport": {"width": 400, "height": 850}, "color_scheme": "dark"}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path / "bench"


@pytest.fixture
def bench(folder: Path) -> Iterator[Workbench]:
    pytest.importorskip("nicegui")
    with workbench(folder) as found:
        yield found


def table(gap: bool = False) -> bytes:
    rows = [f"{k * 0.02:.2f};{100 + k % 50 * 10};{k % 50 * 0.2:.3f}" for k in range(300)]
    return "\n".join(["zeit;p1;weg", *(rows[:200] + rows[230:] if gap else rows), ""]).encode()


def gone(page: Any, name: str) -> None:
    page.get_by_test_id(name).locator("visible=true").first.wait_for(state="detached", timeout=SLOW)


def test_the_example_is_cut_and_undone_in_two_windows_and_after_a_reload(
    browser: Any, bench: Workbench, folder: Path
) -> None:
    workspace = Workspace(folder)
    with visited(browser, bench) as page, visited(browser, bench, **NARROW) as other:
        seen(page, "example").click()
        seen(other, "over-time")  # without a click there
        plot = seen(page, "over-time").bounding_box()
        page.wait_for_timeout(500)
        page.mouse.move(plot["x"] + 200, plot["y"] + 60)
        page.mouse.down()
        page.mouse.move(plot["x"] + 400, plot["y"] + 80, steps=4)
        page.mouse.up()
        start = seen(page, "from")
        page.wait_for_function("(one) => one.value !== ''", arg=start.element_handle())
        seen(page, "keep").click()
        seen(other, "undo")
        name = workspace.entries()[0].name
        assert 10 < len(workspace.recording(name)) < 4000
        other.reload()
        seen(other, "undo").click()
        gone(page, "undo")
        assert len(workspace.recording(name)) == 4501
        seen(page, "from").fill("60")
        seen(page, "split").click()
        page.get_by_text(f"{name}-2").first.wait_for(timeout=SLOW)
        assert len(workspace.recording(f"{name}-2")) == 1501
        seen(page, "remove").click()
        seen(other, "restore").click()
        gone(page, "restore")
        assert len(workspace.entries()) == 3
        assert other.evaluate("document.documentElement.scrollWidth") <= 400


def test_a_file_that_is_not_understood_is_corrected(
    browser: Any, bench: Workbench, folder: Path
) -> None:
    with visited(browser, bench) as page:
        upload(page, "réglé 1.csv", table(gap=True))
        seen(page, "importing")
        page.keyboard.press("Escape")
        upload(page, "another.csv", table(gap=True))
        page.get_by_text("Not read yet either: another.csv").wait_for(timeout=SLOW)
        gone(page, "importing")
        page.get_by_role("button", name="Import settings").first.click()
        dialog = seen(page, "importing")
        assert not seen(page, "import").is_enabled()
        dialog.locator(".q-select").filter(has_text="Gaps").click()
        page.get_by_role("option", name="Bridge by straight lines").click()
        dialog.get_by_label("Channel of p1").fill("pressure")
        dialog.get_by_label("Unit").nth(1).fill("kPa")
        page.wait_for_function("(b) => !b.disabled", arg=seen(page, "import").element_handle())
        seen(page, "import").click()
        seen(page, "over-time")
        gone(page, "importing")
        entry, other = sorted(Workspace(folder).entries(), key=lambda one: one.name != "réglé-1")
        assert other.reading == entry.reading
        found = Workspace(folder).recording(entry.name)
        assert entry.upload == "réglé-1.csv"
        assert entry.reading.gaps == "interpolate"
        assert list(found.channels) == ["pressure", "displacement"]
        assert found["pressure"].max() == pytest.approx(5.9)
        # and it can be read in another way later
        seen(page, "correct").click()
        seen(page, "importing").get_by_label("Turn the sign").nth(2).click()
        seen(page, "import").click()  # the others are left as they are
        gone(page, "importing")
        assert Workspace(folder).recording(entry.name)["displacement"].min() == pytest.approx(-9.8)
        assert Workspace(folder).recording(other.name)["displacement"].min() == 0


def test_errors_are_said_and_keys_suffice(browser: Any, bench: Workbench) -> None:
    with visited(browser, bench) as page:
        upload(page, "a.csv", table().replace(b"p1", b"p1 [kPa]"))
        seen(page, "over-time")
        seen(page, "keep").click()
        page.get_by_text("no part is selected").wait_for(timeout=SLOW)
        page.keyboard.press("Tab")
        row = page.locator("tr.choosable").first
        row.focus()
        page.keyboard.press("Enter")
        assert page.locator("tr.chosen").count() == 1


SLOW_READING = """
import time
from mckibben.app import workspace
read = workspace.understand
workspace.understand = lambda *given: time.sleep(5) or read(*given)
"""


def test_the_page_is_there_while_a_folder_is_read(browser: Any, folder: Path) -> None:
    workspace = Workspace(folder)
    with workspace.receiving("a.csv", len(table())) as (part, _):
        part.write_bytes(table().replace(b"p1", b"p1 [kPa]"))
    workspace.add("a.csv")
    with workbench(folder, SLOW_READING) as bench, visited(browser, bench) as page:
        assert page.get_by_test_id("over-time").count() == 0
        seen(page, "over-time")
