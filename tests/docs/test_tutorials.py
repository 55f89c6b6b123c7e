"""Tutorials run as they are written, from top to bottom, from the folder of the package."""

from __future__ import annotations

import re
import shlex
import shutil
import sys
from pathlib import Path

import pytest

from mckibben import example
from mckibben.cli.main import run

ROOT = Path(__file__).parents[2]
TUTORIALS = sorted((ROOT / "docs" / "tutorials").glob("*.md"))
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


@pytest.mark.parametrize("path", TUTORIALS, ids=lambda path: path.stem)
@pytest.mark.filterwarnings("default")
def test_tutorial_runs(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if "gymnasium" in path.read_text():
        pytest.importorskip("gymnasium")
    shutil.copytree(example.FOLDER, tmp_path / "examples")
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {"__name__": "tutorial"}
    blocks = BLOCK.findall(path.read_text(encoding="utf-8"))
    assert blocks, "a tutorial without anything to run"
    for language, text in blocks:
        if language == "bash":
            for line in filter(None, text.splitlines()):
                command(line, monkeypatch)
        elif language == "python":
            exec(compile(text, path.name, "exec"), names)


def test_every_tutorial_is_in_the_index() -> None:
    index = (ROOT / "docs" / "index.md").read_text(encoding="utf-8")
    for path in TUTORIALS:
        assert f"tutorials/{path.stem}\n" in index


def test_links_between_pages_lead_somewhere() -> None:
    pages = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")]
    for page in pages:
        if "_generated" in page.parts or "_build" in page.parts:
            continue
        for target in re.findall(r"\]\(([^)#\s]+)", page.read_text(encoding="utf-8")):
            if not target.startswith("http") and "_generated" not in target:
                assert (page.parent / target).exists(), f"{page.name}: {target}"


def test_what_readme_shows_of_python_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    first = next(body for language, body in BLOCK.findall(text) if language == "python")
    shutil.copytree(example.FOLDER, tmp_path / "examples")
    monkeypatch.chdir(tmp_path)
    exec(compile(first, "README.md", "exec"), {"__name__": "readme"})
    assert (tmp_path / "model.json").is_file()
