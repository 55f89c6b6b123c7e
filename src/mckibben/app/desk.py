"""What all pages of the workbench share: the workspace, its jobs, the channels chosen, and the calls."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from nicegui import ui

from mckibben.app.jobs import Jobs
from mckibben.app.workspace import Workspace
from mckibben.errors import MckibbenError

Refresh = Callable[[], Any]


@dataclass
class Desk:
    """One browser page over a workspace.

    Parameters
    ----------
    workspace : Workspace
    jobs : Jobs
    """

    workspace: Workspace
    jobs: Jobs
    input: str = "pressure"
    output: str = "displacement"
    dark: bool = False
    preview: str | None = None
    _shown: dict[str, list[Refresh]] = field(default_factory=dict, repr=False)

    @property
    def channels(self) -> tuple[str, str]:
        """Input and output."""
        return self.input, self.output

    def when(self, topic: str, refresh: Refresh) -> None:
        """Call a function whenever something of a topic has changed."""
        self._shown.setdefault(topic, []).append(refresh)

    def changed(self, *topics: str) -> None:
        """Tell all that show a topic."""
        for topic in topics:
            for refresh in self._shown.get(topic, []):
                refresh()

    def did(self, what: str, call: str) -> None:
        """Show and log the call behind a click."""
        self.workspace.log(what, call)
        self.changed("log")

    def settle_channels(self) -> None:
        """Choose an input and an output that the recordings have."""
        known = self.workspace.channels()
        if known and self.input not in known:
            self.input = next((c for c in known if c.startswith(("pressure", "voltage"))), known[0])
        if known and (self.output not in known or self.output == self.input):
            wished = [c for c in known if c.startswith(("displacement", "length", "contraction"))]
            rest = [c for c in known if c != self.input]
            self.output = (wished or rest or known)[0]


def named(element: Any, name: str) -> Any:
    """Give an element a name that tests, and people who script the page, find it by."""
    return element.mark(name).props(f'data-testid="{name}"')


def tell(error: Exception | str) -> None:
    """Show a problem with its remedy until it is closed."""
    ui.notify(
        str(error),
        type="negative",
        multi_line=True,
        close_button="Close",
        timeout=0,
        position="top",
    )


def guarded(action: Callable[[], Awaitable[Any]]) -> Callable[[], Awaitable[None]]:
    """Return an action whose problems become messages."""

    async def act() -> None:
        with told():
            await action()

    return act


def on_event(action: Callable[[Any], Awaitable[Any]]) -> Callable[[Any], Awaitable[None]]:
    """Return a handler of events whose problems become messages."""

    async def act(event: Any) -> None:
        with told():
            await action(event)

    return act


@contextmanager
def told() -> Iterator[None]:
    """Turn problems into messages on the page."""
    try:
        yield
    except MckibbenError as error:
        tell(error)
    except (OSError, ValueError) as error:
        tell(f"{error}. Remedy: check the file or the value.")
