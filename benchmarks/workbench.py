"""How quick the workbench is: first paint, clicks while two fits run, pan and zoom of a million samples.

    python benchmarks/workbench.py

Wants Debian's chromium. Takes about a minute.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from playwright.sync_api import sync_playwright

import mckibben

CHROMIUM = "/usr/bin/chromium"
OPTIONS = [
    "--no-sandbox",
    "--disable-dev-shm-usage",
    "--disable-gpu",
    "--disable-background-networking",
]
SIZE: Any = {"width": 1280, "height": 900}
SAMPLES = 1_000_000
STARTS = 5

ZOOM = """async ([low, high]) => {
  const plot = document.querySelector('[data-testid=preview-plot]');
  const {Plotly} = await import('nicegui-plotly');
  const start = performance.now();
  const redrawn = new Promise(
    done => plot.once('plotly_restyle', () => done(performance.now() - start)));
  await Plotly.relayout(plot, {'xaxis.range[0]': low, 'xaxis.range[1]': high});
  return await redrawn;
}"""

CLICK = """async (name) => {
  const tab = document.querySelector(`[data-testid=${name}]`);
  const start = performance.now();
  tab.click();
  while (tab.getAttribute("aria-selected") !== "true")
    await new Promise((done) => setTimeout(done, 4));
  return performance.now() - start;
}"""
"""Opens a page, and returns when that is seen [ms]."""

AWAKE = """async () => {
  const start = performance.now();
  await fetch("awake", {cache: "no-store"});
  return performance.now() - start;
}"""


def recording(path: Path) -> None:
    """Write a recording of a million samples."""
    rng = np.random.default_rng(0)
    t = np.arange(SAMPLES) * 0.001
    pressure = 2.5 - 2 * np.cos(2 * np.pi * t / 7) * np.cos(2 * np.pi * t / 311)
    displacement = 6 * pressure + 0.05 * rng.normal(size=SAMPLES)
    channels = {"pressure": pressure, "displacement": displacement}
    mckibben.write(mckibben.Recording(channels, 0.001), path)


def told(what: str, seconds: list[float], target: float) -> None:
    middle, worst = statistics.median(seconds), max(seconds)
    print(f"{what}: median {middle:.3f} s, at most {worst:.3f} s (target {target} s)")


def asked(browser: Any, address: str) -> float:
    """Open the workbench in a window that has never seen it, and return when it can be used [s]."""
    window = browser.new_context(viewport=SIZE)
    page = window.new_page()
    began = time.perf_counter()
    page.goto(address)
    page.get_by_test_id("example").wait_for()
    taken = time.perf_counter() - began
    window.close()
    return taken


def walk(page: Any, folder: Path) -> None:
    recording(folder / "long.parquet")
    page.locator("input[type=file]").first.set_input_files(str(folder / "long.parquet"))
    page.get_by_test_id("recording-long").wait_for(timeout=120_000)
    page.get_by_role("button", name="Show long").click()
    time.sleep(3)
    zooms = [page.evaluate(ZOOM, [40 * k, 40 * k + 30 * (1 + k % 4)]) / 1e3 for k in range(20)]
    told(f"pan and zoom of {SAMPLES} samples", zooms, 0.3)

    page.get_by_role("button", name="Remove long").click()
    page.get_by_test_id("example").click()
    page.get_by_test_id("recording-irregular-triangle").wait_for(timeout=60_000)
    page.get_by_test_id("tab-models").click()
    page.get_by_test_id("fit").click()
    time.sleep(3)
    clicks = []
    for number in range(20):
        tab = ("data", "look", "models", "take")[number % 4]
        clicks.append(page.evaluate(CLICK, f"tab-{tab}") / 1e3)
        time.sleep(0.3)
    busy = page.get_by_test_id("busy").inner_text()
    first, again = clicks[:4], clicks[4:]
    told("first opening of each page while fits run", first, 0.2)
    told(f"change of page while fits run ({busy or 'they had ended'})", again, 0.2)
    awake = []
    for _ in range(40):
        time.sleep(0.1)
        awake.append(page.evaluate(AWAKE) / 1e3)
    told("an answer of the server while fits run", awake, 0.2)


@contextmanager
def starting(folder: Path) -> Iterator[subprocess.Popen[str]]:
    """Start the workbench over a folder; Python keeps what it has compiled, as it does by itself."""
    command = [sys.executable, "-m", "mckibben", "app", str(folder)]
    own = {name: text for name, text in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    process = subprocess.Popen(
        [*command, "--port", "0", "--no-show"], stdout=subprocess.PIPE, text=True, env=own
    )
    try:
        yield process
    finally:
        process.terminate()
        process.wait()


def opened(browser: Any, folder: Path) -> tuple[float, float]:
    """Return when the first words and the page are seen after the command was started [s]."""
    page = browser.new_page(viewport=SIZE)
    began = time.perf_counter()
    with starting(folder):
        while not (doors := list(folder.glob(".open-*.html"))):
            time.sleep(0.005)
        page.goto(doors[0].as_uri())
        words = time.perf_counter() - began
        page.get_by_test_id("example").wait_for()
        whole = time.perf_counter() - began
        page.close()
    return words, whole


def main() -> None:
    with tempfile.TemporaryDirectory() as place, sync_playwright() as play:
        browser = play.chromium.launch(executable_path=CHROMIUM, args=OPTIONS)
        opened(browser, Path(place) / "first")  # as after an installation, when much is compiled
        starts = [opened(browser, Path(place) / f"start-{k}") for k in range(STARTS)]
        words, whole = zip(*starts, strict=True)
        told("first words after the command was started", list(words), 2.0)
        told("the page after the command was started", list(whole), 2.0)
        with starting(Path(place) / "ws") as process:
            assert process.stdout is not None
            address = next(w for w in process.stdout.readline().split() if w.startswith("http"))
            time.sleep(10)  # for what pages need later to be loaded
            told(
                "the page after it was asked for", [asked(browser, address) for _ in range(5)], 1.0
            )
            page = browser.new_page(viewport=SIZE)
            page.goto(address)
            walk(page, Path(place))
        browser.close()


if __name__ == "__main__":
    main()
