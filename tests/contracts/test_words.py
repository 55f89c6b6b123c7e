"""Names, messages and first lines of docstrings are without words that are no terms of the field."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import mckibben

SOURCE = Path(mckibben.__file__).parent

FORBIDDEN = re.compile(
    r"wished|untold|\btold\b|\bkept apart\b|\btells? (of|apart)\b|\bstands? (for|beside|apart)\b"
    r"|\bof few\b|\bso manieth\b|\bbeliev|\bbelief\b|\bsays? of\b|\bknows? (no|nothing)\b|\bran away\b"
    r"|\bretaught\b|\bspeaks? (of|against)\b|\bbeside the others\b|\bfor want of\b",
    re.IGNORECASE,
)
"""In sentences, with blanks between words; in names, each underscore counts as a blank."""

ALLOWED = ("loads told", "dead loads told")
"""Names that the workbench imports."""


def _text(node: ast.AST) -> str:
    """Return the words of a string, also of one with values in it."""
    parts = node.values if isinstance(node, ast.JoinedStr) else [node]
    return " ".join(
        part.value
        for part in parts
        if isinstance(part, ast.Constant) and isinstance(part.value, str)
    )


def _names(node: ast.AST) -> Iterator[str]:
    """Yield the names that a node defines for others: classes, functions, arguments, constants."""
    if isinstance(node, ast.ClassDef | ast.FunctionDef):
        yield node.name
    if isinstance(node, ast.FunctionDef):
        yield from (one.arg for one in (*node.args.args, *node.args.kwonlyargs))
    if isinstance(node, ast.Module | ast.ClassDef):
        for line in node.body:
            targets = (
                line.targets if isinstance(line, ast.Assign) else [getattr(line, "target", None)]
            )
            yield from (one.id for one in targets if isinstance(one, ast.Name))


def _sentences(tree: ast.Module) -> Iterator[str]:
    """Yield messages and other strings, and the first paragraph of every docstring."""
    docstrings = set()
    for node in ast.walk(tree):
        for line in (
            getattr(node, "body", ()) if not isinstance(node, ast.Lambda | ast.IfExp) else ()
        ):
            if isinstance(line, ast.Expr):
                docstrings.add(line.value)
                yield _text(line.value).partition("\n\n")[0]
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant | ast.JoinedStr) and node not in docstrings:
            yield _text(node)


def test_the_words_are_those_of_the_field() -> None:
    found = []
    for path in sorted(SOURCE.rglob("*.py")):
        place = path.relative_to(SOURCE)
        if place.parts[0] in ("app", "hints.py"):  # the latter has names of earlier versions
            continue
        tree = ast.parse(path.read_text(encoding="utf-8"))
        names = [name.replace("_", " ") for node in ast.walk(tree) for name in _names(node)]
        names = [name for name in names if name not in ALLOWED]
        for text in (*names, *(" ".join(one.split()) for one in _sentences(tree))):
            if word := FORBIDDEN.search(text):
                found.append(f"{place}: {word[0]!r} in {text[:80]!r}")
    assert not found, "\n".join(found)
