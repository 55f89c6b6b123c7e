"""Tutorials run as they are written, from top to bottom, from the folder of the package."""

from __future__ import annotations

import re
import runpy
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from mckibben.cli.main import run

pytestmark = pytest.mark.long

ROOT = Path(__file__).parents[2]
TUTORIALS = sorted((ROOT / "docs" / "tutorials").glob("*.md"))
NOTEBOOKS = runpy.run_path(str(ROOT / "docs" / "notebooks.py"))

SETTING_UP = (
    "python3 start.py",
    "python3 -m venv .venv",
    ". .venv/bin/activate",
    "pip install",
    "uv sync",
    "jupyter lab",
)

BLOCK = re.compile(r"^```(\w+)\n(.*?)^```", flags=re.M | re.S)


def command(line: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Run a line of a shell block, which must be a call of the command line."""
    words = shlex.split(line, comments=True)
    assert words[0] == "mckibben", f"{line!r} cannot be checked"
    monkeypatch.setattr(sys, "argv", words)
    code: object = 0
    try:
        run()
    except SystemExit as leaving:
        code = leaving.code
    assert not code, f"{line!r} ended with {code}"


def shell(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Return what runs the cells of a notebook as Jupyter does, commands within this process."""
    interactive = pytest.importorskip("IPython.core.interactiveshell")
    config = pytest.importorskip("traitlets.config").Config()
    config.HistoryManager.enabled = False

    class Shell(interactive.InteractiveShell):  # type: ignore[misc, name-defined]
        def system(self, line: str) -> None:
            command(line, monkeypatch)

    return Shell(config=config)


@pytest.mark.parametrize("path", TUTORIALS, ids=lambda path: path.stem)
@pytest.mark.filterwarnings("default")
def test_tutorial_runs_as_a_notebook(
    path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if "gymnasium" in path.read_text():
        pytest.importorskip("gymnasium")
    monkeypatch.chdir(tmp_path)
    cells = [text for kind, text in NOTEBOOKS["cells"](path) if kind == "code"]
    assert cells, "a tutorial without anything to run"
    running = shell(monkeypatch)
    for cell in cells:
        running.run_cell(cell).raise_error()


@pytest.mark.parametrize(
    ("page", "written"),
    [
        ("README.md", ("study/report.html", "study/gpi.json")),
        ("docs/jupyter.md", ("model.json", "loops.png")),
    ],
)
def test_page_runs_from_top_to_bottom(
    page: str, written: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = (ROOT / page).read_text(encoding="utf-8")
    text = re.sub(r"<!-- test -->\n```bash\n.*?```\n", "", text, flags=re.S)  # this very suite
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {"__name__": "page"}
    blocks = BLOCK.findall(text)
    assert blocks
    for language, body in blocks:
        if language == "python":
            exec(compile(body, page, "exec"), names)
            continue
        for line in filter(None, body.splitlines()):
            for part in line.split(" && "):
                if not part.startswith(SETTING_UP):
                    command(part.partition(" > ")[0], monkeypatch)
    for made in written:
        assert (tmp_path / made).exists()
    files = [path.relative_to(tmp_path) for path in tmp_path.rglob("*") if path.is_file()]
    assert page != "README.md" or untracked(files) == []


def untracked(paths: list[Path]) -> list[str]:
    """Return the files that git would list as untracked if they were in the repository."""
    names = [path.as_posix() for path in paths]
    command = ["git", "check-ignore", "--no-index", *names]
    found = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    return sorted(set(names) - set(found.stdout.splitlines()))


def test_files_that_git_does_not_ignore_are_found() -> None:
    assert untracked([Path("study/report.html"), Path("stray.txt")]) == ["stray.txt"]
