"""The picture in architecture.md: the package's rooms on floors, as the code's own imports stack them.

    python docs/architecture.py docs/pictures/architecture.png

A room stands above every room that it imports.  A circle of rooms has no floors and ends the script.
"""

from __future__ import annotations

import ast
import graphlib
import sys
import textwrap
from collections.abc import Iterator
from pathlib import Path

import matplotlib.pyplot as plt
from matplotlib.patches import FancyBboxPatch

SOURCE = Path(__file__).parent.parent / "src" / "mckibben"
GROUND = "foundation"
"""The name under which the modules of the top folder that are no rooms of their own are drawn."""

ABOVE = ("environments", "outputs")
"""Modules of the top folder that stand on rooms."""

ROOMS = sorted({*(path.parent.name for path in SOURCE.glob("*/__init__.py")), *ABOVE})
WIDTH, HEIGHT = 30.0, 3.6
"""Of the house, and of a floor."""


def module(room: str) -> Path:
    """Give the file that says what a room is."""
    return SOURCE / f"{room}.py" if room in ABOVE else SOURCE / room / "__init__.py"


def room_of(module: str) -> str:
    """Give the room of a dotted name below the package."""
    first = module.split(".")[0]
    return first if first in ROOMS else GROUND


def imported(tree: ast.Module) -> Iterator[str]:
    """Give what a module imports of the package, names below it."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module == "mckibben":
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and (node.module or "").startswith("mckibben."):
            yield str(node.module).removeprefix("mckibben.")
        elif isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
            yield from (name[9:] for name in names if name.startswith("mckibben."))


def imports() -> dict[str, set[str]]:
    """Give the rooms that each room imports; the foundation counts below all."""
    found = {room: {GROUND} for room in ROOMS}
    for room in ROOMS:
        for path in (SOURCE / room).rglob("*.py") if room not in ABOVE else [module(room)]:
            names = imported(ast.parse(path.read_text(encoding="utf-8")))
            found[room] |= {room_of(name) for name in names}
        found[room].discard(room)
    return found


def floors(found: dict[str, set[str]]) -> dict[str, int]:
    """Give the floor of every room: one above the highest that it imports."""
    floor: dict[str, int] = {}
    for room in graphlib.TopologicalSorter(found).static_order():
        floor[room] = 1 + max((floor[below] for below in found.get(room, ())), default=-1)
    return floor


def subject(room: str) -> str:
    """Give the first sentence of a room's docstring."""
    if room == GROUND:
        return "recording, registry, metrics, errors, numerals"
    tree = ast.parse(module(room).read_text(encoding="utf-8"))
    return (ast.get_docstring(tree) or "").splitlines()[0].rstrip(".")


def draw(target: str) -> None:
    """Draw all rooms on their floors."""
    found = imports()
    floor = floors(found)
    levels: list[list[str]] = [[] for _ in range(max(floor.values()) + 1)]
    for room in sorted(floor):
        levels[floor[room]].append(room)
    figure, axes = plt.subplots(figsize=(14, 1.5 * len(levels)))
    for level, rooms in enumerate(levels):
        width = WIDTH / len(rooms)
        for place, room in enumerate(rooms):
            left, bottom = place * width + 0.1, level * HEIGHT
            box = FancyBboxPatch(
                (left, bottom),
                width - 0.2,
                HEIGHT - 0.3,
                boxstyle="round,pad=0,rounding_size=0.3",
                facecolor="#eef3f8" if room != GROUND else "#f4f1ea",
                edgecolor="#5b7690",
            )
            axes.add_patch(box)
            middle = left + width / 2 - 0.1
            axes.text(
                middle, bottom + 2.95, room, ha="center", va="center", weight="bold", size=10.5
            )
            words = textwrap.fill(subject(room), int(width * 4.4))
            axes.text(middle, bottom + 1.35, words, ha="center", va="center", size=9)
    axes.set_xlim(0, WIDTH)
    axes.set_ylim(-0.2, HEIGHT * len(levels))
    axes.axis("off")
    figure.savefig(target, bbox_inches="tight")


if __name__ == "__main__":
    draw(sys.argv[1])
