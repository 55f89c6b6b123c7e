"""The workbench as a process: its folder, its address, and a browser that shows it."""

from __future__ import annotations

import contextlib
import os
import socket
import sys
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path
from typing import cast

from mckibben.app.door import door, knock
from mckibben.app.guard import checked_token, new_token
from mckibben.app.workspace import Workspace
from mckibben.errors import DataError

UNUSED = ("aiohttp", "requests", "tornado", "websocket")
"""Clients of the web, which the framework of the pages loads where it finds them: half a second."""


def _print(text: str) -> None:
    print(text, flush=True)


def serve(
    folder: str | Path,
    *,
    host: str = "127.0.0.1",
    port: int = 8750,
    show: bool = True,
    announce: Callable[[str], None] = _print,
) -> None:
    """Serve the workbench over a workspace until it is stopped.

    Parameters
    ----------
    folder : str or Path
        The workspace; made where it is missing. Where another workbench has it, it is shown, and
        nothing in it can be changed.
    host : str
        Address to listen on.
    port : int
        To listen on; 0 for any free one.
    show : bool
        Whether to open the page in a browser.
    announce : callable
        Told the address, with the token, when the server starts.

    Raises
    ------
    DataError
        If the workspace cannot be made, the port is taken, or the token could be guessed.
    """
    # in the environment, not among the arguments that every process list shows
    given = os.environ.get("MCKIBBEN_TOKEN")
    token = new_token() if given is None else checked_token(given)
    os.umask(0o077)  # what is written is its user's alone
    workspace = Workspace(folder)
    port = _free(host, port)
    workspace.claim()
    address = f"http://{_shown(host)}:{port}/{token}/"
    told = f"Workbench over {workspace.folder}: {address} (Ctrl-C ends it)"
    if workspace.read_only:
        told += f"\nNothing can be changed here: {workspace.read_only}."
    with contextlib.suppress(KeyboardInterrupt), door(workspace.folder, port, address) as page:
        if show and page is not None:
            knock(page)  # a browser takes its time too
        with _without(*UNUSED):
            site = import_module("mckibben.app.site")
        site.run(workspace, host=host, port=port, token=token, started=lambda: announce(told))


@contextlib.contextmanager
def _without(*names: str) -> Iterator[None]:
    """Let modules be loaded as if others, which they can do without, were not installed."""
    modules = cast("dict[str, object]", sys.modules)
    hidden = [name for name in names if name not in modules]
    modules.update(dict.fromkeys(hidden))
    try:
        yield
    finally:
        for name in hidden:
            del modules[name]


def _shown(host: str) -> str:
    """Return a host as an address names it."""
    named = {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(host, host)
    return f"[{named}]" if ":" in named else named


def _free(host: str, port: int) -> int:
    """Return the port, or a free one for 0, after checking that it can be listened on."""
    try:
        with socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET) as trial:
            trial.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            trial.bind((host, port))
            return int(trial.getsockname()[1])
    except (OSError, OverflowError) as error:
        reason = getattr(error, "strerror", None) or error
        raise DataError(
            f"{host}:{port} cannot be listened on ({reason})",
            remedy="give another `port`, or close the other workbench",
        ) from None
