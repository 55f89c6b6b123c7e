"""Whoever opens a report or a received folder: nothing in it runs, uploads, or leads away."""

from __future__ import annotations

import base64
import hashlib
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mckibben import GPI, PI, Recording
from mckibben.app import loops
from mckibben.app.workspace import Workspace
from mckibben.report import page as report
from tests.app.browsing import seen, workbench
from tests.attacks.browser import HOSTILE, SCRIPTS, watched
from tests.report.studies_by_hand import measured, renamed, study
from tests.tools import needs


@pytest.fixture(scope="module")
def hostile() -> str:
    """Return the report of a study in which every name and note is hostile."""
    channels = (f"pressure{HOSTILE}", f"displacement{HOSTILE}")
    recording = measured(300, channels=channels, name=HOSTILE, file=HOSTILE, notes=HOSTILE)
    test = measured(200, seed=1, channels=channels, name=HOSTILE)
    blocks = {HOSTILE: renamed(GPI.example(), channels)}
    found = study(
        (recording,), (test,), blocks=blocks, inverse=False, notes=(HOSTILE,), reason=HOSTILE
    )
    return report.page(found)


def test_the_policy_lets_the_page_s_own_scripts_run_and_no_other(hostile: str) -> None:
    policy = re.search(r'http-equiv="Content-Security-Policy" content="([^"]*)"', hostile)
    assert policy is not None
    rules = dict(rule.split(" ", 1) for rule in policy[1].replace("&#39;", "'").split("; "))
    for what in ("default-src", "connect-src", "form-action", "base-uri"):
        assert rules[what] == "'none'"
    scripts = re.findall(r"<script>(.*?)</script>", hostile, flags=re.DOTALL)
    own = [hashlib.sha256(script.encode()).digest() for script in scripts]
    assert rules["script-src"].split() == [
        f"'sha256-{base64.b64encode(one).decode()}'" for one in own
    ]
    assert '<meta name="referrer" content="no-referrer">' in hostile
    assert HOSTILE not in hostile


@pytest.mark.long
@needs("chromium")
def test_no_click_in_a_hostile_page_reaches_the_network_or_runs_a_name(
    hostile: str, tmp_path: Path
) -> None:
    file = tmp_path / "report.html"
    file.write_text(hostile, encoding="utf-8")
    with watched(file.as_uri()) as browser:
        browser.page.locator("html[data-drawn=all]").wait_for(state="attached")
        n_plots = browser.page.locator(".plot").count()
        assert browser.click_everything() > 5 * n_plots  # the tool bars are among it
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


def received(folder: Path) -> None:
    """Write a workspace with scripts wherever text is kept, and rubbish between."""
    workspace = Workspace(folder)
    t = np.arange(200) * 0.1
    given = Recording({"pressure": 2 + np.sin(t), "displacement": 10 + np.cos(t - 0.3)}, 0.1)
    workspace.add_recording(given.with_meta(notes=SCRIPTS), name="run")
    (entry,) = workspace.entries()
    workspace.put(entry.model_copy(update={"origin": SCRIPTS[0], "notes": [*SCRIPTS]}))
    PI.example().save(workspace.path("models", "mine.json"))
    reference = loops.store_reference(workspace, given.select(["displacement"]))
    for number, text in enumerate(SCRIPTS):
        asked = {"title": text, "model": text, "name": text, ":x": text}
        job = {"kind": "fit", "state": "failed", "message": text, "given": asked}
        workspace.write("jobs", f"job-{number}", job)
        result = {"status": "ok", "model": text, "settings": {text: text, ":x": text}, ":x": text}
        workspace.write("results", f"result-{number}", result)
        run = {"model": "mine", "rig": text, "controller": text, "rmse": {text: 1.0}}
        run |= {"reference": f"{reference}.csv", "notes": [text]}
        workspace.write("runs", f"run-{number}", run)
    for kind in ("jobs", "results", "runs", "recordings", "models"):
        (folder / kind / "<img src=x onerror=alert(1)>.json").write_text("{}")
        (folder / kind / "deep.json").write_text("[" * 100_000)
        (folder / kind / "null.json").write_text("null")


SHOWN = {
    "data": "recordings",
    "look": "words",
    "models": "fits",
    "compensate": "runs",
    "take": "things",
}
"""What each tab shows."""


@pytest.mark.long
@needs("chromium")
def test_nothing_of_a_received_folder_runs(tmp_path: Path) -> None:
    received(tmp_path / "ws")
    dialogs: list[str] = []

    def answer(dialog: Any) -> None:
        dialogs.append(dialog.message)
        dialog.dismiss()

    with workbench(tmp_path / "ws") as bench, watched(bench.link) as browser:
        page = browser.page
        page.on("dialog", answer)
        for tab, shown in SHOWN.items():
            seen(page, f"tab-{tab}").click()
            seen(page, shown)
            browser.click_everything(".modebar-btn, [class*=dialog] *")
        browser.unharmed()
    assert dialogs == []
