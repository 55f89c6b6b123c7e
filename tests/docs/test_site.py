"""The site of the documentation: built without warnings, whole, offline, and found in."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import threading
from collections.abc import Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import pytest

from mckibben import registry
from tests.tools import needs, where

pytest.importorskip("sphinx")
pytest.importorskip("furo")
pytest.importorskip("myst_parser")

ROOT = Path(__file__).parents[2]
LONGEST = 120_000
"""Letters of text on a page: about sixty screens."""

FIRST = {
    "install": "install",
    "workbench": "workbench",
    "jupyter": "jupyter",
    "angle": "units",
    "units": "units",
    "hysteresis": "models/choosing",
    "inverse": "tutorials/compensate",
    "matlab": "files",
    "arduino": "tutorials/microcontroller",
    "simulink": "deploy/README",
    "ros": "deploy/ros",
}
"""What people look for, and the page that is to come first."""


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


def pages(site: Path) -> dict[Path, str]:
    return {path: path.read_text(encoding="utf-8") for path in site.rglob("*.html")}


def test_every_model_has_a_page_with_its_equations(site: Path) -> None:
    index = (site / "_generated" / "models" / "index.html").read_text(encoding="utf-8")
    for model in registry.names("estimators"):
        text = (site / "_generated" / "models" / f"{model}.html").read_text(encoding="utf-8")
        assert "<math" in text, model
        assert f'href="{model}.html"' in index
        for part in ("Equations", "Parameters", "Settings", "How to fit it"):
            assert f">{part}<" in text, (model, part)


def test_symbols_in_words_are_set_as_mathematics(site: Path) -> None:
    for model in ("mpi", "gpi", "kp"):
        text = (site / "_generated" / "models" / f"{model}.html").read_text(encoding="utf-8")
        words = re.sub(r"<[^>]+>", "", text.partition('id="in-words"')[2])
        assert not re.findall(r"\bsum_|\b[uwy]_[ijt]\b", words), model


def test_pages_say_what_has_an_inverse_and_what_data_are_of(site: Path) -> None:
    def said(model: str) -> str:
        text = (site / "_generated" / "models" / f"{model}.html").read_text(encoding="utf-8")
        (article,) = re.findall(r"<article.*?</article>", text, flags=re.DOTALL)
        return re.sub(r"\s+", " ", re.sub(r"<[^>]+>", "", article))

    compensator = "is itself a compensator"
    assert compensator in said("activation-memory")
    for model in ("balance", "gpi", "air"):
        assert compensator not in said(model)
        assert "mckibben invert model.json" in said(model)
    assert "recordings of a virtual rig" in said("balance")
    for model in ("bouc-wen-oscillator", "duhem-oscillator", "state-network"):
        assert "virtual rig" not in said(model)
        assert "Bouc-Wen benchmark" in said(model)


def test_nothing_is_asked_of_the_internet(site: Path) -> None:
    for path, text in pages(site).items():
        asked = re.findall(
            r"<(?:script|link|img|iframe)[^>]*(?:src|href)=\"(?:https?:)?//[^\"]*", text
        )
        assert not asked, (path.name, asked)
    for path in site.rglob("*.css"):
        assert not re.search(r"url\(['\"]?(https?:)?//", path.read_text(encoding="utf-8")), (
            path.name
        )


def test_links_lead_somewhere(site: Path) -> None:
    found = pages(site)
    anchors = {path: set(re.findall(r"\bid=\"([^\"]+)\"", text)) for path, text in found.items()}
    for path, text in found.items():
        for link in re.findall(r"<a [^>]*href=\"([^\"]+)\"", text):
            place, _, anchor = link.partition("#")
            if re.match(r"[a-z]+:", place):
                continue
            target = (path.parent / place).resolve() if place else path
            assert target.exists(), (path.name, link)
            if anchor and target in anchors:
                assert anchor in anchors[target], (path.name, link)


def test_pages_are_of_readable_length(site: Path) -> None:
    for path, text in pages(site).items():
        if path.name not in ("genindex.html", "py-modindex.html"):
            article = re.search(r"<article.*?</article>", text, re.S)
            read = re.sub(r"<[^>]+>", "", article[0]) if article else ""
            assert len(read) < LONGEST, (path.name, len(read))


class Quiet(SimpleHTTPRequestHandler):
    """Serves files, and says nothing."""

    def log_message(self, *told: Any) -> None:
        pass


@pytest.fixture(scope="module")
def served(site: Path) -> Iterator[str]:
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=str(site)))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_address[1]}"
    server.shutdown()
    server.server_close()


@needs("chromium")
def test_search_finds_the_right_page_first(served: str) -> None:
    playwright = pytest.importorskip("playwright.sync_api")
    first = {}
    with playwright.sync_playwright() as play:
        browser = play.chromium.launch(
            executable_path=where("chromium"), args=["--no-sandbox", "--disable-gpu"]
        )
        page = browser.new_page()
        for word in FIRST:
            page.goto(f"{served}/search.html?q={word}")
            found = page.locator("#search-results ul.search li a").first
            found.wait_for(timeout=60_000)
            first[word] = (
                (found.get_attribute("href") or "").partition("?")[0].partition(".html")[0]
            )
        browser.close()
    assert first == FIRST
