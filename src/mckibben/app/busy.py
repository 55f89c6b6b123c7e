"""What runs is told at once: on the button that began it, and in the header; no click counts twice."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from inspect import Parameter, Signature
from typing import Any
from weakref import WeakKeyDictionary

from nicegui import Client, context, ui

SOON = 0.1
"""Time before which nothing is shown: what is quicker would only flicker [s]."""


@dataclass(eq=False)
class Doing:
    """Something that runs.

    Parameters
    ----------
    what : str
        What it is, as a person would say it.
    share : float, optional
        How much of it is done, from 0 to 1, where that is known; any thread may set it.
    """

    what: str
    share: float | None = None

    def __str__(self) -> str:
        share = "" if self.share is None else f" {100 * min(max(self.share, 0.0), 1.0):.0f} %"
        return f"{self.what}{share}"


_RUNNING: WeakKeyDictionary[Client, list[Doing]] = WeakKeyDictionary()
_TOLD: WeakKeyDictionary[Client, Callable[[], None]] = WeakKeyDictionary()


def under_way(client: Client) -> list[Doing]:
    """Return what runs for a page."""
    return list(_RUNNING.get(client, ()))


def tell_of(client: Client, told: Callable[[], None]) -> None:
    """Call a function whenever something begins or ends for a page."""
    _TOLD[client] = told
    # what is called may know the page, which would then hold itself
    client.on_delete(lambda: (_TOLD.pop(client, None), _RUNNING.pop(client, None)))


@contextmanager
def doing(what: str) -> Iterator[Doing]:
    """Show in the header that something runs, and how far it is where ``share`` is set meanwhile."""
    client, one = context.client, Doing(what)
    _begin(client, one)
    try:
        yield one
    finally:
        _end(client, one)


def _begin(client: Client, one: Doing) -> None:
    _RUNNING.setdefault(client, []).append(one)
    _TOLD.get(client, _nobody)()


def _end(client: Client, one: Doing) -> None:
    running = _RUNNING.get(client, [])
    if one in running:
        running.remove(one)
        _TOLD.get(client, _nobody)()


def _nobody() -> None:
    """Tell nobody: there is no header."""


class Answer:
    """A handler that shows that it runs, and by default does nothing when called again meanwhile.

    Parameters
    ----------
    action : callable
        What to do; given the event where it takes one.
    what : str
        What that is; default what stands on the button.
    takes_event : bool
        Whether the action wants the event.
    once : bool
        Whether calls that come while it runs are dropped; of clicks, not of files.
    """

    # by which handlers are recognised that want to know who was clicked; timers give nothing
    __signature__ = Signature([Parameter("event", Parameter.POSITIONAL_OR_KEYWORD)])

    def __init__(
        self,
        action: Callable[..., Awaitable[Any]],
        what: str = "",
        *,
        takes_event: bool = False,
        once: bool = True,
    ) -> None:
        self.action, self.what = action, what
        self.takes_event, self.once = takes_event, once
        self.running = False

    async def __call__(self, event: Any = None) -> None:
        """Do it."""
        if self.running and self.once:
            return
        sender = getattr(event, "sender", None)
        button = sender if isinstance(sender, ui.button) else None
        client, one = context.client, Doing(self.what or _said(button))

        def show() -> None:
            _begin(client, one)
            if button is not None and not button.is_deleted:
                button.props("loading")

        later = asyncio.get_running_loop().call_later(SOON, show)
        self.running = True
        try:
            await (self.action(event) if self.takes_event else self.action())
        finally:
            self.running = False
            later.cancel()
            _end(client, one)
            if button is not None and not button.is_deleted:
                button.props(remove="loading")


def _said(button: ui.button | None) -> str:
    if button is None:
        return "Working"
    return str(button.text or button.props.get("aria-label") or "Working")
