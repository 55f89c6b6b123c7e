"""Three people walk the whole way in a real browser: one muscle, an arm, a muscle under a load."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Iterator
from pathlib import Path
from shutil import which
from typing import Any

import pytest

from tests.app.browsing import SLOW, Workbench, seen, upload, visited, workbench
from tests.app.simulated import arm, hanging

pytest.importorskip("playwright.sync_api")

CLICKS = 25
"""Most clicks of a journey."""

pytestmark = pytest.mark.long


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Workbench]:
    pytest.importorskip("nicegui")
    with workbench(tmp_path / "ws") as found:
        yield found


class Walk:
    """A person in a page, who counts clicks."""

    def __init__(self, page: Any) -> None:
        self.page, self.clicks = page, 0

    def click(self, name: str) -> None:
        """Click what has this name."""
        seen(self.page, name).click()
        self.clicks += 1

    def fit(self, *models: str) -> None:
        """Fit models, and wait until all are in the leaderboard."""
        self.click("tab-models")
        self.click("fit-models")
        self.click("tick-none")
        for model in models:
            self.click(f"model-{model}")
        self.click("fit")
        rows = self.page.get_by_test_id("leaderboard").locator("tr.choosable")
        rows.nth(len(models) - 1).wait_for(timeout=SLOW)

    def follow(self) -> None:
        """Let the compensator follow a motion."""
        self.click("tab-compensate")
        self.click("run")
        seen(self.page, "runs").locator("tbody tr").first.wait_for(timeout=SLOW)

    def take(self, name: str) -> bytes:
        """Take something away."""
        with self.page.expect_download(timeout=SLOW) as download:
            self.click(f"take-{name}")
        return Path(download.value.path()).read_bytes()


@pytest.mark.journey
def test_one_muscle_from_the_example_to_c(browser: Any, bench: Workbench, tmp_path: Path) -> None:
    with visited(browser, bench) as page:
        walk = Walk(page)
        walk.click("example")
        seen(page, "over-time")
        walk.click("tab-look")
        seen(page, "words").get_by_text("Loop width", exact=False).first.wait_for(timeout=SLOW)
        walk.fit("pi", "mpi")
        walk.follow()
        walk.click("tab-take")
        with zipfile.ZipFile(io.BytesIO(walk.take("c"))) as archive:
            archive.extractall(tmp_path)
            names = archive.namelist()
        assert any(name.endswith("CMakeLists.txt") for name in names)
        if which("cc"):
            from mckibben.exporting.programs import self_test

            folder = tmp_path / names[0].split("/")[0]
            assert self_test(folder, folder.name.replace("-", "_"))
        assert walk.take("json").startswith(b'{\n  "format": "mckibben-model"')
        assert walk.clicks <= CLICKS


def test_an_arm_of_several_muscles(browser: Any, bench: Workbench) -> None:
    with visited(browser, bench) as page:
        walk = Walk(page)
        for number, run in enumerate(arm()):
            upload(page, f"arm-{number}.csv", run)
        seen(page, "over-time")
        walk.click("tab-look")
        seen(page, "coupling")
        walk.fit("balance")
        walk.follow()
        walk.click("tab-take")
        assert walk.take("json").startswith(b'{\n  "format": "mckibben-model"')
        assert walk.clicks <= CLICKS


def test_a_muscle_under_a_load(browser: Any, bench: Workbench) -> None:
    with visited(browser, bench) as page:
        walk = Walk(page)
        for number, run in enumerate(hanging()):
            upload(page, f"load-{number}.csv", run)
        seen(page, "over-time")
        walk.fit("balance", "play-ridge")
        walk.follow()
        walk.click("tab-take")
        assert b"mckibben.compare(" in walk.take("script")
        assert walk.clicks <= CLICKS
