"""The state that all windows of a workbench share, and the parts of pages that show it."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import field
from functools import wraps
from typing import Any

from nicegui import binding, ui

from mckibben.app.jobs import Jobs
from mckibben.app.modelling import sides_of
from mckibben.app.widgets import shielded
from mckibben.app.workspace import Workspace
from mckibben.channels import Channels, channels_of
from mckibben.errors import DataError

_VIEWS: list[Any] = []

READING_TIME = 1.0
"""How long a page waits until the folder is read; after that it comes without [s]."""


def view(build: Callable[..., None]) -> Any:
    """Make a function a `ui.refreshable` that `State.changed` builds again, in every window.

    It is empty while the folder is read for the first time. What cannot be shown, such as a damaged
    model, is an error in its place.
    """

    @wraps(build)
    def built(state: State) -> None:
        if not state.ready.is_set():
            ui.spinner()
            ui.timer(0.1, lambda: made.refresh() if state.ready.is_set() else None)
            return
        shielded(build)(state)

    made = ui.refreshable(built)
    _VIEWS.append(made)
    return made


@binding.bindable_dataclass
class State:
    """What is chosen, for all windows; what is known is in ``workspace`` and ``jobs``.

    ``chosen`` is what else pages choose, by names that begin with the page's.
    """

    workspace: Workspace
    jobs: Jobs
    recording: str = ""
    inputs: list[str] = field(default_factory=list)
    outputs: list[str] = field(default_factory=list)
    load: str = ""
    model: str = ""
    chosen: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.ready = threading.Event()
        threading.Thread(target=self._begin, daemon=True).start()

    def _begin(self) -> None:
        try:
            self._settle()
            self.workspace.digest()
        finally:
            self.ready.set()

    def settle(self) -> None:
        """Choose what is not chosen, or not there any more.

        Of a folder that is long to read at first, it goes on in the background; see `view`.
        """
        if self.ready.wait(READING_TIME):
            self._settle()

    def _settle(self) -> None:
        recordings = [entry.name for entry in self.workspace.entries()]
        models = self.workspace.models()
        if self.recording not in recordings:
            self.recording = next(iter(recordings), "")
        if self.model not in models:
            self.model = next(iter(models), "")
        known = self.workspace.channels()

        def choose(*sides: Sequence[str]) -> None:
            self.inputs, self.outputs = ([n for n in side if n in known] for side in sides)

        choose(self.inputs, self.outputs)
        if known and not (self.inputs and self.outputs):  # what is chosen stays
            with suppress(DataError):
                runs = [run.select(known) for run in self.workspace.used().values()]
                sides = channels_of(runs, self.inputs or None, self.outputs or None)
                choose(sides.inputs, sides.outputs)

    @property
    def sides(self) -> Channels:
        """What is modelled."""
        return sides_of(self.workspace, self.inputs, self.outputs, self.load)

    def read_again(self) -> None:
        """Choose inputs, outputs and load anew, as channels are read in another way now."""
        self.inputs, self.outputs, self.load = [], [], ""
        self.changed()

    def changed(self) -> None:
        """Build every `view` again, in all windows; call it after the folder or a choice has changed."""
        if self.ready.is_set():
            self._settle()
        for part in _VIEWS:
            part.refresh()
