"""The page, and the server that serves it to this machine."""

from __future__ import annotations

import asyncio
import contextlib
import socket
import sys
import threading
import webbrowser
from collections.abc import Awaitable, Callable, Iterator
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

from nicegui import Client, app, ui

from mckibben import registry
from mckibben.app.claim import keep_to_the_user
from mckibben.app.desk import Desk, code, named, tell, unexpected
from mckibben.app.guard import Guard, checked_token, new_token
from mckibben.app.jobs import Job, Jobs
from mckibben.app.workspace import Workspace
from mckibben.errors import DataError, MckibbenError
from mckibben.system.atomic import write_text
from mckibben.system.workers import PRELOADED

PAGES = {
    "Data": ("folder_open", "data"),
    "Look": ("timeline", "look"),
    "Models": ("leaderboard", "models"),
    "Compensate": ("sync_alt", "compensate"),
    "Take away": ("download", "takeaway"),
}
"""Icon and module of each page; a module is loaded when its page is opened, or nothing else is to do."""

PATIENCE = 600.0
"""For what a page shows to be read, the first time [s]."""

UNOPENED = 16
"""Pages that were asked for and have not been opened; older ones are let go."""

ABSENCE = 30.0
"""For which a page that has lost the server is kept as it was [s]; on a busy machine seconds pass."""

OPENING = 0.5
"""After the server has started, when to open a browser [s]."""

IDLE = 1.0
"""After the first page is there, when to load what the others need [s]."""

HEAD = """
<style>:focus-visible { outline: 2px solid #56b4e9; outline-offset: 2px }</style>
<script>
  // a figure on a page that is not shown cannot be resized, and need not be
  addEventListener("unhandledrejection", (event) => {
    if (String(event.reason).includes("displayed plot div")) event.preventDefault();
  });
</script>
"""

TICK = 0.4
"""How often a page looks how its jobs do [s]."""

TOPICS = {"fit": "results", "loop": "runs", "record": "recordings", "report": "jobs"}
"""What changes when a job of a kind has ended."""


def build(workspace: Workspace, jobs: Jobs) -> None:
    """Build one page for one browser."""
    ui.on_exception(unexpected)
    desk = Desk(workspace, jobs)
    desk.settle_channels()
    dark = ui.dark_mode(None)
    ui.add_head_html(HEAD)
    with ui.header().classes("items-center gap-2 py-1"):
        ui.label("mckibben").classes("text-lg font-medium")
        with ui.tabs().props("dense inline-label outside-arrows mobile-arrows") as tabs:
            tab = {
                name: named(ui.tab(name, icon=icon), f"tab-{name.split()[0].lower()}")
                for name, (icon, _) in PAGES.items()
            }
        ui.space()
        busy = named(ui.label("").classes("text-xs"), "busy")
        ui.button(icon="contrast", on_click=lambda: _switch(desk, dark)).props(
            'flat dense color=white aria-label="Light or dark"'
        )
    if workspace.read_only:
        text = f"Nothing can be changed here: {workspace.read_only}."
        named(ui.label(text).classes("w-full text-center bg-warning text-black"), "read-only")
    panels = ui.tab_panels(tabs, value=tab["Data"], animated=False)
    with panels.classes("w-full bg-transparent"):
        built: set[str] = set()
        holders = {}
        for name in PAGES:
            with ui.tab_panel(tab[name]).classes("p-2"):
                holders[name] = ui.column().classes("w-full")
    built.add("Data")
    with holders["Data"]:
        _module("Data").build(desk)

    def opened(event: Any) -> Awaitable[None] | None:
        """Build a page when it is first opened: at once, where its module is there."""
        name = str(event.value)
        if name not in PAGES or name in built:
            return None
        built.add(name)
        if not hasattr(sys.modules.get(_place(name)), "build"):
            return load(name)
        with holders[name]:
            _module(name).build(desk)
        return None

    async def load(name: str) -> None:
        module = await asyncio.to_thread(_module, name)
        with holders[name]:
            module.build(desk)

    panels.on_value_change(opened)
    _log(desk)
    ends = {name: job.state for name, job in jobs.jobs.items()}
    told: dict[str, int] = {}

    async def tick() -> None:
        while jobs.untold:
            tell(jobs.untold.pop(0))
        active = jobs.active()
        busy.set_text(f"{len(active)} job(s)" if active else "")
        moved, ended = False, []
        for name, job in list(jobs.jobs.items()):
            lines = len(jobs.progress(name)) if job.state == "running" else 0
            if ends.get(name) != job.state:
                ends[name] = job.state
                moved = True
                if job.state in ("done", "failed", "cancelled"):
                    ended.append(job)
            elif lines != told.get(name):
                moved = True
            told[name] = lines
        if ended:
            await asyncio.to_thread(workspace.warm)
        for job in ended:
            _say(job)
            desk.changed(TOPICS.get(job.kind, "jobs"), "log")
            if job.kind == "record":
                desk.changed("channels")
        if moved:
            desk.changed("jobs")

    async def match() -> None:
        """Draw figures for the theme that the browser has chosen."""
        query = "window.matchMedia('(prefers-color-scheme: dark)').matches"
        with contextlib.suppress(TimeoutError):  # of a browser that is busy: it stays light
            desk.dark = bool(await ui.run_javascript(query, timeout=5.0))
        dark.set_value(desk.dark)
        if desk.dark:
            desk.changed("theme")

    ui.timer(0.1, match, once=True)
    ui.timer(TICK, tick)


def _say(job: Job) -> None:
    text = f"{job.title:.80}: {job.state}. {job.message}"[:300]
    if job.state == "failed":
        ui.notify(text, type="negative", multi_line=True, timeout=10_000)
    else:
        ui.notify(text, type="info")


def _switch(desk: Desk, dark: ui.dark_mode) -> None:
    desk.dark = not desk.dark
    dark.set_value(desk.dark)
    desk.changed("theme")


def _module(name: str) -> ModuleType:
    return import_module(_place(name))


def _place(name: str) -> str:
    return f"mckibben.app.pages.{PAGES[name][1]}"


def _log(desk: Desk) -> None:
    """Show the calls behind the clicks, newest first."""
    with named(ui.expansion("What was done, as calls").classes("w-full"), "log"):

        @ui.refreshable
        def shown() -> None:
            lines = [entry for entry in desk.workspace.logged() if entry["call"]][-12:]
            if not lines:
                ui.label("Nothing yet.").classes("opacity-70")
            else:
                code("\n".join(f"# {entry['did']}\n{entry['call']}" for entry in reversed(lines)))

        desk.when("log", shown.refresh)
        shown()


def _load_the_rest() -> None:
    """Load what all pages need, in a thread, so that opening one does not wait for it."""
    for name in PAGES:
        _module(name)
    for module in (*PRELOADED, "mckibben.app.work"):
        import_module(module)
    for name in registry.names("estimators"):
        registry.load("estimators", name)


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

    idle = threading.Timer(IDLE, _load_the_rest)
    idle.daemon = True

    @ui.page("/", title="mckibben", response_timeout=PATIENCE)
    async def page() -> None:
        _make_room()
        await asyncio.to_thread(workspace.warm)
        build(workspace, jobs)
        if not idle.is_alive() and not idle.finished.is_set():
            idle.start()

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
