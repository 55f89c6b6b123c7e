"""Links lead somewhere, and the commands that pages show exist with their options."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click
import pytest

from mckibben.cli.main import app

CONTEXT = click.Context(app)
ROOT = Path(__file__).parents[2]
PAGES = [
    page
    for page in (*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"))
    if not {"_generated", "_build"} & set(page.parts)
]
SHELL = re.compile(r"^```(?:bash|sh|shell)\n(.*?)^```|(?<!`)`(mckibben [^`\n]+)`", re.M | re.S)


def shown(page: Path) -> Iterator[str]:
    """Give the commands of a page, of blocks and within sentences."""
    if page.name == "CHANGELOG.md":  # which keeps those that there were
        return
    for block, inline in SHELL.findall(page.read_text(encoding="utf-8")):
        for line in (block or inline).replace("\\\n", " ").splitlines():
            for part in re.split(r"&&|\||;| # ", line):
                if part.strip().startswith("mckibben "):
                    yield part.strip()


def unknown(line: str, root: Any) -> list[str]:
    """Return the words of a command that the command line does not have."""
    command, lacking = root, []
    for word in line.split()[1:]:
        options = {option for one in command.params for option in (*one.opts, *one.secondary_opts)}
        if word.startswith("-") and not re.match(r"-\d", word):
            if word.split("=")[0] not in {*options, "--help", "--version"}:
                lacking.append(word)
        elif isinstance(command, click.Group) and word in command.list_commands(CONTEXT):
            command = command.get_command(CONTEXT, word)
        elif isinstance(command, click.Group) and not word.isupper() and word.isalpha():
            lacking.append(word)
    return lacking


def test_commands_exist_with_their_options() -> None:
    root = app
    lines = [(page.name, line) for page in PAGES for line in shown(page)]
    assert len(lines) > 100
    assert unknown("mckibben fitt", root) == ["fitt"]
    assert unknown("mckibben fit gpi --outputs x", root) == ["--outputs"]
    assert [(name, line, bad) for name, line in lines if (bad := unknown(line, root))] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_between_pages_lead_somewhere(page: Path) -> None:
    for target in re.findall(r"\]\(([^)#\s]+)", page.read_text(encoding="utf-8")):
        if not target.startswith("http") and "_generated" not in target:
            assert (page.parent / target).exists(), target


def test_tutorials_are_in_the_index() -> None:
    index = (ROOT / "docs" / "index.md").read_text(encoding="utf-8")
    tutorials = (ROOT / "docs" / "tutorials").glob("*.md")
    assert [path for path in tutorials if f"<tutorials/{path.stem}>\n" not in index] == []


def test_paths_that_the_page_of_the_architecture_names_exist() -> None:
    text = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    named = re.findall(r"`([\w/.<>]+)`", text)
    folders = ROOT, ROOT / "src" / "mckibben"
    patterns = {name: re.sub(r"<\w+>", "*", name).rstrip("/") for name in named}
    assert len(patterns) > 40
    assert [
        name
        for name, pattern in patterns.items()
        if not [path for folder in folders for path in folder.glob(pattern)]
    ] == []
