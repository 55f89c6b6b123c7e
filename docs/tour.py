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
LARGEST = 74_000
"""Bytes of a picture."""

WIDTH, HEIGHT = 1280, 860
"""Pixels of the window."""

WAIT = 60_000
"""Milliseconds until what a step waits for is there."""

DONE = "!/Fitting|Running/.test(document.querySelector('header').innerText)"
"""Whether nothing runs any more, in the page's words."""

OPTIONS = ("--no-sandbox", "--disable-dev-shm-usage", "--disable-gpu", "--no-first-run")


@dataclass(frozen=True)
class Step:
    """A picture: what is clicked before, what is waited for, shown from where, and said above it."""

    name: str
    heading: str
    text: str
    clicks: Sequence[str]
    awaited: str
    top: str = ""
    height: int = HEIGHT


STEPS = (
    Step(
        "start",
        "An empty workspace",
        "Drop files, open the example, or record a virtual muscle.",
        (),
        "empty",
        height=360,
    ),
    Step(
        "data",
        "Data",
        "Every recording with its channels and units. The sliders behind each open its import again: "
        "columns, units, rate, sign, calibration. One recording trains, another tests; "
        "parts are cut by dragging, or by numbers.",
        ("example",),
        "preview-plot",
    ),
    Step(
        "look",
        "Look",
        "Loops, cycles, and what the muscle does, in words and numbers.",
        ("tab-look",),
        "loop-plot",
    ),
    Step(
        "models",
        "Models: the choice",
        "Models stand by what they are for, with what they need and cost. "
        "Those that suit these data are offered, the usual ones ticked; sliders open settings.",
        ("tab-models",),
        "fit",
        height=740,
    ),
    Step(
        "ranking",
        "Models: the ranking",
        "*Fit* runs in the background. The choice is by cross-validation on the training side; "
        "the test stands beside, and any two can be looked at closer.",
        ("fit",),
        "closer-0",
        top="leaderboard",
    ),
    Step(
        "compensate",
        "Compensate: a motion",
        "Draw a motion within what can be reached, or take a wave, and see the pressures that make it.",
        ("tab-compensate", "wave", "show-pressures"),
        "pressure-plot",
    ),
    Step(
        "loop",
        "Compensate: the loop",
        "Try the compensator on another model of the muscle, or a virtual rig of like size, "
        "beside the uncompensated run.",
        ("run-loop",),
        "runs",
        top="loop-plant",
    ),
    Step(
        "take",
        "Take away",
        "The model, its inverse, C99 or an FMU; figures; the report; and all that was done as a script.",
        ("tab-take",),
        "take-report",
        height=650,
    ),
)


def small(page: Any, path: Path, height: int) -> None:
    """Save what the page shows, in as few colours as it takes."""
    from PIL import Image

    page.screenshot(path=path, clip={"x": 0, "y": 0, "width": WIDTH, "height": height})
    with Image.open(path) as opened:
        whole = opened.convert("RGB")
    for colours, width in ((128, WIDTH), (64, WIDTH), (48, 1100), (32, 1000), (24, 900), (16, 800)):
        size = (width, round(whole.height * width / whole.width))
        whole.resize(size).quantize(colours, Image.Quantize.MAXCOVERAGE).save(path, optimize=True)
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
                page.wait_for_timeout(1500)
            page.get_by_test_id(step.awaited).first.wait_for(timeout=WAIT)
            page.wait_for_function(DONE, timeout=WAIT)
        except Error as error:
            print(f"{step.name}: left out, {str(error).splitlines()[0]}")
            continue
        page.wait_for_timeout(2500)  # plots are drawn a little later than they are there
        if step.top:
            page.get_by_test_id(step.top).first.evaluate(
                "at => window.scrollTo(0, at.getBoundingClientRect().top + scrollY - 110)"
            )
            page.wait_for_timeout(500)
        small(page, PICTURES / f"{step.name}.png", step.height)
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
                "mckibben",
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
            page = browser.new_page(viewport={"width": WIDTH, "height": HEIGHT})
            page.goto(address, timeout=WAIT)
            page.add_style_tag(content=".q-notifications { display: none }")
            steps = walk(page)
            browser.close()
        finally:
            process.terminate()
            process.wait(20)
    tell(steps)


if __name__ == "__main__":
    main()
