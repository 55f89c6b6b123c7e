"""Take the pictures of the workbench's tour, on the bundled example, in a headless browser.

    python docs/tour.py     # by hand; into docs/pictures/tour and docs/workbench.md

Needs playwright and chromium.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

DOCS = Path(__file__).parent
PICTURES = DOCS / "pictures" / "tour"
LARGEST = 74_000
"""Bytes of a picture."""

WIDTH, HEIGHT = 1400, 900
"""Pixels of the window."""

WAIT = 120_000
"""Milliseconds until what a step waits for is there."""

OPTIONS = ("--no-sandbox", "--disable-dev-shm-usage", "--disable-gpu", "--no-first-run")


@dataclass(frozen=True)
class Step:
    """A screenshot: the clicks before it, the element to wait for, and the text above it."""

    name: str
    heading: str
    text: str
    clicks: Sequence[str]
    awaited: str


STEPS = (
    Step(
        "start",
        "An empty workspace",
        "Drop files, or open the example.",
        (),
        "example",
    ),
    Step(
        "data",
        "Data",
        "Each recording is listed with its channels and role. *Import settings* shows how the file was "
        "read, and changes it: columns, units, rate, sign, calibration, lines, encoding. Drag across "
        "the plot to trim a recording. Every step can be undone.",
        ("example",),
        "over-time",
    ),
    Step(
        "look",
        "Look",
        "Hysteresis loops, time plots, a characterization of the muscle, a plan of the next recording.",
        ("tab-look",),
        "look-loop",
    ),
    Step(
        "choice",
        "Models: the choice",
        "Models are grouped by purpose. The usual ones are preselected. For a model that does not apply "
        "to the recordings, the reason is shown.",
        ("tab-models", "fit-models"),
        "fit",
    ),
    Step(
        "models",
        "Models: the leaderboard",
        "Each fit runs in its own process in the background. The best model is listed first. Tabs show "
        "the loop, time plot, residual, parameters and check of the selected model.",
        ("fit",),
        "closer-loop",
    ),
    Step(
        "compensate",
        "Compensate",
        "The compensator follows a reachable reference on another model or a virtual rig. Its error is "
        "compared with the error without compensation.",
        ("tab-compensate", "run"),
        "runs",
    ),
    Step(
        "take",
        "Take away",
        "Download the report, model, C99, FMU, ROS 2 package, MuJoCo file and recordings, and a script "
        "that repeats all steps.",
        ("tab-take",),
        "things",
    ),
)


def small(page: Any, path: Path) -> None:
    """Save what the page shows, in as few colours as it takes."""
    from PIL import Image

    page.screenshot(path=path)
    with Image.open(path) as opened:
        whole = opened.convert("RGB")
    for colours, width in (
        (128, WIDTH),
        (64, WIDTH),
        (48, 1200),
        (32, 1100),
        (24, 1000),
        (16, 900),
    ):
        size = (width, round(whole.height * width / whole.width))
        whole.resize(size).quantize(colours, Image.Quantize.MAXCOVERAGE).save(path, optimize=True)
        if path.stat().st_size < LARGEST:
            return
    sys.exit(f"{path.name} is larger than {LARGEST} bytes")


def walk(page: Any) -> None:
    """Take the steps one after another."""
    for step in STEPS:
        for name in step.clicks:
            page.get_by_test_id(name).locator("visible=true").first.click(timeout=WAIT)
        page.get_by_test_id(step.awaited).locator("visible=true").first.wait_for(timeout=WAIT)
        page.get_by_test_id("running").wait_for(state="detached", timeout=WAIT)
        page.wait_for_timeout(2500)  # plots are drawn a little later than they are there
        small(page, PICTURES / f"{step.name}.png")
        print(f"{step.name}: {(PICTURES / f'{step.name}.png').stat().st_size} bytes")


def write_page() -> None:
    """Write headings, words and pictures into the tour's page."""
    path = DOCS / "workbench.md"
    lines = ["<!-- tour: made by docs/tour.py -->", ""]
    for step in STEPS:
        lines += [f"## {step.heading}", "", step.text, ""]
        lines += [f"![{step.heading} in the workbench](pictures/tour/{step.name}.png)", ""]
    found = path.read_text(encoding="utf-8")
    before, _, rest = found.partition("<!-- tour")
    after = re.split(r"(?m)^(?=## Privacy and security)", rest)[1]
    path.write_text(before + "\n".join(lines) + "\n" + after, encoding="utf-8")


def main() -> None:
    """Start the workbench in an empty folder, and walk through it."""
    from playwright.sync_api import sync_playwright

    shutil.rmtree(PICTURES, ignore_errors=True)
    PICTURES.mkdir(parents=True)
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as play:
        command = [sys.executable, "-m", "mckibben", "app", f"{folder}/my_muscle", "--port", "0"]
        process = subprocess.Popen([*command, "--no-show"], stdout=subprocess.PIPE, text=True)
        try:
            assert process.stdout is not None
            line = process.stdout.readline()
            address = next(word for word in line.split() if word.startswith("http"))
            browser = play.chromium.launch(executable_path=shutil.which("chromium"), args=OPTIONS)
            page = browser.new_page(viewport={"width": WIDTH, "height": HEIGHT})
            page.goto(address, timeout=WAIT)
            walk(page)
            browser.close()
        finally:
            process.terminate()
            process.wait(20)
    write_page()


if __name__ == "__main__":
    main()
