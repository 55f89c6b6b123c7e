"""The page, and the server that serves it to this machine."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import socket
import threading
import webbrowser
from collections.abc import Callable, Iterator
from pathlib import Path

from nicegui import Client, app, ui
from starlette.responses import Response

from mckibben.app.claim import keep_to_the_user
from mckibben.app.guard import Guard, checked_token, new_token
from mckibben.app.jobs import Jobs
from mckibben.app.shell import TICK, build, load_the_rest
from mckibben.app.workspace import Workspace
from mckibben.errors import DataError, MckibbenError
from mckibben.system.atomic import write_text

PATIENCE = 600.0
"""For what a page shows to be read, the first time [s]."""

UNOPENED = 16
"""Pages that were asked for and have not been opened; older ones are let go."""

ABSENCE = 30.0
"""For which a page that has lost the server is kept as it was [s]; on a busy machine seconds pass."""

OPENING = 0.5
"""After the server has started, when to open a browser [s]."""

IDLE = 0.3
"""After the first page is there, when to load what the others need [s]."""


def _print(text: str) -> None:
    print(text, flush=True)


def serve(
    folder: str | Path,
    *,
    host: str = "127.0.0.1",
    port: int = 8750,
    token: str | None = None,
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
    token : str, optional
        To demand of whoever connects, from this machine too; default a new one.
    show : bool
        Whether to open the page in a browser.
    announce : callable
        Told the address, with the token, when the server starts.

    Raises
    ------
    DataError
        If the workspace cannot be made, the port is taken, or the token could be guessed.
    """
    token = new_token() if token is None else checked_token(token)
    keep_to_the_user()
    workspace = Workspace(folder)
    port = _free(host, port)
    workspace.claim()
    jobs = Jobs(workspace)
    address = f"http://{_shown(host)}:{port}/{token}/"
    app.add_middleware(Guard, host=host, token=token)
    app.on_shutdown(jobs.close)
    app.timer(TICK, jobs.poll)  # whether or not a page is open

    # what a page tells a person with its remedy is no news for the terminal
    logging.getLogger("nicegui").addFilter(_unforeseen)

    def prepare() -> None:
        load_the_rest()
        jobs.warm()

    idle = threading.Timer(IDLE, prepare)
    idle.daemon = True

    @ui.page("/", title="mckibben", response_timeout=PATIENCE)
    async def page() -> None:
        _make_room()
        await asyncio.to_thread(workspace.warm)
        build(workspace, jobs)
        if not idle.is_alive() and not idle.finished.is_set():
            idle.start()

    @app.get("/awake")
    async def awake() -> Response:
        """Answer as soon as clicks are answered; see the page's script."""
        return Response(status_code=204)

    told = f"Workbench over {workspace.folder}: {address} (Ctrl-C ends it)"
    if workspace.read_only:
        told += f"\nNothing can be changed here: {workspace.read_only}."
    app.on_startup(lambda: announce(told))
    with contextlib.suppress(KeyboardInterrupt), _door(workspace, port, address) as door:
        if show and door is not None:
            app.timer(OPENING, lambda: _open(door), once=True, immediate=False)
        ui.run(
            host=host,
            port=port,
            title="mckibben",
            show=False,
            reload=False,
            show_welcome_message=False,
            reconnect_timeout=ABSENCE,
            favicon="🦾",
        )


def _unforeseen(record: logging.LogRecord) -> bool:
    """Tell whether what is logged is no error of ours."""
    error = record.exc_info[1] if record.exc_info else record.msg
    return not isinstance(error, MckibbenError)


def _make_room() -> None:
    """Let go of pages that were asked for and never opened, beyond some; each takes memory."""
    own = ui.context.client
    waiting = [
        client
        for client in Client.instances.values()
        if client is not own and not client.has_socket_connection
    ]
    for client in sorted(waiting, key=lambda client: client.created)[:-UNOPENED]:
        client.delete()


def _shown(host: str) -> str:
    """Return a host as an address names it."""
    named = {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(host, host)
    return f"[{named}]" if ":" in named else named


@contextlib.contextmanager
def _door(workspace: Workspace, port: int, address: str) -> Iterator[Path | None]:
    """Make a page in the workspace that leads to the workbench, as long as that is there.

    The address must not stand in the command that starts a browser: every user of this machine may
    read that.
    """
    path = workspace.folder / f".open-{port}.html"
    try:
        write_text(path, f'<meta http-equiv="refresh" content="0;url={address}">')
    except MckibbenError:  # of a folder that may only be read
        yield None
        return
    try:
        yield path
    finally:
        path.unlink(missing_ok=True)


def _open(door: Path) -> None:
    threading.Thread(target=webbrowser.open, args=(door.as_uri(),), daemon=True).start()


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
            remedy="give another --port, or close the other workbench",
        ) from None
