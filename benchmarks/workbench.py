"""Response times of the workbench: first paint, clicks during two fits, first result of a fit.

    python benchmarks/workbench.py

Wants Debian's chromium. Takes about a minute.
"""

from __future__ import annotations

import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from playwright.sync_api import sync_playwright

CHROMIUM = "/usr/bin/chromium"
OPTIONS = ["--no-sandbox", "--disable-dev-shm-usage", "--disable-gpu"]
SIZE: Any = {"width": 1400, "height": 900}
WAIT = 120_000

CLICK = """async ([name, shown]) => {
  const seen = (name) => {
    const at = document.querySelector(`[data-testid=${name}]`);
    return at && at.getClientRects().length > 0;
  };
  const start = performance.now();
  document.querySelector(`[data-testid=${name}]`).click();
  while (!seen(shown)) await new Promise((done) => setTimeout(done, 4));
  return performance.now() - start;
}"""
"""Clicks a tab, and returns when its page is there [ms]."""

TABS = (
    ("tab-data", "page-data"),
    ("tab-look", "page-look"),
    ("tab-models", "page-models"),
    ("tab-take", "page-takeaway"),
)


def told(what: str, seconds: Sequence[float], target: str) -> None:
    middle, worst = statistics.median(seconds), max(seconds)
    print(f"{what}: median {middle:.2f} s, at most {worst:.2f} s (target: {target})", flush=True)


@contextmanager
def started(folder: Path) -> Iterator[tuple[str, float]]:
    """Start the workbench over a folder; give its link, and how long that took [s]."""
    command = [sys.executable, "-m", "mckibben", "app", str(folder), "--port", "0", "--no-show"]
    began = time.perf_counter()
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    try:
        line = process.stdout.readline()
        yield next(w for w in line.split() if w.startswith("http")), time.perf_counter() - began
    finally:
        process.terminate()
        process.wait()


def painted(page: Any, address: str) -> float:
    """Open an address, and return how long it took until the page was there [s]."""
    began = time.perf_counter()
    page.goto(address)
    page.get_by_test_id("page-data").wait_for(timeout=WAIT)
    return time.perf_counter() - began


def fitted(page: Any, *models: str) -> None:
    """Start fits."""
    page.get_by_test_id("tab-models").click()
    page.get_by_test_id("fit-models").click()
    page.get_by_test_id("tick-none").click(timeout=WAIT)
    for model in models:
        more = page.get_by_test_id(f"model-{model}")
        if not more.is_visible():
            more.locator("xpath=ancestor::*[contains(@class,'q-expansion-item')][1]").first.click()
        more.click()
    page.get_by_test_id("fit").click()


def main() -> None:
    with tempfile.TemporaryDirectory() as place, sync_playwright() as play:
        browser = play.chromium.launch(executable_path=CHROMIUM, args=OPTIONS)
        page = browser.new_page(viewport=SIZE)
        with started(Path(place, "folder")) as (link, seconds):
            print(f"from the command to its link: {seconds:.2f} s", flush=True)
            address = link.partition("/enter")[0]
            painted(page, link)
            time.sleep(5)  # for what the first job needs to be loaded
            told("first paint", [painted(page, address) for _ in range(5)], "1 s")
            page.get_by_test_id("example").click()
            page.get_by_test_id("over-time").first.wait_for(timeout=WAIT)
            began = time.perf_counter()
            fitted(page, "pi")
            page.locator("[data-testid=leaderboard] tr.choosable").first.wait_for(timeout=WAIT)
            told("from the tab Models to the first result", [time.perf_counter() - began], "3 s")
            fitted(page, "bouc-wen", "balance")
            clicks = [page.evaluate(CLICK, list(TABS[k % 4])) / 1e3 for k in range(20)]
            busy = page.get_by_test_id("running").count()
            during = "during two fits" if busy else "after two fits"
            told(f"a click on a tab {during}", clicks, "0.2 s, at most 0.5 s")
        browser.close()


if __name__ == "__main__":
    main()
