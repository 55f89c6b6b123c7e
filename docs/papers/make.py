"""The papers' pages, from full runs: python docs/papers/make.py [PAPER ...].

Each page has an index of the paper (every system, equation, table and figure), and all tables and
figures with what is printed beside ours. A run that was stopped goes on from there.
"""

from __future__ import annotations

import sys
from datetime import UTC, datetime
from pathlib import Path

from matplotlib import rc_context
from PIL import Image

from mckibben import registry
from mckibben.checkpoints import Checkpoints
from mckibben.papers.experiment import Reproduction, reproduce
from mckibben.papers.paper import papers
from mckibben.report.printed import METADATA, STYLE, draw_figure
from mckibben.report.reproduction import drawing, markdown

HERE = Path(__file__).parent
HEAD = """# The five papers

Made by `python docs/papers/make.py`; do not edit. Each page begins with an index of the systems,
equations, tables and figures of the paper, followed by printed values next to those of a full run.
`mckibben reproduce NAME` repeats the experiments; `--data FOLDER` uses recordings of your own muscle.
`mckibben.papers.paper.printed(NAME)` returns models with the printed parameters.

What the first leaves open: [higher frequencies and loads](rates-and-loads.md), and
[several sections](two-sections.md).

| number | paper | question | with your muscle |
|---|---|---|---|"""

TUTORIALS = {
    "activation-pressure": "activation_pressure",
    "field-models": "field_models",
    "mpi-narmax": "own_load",
    "multistate-friction": "friction",
    "sdchm": "own_arm",
}

PICTURES = HERE.parent / "pictures" / "papers"
RESOLUTION, COLOURS = 130, 256
"""Dots per inch; in a picture, of a palette, which makes files a third of the size."""


def main() -> None:
    """Run the papers named, or all, and write their pages and the list of them."""
    (HERE / "README.md").write_text(listed(), encoding="utf-8")
    for name in sys.argv[1:] or registry.names("papers"):
        kept = HERE / "unfinished" / name
        found = reproduce(name, folder=kept, clear=False, progress=True)
        write(found)
        Checkpoints(kept).clear()


def listed() -> str:
    """Return the list of the papers, with their pages and what to do with one's own muscle."""
    rows = [
        f"| {each.number} | [{each.title}]({name}.md) | {each.question} "
        f"| [tutorial](../tutorials/{TUTORIALS[name]}.md) |"
        for name, each in papers().items()
    ]
    return "\n".join([HEAD, *rows]) + "\n"


def write(found: Reproduction) -> None:
    """Write the page of a re-run and its pictures."""
    folder = PICTURES / found.name
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.glob("*.png"):
        old.unlink()
    for figure in found.figures:
        file = folder / f"{figure.key}.png"
        with rc_context(dict(STYLE)):
            draw_figure(drawing(figure)).savefig(
                file, dpi=RESOLUTION, metadata=dict(METADATA["png"])
            )
        with Image.open(file) as whole:
            few = whole.convert("RGB").quantize(COLOURS, Image.Quantize.MAXCOVERAGE)
        few.save(file, optimize=True)
    date = datetime.now(UTC).date().isoformat()
    page = markdown(found, date, f"../pictures/papers/{found.name}")
    (HERE / f"{found.name}.md").write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
