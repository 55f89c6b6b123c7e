"""The page that a browser is given says what goes on, and leads to the workbench that starts."""

from __future__ import annotations

import sys
import time
from pathlib import Path

import pytest

from mckibben.app.door import door
from mckibben.app.server import _without
from mckibben.app.workspace import Workspace
from tests.app.browsing import BROWSER, OPTIONS, seen, starting
from tests.tools import needs

ADDRESS = "http://127.0.0.1:8750/a-token-of-tests/"


def test_it_is_the_users_alone_and_goes_with_the_workbench(tmp_path: Path) -> None:
    with door(tmp_path, 8750, ADDRESS) as page:
        assert page is not None
        assert ADDRESS in page.read_text()
    assert not page.exists()


def test_the_page_of_a_workbench_that_was_killed_goes(tmp_path: Path) -> None:
    (tmp_path / ".open-8750.html").write_text("a token")
    assert Workspace(tmp_path).claim()
    assert not list(tmp_path.glob(".open-*"))


def test_names_of_folders_are_text(tmp_path: Path) -> None:
    folder = tmp_path / "<script>alert(1)<"
    folder.mkdir()
    with door(folder, 8750, ADDRESS) as page:
        assert page is not None
        assert "<script>alert" not in page.read_text()


def test_what_is_left_out_at_the_start_can_be_loaded_later() -> None:
    for name in [name for name in sys.modules if name.split(".")[0] == "wave"]:
        del sys.modules[name]
    with _without("wave"), pytest.raises(ImportError):
        __import__("wave")
    assert __import__("wave").open


@needs("chromium")
def test_a_browser_waits_there_and_is_let_in(tmp_path: Path) -> None:
    playwright = pytest.importorskip("playwright.sync_api")
    with playwright.sync_playwright() as play:
        browser = play.chromium.launch(executable_path=BROWSER, args=OPTIONS)
        with starting(tmp_path / "ws") as process:
            while not (found := list((tmp_path / "ws").glob(".open-*.html"))):
                assert process.poll() is None
                time.sleep(0.01)
            page = browser.new_page()
            page.goto(found[0].as_uri())
            assert "is starting" in page.inner_text("body")
            seen(page, "tab-data")
        browser.close()
