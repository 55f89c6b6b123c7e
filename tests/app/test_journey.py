"""A real browser walks the whole way, from the example to a C folder, and asks nobody else."""

from __future__ import annotations

import io
import os
import zipfile
from collections.abc import Iterator
from pathlib import Path
from shutil import which
from typing import Any

import pytest

from tests.app.browsing import SLOW, downloaded, seen, visited, workbench

pytest.importorskip("playwright.sync_api")

pytestmark = [pytest.mark.long, pytest.mark.journey]


@pytest.fixture
def address(tmp_path: Path) -> Iterator[str]:
    """Start the workbench on a free port, and give its address."""
    with workbench(tmp_path / "ws") as address:
        yield address
    if os.name == "posix":  # all that it wrote is for nobody else
        assert not [path for path in (tmp_path / "ws").rglob("*") if path.stat().st_mode & 0o077]


@pytest.fixture
def page(browser: Any, address: str) -> Iterator[Any]:
    """Open the workbench in a browser that reports foreign requests and errors."""
    with visited(browser, address) as page:
        yield page


def test_from_the_example_to_a_c_folder(page: Any, tmp_path: Path) -> None:
    seen(page, "empty")
    seen(page, "example").click()
    seen(page, "recording-irregular-triangle")
    seen(page, "preview-plot")

    seen(page, "tab-look").click()
    seen(page, "loop-plot")
    seen(page, "characterization").locator("li, td").first.wait_for(timeout=SLOW)

    seen(page, "tab-models").click()
    seen(page, "untick").click()
    for name in ("pi", "mpi"):
        seen(page, f"model-{name}").click()
    seen(page, "fit").click()
    seen(page, "leaderboard").locator("tbody tr").get_by_text("mpi:").wait_for(timeout=SLOW)
    seen(page, "closer-0")

    seen(page, "tab-compensate").click()
    seen(page, "wave").click()
    page.wait_for_function(
        "[...document.querySelectorAll('textarea')].some(t => t.value.split('\\n').length > 10)"
    )
    seen(page, "show-pressures").click()
    seen(page, "pressure-plot")
    assert downloaded(page, "take-pressures").startswith(b"time_s,pressure_bar\n0,")
    seen(page, "run-loop").click()
    page.get_by_test_id("runs").get_by_text("feedforward-pid").first.wait_for(timeout=SLOW)

    seen(page, "tab-take").click()
    with zipfile.ZipFile(io.BytesIO(downloaded(page, "take-c"))) as archive:
        names = archive.namelist()
        archive.extractall(tmp_path)
    assert any(name.endswith("CMakeLists.txt") for name in names)
    if which("cc"):
        from mckibben.export.programs import self_test

        folder = tmp_path / names[0].split("/")[0]
        assert self_test(folder, folder.name.removesuffix("-c"))
    assert downloaded(page, "take-json").startswith(b'{\n  "format": "mckibben-model"')
    assert b"mckibben.compare" in downloaded(page, "take-script")
    assert downloaded(page, "take-figure").startswith(b"%PDF")
    seen(page, "take-report").click()
    assert b"<html" in downloaded(page, "get-report")
