"""The pages of a workbench, served to whoever has its token."""

from __future__ import annotations

import asyncio
import logging
import threading
from collections.abc import Callable

from nicegui import Client, app, ui
from starlette.middleware.gzip import GZipMiddleware
from starlette.responses import Response

from mckibben.app.guard import LOCAL, Guard
from mckibben.app.jobs import Jobs
from mckibben.app.shell import TICK, build, load_the_rest, page_module
from mckibben.app.workspace import Workspace
from mckibben.errors import MckibbenError

PATIENCE = 600.0
"""For what a page shows to be read, the first time [s]."""

UNOPENED = 16
"""Pages that were asked for and have not been opened; older ones are let go."""

ABSENCE = 30.0
"""For which a page that has lost the server is kept as it was [s]; on a busy machine seconds pass."""

IDLE = 0.3
"""After the first page is shown, when to load what the others need [s]."""


def run(
    workspace: Workspace, *, host: str, port: int, token: str, started: Callable[[], None]
) -> None:
    """Serve the pages until the process is interrupted.

    Parameters
    ----------
    workspace : Workspace
        Claimed, or to be shown alone.
    host, port : str, int
        To listen on.
    token : str
        To demand.
    started : callable
        Called when the server listens.
    """
    jobs = Jobs(workspace)
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

    def spend() -> None:
        """Use the time of who looks at the first page."""
        if not idle.is_alive() and not idle.finished.is_set():
            idle.start()

    @ui.page("/", title="mckibben", response_timeout=PATIENCE)
    async def page() -> None:
        _make_room()
        await asyncio.to_thread(workspace.warm)
        build(workspace, jobs)
        ui.context.client.on_connect(spend)

    @app.get("/awake")
    async def awake() -> Response:
        """Answer as soon as clicks are answered; see the page's script."""
        return Response(status_code=204)

    page_module("Data")  # which is the first to be seen
    app.on_startup(started)
    ui.run(
        host=host,
        port=port,
        title="mckibben",
        show=False,
        reload=False,
        show_welcome_message=False,
        reconnect_timeout=ABSENCE,
        favicon="🦾",
        gzip_middleware_factory=None if host in LOCAL else GZipMiddleware,  # which only takes time
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
