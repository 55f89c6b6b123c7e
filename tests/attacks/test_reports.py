"""Attacked: whoever opens a report. A click that uploads, a name that is run, a link that leads away."""

from __future__ import annotations

import base64
import hashlib
import re
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from mckibben.blocks.play_type.gpi import GPI
from mckibben.papers.reproduction import Figure, Points, Reproduction, Source, Table
from mckibben.report import page as report
from mckibben.report.reproduction import reproduction_page
from tests.app.browsing import SLOW
from tests.app.test_journey import address as address  # the fixture that starts the workbench
from tests.attacks.browser import HOSTILE, watched
from tests.report.studies_by_hand import measured, renamed, study
from tests.tools import needs

DRAWN = "html[data-drawn=all]"


def hostile_report() -> str:
    """Return the report of a study in which every name and note is hostile."""
    channels = (f"pressure{HOSTILE}", f"displacement{HOSTILE}")
    recording = measured(300, channels=channels, name=HOSTILE, file=HOSTILE, notes=HOSTILE)
    test = measured(200, seed=1, channels=channels, name=HOSTILE)
    blocks = {HOSTILE: renamed(GPI.example(), channels)}
    found = study(
        (recording,), (test,), blocks=blocks, inverse=False, notes=(HOSTILE,), reason=HOSTILE
    )
    return report.page(found)


def hostile_reproduction() -> str:
    """Return the report of a re-run in which every word is hostile."""
    ramp: NDArray[np.float64] = np.linspace(0.0, 1.0, 5)
    curve = (ramp, ramp)
    figures = (Figure(HOSTILE, HOSTILE, HOSTILE, {"measured": curve, HOSTILE: curve}),)
    tables = (Table(HOSTILE, (HOSTILE, "x"), ((HOSTILE, 1.0),), HOSTILE, Points(HOSTILE, ("x",))),)
    return reproduction_page(
        Reproduction(
            name=HOSTILE,
            source=Source(HOSTILE, HOSTILE, HOSTILE, HOSTILE, HOSTILE),
            summary=(HOSTILE,),
            notes=(HOSTILE,),
            tables=tables,
            figures=figures,
        )
    )


HIDDEN = """[...document.querySelectorAll(".plot")].flatMap((plot) => {
    const bar = plot.querySelector(".modebar").getBoundingClientRect();
    return [...plot.querySelectorAll(".legend, .gtitle, [*|href]")].filter(
        (one) => one.getBoundingClientRect().top < bar.bottom || one.hasAttribute("href"));
}).map((one) => one.outerHTML)"""
"""What lies under the tool bars of plots, and the links in plots: there is to be neither."""

PAGES = {"report": hostile_report, "reproduction": hostile_reproduction}


@pytest.mark.parametrize("kind", PAGES)
@needs("chromium")
def test_no_click_in_a_hostile_page_reaches_the_network_or_runs_a_name(
    kind: str, tmp_path: Path
) -> None:
    file = tmp_path / f"{kind}.html"
    file.write_text(PAGES[kind](), encoding="utf-8")
    with watched(file.as_uri()) as browser:
        browser.page.locator(DRAWN).wait_for(state="attached")
        n_plots = browser.page.locator(".plot").count()
        assert browser.click_everything() > 5 * n_plots  # the tool bars are among it
        assert browser.page.evaluate(HIDDEN) == []
        browser.unharmed()


@needs("chromium")
def test_no_plot_of_the_workbench_uploads(address: str) -> None:
    with watched(address) as browser:
        browser.page.get_by_test_id("example").click()
        button = browser.page.get_by_test_id("preview-plot").locator(".modebar-btn").first
        button.wait_for(state="attached", timeout=SLOW)
        assert browser.click_everything(".modebar-btn, [class*=dialog] *") > 5
        browser.unharmed()


@needs("chromium")
def test_the_browser_of_these_tests_catches_what_leaves(tmp_path: Path) -> None:
    file = tmp_path / "open.html"
    file.write_text(
        "<button onclick=\"fetch('http://a.example/').catch(() => 0)\">Share</button>"
        "<button onclick=\"window.open('http://b.example/')\">Share</button>"
    )
    with watched(file.as_uri()) as browser:
        assert browser.click_everything() == 2
        assert sorted(browser.left) == ["http://a.example/", "http://b.example/"]


@pytest.mark.parametrize("kind", PAGES)
def test_the_policy_lets_the_page_s_own_scripts_run_and_no_other(kind: str) -> None:
    html = PAGES[kind]()
    policy = re.search(r'http-equiv="Content-Security-Policy" content="([^"]*)"', html)
    assert policy is not None
    rules = dict(rule.split(" ", 1) for rule in policy[1].replace("&#39;", "'").split("; "))
    for what in ("default-src", "connect-src", "form-action", "base-uri"):
        assert rules[what] == "'none'"
    scripts = re.findall(r"<script>(.*?)</script>", html, flags=re.DOTALL)
    own = [hashlib.sha256(script.encode()).digest() for script in scripts]
    assert rules["script-src"].split() == [
        f"'sha256-{base64.b64encode(one).decode()}'" for one in own
    ]
    assert '<meta name="referrer" content="no-referrer">' in html
