"""Who on a page shows what, and hears that it has changed: each once, one after another, none forgotten.

What is on a tab that is not open is drawn when that is opened. What fails is told, harms nothing else,
and is tried again: it may have met a file that was just being written.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from contextlib import nullcontext
from dataclasses import dataclass, field
from typing import Any

from nicegui import Client, background_tasks, context, core, ui
from nicegui.element import Element

Refresh = Callable[[], Any]

SHORTLY = 0.02
"""How often it is looked whether all is shown [s]."""

AGAIN = (0.3, 1.0, 3.0)
"""After which times what failed is tried again [s]."""


@dataclass(eq=False)
class Listener:
    """A function that shows a topic anew.

    Parameters
    ----------
    refresh : callable
    place : Element, optional
        Where it was when it began to listen; when that is gone, so is it.
    tab : str, optional
        The tab that it is on.
    """

    refresh: Refresh
    place: Element | None
    tab: str | None
    stale: bool = False

    @property
    def gone(self) -> bool:
        """Whether what it showed is no longer there."""
        return self.place is not None and self.place.is_deleted

    @property
    def shows(self) -> Any:
        """What it draws: a refreshable gives another function each time that it is asked for one."""
        for cell in getattr(self.refresh, "__closure__", None) or ():
            drawn = getattr(cell.cell_contents, "__self__", None)
            if isinstance(drawn, ui.refreshable):
                return drawn
        return self.refresh


@dataclass(eq=False)
class News:
    """The listeners of one page.

    Parameters
    ----------
    client : Client, optional
        The page.
    open_tab : str, optional
        What is shown now.
    tabs : dict
        What holds each tab.
    told : callable
        Told of an exception that will not go away.
    """

    client: Client | None = None
    open_tab: str | None = None
    tabs: dict[str, Element] = field(default_factory=dict)
    told: Callable[[Exception], None] | None = None
    _listeners: dict[str, list[Listener]] = field(default_factory=dict)
    _pending: dict[Any, Listener] = field(default_factory=dict)
    _at_work: bool = False
    _closed: bool = False

    def when(self, topic: str, refresh: Refresh) -> None:
        """Call a function when a topic has changed, as long as where it stands is there."""
        place = _here()
        holders = {holder: tab for tab, holder in self.tabs.items()}
        above = () if place is None else place.ancestors(include_self=True)
        tab = next((holders[element] for element in above if element in holders), None)
        kept = [one for one in self._listeners.get(topic, []) if not one.gone]
        self._listeners[topic] = [*kept, Listener(refresh, place, tab)]

    def changed(self, *topics: str) -> None:
        """Tell who shows a topic, soon; each once, however many topics and calls there are."""
        for topic in topics:
            for one in self._listeners.get(topic, []):
                self._pending[one.shows] = one
        self._go()

    async def settled(self) -> None:
        """Wait until what has changed is shown, for what comes on top of it."""
        while self._at_work:
            await asyncio.sleep(SHORTLY)

    def opened(self, tab: str) -> None:
        """Show what has changed on a tab while it was not open."""
        self.open_tab = tab
        for listeners in self._listeners.values():
            for one in listeners:
                if one.stale and one.tab == tab:
                    self._pending[one.shows] = one
        self._go()

    def close(self) -> None:
        """Let go of everything."""
        self._closed = True
        self._listeners.clear()
        self._pending.clear()
        self.tabs.clear()
        self.client = self.told = None

    def _go(self) -> None:
        if self._pending and not self._at_work and not self._closed and core.is_loop_running():
            self._at_work = True
            background_tasks.create(self._tell(), name="news", context=self.client)

    async def _tell(self) -> None:
        try:
            while self._pending and not self._closed:
                one = self._pending.pop(next(iter(self._pending)))
                if one.gone:
                    continue
                one.stale = one.tab not in (None, self.open_tab)
                if not one.stale:
                    await self._show(one)
                    await asyncio.sleep(0)  # clicks are answered between two of them
        finally:
            self._at_work = False

    async def _show(self, one: Listener, tries: int = 0) -> None:
        try:
            # not where the change was made: that may be gone as soon as it is shown anew
            with self.client or nullcontext():
                shown = one.refresh()
                if isinstance(shown, Awaitable):
                    await shown
        except Exception as error:
            if tries < len(AGAIN):
                background_tasks.create(self._later(one, tries), name="news", context=self.client)
            elif self.told is not None:
                self.told(error)

    async def _later(self, one: Listener, tries: int) -> None:
        await asyncio.sleep(AGAIN[tries])
        if not one.gone and not self._closed:
            await self._show(one, tries + 1)


def _here() -> Element | None:
    """Return the element that is being filled; without a page there is none."""
    try:
        return context.slot.parent
    except RuntimeError:
        return None
