"""The house in order: no circle of imports, no file too long to be read, nothing public unexplained."""

from __future__ import annotations

import ast
from collections import defaultdict
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

import mckibben
from tests.conftest import LONG

SOURCE = Path(mckibben.__file__).parent

ROOT = Path(__file__).parents[2]

LONGEST = 400
"""Lines of a file."""

FACE = "mckibben"
"""Imports everything when asked for it, and everything may ask it for the version."""


def name_of(path: Path) -> str:
    parts = path.relative_to(SOURCE.parent).with_suffix("").parts
    return ".".join(parts).removesuffix(".__init__")


TEXTS = {name_of(path): path.read_text(encoding="utf-8") for path in sorted(SOURCE.rglob("*.py"))}
TREES = {name: ast.parse(text) for name, text in TEXTS.items()}


def run(tree: ast.AST) -> Iterator[ast.AST]:
    """Give all that runs: what is imported for types alone, as a class by its helpers, does not."""
    for node in ast.iter_child_nodes(tree):
        if not (isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"):
            yield node
            yield from run(node)


def imported(tree: ast.Module) -> Iterator[str]:
    """Give the modules that a module imports, at its top or in functions."""
    for node in run(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            for alias in node.names:
                inner = f"{node.module}.{alias.name}"
                yield inner if inner in TREES else node.module or ""


def test_imports_go_round_in_no_circle() -> None:
    known = TREES.keys() - {FACE}
    graph = {name: known & {*imported(TREES[name])} for name in known}
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        pytest.fail(" -> ".join(error.args[1]))


@pytest.mark.parametrize("name", TREES)
def test_files_can_be_read_at_a_sitting(name: str) -> None:
    n = len(TEXTS[name].splitlines())
    assert n <= LONGEST, f"{n} lines"


def test_what_takes_long_is_there() -> None:
    assert [place for place in LONG if not (ROOT / place).exists()] == []


def test_public_methods_say_what_they_do_or_their_bases_do() -> None:
    bases: dict[str, set[str]] = defaultdict(set)
    methods: dict[str, dict[str, bool]] = defaultdict(dict)
    for node in (node for tree in TREES.values() for node in tree.body):
        if isinstance(node, ast.ClassDef):
            bases[node.name] |= {ast.unparse(base).partition("[")[0] for base in node.bases}
            for inner in node.body:
                if isinstance(inner, ast.FunctionDef | ast.AsyncFunctionDef):
                    said = ast.get_docstring(inner) is not None
                    methods[node.name][inner.name] = said
                elif isinstance(inner, ast.AnnAssign) and isinstance(inner.target, ast.Name):
                    methods[node.name].setdefault(inner.target.id, True)

    def explained(owner: str, method: str) -> bool:
        return methods[owner].get(method, False) or any(
            explained(base, method) for base in bases[owner]
        )

    mute = [
        f"{owner}.{method}"
        for owner in list(methods)
        for method in methods[owner]
        if not owner.startswith("_") and not method.startswith("_")
        if not explained(owner, method)
    ]
    assert not mute
