"""Convert each tutorial in docs/tutorials to a notebook.

python docs/notebooks.py -o notebooks
"""

from __future__ import annotations

import argparse
import json
import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from mckibben.system.atomic import replacing

PAGES = Path(__file__).parent / "tutorials"

FENCE = re.compile(r"^```(bash|python)\n(.*?)^```\n", flags=re.M | re.S)
"""A block that is run; others, such as C code or output, remain text."""

LINK = re.compile(r"(\]\()(?!https?:|#)([^)\s#]+)")

EXAMPLES = "!mckibben example  # the recordings that follow, into ./examples"


def pages() -> list[Path]:
    """Return the tutorials."""
    return sorted(PAGES.glob("*.md"))


def cells(page: Path) -> Iterator[tuple[str, str]]:
    """Yield the cells of a tutorial: ``"markdown"`` or ``"code"``, and the text."""
    text = page.read_text(encoding="utf-8")
    begun = "examples/" not in text
    end = 0
    for block in FENCE.finditer(text):
        yield "markdown", text[end : block.start()].strip()
        if not begun:
            yield "code", EXAMPLES
            begun = True
        language, body = block.groups()
        lines = body.strip()
        if language == "bash":
            lines = re.sub(r"^(?=\S)", "!", lines.replace("\\\n", " "), flags=re.M)
        yield "code", lines
        end = block.end()
    yield "markdown", text[end:].strip()


def notebook(page: Path, folder: Path) -> dict[str, Any]:
    """Return a tutorial as a notebook for a folder, with adjusted links."""

    def led(found: re.Match[str]) -> str:
        target = os.path.relpath((page.parent / found[2]).resolve(), folder.resolve())
        return found[1] + Path(target).as_posix()

    made: list[dict[str, Any]] = []
    for kind, text in cells(page):
        if not text:
            continue
        text = LINK.sub(led, text) if kind == "markdown" else text
        cell = {"cell_type": kind, "id": f"{page.stem}-{len(made)}", "metadata": {}}
        made.append(cell | {"source": text.splitlines(keepends=True)})
        if kind == "code":
            made[-1] |= {"execution_count": None, "outputs": []}
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    about = {"kernelspec": kernel, "language_info": {"name": "python"}}
    return {"cells": made, "metadata": about, "nbformat": 4, "nbformat_minor": 5}


def write(folder: Path) -> list[Path]:
    """Write all notebooks into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for page in pages():
        path = folder / f"{page.stem}.ipynb"
        with replacing(path) as new:
            text = json.dumps(notebook(page, folder), indent=1, ensure_ascii=False)
            new.write_text(text + "\n", encoding="utf-8")
        written.append(path)
    return written


def main() -> None:
    """Write the notebooks."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("-o", "--out", type=Path, default=Path("notebooks"), help="folder")
    folder = parser.parse_args().out
    print(f"Written: {len(write(folder))} notebooks to {folder}. Next: jupyter lab {folder}")


if __name__ == "__main__":
    main()
