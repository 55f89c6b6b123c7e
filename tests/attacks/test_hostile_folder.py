"""A folder received from a stranger, in a real browser: nothing in it runs, and the page works."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mckibben import Recording
from mckibben.app.workspace import Workspace
from mckibben.registry import load
from tests.app.browsing import BROWSER, OPTIONS, SLOW, seen
from tests.tools import needs

pytestmark = needs("chromium")

playwright = pytest.importorskip("playwright.sync_api")

SCRIPTS = (
    '" :x="window.pwned=1" onclick="window.pwned=1',
    "x' :data-y='window.pwned=1",
    "<img src=x onerror=window.pwned=1>",
    "</script><script>window.pwned=1</script>",
    "```\n<script>window.pwned=1</script>\n<a href='javascript:window.pwned=1'>click</a>\n```",
    "`${window.pwned=1}` {{ constructor.constructor('window.pwned=1')() }}",
    '<svg onload="window.pwned=1"></svg>',
)


@pytest.fixture
def hostile(tmp_path: Path) -> Path:
    """Return a folder with scripts wherever text is kept, and rubbish between."""
    folder = tmp_path / "ws"
    workspace = Workspace(folder)
    t = np.arange(200) * 0.1
    samples = {"pressure": 2 + np.sin(t), "displacement": 10 + np.cos(t - 0.3)}
    given = Recording(samples, 0.1)
    workspace.add(given, origin=SCRIPTS[0], call=SCRIPTS[4], name="run", notes=SCRIPTS)
    load("blocks", "pi").example().save(workspace.path("models", "mine.json"))
    for number, text in enumerate(SCRIPTS):
        workspace.log(text, text)
        asked = {"title": text, "model": text, "name": text, "call": text, ":x": "window.pwned=1"}
        job = {"kind": "fit", "state": "failed", "message": text, "given": asked}
        workspace.write_json("jobs", f"job-{number}", job)
        result = {"status": "ok", "model": text, "settings": {text: text, ":x": text}}
        workspace.write_json("results", f"result-{number}", result | {":x": "window.pwned=1"})
        run = {"model": "mine", "rig": text, "controller": text, "rmse": {text: 1.0}}
        workspace.write_json("runs", f"run-{number}", run)
    for kind in ("jobs", "results", "runs", "recordings", "models"):
        (folder / kind / "<img src=x onerror=window.pwned=1>.json").write_text("{}")
        (folder / kind / "deep.json").write_text("[" * 100_000)
        (folder / kind / "null.json").write_text("null")
    with (folder / "log.jsonl").open("ab") as file:
        file.write(b'null\n3\n\xff\xfe\n{"did": {"a": 1}, "call": []}\n')
    (folder / "jobs" / "job-0.progress").write_text("nan nan nan\nx y z\n0 0.5 1e999\n")
    return folder


@pytest.fixture
def address(hostile: Path) -> Iterator[str]:
    """Start the workbench over it, and give its address."""
    plain = {name: value for name, value in os.environ.items() if "PYTEST" not in name}
    command = [sys.executable, "-m", "mckibben.cli.main", "app", str(hostile)]
    process = subprocess.Popen(
        [*command, "--port", "0", "--no-show"], stdout=subprocess.PIPE, text=True, env=plain
    )
    assert process.stdout is not None
    line = process.stdout.readline()
    yield next(word for word in line.split() if word.startswith("http"))
    process.terminate()
    process.wait(20)
    process.stdout.close()


def test_nothing_of_a_received_folder_runs(address: str) -> None:
    with playwright.sync_playwright() as play:
        browser = play.chromium.launch(executable_path=BROWSER, args=OPTIONS)
        page: Any = browser.new_page()
        foreign: list[str] = []
        dialogs: list[str] = []
        home = address.partition("?")[0]

        def asked(request: Any) -> None:
            if not request.url.startswith((home, "data:", "blob:")):
                foreign.append(request.url)

        def answer(dialog: Any) -> None:
            dialogs.append(dialog.message)
            dialog.dismiss()

        page.on("request", asked)
        page.on("dialog", answer)
        page.goto(address, timeout=SLOW)
        seen(page, "recording-run")
        assert SCRIPTS[2] in seen(page, "note-run").locator("..").inner_text()
        seen(page, "log").click()
        page.get_by_text("```").first.wait_for(timeout=SLOW)
        seen(page, "preview-plot")
        seen(page, "tab-look").click()
        seen(page, "loop-plot")
        seen(page, "tab-models").click()
        seen(page, "leaderboard")
        page.get_by_test_id(f"job-{SCRIPTS[2]}").wait_for(timeout=SLOW)
        page.get_by_role("button", name="Close").first.click()  # of a result without a model
        seen(page, "tab-compensate").click()
        seen(page, "wave").click()
        seen(page, "show-pressures").click()
        seen(page, "pressure-plot")
        page.get_by_test_id("runs").get_by_text(SCRIPTS[2]).first.wait_for(timeout=SLOW)
        seen(page, "tab-take").click()
        seen(page, "script")
        # what is written into the page with a script in it does not run either
        page.evaluate(
            """() => {
                const place = document.body.appendChild(document.createElement("div"));
                place.innerHTML = "<img src=x onerror='window.pwned = 1'>";
                const script = document.createElement("script");
                script.textContent = "window.pwned = 1";
                document.body.append(script);
            }"""
        )
        page.wait_for_timeout(300)
        assert page.evaluate("typeof window.pwned") == "undefined"
        browser.close()
    assert foreign == []
    assert dialogs == []


def test_a_name_is_an_attribute_and_nothing_more() -> None:
    pytest.importorskip("nicegui")
    from nicegui import Client, ui
    from nicegui.page import page

    from mckibben.app.desk import named

    with Client(page("")):
        for text in SCRIPTS:
            element = named(ui.label("x"), text)
            assert dict(element.props) == {"data-testid": text}
            json.dumps(dict(element.props))
