"""Draw the figure of architecture.md: folders and modules of the package in layers.

    python docs/architecture.py docs/pictures/architecture.png

The layers are those of tests/contracts/test_imports.py, which checks that imports point downwards.
"""

from __future__ import annotations

import ast
import sys
import textwrap
from pathlib import Path

import matplotlib.pyplot as plt
from matplotlib.patches import FancyBboxPatch

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

from tests.contracts.test_imports import LAYERS  # noqa: E402

WIDTH, CHARACTERS = 30.0, 150
"""Width of a layer, in units of its height and in characters of small text."""


def subject(name: str) -> str:
    """Return the first line of a module's docstring."""
    path = ROOT / "src" / "mckibben" / name
    path = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
    text = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
    return text.splitlines()[0].rstrip(".")


def draw(target: str) -> None:
    """Draw all layers."""
    layers = [sorted(layer - {"__main__", "version"}) for layer in LAYERS]
    layers = [layer for layer in layers if layer]
    figure, axes = plt.subplots(figsize=(12, 0.56 * len(layers)))
    for level, names in enumerate(layers):
        width = WIDTH / len(names)
        for place, name in enumerate(names):
            box = FancyBboxPatch(
                (place * width + 0.1, level),
                width - 0.2,
                0.85,
                boxstyle="round,pad=0,rounding_size=0.1",
                facecolor="#eef3f8",
                edgecolor="#5b7690",
            )
            axes.add_patch(box)
            middle = (place + 0.5) * width
            about = textwrap.shorten(subject(name), CHARACTERS // len(names), placeholder=" …")
            shown = len(names) <= 2
            axes.text(middle, level + (0.6 if shown else 0.42), name, ha="center", va="center",
                      weight="bold", size=9)  # fmt: skip
            if shown:
                axes.text(middle, level + 0.24, about, ha="center", va="center", size=7.5)
    axes.set_xlim(0, WIDTH)
    axes.set_ylim(-0.1, len(layers))
    axes.axis("off")
    figure.savefig(target, bbox_inches="tight")


if __name__ == "__main__":
    draw(sys.argv[1])
