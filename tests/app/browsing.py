"""A workbench and a browser for tests: one of each for all tests of a module."""

from __future__ import annotations

import os
import subprocess
import sys
import time
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from shutil import which
from typing import Any

BROWSER = which("chromium")

SLOW = 300_000
"""Milliseconds to wait for fits on a busy machine."""

OPTIONS = [
    "--no-sandbox",
    "--disable-dev-shm-usage",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]


@contextmanager
def workbench(folder: Path) -> Iterator[str]:
    """Start the workbench over a folder on a free port, and give its address."""
    command = [sys.executable, "-m", "mckibben", "app", str(folder)]
    plain = {name: value for name, value in os.environ.items() if "PYTEST" not in name}
    process = subprocess.Popen(
        [*command, "--port", "0", "--no-show"], stdout=subprocess.PIPE, text=True, env=plain
    )
    assert process.stdout is not None
    try:
        line = process.stdout.readline()
        address = next(word for word in line.split() if word.startswith("http"))
        answering(address)
        yield address
    finally:
        process.terminate()
        process.wait(20)
        process.stdout.close()


def answering(address: str) -> None:
    """Wait until the server answers."""
    for _ in range(200):
        try:
            urllib.request.urlopen(address, timeout=5).close()
        except OSError:
            time.sleep(0.05)
        else:
            return
    raise AssertionError("the workbench does not answer")


@contextmanager
def visited(browser: Any, address: str) -> Iterator[Any]:
    """Open the workbench in a window of its own; demand that nobody else is asked, without errors."""
    window = browser.new_context(viewport={"width": 1280, "height": 900})
    page = window.new_page()
    foreign: list[str] = []
    errors: list[str] = []

    def asked(request: Any) -> None:
        if not request.url.startswith((address, "data:", "blob:")):
            foreign.append(request.url)

    page.on("request", asked)
    page.on("console", lambda said: errors.append(said.text) if said.type == "error" else None)
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.goto(address)
    seen(page, "tab-data")
    met: list[str] = []
    try:
        yield page
        met = list(errors)  # not those of what was under way when the window was closed
    except Exception as error:
        error.add_note(f"{page.inner_text('body')}\n\nConsole: {errors}")
        raise
    finally:
        window.close()
    assert foreign == [], foreign
    assert met == [], met


def seen(page: Any, name: str) -> Any:
    """Wait until an element is there, and give it."""
    place = page.get_by_test_id(name).first
    place.wait_for(timeout=SLOW)
    return place


def downloaded(page: Any, name: str) -> bytes:
    """Click what gives a file, and return that."""
    with page.expect_download(timeout=SLOW) as download:
        seen(page, name).click()
    return Path(download.value.path()).read_bytes()


def upload(page: Any, name: str, content: bytes) -> None:
    """Drop a file, by its name without an ending."""
    seen(page, "upload")
    file = {"name": f"{name}.csv", "mimeType": "text/csv", "buffer": content}
    page.locator("input[type=file]").first.set_input_files([file])


def holds(page: Any, true: Callable[[], Any]) -> None:
    """Wait until something is so."""
    for _ in range(SLOW // 100):
        if true():
            return
        page.wait_for_timeout(100)
    raise AssertionError("it is never so")
