"""Take the pictures of the workbench's tour, on the bundled example, in a headless browser.

    python docs/tour.py     # by hand; into docs/pictures/tour and docs/workbench.md

Needs playwright and chromium. A step that this workbench does not have is left out.
"""

from __future__ import annotations

import os
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
LARGEST = 60_000
"""Bytes of a picture."""

WAIT = 60_000
"""Milliseconds until what a step waits for is there."""

OPTIONS = ("--no-sandbox", "--disable-dev-shm-usage", "--disable-gpu", "--no-first-run")


@dataclass(frozen=True)
class Step:
    """A picture: what is clicked before, what is waited for, and what is said below."""

    name: str
    heading: str
    text: str
    clicks: Sequence[str]
    awaited: str


STEPS = (
    Step(
        "start",
        "An empty workspace",
        "Drop files, open the example, or record a virtual muscle.",
        (),
        "empty",
    ),
    Step(
        "data",
        "Data",
        "Every recording with its channels and units; columns are mapped by hand where names "
        "do not tell, "
        "and parts are cut by dragging. One recording trains, another tests.",
        ("example",),
        "preview-plot",
    ),
    Step(
        "look",
        "Look",
        "Loops, cycles, and what the muscle does in words and numbers.",
        ("tab-look",),
        "loop-plot",
    ),
    Step(
        "models",
        "Models",
        "Models are fitted in the background and ranked; "
        "the choice is by cross-validation on the training side.",
        ("tab-models", "fit"),
        "closer-0",
    ),
    Step(
        "compensate",
        "Compensate",
        "Draw a motion, see what can be reached, and close the loop on another model of "
        "the muscle, or a rig.",
        ("tab-compensate", "wave", "run-loop"),
        "runs",
    ),
    Step(
        "take",
        "Take away",
        "The report, figures, the model, its inverse, C99 or an FMU.",
        ("tab-take",),
        "take-report",
    ),
)


def small(page: Any, path: Path) -> None:
    """Save what the page shows, in as few colours as it takes."""
    from PIL import Image

    page.screenshot(path=path)
    with Image.open(path) as opened:
        whole = opened.convert("RGB")
    for colours, width in ((96, 1280), (64, 1280), (48, 1100), (32, 1000), (24, 900), (16, 800)):
        size = (width, round(whole.height * width / whole.width))
        whole.resize(size).quantize(colours).save(path, optimize=True)
        if path.stat().st_size < LARGEST:
            return
    sys.exit(f"{path.name} is larger than {LARGEST} bytes")


def walk(page: Any) -> list[Step]:
    """Take the steps one after another; return those of which there is a picture."""
    from playwright.sync_api import Error

    taken = []
    for step in STEPS:
        try:
            for name in step.clicks:
                page.get_by_test_id(name).first.click(timeout=WAIT)
                page.wait_for_timeout(500)
            page.get_by_test_id(step.awaited).first.wait_for(timeout=WAIT)
        except Error as error:
            print(f"{step.name}: left out, {str(error).splitlines()[0]}")
            continue
        page.wait_for_timeout(2500)  # plots are drawn a little later than they are there
        small(page, PICTURES / f"{step.name}.png")
        taken.append(step)
        print(f"{step.name}: {(PICTURES / f'{step.name}.png').stat().st_size} bytes")
    return taken


def tell(steps: Sequence[Step]) -> None:
    """Write headings, words and pictures into the tour's page."""
    path = DOCS / "workbench.md"
    lines = ["<!-- tour: made by docs/tour.py -->", ""]
    for step in steps:
        lines += [f"## {step.heading}", "", step.text, ""]
        if (PICTURES / f"{step.name}.png").is_file():
            lines += [f"![{step.heading} in the workbench](pictures/tour/{step.name}.png)", ""]
    found = path.read_text(encoding="utf-8")
    before, _, rest = found.partition("<!-- tour")
    after = re.split(r"(?m)^(?=## What it keeps to itself)", rest)[1]
    path.write_text(before + "\n".join(lines) + "\n" + after, encoding="utf-8")


def main() -> None:
    """Start the workbench in an empty folder, and walk through it."""
    from playwright.sync_api import sync_playwright

    PICTURES.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as play:
        process = subprocess.Popen(
            [
                sys.executable,
                "-m",
                "mckibben.cli.main",
                "app",
                f"{folder}/my_muscle",
                "--port",
                "0",
                "--no-show",
            ],
            stdout=subprocess.PIPE,
            text=True,
            env=dict(os.environ),
        )
        try:
            assert process.stdout is not None
            line = process.stdout.readline()
            address = next(word for word in line.split() if word.startswith("http"))
            browser = play.chromium.launch(executable_path=shutil.which("chromium"), args=OPTIONS)
            page = browser.new_page(viewport={"width": 1280, "height": 860})
            page.goto(address, timeout=WAIT)
            steps = walk(page)
            browser.close()
        finally:
            process.terminate()
            process.wait(20)
    tell(steps)


if __name__ == "__main__":
    main()
