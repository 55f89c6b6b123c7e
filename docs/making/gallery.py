"""The gallery: every script with its figure."""

from __future__ import annotations

import hashlib
import runpy
import sys
from pathlib import Path

from making.pages import DOCS, MADE, write


def write_gallery() -> None:
    """Run every changed script of the gallery, and write the page of figures and scripts."""
    lines = [
        "# Gallery",
        "",
        "Each figure is drawn by the script below it, in `docs/gallery`.",
        "",
    ]
    for script in sorted((DOCS / "gallery").glob("*.py")):
        picture = MADE / "gallery" / f"{script.stem}.png"
        text = script.read_text(encoding="utf-8")
        drawn(script, text, picture)
        title = text.splitlines()[0].strip('"').rstrip(".")
        lines += [f"## {title}", "", f"![{title}](gallery/{picture.name})", ""]
        lines += ["```python", text.rstrip(), "```", ""]
    write(MADE / "gallery.md", "\n".join(lines))


def drawn(script: Path, text: str, picture: Path) -> None:
    """Draw a script's figure, unless it exists for the same script."""
    picture.parent.mkdir(parents=True, exist_ok=True)
    stamp = picture.with_suffix(".stamp")
    token = hashlib.sha256(text.encode()).hexdigest()
    if picture.is_file() and stamp.is_file() and stamp.read_text() == token:
        return
    kept, sys.argv = sys.argv, [str(script), str(picture)]
    try:
        runpy.run_path(str(script), run_name="__main__")
    finally:
        sys.argv = kept
    stamp.write_text(token)
