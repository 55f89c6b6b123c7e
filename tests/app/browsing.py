"""A workbench and a browser for tests."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from shutil import which
from typing import Any

BROWSER = which("chromium")

OPTIONS = ["--no-sandbox", "--disable-dev-shm-usage", "--disable-gpu", "--no-first-run"]

SLOW = 60_000
"""For anything to be there on a busy machine [ms]."""

START = "from mckibben.app.main import serve; import sys; serve(sys.argv[1], port=0, show=False)"


NARROW: dict[str, Any] = {"viewport": {"width": 400, "height": 850}, "color_scheme": "dark"}
"""Of a window on a telephone, at night."""


@contextmanager
def workbench(folder: Path, before: str = "") -> Iterator[Workbench]:
    """Start a workbench over a folder on a free port, after some Python, and end it."""
    plain = {name: value for name, value in os.environ.items() if "PYTEST" not in name}
    process = subprocess.Popen(
        [sys.executable, "-c", before + START, str(folder)],
        stdout=subprocess.PIPE,
        text=True,
        env=plain,
    )
    try:
        yield Workbench(process)
    finally:
        process.terminate()
        process.wait(20)
        assert process.stdout is not None
        process.stdout.close()


class Workbench:
    """A running workbench."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self.process = process
        self.link = self.next_link()
        self.address = self.link.partition("/enter")[0]
        self.port = int(self.address.rpartition(":")[2])

    def next_link(self) -> str:
        """Wait for the next one-time link, and return it."""
        assert self.process.stdout is not None
        for line in self.process.stdout:
            if found := [word for word in line.split() if word.startswith("http")]:
                return found[0]
        raise AssertionError("the workbench did not start")


@contextmanager
def visited(browser: Any, bench: Workbench, **look: Any) -> Iterator[Any]:
    """Open the workbench in a window; nobody else may be asked, and the console stays empty."""
    window = browser.new_context(**{"viewport": {"width": 1400, "height": 900}} | look)
    page = window.new_page()
    foreign: list[str] = []
    errors: list[str] = []
    page.on(
        "request",
        lambda asked: (
            None
            if asked.url.startswith((bench.address, "data:", "blob:"))
            else foreign.append(asked.url)
        ),
    )
    page.on("console", lambda said: errors.append(said.text) if said.type == "error" else None)
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.goto(bench.link)
    bench.link = bench.next_link()
    seen(page, "page-data")
    try:
        yield page
    except Exception as error:
        error.add_note(f"{page.inner_text('body')}\n\nConsole: {errors}")
        raise
    finally:
        met = list(errors)
        window.close()
    assert foreign == []
    assert met == []


def seen(page: Any, name: str) -> Any:
    """Wait until an element is visible, and return it."""
    place = page.get_by_test_id(name).locator("visible=true").first
    place.wait_for(timeout=SLOW)
    return place


def upload(page: Any, name: str, content: bytes) -> None:
    """Choose a file."""
    page.locator("input[type=file]").first.set_input_files(
        [{"name": name, "mimeType": "text/csv", "buffer": content}]
    )
