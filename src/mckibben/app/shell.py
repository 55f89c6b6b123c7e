"""The frame of every page: the header with its tabs, what runs, and the theme."""

from __future__ import annotations

import asyncio
import contextlib
import json
import sys
import threading
from importlib import import_module
from types import ModuleType
from typing import Any
from urllib.parse import urlencode

from nicegui import context, ui

from mckibben import registry
from mckibben.app import busy, fields, theme
from mckibben.app.desk import Desk, code, hinted, labelled, named, tell, told, unexpected
from mckibben.app.fields import shortened
from mckibben.app.jobs import DONE, ENDED, RUNNING, Job, Jobs
from mckibben.app.workspace import Workspace
from mckibben.system.workers import PRELOADED

PAGES = {
    "Data": ("folder_open", "data"),
    "Look": ("timeline", "look"),
    "Models": ("leaderboard", "models"),
    "Compensate": ("sync_alt", "compensate"),
    "Take away": ("download", "takeaway"),
}
"""Icon and module of each page; a module is loaded when its page is opened, or nothing else is to do."""

TAB = "tab"
"""What the open page is called in the address, so that it stays when that is loaded again."""

TICK = 0.4
"""How often a page looks how its jobs do [s]."""

SENT = 0.03
"""For the browser to be told that a tab was opened, before what is on it is made [s]."""

TOPICS = {"fit": "results", "loop": "runs", "record": "recordings", "report": "jobs"}
"""What changes when a job of a kind has ended."""

WORDS = {"fit": "Fitting", "loop": "Running", "record": "Recording", "report": "Writing the"}
"""What a job of a kind does."""

_LOADING = threading.RLock()


class Steps(ui.tabs):
    """Tabs that move when they are clicked, not when the server has answered.

    Otherwise a click back, on a busy machine, would be one on the tab still shown: none at all.
    """

    LOOPBACK = False

    def __init__(self) -> None:
        super().__init__()
        # what stands there by then is a list of the value, which is no tab's name
        self.on("update:model-value", js_handler=SELECTED)


def build(workspace: Workspace, jobs: Jobs) -> Desk:
    """Build one page for one browser."""
    ui.on_exception(unexpected)
    desk = Desk(workspace, jobs)
    desk.news.client, desk.news.told = context.client, unexpected
    context.client.on_delete(desk.close)
    desk.settle_channels()
    dark = ui.dark_mode(None)
    ui.add_head_html(f"<style>{theme.style()}</style><script>{theme.SCRIPT}</script>")
    ui.element("div").props('id=asked role=presentation aria-hidden="true"')
    tabs, tab = _header(desk, dark)
    if workspace.read_only:
        text = f"Nothing can be changed here: {workspace.read_only}."
        named(ui.label(text).classes("w-full text-center bg-warning"), "read-only")
    with ui.element("div").props('id=content tabindex="-1"').classes("w-full"):
        _panels(desk, tabs, tab)
        _log(desk)
    _watch(desk)
    ui.timer(0.1, lambda: _match(desk, dark), once=True)
    return desk


def _header(desk: Desk, dark: ui.dark_mode) -> tuple[ui.tabs, dict[str, ui.tab]]:
    with ui.header().classes("bar items-center gap-x-2 gap-y-0 py-1"):
        ui.link("Skip to the content", "#content").classes("skip")
        ui.label("mckibben").classes("text-lg font-medium").props('role=heading aria-level="1"')
        with Steps().props("dense inline-label").classes("tabs") as tabs:
            labelled(tabs, "aria-label", "Steps")
            tab = {
                name: named(ui.tab(name, icon=icon), f"tab-{name.split()[0].lower()}")
                for name, (icon, _) in PAGES.items()
            }
        ui.space()
        spinner = ui.spinner(size="1.2em", color="currentColor")
        said = named(ui.label("").classes("text-xs"), "busy").props("role=status")
        switch = ui.button(icon="contrast", color=None)
        switch.on("click", lambda shown: _switch(desk, dark, bool(shown.args)), js_handler=IS_DARK)
        labelled(hinted(switch.props("flat dense"), word := "Light or dark"), "aria-label", word)
    named(switch, "theme")
    client = context.client

    def show() -> None:
        text = _under_way(busy.under_way(client), desk.jobs)
        said.set_text(text)
        spinner.set_visibility(bool(text))

    busy.tell_of(client, show)
    show()
    with said:
        ui.timer(TICK, show)
    return tabs, tab


def _under_way(here: list[busy.Doing], jobs: Jobs) -> str:
    """Return what runs, in a few words, and how far it is."""
    active = jobs.active()
    running = [job for job in active if job.state == RUNNING] or active
    said = [f"{one}" for one in here[:1]]
    if running:
        job = running[0]
        told = jobs.progress(job.name)
        share = told[-1][1] if told else 0.0
        word = WORDS.get(job.kind, "Working on")
        said.append(
            f"{word} {shortened(job.title, 24)}{f' {100 * share:.0f} %' if share > 0 else ''}"
        )
    more = len(active) + len(here) - len(said)
    return ", ".join(said) + (f", {more} more" if more else "")


