"""The page, and the server that serves it to this machine."""

from __future__ import annotations

import contextlib
import socket
import threading
from collections.abc import Callable
from importlib import import_module
from pathlib import Path

from nicegui import app, ui

from mckibben import registry
from mckibben.app.desk import Desk, named
from mckibben.app.guard import LOCAL, Guard, new_token
from mckibben.app.jobs import Job, Jobs
from mckibben.app.workspace import Workspace
from mckibben.errors import DataError
from mckibben.workers import PRELOADED

PAGES = {
    "Data": ("folder_open", "data"),
    "Look": ("timeline", "look"),
    "Models": ("leaderboard", "models"),
    "Compensate": ("sync_alt", "compensate"),
    "Take away": ("download", "takeaway"),
}
"""Icon and module of each page; a module is loaded when its page is opened, or nothing else is to do."""

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
    panels = ui.tab_panels(tabs, value=tab["Data"], animated=False)
    with panels.classes("w-full bg-transparent"):
        built: set[str] = set()
        holders = {}
        for name in PAGES:
            with ui.tab_panel(tab[name]).classes("p-2"):
                holders[name] = ui.column().classes("w-full")
    _fill(desk, "Data", holders, built)
    panels.on_value_change(lambda event: _fill(desk, str(event.value), holders, built))
    _log(desk)
    ends = {name: job.state for name, job in jobs.jobs.items()}
    told: dict[str, int] = {}

    def tick() -> None:
        active = jobs.active()
        busy.set_text(f"{len(active)} job(s)" if active else "")
        moved = False
        for name, job in list(jobs.jobs.items()):
            lines = len(jobs.progress(name)) if job.state == "running" else 0
            if ends.get(name) != job.state:
                ends[name] = job.state
                moved = True
                if job.state in ("done", "failed", "cancelled"):
                    _say(job)
                    desk.changed(TOPICS.get(job.kind, "jobs"), "log")
                    if job.kind == "record":
                        desk.changed("channels")
            elif lines != told.get(name):
                moved = True
            told[name] = lines
        if moved:
            desk.changed("jobs")

    async def match() -> None:
        """Draw figures for the theme that the browser has chosen."""
        query = "window.matchMedia('(prefers-color-scheme: dark)').matches"
        desk.dark = bool(await ui.run_javascript(query, timeout=5.0))
        dark.set_value(desk.dark)
        if desk.dark:
            desk.changed("theme")

    ui.timer(0.1, match, once=True)
    ui.timer(TICK, tick)


def _say(job: Job) -> None:
    text = f"{job.title}: {job.state}. {job.message}"[:300]
    if job.state == "failed":
        ui.notify(text, type="negative", multi_line=True, timeout=10_000)
    else:
        ui.notify(text, type="info")


def _switch(desk: Desk, dark: ui.dark_mode) -> None:
    desk.dark = not desk.dark
    dark.set_value(desk.dark)
    desk.changed("theme")


def _fill(desk: Desk, name: str, holders: dict[str, ui.column], built: set[str]) -> None:
    """Build a page when it is first opened."""
    if name in PAGES and name not in built:
        built.add(name)
        with holders[name]:
            import_module(f"mckibben.app.pages.{PAGES[name][1]}").build(desk)


def _log(desk: Desk) -> None:
    """Show the calls behind the clicks, newest first."""
    with named(ui.expansion("What was done, as calls").classes("w-full"), "log"):

        @ui.refreshable
        def shown() -> None:
            lines = [entry for entry in desk.workspace.logged() if entry.get("call")][-12:]
            if not lines:
                ui.label("Nothing yet.").classes("opacity-70")
            text = "\n".join(f"# {entry['did']}\n{entry['call']}" for entry in reversed(lines))
            if text:
                ui.code(text, language="python").classes("w-full")

        desk.when("log", shown.refresh)
        shown()


def _load_the_rest() -> None:
    """Load what all pages need, in a thread, so that opening one does not wait for it."""
    for _, module in PAGES.values():
        import_module(f"mckibben.app.pages.{module}")
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
        The workspace; made where it is missing.
    host : str
        Address to listen on; any but this machine's own demands a token.
    port : int
        To listen on; 0 for any free one.
    token : str, optional
        To demand; default a new one where the host is not this machine alone, else none.
    show : bool
        Whether to open the page in a browser.
    announce : callable
        Told the address when the server starts.

    Raises
    ------
    DataError
        If the workspace cannot be made, or the port is taken.
    """
    workspace = Workspace(folder)
    jobs = Jobs(workspace)
    port = _free(host, port)
    if token is None and host not in LOCAL:
        token = new_token()
    address = f"http://{'127.0.0.1' if host == '0.0.0.0' else host}:{port}/"
    address += f"?token={token}" if token else ""
    app.add_middleware(Guard, host=host, token=token)
    app.on_shutdown(jobs.close)
    app.timer(TICK, jobs.poll)  # whether or not a page is open

    idle = threading.Timer(IDLE, _load_the_rest)
    idle.daemon = True

    @ui.page("/", title="mckibben")
    def page() -> None:
        build(workspace, jobs)
        if not idle.is_alive() and not idle.finished.is_set():
            idle.start()

    told = f"Workbench over {workspace.folder}: {address} (Ctrl-C ends it)"
    app.on_startup(lambda: announce(told))
    with contextlib.suppress(KeyboardInterrupt):
        ui.run(
            host=host,
            port=port,
            title="mckibben",
            show=address if show else False,
            reload=False,
            show_welcome_message=False,
            favicon="🦾",
        )


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
