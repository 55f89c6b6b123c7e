"""The site of the documentation: built without warnings, whole and offline."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from mckibben import registry
from tests.app.browsing import BROWSER, OPTIONS, SLOW
from tests.tools import needs

pytestmark = pytest.mark.long

pytest.importorskip("sphinx")
pytest.importorskip("furo")
pytest.importorskip("myst_parser")

ROOT = Path(__file__).parents[2]

FIRST = {
    "install": "install",
    "windows": "install",
    "raspberry pi": "install",
    "csv": "files",
    "matlab": "files",
    "excel": "files",
    "units": "units",
    "commands": "_generated/commands",
    "workbench": "workbench",
    "jupyter": "jupyter",
    "glossary": "_generated/glossary",
    "hysteresis": "models/choosing",
    "models": "models/choosing",
    "inverse": "tutorials/compensate",
    "compensator": "tutorials/compensate",
    "feedforward": "tutorials/compensate",
    "friction": "tutorials/friction",
    "creep": "models/choosing",
    "soft arm": "tutorials/soft_arm",
    "load": "tutorials/varying_loads",
    "log": "tutorials/log",
    "uncertainty": "tutorials/how_sure",
    "rigs": "tutorials/virtual_rigs",
    "gymnasium": "tutorials/virtual_rigs",
    "arduino": "tutorials/microcontroller",
    "fmu": "deploy/README",
    "ros2": "deploy/ros",
    "mujoco": "deploy/mujoco",
    "adaptive": "deploy/adaptive",
    "valve": "models/air",
    "preisach": "_generated/models/preisach",
    "bouc-wen": "_generated/models/bouc-wen",
    "drift": "models/choosing",
    "architecture": "architecture",
    "gallery": "_generated/gallery",
    "api": "_generated/api/index",
}
"""Words searched for, and the page that is to be first."""


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the site."""
    into = tmp_path_factory.mktemp("site") / "html"
    done = subprocess.run(
        [sys.executable, "docs/build.py", "--into", str(into)],
        cwd=ROOT,
        env=os.environ | {"PYTHONPATH": str(ROOT / "src")},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return into


def test_every_model_has_a_page_with_its_equations(site: Path) -> None:
    index = (site / "_generated" / "models" / "index.html").read_text(encoding="utf-8")
    for model in registry.names("estimators"):
        text = (site / "_generated" / "models" / f"{model}.html").read_text(encoding="utf-8")
        assert "<math" in text, model
        assert f'href="{model}.html"' in index
        for part in ("Equations", "Parameters", "Settings", "How to fit it"):
            assert f">{part}<" in text, (model, part)


def test_nothing_is_asked_of_the_internet(site: Path) -> None:
    loaded = r"<(?:script|link|img|iframe)[^>]*(?:src|href)=\"(?:https?:)?//[^\"]*"
    for ending, asked in (("html", loaded), ("css", r"url\(['\"]?(?:https?:)?//")):
        for path in site.rglob(f"*.{ending}"):
            assert not re.findall(asked, path.read_text(encoding="utf-8")), path.name


@needs("chromium")
def test_search_finds_the_obvious_page_first(site: Path) -> None:
    playwright = pytest.importorskip("playwright.sync_api")
    found = {}
    with playwright.sync_playwright() as play:
        browser = play.chromium.launch(executable_path=BROWSER, args=OPTIONS)
        page = browser.new_page()
        for words in FIRST:
            page.goto(f"{(site / 'search.html').as_uri()}?q={words.replace(' ', '+')}")
            first = page.locator("ul.search li a").first
            first.wait_for(timeout=SLOW)
            target = str(first.get_attribute("href"))
            found[words] = target.partition("#")[0].partition("?")[0].removesuffix(".html")
        browser.close()
    assert found == FIRST
