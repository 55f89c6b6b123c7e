"""The page that a browser shows while the workbench starts, and that leads to it.

The address holds the token and must not stand in the command that starts a browser, which every user of
this machine may read: it stands in a file of the workspace, which is the user's alone.
"""

from __future__ import annotations

import contextlib
import json
import threading
import webbrowser
from collections.abc import Iterator
from html import escape
from pathlib import Path

from mckibben.errors import MckibbenError
from mckibben.system.atomic import write_text

PAGE = """<!doctype html>
<html lang="en">
<meta charset="utf-8">
<meta name="viewport" content="width=device-width">
<meta name="color-scheme" content="light dark">
<title>mckibben</title>
<style>body {{ font: 1rem/1.5 sans-serif; max-width: 40rem; margin: 20vh auto; padding: 0 1rem }}</style>
<p role="status">The workbench over <b>{folder}</b> is starting …</p>
<p><a href="{link}">Open it</a> if this page stays.</p>
<script>
  const there = {address}, until = Date.now() + {patience};
  const enter = () => location.replace(there);
  const look = () => fetch(there + "awake", {{mode: "no-cors", cache: "no-store"}})
    .then(enter, () => Date.now() > until ? enter() : setTimeout(look, 100));
  look();
</script>
</html>
"""

PATIENCE = 20.0
"""For the server to be heard, after which the page goes there all the same [s]."""


@contextlib.contextmanager
def door(folder: Path, port: int, address: str) -> Iterator[Path | None]:
    """Keep the page in a workspace; None of a folder that may only be read.

    Parameters
    ----------
    folder : Path
        The workspace.
    port : int
        Of the server.
    address : str
        To lead to, with the token.
    """
    path = folder / f".open-{port}.html"
    page = PAGE.format(
        folder=escape(str(folder)),
        link=escape(address),
        address=json.dumps(address).replace("<", "\\u003c"),
        patience=round(1e3 * PATIENCE),
    )
    try:
        write_text(path, page)
    except MckibbenError:
        yield None
        return
    try:
        yield path
    finally:
        path.unlink(missing_ok=True)


def knock(path: Path) -> None:
    """Open the page in the user's browser, without waiting for that."""
    threading.Thread(target=webbrowser.open, args=(path.as_uri(),), daemon=True).start()
