"""The API reference: a page a module, found from a page a part, with what each holds in a table."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import mckibben
from making.pages import MADE, plain, table, toctree, write
from mckibben import registry

SOURCE = Path(mckibben.__file__).parent

PARTS = (
    *("recording", "signals", "metrics", "diagnosis", "files", "rigs", "environments"),
    *("blocks", "estimators", "control", "comparison", "planning", "validation", "muscles"),
    *("papers", "report", "studying", "export", "stream", "link", "ros"),
    *("diagnosis", "measured", "example", "errors"),
)
"""Of the package, in the order of its layers."""


def first_sentence(node: ast.AST) -> str:
    """Return the first line of a docstring."""
    text = (
        ast.get_docstring(node)
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef)
        else ""
    )
    return plain((text or "").partition("\n\n")[0])


@cache
def offered() -> frozenset[str]:
    """Return the modules meant for others: those of plug-ins, and of names that packages hand on."""
    found = {
        value.partition(":")[0] for group in registry.PLUGINS.values() for value in group.values()
    }
    for face in (*SOURCE.rglob("__init__.py"), SOURCE / "__init__.pyi"):
        package = ".".join(("mckibben", *face.parent.relative_to(SOURCE).parts))
        for node in ast.walk(ast.parse(face.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.module:
                found.add(f"{package}.{node.module}" if node.level else node.module)
    return frozenset(found)


def modules(part: str) -> Iterator[tuple[str, ast.Module]]:
    """Give the modules of a part that hold something public and documented, and are offered."""
    place = SOURCE / part
    paths = sorted(place.rglob("*.py")) if place.is_dir() else [SOURCE / f"{part}.py"]
    for path in paths:
        names = path.relative_to(SOURCE).with_suffix("").parts
        name = ".".join(("mckibben", *names))
        if names[-1] != "__init__" and (name in offered() or not place.is_dir()):
            tree = ast.parse(path.read_text(encoding="utf-8"))
            if public(tree):
                yield name, tree


def public(tree: ast.Module) -> list[ast.ClassDef | ast.FunctionDef]:
    """Return what classes and functions a module gives to others."""
    return [
        node
        for node in tree.body
        if isinstance(node, ast.ClassDef | ast.FunctionDef)
        and not node.name.startswith("_")
        and ast.get_docstring(node)
    ]


def write_api() -> None:
    """Write the pages, which Sphinx fills from the docstrings."""
    rows = []
    for part in PARTS:
        found = list(modules(part))
        lines = [f"# mckibben.{part}", ""]
        place = SOURCE / part / "__init__.py"
        about = first_sentence(
            ast.parse(
                (place if place.is_file() else place.parent.with_suffix(".py")).read_text("utf-8")
            )
        )
        lines += [about, ""]
        for module, tree in found:
            lines += [f"## {module.removeprefix(f'mckibben.{part}.')}", ""]
            lines += [f"{first_sentence(tree)} [Details]({module}.rst)", ""]
            lines += table(
                ["name", "what it is"],
                [[f"`{node.name}`", first_sentence(node)] for node in public(tree)],
            )
            write_module(module)
        rows.append([f"[{part}](mckibben.{part}.part.md)", about])
        write(MADE / "api" / f"mckibben.{part}.part.md", "\n".join(lines))
    lines = [
        "# API reference",
        "",
        "From the docstrings, in the order of the package's layers.",
        "",
    ]
    lines += [
        *table(["part", "what it is"], rows),
        *toctree([f"mckibben.{part}.part" for part in PARTS], "hidden"),
    ]
    write(MADE / "api" / "index.md", "\n".join(lines))


def write_module(module: str) -> None:
    """Write the page of a module, which no list of pages but that of its part leads to."""
    title = f"{module}\n{'=' * len(module)}"
    write(MADE / "api" / f"{module}.rst", f":orphan:\n\n{title}\n\n.. automodule:: {module}\n")
