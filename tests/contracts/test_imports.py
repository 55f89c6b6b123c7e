"""Imports point one way: none from a layer above, and in no circle."""

from __future__ import annotations

import ast
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

import mckibben

SOURCE = Path(mckibben.__file__).parent

LAYERS = (
    {
        "errors",
        "hints",
        "arrays",
        "registry",
        "numerals",
        "printing",
        "version",
        "system",
        "numerics",
    },
    {"recording", "signals", "channels", "metrics", "splits"},
    {"options", "keywords", "parsers"},
    {"files"},
    {"rigs"},
    {"blocks"},
    {"muscles"},
    {
        "estimators",
        "exporting",
        "stream",
        "link",
        "outputs",
        "checkpoints",
        "example",
        "simulation",
    },
    {"control"},
    {"environments"},
    {"diagnosis"},
    {"comparison"},
    {"planning"},
    {"reading"},
    {"studying"},
    {"papers"},
    {"report"},
    {"measured"},
    {"workflow"},
    {"app"},
    {"cli"},
    {"__main__"},
)
"""Lowest first."""

BASE = {"arrays", "errors", "hints", "printing"}

STANDS_ON = {
    "numerics": {"numerics", *BASE},
    "files": {
        *("files", "recording", "registry", "system", "options", "keywords", "signals", "channels"),
        *BASE,
    },
    "rigs": {"rigs", "recording", "signals", "registry", "system", "metrics", *BASE},
    "exporting": {"exporting", "blocks", "outputs", "registry", "system", *BASE},
    "stream": {"stream", "blocks", *BASE},
    "link": {"link", "recording", "system", *BASE},
    "control": {
        *("control", "blocks", "recording", "signals", "registry", "numerals", "system"),
        *BASE,
    },
    "environments": {
        *("environments", "control", "blocks", "rigs", "recording", "signals", "system"),
        *BASE,
    },
}
"""What some members may import and no more: a rig's physics knows nothing of models."""


def name_of(path: Path) -> str:
    parts = path.relative_to(SOURCE.parent).with_suffix("").parts
    return ".".join(parts).removesuffix(".__init__")


MODULES = {
    name_of(path): path
    for path in sorted(SOURCE.rglob("*.py"))
    # the package's face imports everything when asked for it, and gives the version to all
    if path != SOURCE / "__init__.py"
}


def layer(name: str) -> int:
    for number, members in enumerate(LAYERS):
        if name in members:
            return number
    raise AssertionError(f"{name!r} is in no layer: add it to LAYERS where it belongs")


@cache
def imported(name: str) -> frozenset[str]:
    """Return the modules of the package that a module imports, wherever in its text.

    Imports inside functions and for types alone count: who reads a file needs what it names.
    """
    modules: set[str] = set()
    for node in ast.walk(ast.parse(MODULES[name].read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{name}: relative imports hide where they point"
            inner = [f"{node.module}.{alias.name}" for alias in node.names]
            found = [one if one in MODULES else node.module or "" for one in inner]
            assert node.module != "mckibben" or {*inner} <= {*MODULES, "mckibben.__version__"}
        else:
            continue
        modules |= {one for one in found if one in MODULES}
    return frozenset(modules)


@pytest.mark.parametrize("name", MODULES)
def test_imports_point_down(name: str) -> None:
    own, members = name.split(".")[1], {one.split(".")[1] for one in imported(name)}
    upward = {member for member in members if layer(member) > layer(own)}
    assert not upward, f"{own} imports {upward} from above"
    assert members <= STANDS_ON.get(own, members)


def test_imports_go_round_in_no_circle() -> None:
    graph = {name: imported(name) for name in MODULES}
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        pytest.fail(" -> ".join(error.args[1]))


def test_rooms_go_round_in_no_circle() -> None:
    """The files of one folder, or one file beside the folders, are a room."""
    graph: dict[str, set[str]] = {}
    for name in MODULES:
        own = name.split(".")[1]
        graph.setdefault(own, set()).update(one.split(".")[1] for one in imported(name))
        graph[own].discard(own)
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        pytest.fail(" -> ".join(error.args[1]))
