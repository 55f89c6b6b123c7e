"""What is taken away from the workbench: files made by jobs, a script that repeats it, in Chromium."""

from __future__ import annotations

import io
import subprocess
import sys
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import mckibben
from mckibben.app import downloads
from mckibben.app.workspace import Workspace
from tests.app.browsing import Workbench, seen, visited, workbench
from tests.app.simulated import with_example
from tests.export.muscle import MUSCLE

pytestmark = pytest.mark.filterwarnings("ignore::mckibben.errors.DataWarning")

OF: dict[str, Any] = {"model": "pi", "use": "inverse", "settings": {}}
OF |= {"inputs": ["pressure"], "outputs": ["displacement"], "load": ""}


def silent(*_: Any) -> None:
    """Hear of no progress."""


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    """The example, and a model of it."""
    return with_example(tmp_path_factory.mktemp("bench"), "pi")


def test_code_and_recordings_are_written(workspace: Workspace) -> None:
    def take(key: str, file: str, of: Any = OF, **options: Any) -> None:
        thing = downloads.THINGS[key]
        thing.work(workspace, silent, file=file, options=options, of=of, **thing.more)

    take("c", "a-c.zip", single=True)
    take("c", "a-c-2.zip")  # taken a second time
    take("ros2", "b-ros2.zip")
    take("json", "c.json")
    take("recordings", "r.zip")
    MUSCLE.save(workspace.path("models", "muscle.json"))
    of = OF | {"model": "muscle", "use": "model"}
    take("mjcf", "m.xml", of, rest_length=200.0)
    workspace.path("models", "muscle.json").unlink()
    folder = workspace.folder / "takeaway"
    assert '<general name="m"' in (folder / "m.xml").read_text()
    held = {p.name: zipfile.ZipFile(p).namelist() for p in folder.glob("*.zip")}
    assert {"a_c.c", "a_c.h"} <= {Path(name).name for name in held["a-c.zip"]}
    assert {"a_c_2.c", "a_c_2.h"} <= {Path(name).name for name in held["a-c-2.zip"]}
    assert any(name.endswith("package.xml") for name in held["b-ros2.zip"])
    assert {name.partition("/")[0] for name in held["r.zip"]} == {"train", "test"}
    assert [c.name for c in mckibben.load(folder / "c.json").outputs] == ["pressure"]


def test_the_script_repeats_the_work(workspace: Workspace) -> None:
    script = workspace.folder / "script.py"
    script.write_text(downloads.script(workspace, OF), encoding="utf-8")
    done = subprocess.run(
        [sys.executable, script], cwd=workspace.folder, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert mckibben.load(workspace.folder / "pi.json") == workspace.model("pi")
    assert (workspace.folder / "pi-inverse-c").is_dir()


@pytest.fixture
def bench(workspace: Workspace) -> Iterator[Workbench]:
    pytest.importorskip("nicegui")
    with workbench(workspace.folder) as found:
        yield found


def test_things_are_taken_in_chromium(browser: Any, bench: Workbench) -> None:
    with visited(browser, bench) as page:
        seen(page, "tab-take").click()
        seen(page, "things")
        assert page.evaluate("document.documentElement.scrollHeight") <= 1350
        seen(page, "options-c").click()
        seen(page, "option-name").fill("inverse_of_it")
        page.get_by_role("button", name="Done").click()
        with page.expect_download() as taken:
            seen(page, "take-c").click()
        archive = zipfile.ZipFile(io.BytesIO(taken.value.path().read_bytes()))
        assert any(name.endswith("/inverse_of_it.c") for name in archive.namelist())
        with page.expect_download(timeout=120_000) as taken:
            seen(page, "take-report").click()
            page.get_by_test_id("tab-look").click()  # it comes although its page is left
        assert "</html>" in taken.value.path().read_text(encoding="utf-8")
        page.get_by_test_id("tab-take").click()
        with page.expect_download() as taken:
            seen(page, "take-script").click()
        assert "mckibben.compare(" in taken.value.path().read_text(encoding="utf-8")