def _panels(desk: Desk, tabs: ui.tabs, tab: dict[str, ui.tab]) -> None:
    begun = _asked_for()
    panels = ui.tab_panels(tabs, value=tab[begun], animated=False)
    with panels.classes("w-full bg-transparent"):
        for name in PAGES:
            with ui.tab_panel(tab[name]).classes("p-2"):
                desk.news.tabs[name] = ui.column().classes("w-full")
    built: set[str] = set()
    desk.news.open_tab = begun

    async def show(name: str) -> None:
        """Show a page: it is made when it is first opened, and anew where that did not work."""
        desk.news.opened(name)
        if name in built:
            return
        built.add(name)
        holder = desk.news.tabs[name]
        holder.clear()
        with told(), holder:
            try:
                with busy.doing(f"Opening {name}"):
                    wait = ui.spinner(size="3em").classes("self-center")
                    if hasattr(sys.modules.get(_place(name)), "build"):
                        await asyncio.sleep(SENT)
                    else:
                        await asyncio.to_thread(load_the_rest)
                    wait.delete()
                    page_module(name).build(desk)
            except BaseException:
                built.discard(name)
                raise

    back: dict[str, str] = {}

    def returned(event: Any) -> None:
        """Go where the browser has gone, back or forth: its address is that of the step already."""
        name = event.args if event.args in PAGES else "Data"
        if name != tabs.value:
            back["to"] = name
            tabs.set_value(name)

    ui.add_head_html(f"<script>{RETURNED}</script>")
    ui.on("returned", returned)

    async def opened(event: Any) -> None:
        name = str(event.value)
        if name in PAGES:
            address = json.dumps(f"?{urlencode({TAB: name})}")
            if back.pop("to", "") != name:
                ui.run_javascript(f"history.pushState(history.state, '', {address})")
            await show(name)

    panels.on_value_change(opened)
    if begun == "Data":
        built.add(begun)
        with desk.news.tabs[begun]:
            page_module(begun).build(desk)
    else:  # what it needs may not be loaded yet
        ui.timer(SENT, lambda: show(begun), once=True)


def _asked_for() -> str:
    """Return the page that the address names, as it does when it is loaded again."""
    request = context.client.request
    name = request.query_params.get(TAB, "") if request is not None else ""
    return name if name in PAGES else "Data"


def _watch(desk: Desk) -> None:
    """Look how the jobs do, and show what comes of them."""
    jobs, workspace = desk.jobs, desk.workspace
    ends = {name: job.state for name, job in jobs.jobs.items()}
    lines: dict[str, int] = {}
    unsaid: list[Job] = []

    async def tick() -> None:
        while jobs.untold:
            tell(jobs.untold.pop(0))
        moved = False
        for name, job in list(jobs.jobs.items()):
            known = len(jobs.progress(name)) if job.state == RUNNING else 0
            if ends.get(name) != job.state:
                ends[name] = job.state
                moved = True
                if job.state in ENDED:
                    unsaid.append(job)
            elif known != lines.get(name):
                moved = True
            lines[name] = known
        if unsaid:
            with contextlib.suppress(Exception):  # who shows it reads it again, and tells
                await asyncio.to_thread(workspace.warm)
        while unsaid:
            job = unsaid.pop(0)
            desk.news.changed(TOPICS.get(job.kind, "jobs"), "log")
            if job.kind == "record":
                desk.news.changed("channels")
            _say(job)
        if moved:
            desk.news.changed("jobs")

    ui.timer(TICK, tick)


def _say(job: Job) -> None:
    """Say how a job has ended, unless it is well: that the header and the page tell."""
    title = shortened(job.title, 40)
    if job.state == "failed":
        text = fields.said(f"{title}: {job.said}")[:300]
        ui.notify(text, type="negative", multi_line=True, position="bottom", timeout=6000)
    elif job.state != DONE:
        ui.notify(f"{title}: {job.state}", type="info", position="bottom", timeout=2500)


async def _match(desk: Desk, dark: ui.dark_mode) -> None:
    """Draw figures for the theme that the browser has chosen."""
    query = "window.matchMedia('(prefers-color-scheme: dark)').matches"
    with contextlib.suppress(TimeoutError):  # of a browser that is busy: it stays light
        chosen = bool(await ui.run_javascript(query, timeout=5.0))
        if dark.value is None:  # a click may have come before the answer
            _show(desk, dark, chosen)


def _switch(desk: Desk, dark: ui.dark_mode, shown: bool) -> None:
    """Change to the other theme than the one that is shown."""
    _show(desk, dark, not shown)


def _show(desk: Desk, dark: ui.dark_mode, chosen: bool) -> None:
    dark.set_value(chosen)
    if desk.dark != chosen:
        desk.dark = chosen
        desk.changed("theme")


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


def page_module(name: str) -> ModuleType:
    """Return what builds a page, loaded."""
    return import_module(_place(name))


def _place(name: str) -> str:
    return f"mckibben.app.pages.{PAGES[name][1]}"


def load_the_rest() -> None:
    """Load what all pages need, in a thread, so that opening one does not wait for it.

    Whoever comes while it is under way waits: two threads that import what imports one another get
    modules that are half there.
    """
    with _LOADING:
        for module in FIRST:
            import_module(module)
        for name in PAGES:
            page_module(name)
        for module in (*PRELOADED, *LATER):
            import_module(module)
        for name in registry.names("estimators"):
            registry.load("estimators", name)


FIRST = ("mckibben.files", "pandas")
"""What reads files, which is what a new user does first."""

SELECTED = '(value) => { element.props["model-value"] = value }'
"""Where handlers of events are made, ``element`` is what they are of."""

RETURNED = f"""
window.addEventListener("popstate", () =>
  emitEvent("returned", new URLSearchParams(location.search).get("{TAB}") ?? ""))
"""
"""Tells where the browser's own buttons, back and forth, have gone."""

IS_DARK = "() => emit(document.body.classList.contains('body--dark'))"
"""Tells which theme is shown, which until :func:`_match` has asked is known to the browser alone."""

LATER = ("mckibben.app.work", "mckibben.characterization", "mckibben.diagnosis.data_gaps")
"""What pages import when they first need it, in threads of their own."""
