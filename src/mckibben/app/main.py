"""The workbench as a server: one folder, one address, a header with tabs, and the pages."""

from __future__ import annotations

import asyncio
import os
import socket
import threading
import time
import warnings
import webbrowser
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

from nicegui import app, context, ui
from starlette.middleware.trustedhost import TrustedHostMiddleware

from mckibben.app import jobs, widgets
from mckibben.app.guard import HOSTS, MOST_HEAD_BYTES, Guard, Links
from mckibben.app.jobs import Jobs
from mckibben.app.pages import compensate, data, look, models, takeaway
from mckibben.app.state import State, view
from mckibben.app.workspace import Workspace
from mckibben.errors import DataError, MckibbenWarning

PAGES: dict[str, Any] = {
    "/": data,
    "/look": look,
    "/models": models,
    "/compensate": compensate,
    "/takeaway": takeaway,
}
"""In the order of tabs."""

HOST = HOSTS[0]

TICK = 0.3
"""How often jobs are asked how far they are [s]."""

IGNORE_UNDRAWN_PLOTS = """addEventListener("unhandledrejection", (event) => {
    if (`${event.reason}`.includes("displayed plot div")) event.preventDefault();
});"""
"""A page that is left before its plots are drawn: they are measured once more, in vain."""

RECONNECT_TIME = 30.0
"""How long a page that has lost the server is kept as it was [s]."""


def serve(
    folder: str | Path,
    *,
    port: int = 8750,
    show: bool = True,
    announce: Callable[[str], None] = lambda text: print(text, flush=True),
) -> None:
    """Serve the workbench over a folder on this machine until it is stopped.

    Parameters
    ----------
    folder : path
        Made where it is missing.
    port : int
        To listen on; 0 for any free one.
    show : bool
        Whether to open a browser.
    announce : callable
        Called with every one-time link, in words.
    """
    os.umask(0o077)  # what is written is its user's alone
    workspace = Workspace(folder)
    workspace.claim()
    port = _free(port)
    links = Links(f"http://{HOST}:{port}", lambda link: announce(f"Another browser: {link}"))
    state = State(workspace, Jobs(workspace))
    app.add_middleware(Guard, port=port, links=links)
    app.add_middleware(TrustedHostMiddleware, allowed_hosts=HOSTS)
    app.on_shutdown(state.jobs.close)
    app.timer(TICK, lambda: state.changed() if state.jobs.poll() else None)
    warnings.simplefilter("ignore", MckibbenWarning)  # pages show the notes of recordings

    @ui.page("/")
    @ui.page("/{_:path}")
    async def page() -> None:
        await asyncio.to_thread(state.settle)  # reads what is new, away from clicks
        build(state)

    def ready() -> None:
        """Say where it is once it listens, and load what the first job needs."""
        for _ in range(200):
            with suppress(OSError), socket.create_connection((HOST, port)):
                break
            time.sleep(0.05)
        announce(f"Workbench over {workspace.folder}: {links.link} (Ctrl-C ends it)")
        if show:
            webbrowser.open(links.link)
        jobs.warm()

    app.on_startup(lambda: threading.Thread(target=ready, daemon=True).start())
    with suppress(KeyboardInterrupt):
        ui.run(
            host=HOST,
            port=port,
            title="mckibben",
            show=False,
            reload=False,
            show_welcome_message=False,
            reconnect_timeout=RECONNECT_TIME,
            favicon="🦾",
            gzip_middleware_factory=None,
            http="h11",
            h11_max_incomplete_event_size=MOST_HEAD_BYTES,
        )


def build(state: State) -> None:
    """Build the frame of a window, and the page that its address names."""
    ui.add_css(widgets.style())
    ui.add_head_html(f"<script>{IGNORE_UNDRAWN_PLOTS}</script>")
    ui.dark_mode().bind_value_from(widgets.theme, "dark")
    router = context.client.sub_pages_router
    with ui.header().classes("bar"):
        ui.link("Skip to the content", "#content").classes("skip")
        ui.label("mckibben").classes("brand").props('role=heading aria-level="1"')
        with ui.element("nav").props('aria-label="Pages"'):
            tabs = {path: _tab(path, page) for path, page in PAGES.items()}
        ui.space()
        running(state)
        widgets.icon_button("contrast", "Light or dark", lambda: _switch(state))

    def choose(path: str) -> None:
        for page_path, tab in tabs.items():
            tab.classes(**{"add" if page_path == path.partition("?")[0] else "remove": "chosen"})

    router.on_path_changed(choose)
    choose(router.current_path)
    with ui.element("div").props('id=content tabindex="-1"'):
        ui.sub_pages({path: partial(page.build, state) for path, page in PAGES.items()})
    ui.timer(0.1, lambda: _prefer(state), once=True)


def _tab(path: str, page: Any) -> Any:
    with ui.link(target=path).classes("tab") as tab:
        ui.icon(page.ICON)
        ui.label(page.TITLE)
    return widgets.mark(tab, f"tab-{page.TITLE.split()[0].lower()}")


@view
def running(state: State) -> None:
    """Show how many jobs wait or run, on every page."""
    active = state.jobs.active()
    if active:
        waiting = sum(job.state == jobs.WAITING for job in active)
        text = f"{len(active) - waiting} running" + f", {waiting} waiting" * bool(waiting)
        ui.spinner(size="16px", color="currentColor")
        widgets.mark(ui.label(text).classes("muted"), "running").props("role=status")


def _switch(state: State) -> None:
    widgets.theme.dark, widgets.theme.known = not widgets.theme.dark, True
    state.changed()


async def _prefer(state: State) -> None:
    """Take the first browser's preference for light or dark."""
    if not widgets.theme.known:
        widgets.theme.known = True
        with suppress(TimeoutError):
            query = "matchMedia('(prefers-color-scheme: dark)').matches"
            if await ui.run_javascript(query, timeout=5.0):
                widgets.theme.dark = True
                state.changed()


def _free(port: int) -> int:
    """Return the port, or a free one for 0; `DataError` if it is taken."""
    try:
        with socket.socket() as trial:
            trial.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            trial.bind((HOST, port))
            return int(trial.getsockname()[1])
    except (OSError, OverflowError) as error:
        problem = f"port {port} cannot be listened on ({error})"
        raise DataError(problem, remedy="give another `port`, or close what uses it") from None
