"""What the library says for a terminal is said in the words of the workbench."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import mckibben
from mckibben.app.fields import said

SOURCE = Path(mckibben.__file__).parent

OPTION = re.compile(r"(?<![\w-])--[a-z][a-z0-9-]*")

NEVER_SHOWN = (
    "app/",  # its own commands, shown as such, its styles, and what stops it from starting
    "cli/",
    "report/",  # commands that a report lists, and styles
    "export/c/emulation.py",  # arguments of compilers
    "export/fmu/toolchains.py",
    "papers/",  # commands by which a paper's runs are made by hand
    "ros/",
)


def texts(tree: ast.AST) -> Iterator[str]:
    """Give all texts but docstrings, with x for what is put into them."""
    passed_over: set[int] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Expr) or id(node) in passed_over:
            passed_over.update(map(id, ast.iter_child_nodes(node)))
        elif isinstance(node, ast.JoinedStr):
            passed_over.update(map(id, ast.walk(node)))
            parts = node.values
            yield "".join(str(p.value) if isinstance(p, ast.Constant) else "x" for p in parts)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.value


def test_no_option_of_the_command_line_reaches_a_page() -> None:
    found = {
        f"{path}: {text}": said(text)
        for path in sorted(SOURCE.rglob("*.py"))
        if not path.relative_to(SOURCE).as_posix().startswith(NEVER_SHOWN)
        for text in texts(ast.parse(path.read_text("utf-8")))
        if OPTION.search(text)
    }
    assert len(found) > 60
    assert {text: words for text, words in found.items() if OPTION.search(words)} == {}


def test_values_of_options_stay_and_placeholders_go() -> None:
    assert "kN" in said("as in --unit force=kN")
    assert "UNIT" not in said("as in --unit force=UNIT")
