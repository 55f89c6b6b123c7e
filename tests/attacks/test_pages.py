"""Whoever opens a report or a received folder: nothing in it runs, uploads, or leads away."""

from __future__ import annotations

import base64
import hashlib
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from mckibben import Recording
from mckibben.app.workspace import Workspace
from mckibben.blocks.play_type.gpi import GPI
from mckibben.papers.reproduction import Figure, Points, Reproduction, Source, Table
from mckibben.registry import load
from mckibben.report import page as report
from mckibben.report.reproduction import reproduction_page
from tests.app.browsing import SLOW, seen
from tests.attacks.browser import HOSTILE, PROBE, SCRIPTS, watched
from tests.report.studies_by_hand import measured, renamed, study
from tests.tools import needs


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


PAGES = {"report": hostile_report, "reproduction": hostile_reproduction}


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
    assert HOSTILE not in html


HIDDEN = """[...document.querySelectorAll(".plot")].flatMap((plot) => {
    const bar = plot.querySelector(".modebar").getBoundingClientRect();
    return [...plot.querySelectorAll(".legend, .gtitle, [*|href]")].filter(
        (one) => one.getBoundingClientRect().top < bar.bottom || one.hasAttribute("href"));
}).map((one) => one.outerHTML)"""
"""What lies under the tool bars of plots, and the links in plots: there is to be neither."""


@pytest.mark.long
@needs("chromium")
@pytest.mark.parametrize("kind", PAGES)
def test_no_click_in_a_hostile_page_reaches_the_network_or_runs_a_name(
    kind: str, tmp_path: Path
) -> None:
    file = tmp_path / f"{kind}.html"
    file.write_text(PAGES[kind](), encoding="utf-8")
    with watched(file.as_uri()) as browser:
        browser.page.locator("html[data-drawn=all]").wait_for(state="attached")
        n_plots = browser.page.locator(".plot").count()
        assert browser.click_everything() > 5 * n_plots  # the tool bars are among it
        assert browser.page.evaluate(HIDDEN) == []
        browser.unharmed()


@pytest.mark.long
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


@pytest.fixture
def address(tmp_path: Path) -> Iterator[str]:
    """Start the workbench over a folder with scripts wherever text is kept, and rubbish between."""
    folder = tmp_path / "ws"
    workspace = Workspace(folder)
    t = np.arange(200) * 0.1
    given = Recording({"pressure": 2 + np.sin(t), "displacement": 10 + np.cos(t - 0.3)}, 0.1)
    workspace.add(given, origin=SCRIPTS[0], call=SCRIPTS[3], name="run", notes=SCRIPTS)
    load("blocks", "pi").example().save(workspace.path("models", "mine.json"))
    for number, text in enumerate(SCRIPTS):
        workspace.log(text, text)
        asked = {"title": text, "model": text, "name": text, "call": text, ":x": text}
        job = {"kind": "fit", "state": "failed", "message": text, "given": asked}
        workspace.write_json("jobs", f"job-{number}", job)
        result = {"status": "ok", "model": text, "settings": {text: text, ":x": text}, ":x": text}
        workspace.write_json("results", f"result-{number}", result)
        run = {"model": "mine", "rig": text, "controller": text, "rmse": {text: 1.0}}
        workspace.write_json("runs", f"run-{number}", run)
    for kind in ("jobs", "results", "runs", "recordings", "models"):
        (folder / kind / "<img src=x onerror=alert(1)>.json").write_text("{}")
        (folder / kind / "deep.json").write_text("[" * 100_000)
        (folder / kind / "null.json").write_text("null")
    with (folder / "log.jsonl").open("ab") as file:
        file.write(b'null\n3\n\xff\xfe\n{"did": {"a": 1}, "call": []}\n')
    plain = {name: value for name, value in os.environ.items() if "PYTEST" not in name}
    command = [sys.executable, "-m", "mckibben.cli.main", "app", str(folder)]
    process = subprocess.Popen(
        [*command, "--port", "0", "--no-show"], stdout=subprocess.PIPE, text=True, env=plain
    )
    assert process.stdout is not None
    line = process.stdout.readline()
    yield next(word for word in line.split() if word.startswith("http"))
    process.terminate()
    process.wait(20)
    process.stdout.close()


@pytest.mark.long
@needs("chromium")
def test_nothing_of_a_received_folder_runs(address: str) -> None:
    dialogs: list[str] = []

    def answer(dialog: Any) -> None:
        dialogs.append(dialog.message)
        dialog.dismiss()

    with watched(address) as browser:
        page = browser.page
        page.on("dialog", answer)
        seen(page, "recording-run")
        assert SCRIPTS[2] in seen(page, "note-run").locator("..").inner_text()
        seen(page, "log").click()
        page.get_by_text("```").first.wait_for(timeout=SLOW)
        button = seen(page, "preview-plot").locator(".modebar-btn").first
        button.wait_for(state="attached", timeout=SLOW)
        assert browser.click_everything(".modebar-btn, [class*=dialog] *") > 5
        seen(page, "tab-look").click()
        seen(page, "loop-plot")
        seen(page, "tab-models").click()
        seen(page, "leaderboard")
        page.get_by_test_id(f"job-{SCRIPTS[2]}").wait_for(timeout=SLOW)
        page.get_by_role("button", name="Close").first.click()  # of a result without a model
        seen(page, "tab-compensate").click()
        page.get_by_test_id("runs").get_by_text(SCRIPTS[2]).first.wait_for(timeout=SLOW)
        seen(page, "tab-take").click()
        seen(page, "script")
        browser.unharmed()
        # what is written into the page with a script in it does not run either
        page.evaluate(
            """(script) => {
                const place = document.body.appendChild(document.createElement("div"));
                place.innerHTML = `<img src=x onerror="${script}">`;
                const added = document.createElement("script");
                added.textContent = script;
                document.body.append(added);
            }""",
            f"window['{PROBE}']=1",
        )
        page.wait_for_timeout(300)
        assert page.evaluate(f"window['{PROBE}'] ?? null") is None
        assert browser.left == []
    assert dialogs == []
