"""Imports point one way: none from a layer above one's own, and none in a circle of modules."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

import mckibben

SOURCE = Path(mckibben.__file__).parent

LAYERS = (
    {
        "errors",
        "arrays",
        "registry",
        "presets",
        "numerals",
        "version",
        "example",
        "system",
    },
    {"recording", "signals", "metrics", "characterization"},
    {"files"},
    {"rigs"},
    {"blocks"},
    {"muscles"},
    {"estimators", "export", "stream", "link", "outputs"},
    {"control", "simulators", "ros"},
    {"environments"},
    {"bands"},
    {"comparison"},
    {"validation", "excitation"},
    {"studying"},
    {"papers", "measured", "missing"},
    {"report"},
    {"app"},
    {"cli"},
)
"""Lowest first."""

STANDS_ON = {
    "files": {
        "files",
        "recording",
        "arrays",
        "errors",
        "registry",
        "system",
    },
    "rigs": {
        *("rigs", "recording", "signals", "arrays", "errors", "registry", "system"),
    },
    "export": {
        "export",
        "blocks",
        "arrays",
        "errors",
        "registry",
        "system",
    },
    "stream": {"stream", "blocks", "arrays", "errors"},
    "link": {"link", "export", "blocks", "arrays", "errors"},
    "control": {
        *("control", "blocks", "recording", "signals"),
        *("arrays", "errors", "registry", "numerals", "system"),
    },
    "environments": {
        *("environments", "control", "blocks", "rigs", "recording", "signals", "arrays", "errors"),
        "system",
    },
}
"""What some members may import and no more: a rig's physics knows nothing of models."""

MODULES = [path for path in sorted(SOURCE.rglob("*.py")) if path != SOURCE / "__init__.py"]


def member(path: Path) -> str:
    """Return the folder or file directly in the package that a module belongs to."""
    return path.relative_to(SOURCE).with_suffix("").parts[0]


def layer(name: str) -> int:
    for number, members in enumerate(LAYERS):
        if name in members:
            return number
    raise AssertionError(f"{name!r} is in no layer: add it to LAYERS where it belongs")


def imported(path: Path) -> Iterator[str]:
    """Give the members of the package that a module imports, wherever in its text."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative imports hide where they point"
            whole = node.module == "mckibben"
            found = [
                f"mckibben.{alias.name}" if whole else node.module or "" for alias in node.names
            ]
        else:
            continue
        for name in found:
            package, _, rest = name.partition(".")
            own = rest.partition(".")[0]
            if package == "mckibben" and own and own != "__version__":
                yield own


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(SOURCE)))
def test_imports_point_down(path: Path) -> None:
    own = member(path)
    upward = {name for name in imported(path) if layer(name) > layer(own)}
    assert not upward, f"{own} imports {upward} from above"
    if own in STANDS_ON:
        assert set(imported(path)) <= STANDS_ON[own]


def run(tree: ast.AST) -> Iterator[ast.AST]:
    """Give all that runs: what is imported for types alone does not."""
    for node in ast.iter_child_nodes(tree):
        if not (isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"):
            yield node
            yield from run(node)


def test_imports_go_round_in_no_circle() -> None:
    trees = {
        ".".join(path.relative_to(SOURCE.parent).with_suffix("").parts).removesuffix(
            ".__init__"
        ): ast.parse(path.read_text(encoding="utf-8"))
        for path in MODULES
    }
    graph: dict[str, set[str]] = {}
    for name, tree in trees.items():
        graph[name] = set()
        for node in run(tree):
            if isinstance(node, ast.Import):
                graph[name] |= {alias.name for alias in node.names} & trees.keys()
            elif isinstance(node, ast.ImportFrom):
                inner = {f"{node.module}.{alias.name}" for alias in node.names}
                graph[name] |= (inner | {str(node.module)}) & trees.keys()
                if inner <= trees.keys():  # modules of a package, which itself is not asked for
                    graph[name].discard(str(node.module))
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        pytest.fail(" -> ".join(error.args[1]))


def test_registry_names_modules_that_exist() -> None:
    from mckibben.registry import PLUGINS

    for group in PLUGINS.values():
        for found in group.values():
            location = found if isinstance(found, str) else found.location
            module, _, _ = location.partition(":")
            place = SOURCE.parent / module.replace(".", "/")
            assert place.with_suffix(".py").is_file() or (place / "__init__.py").is_file()
