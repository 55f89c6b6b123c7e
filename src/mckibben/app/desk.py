"""What all pages of the workbench share: the workspace, its jobs, the channels chosen, and the calls."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any
from weakref import WeakSet

from nicegui import ui

from mckibben.app.busy import Answer
from mckibben.app.fields import LONGEST as LONGEST
from mckibben.app.fields import said
from mckibben.app.jobs import Jobs
from mckibben.app.news import News, Refresh
from mckibben.app.workspace import Workspace
from mckibben.errors import DataError, MckibbenError
from mckibben.report import words

if TYPE_CHECKING:
    from nicegui.elements.upload_files import FileUpload

    from mckibben.comparison.channels import Channels
    from mckibben.comparison.splits import Split
    from mckibben.recording import Recording

SHARED = ("recordings", "results", "runs", "log")
"""Topics of the workspace; the others are of one page."""

_DESKS: WeakSet[Desk] = WeakSet()


@dataclass(eq=False)
class Desk:
    """One browser page over a workspace.

    Parameters
    ----------
    workspace : Workspace
    jobs : Jobs
    """

    workspace: Workspace
    jobs: Jobs
    inputs: tuple[str, ...] = ("pressure",)
    outputs: tuple[str, ...] = ("displacement",)
    allow_shared: bool = False
    """Whether models are tested on data that they were fitted to, which every result then says."""
    dark: bool = False
    preview: str | None = None
    drawn: Sequence[str] = ()
    """Channels over time that were chosen to be drawn."""
    compensator: tuple[str, str, dict[str, Any], float] | None = None
    """The model, use, settings and step whose pressures were shown last; see `mckibben.app.forms`."""
    _chosen: bool = False
    news: News = field(default_factory=News, repr=False)
    """Who shows what on this page, and hears of changes."""

    @property
    def input(self) -> str:
        """The first input."""
        return self.inputs[0]

    @property
    def output(self) -> str:
        """The first output."""
        return self.outputs[0]

    @property
    def sides(self) -> Channels:
        """What is modelled, of what, and what is given beside: loads are never commanded."""
        from mckibben.comparison.channels import Channels, dead_loads_told, loads_told

        used = self.workspace.used()
        roles = {entry.name: entry.role for entry in self.workspace.entries()}
        train = [run for name, run in used.items() if roles.get(name) == "train"]
        recordings = train or list(used.values())
        found = loads_told(recordings, Channels(self.inputs, self.outputs))
        return dead_loads_told(recordings, found)

    @property
    def channels(self) -> dict[str, str | list[str]]:
        """Input and output, or all of them, and the load, as the library's functions take them."""
        sides = self.sides
        named = {"input": sides.inputs, "output": sides.outputs}
        found = {key: names[0] if len(names) == 1 else list(names) for key, names in named.items()}
        return found | ({"load": sides.scheduling[0]} if sides.scheduling else {})

    def looked_at(self, recordings: Sequence[Recording] = ()) -> tuple[tuple[str, str], ...]:
        """Return what every output of recordings, or of all there are, is drawn over, and the output."""
        from mckibben.diagnosis.coupling import coupling

        used = list(self.workspace.used().values())
        sides = self.sides
        return coupling(used, sides.inputs, sides.outputs).pairs(recordings or used)

    def split(self) -> Split:
        """Return what a fit now trains on and is tested on.

        Raises
        ------
        DataError
            If there is too little for both.
        """
        from mckibben.comparison.splits import split_of

        train, test = self.workspace.with_role("train"), self.workspace.with_role("test")
        if not (train or test):
            raise DataError("there is no recording in use", remedy="add one under Data")
        return split_of(train, test, self.sides)

    def results(self) -> list[dict[str, Any]]:
        """Return what is known of the models of these channels: other errors do not compare."""
        sides = self.sides
        named = [", ".join(side) for side in (sides.inputs, sides.outputs)]
        load = (sides.scheduling or ("",))[0]
        return [
            result
            for result in self.workspace.results()
            if all(
                result[key] in ("", own)
                for key, own in zip(("input", "output"), named, strict=True)
            )
            and result["load"] == load
        ]

    def stale(self) -> set[str]:
        """Return the models that were fitted to recordings as they are no more."""
        return {row["name"] for row in self.workspace.results() if not row["current"]}

    def model_to_show(self, now: str, names: Sequence[str]) -> str:
        """Return the model chosen now, or the first, where that one is gone or of data that were."""
        stale = self.stale()
        kept = now in names and (now not in stale or names[0] in stale)
        return now if kept else names[0]

    @property
    def not_recommended(self) -> str:
        """Why none of these models is recommended; empty where one is, or there is none.

        Each was fitted by itself and says so of itself; which one it depends on is a matter of all, as
        in `mckibben.comparison.choosing.recommended`.
        """
        return not_recommended(self.results())

    def __post_init__(self) -> None:
        _DESKS.add(self)

    def when(self, topic: str, refresh: Refresh) -> None:
        """Call a function whenever something of a topic has changed, while what it shows is there."""
        self.news.when(topic, refresh)

    def changed(self, *topics: str) -> None:
        """Tell all that show a topic: on this page, and on other pages over the same workspace."""
        self.news.changed(*topics)
        shared = [topic for topic in topics if topic in SHARED]
        for desk in list(_DESKS):
            if shared and desk is not self and desk.workspace is self.workspace:
                desk.news.changed(*shared)

    def close(self) -> None:
        """Let go of all that was shown: the page is closed."""
        _DESKS.discard(self)
        self.news.close()

    def did(self, what: str, call: str) -> None:
        """Show and log the call behind a click."""
        self.workspace.log(what, call)
        self.changed("log")

    def settle_channels(self) -> None:
        """Choose inputs and outputs that the recordings have: of several muscles, all of them."""
        from mckibben.comparison.channels import recognised

        known = set(self.workspace.channels())
        used = self.inputs + self.outputs
        if known and (not self._chosen or not set(used) <= known or len(set(used)) < len(used)):
            self._chosen = False
            found = recognised(self.workspace.readable(), self.workspace.channels())
            self.inputs, self.outputs = found

    def choose(self, side: str, channels: Sequence[str]) -> None:
        """Take what the user has chosen for inputs or outputs; it stays as long as it is there.

        What is on one side is not on the other, and neither is left without any.
        """
        other = "outputs" if side == "inputs" else "inputs"
        taken, given = getattr(self, other), getattr(self, side)
        left = tuple(name for name in taken if name not in channels)
        left = left or tuple(name for name in given if name not in channels) or taken
        setattr(self, other, left)
        setattr(self, side, tuple(name for name in channels if name not in left))
        self._chosen = True


def against(results: Sequence[dict[str, Any]]) -> dict[str, str]:
    """Return the models that are not recommended, each judged by itself, and why."""
    return {
        row["name"]: words.not_recommended(
            "test" if row["not_recommended"] == "test" else "validation",
            row,
            row["constant"] or {},
            row["unit"],
        )
        for row in results
        if row["not_recommended"]
    }


def not_recommended(results: Sequence[dict[str, Any]]) -> str:
    """Return why none of some models, in the order of the choice, is recommended; empty where one is."""
    better = [result for result in results if (result["skill_least"] or 0.0) > 0]
    return "".join(against((better or list(results))[:1]).values())


def named(element: Any, name: str) -> Any:
    """Give an element a name that tests, and people who script the page, find it by."""
    return labelled(element.mark(name), "data-testid", name)


def labelled(element: Any, attribute: str, text: str) -> Any:
    """Set an attribute of an element to a text, whatever that holds: it is never read as more."""
    element.props[attribute] = text
    return element


def hinted(element: Any, text: str) -> Any:
    """Say what an element is for where a pointer rests on it.

    The browser does so itself: Quasar's tooltips complain, and stay away, where a page is hidden while
    its elements are made.
    """
    return labelled(element, "title", text)


def code(text: str) -> Any:
    """Show Python as it stands, with a button that copies it; nothing in it is read as markup."""
    with ui.row().classes("w-full no-wrap items-start") as row:
        shown = ui.label(text).classes("flex-1 whitespace-pre overflow-x-auto font-mono text-sm")
        copy = f"() => navigator.clipboard.writeText(getHtmlElement({shown.id}).innerText)"
        button = ui.button(icon="content_copy").props("flat dense").on("click", js_handler=copy)
        labelled(button, "aria-label", "Copy")
    return row


def tell(error: Exception | str) -> None:
    """Show a problem with its remedy until it is closed."""
    ui.notify(
        said(error),
        type="negative",
        multi_line=True,
        close_button="Close",
        timeout=0,
        position="bottom",  # the tabs stay free, where the remedy may be
    )


def caution(text: str) -> Any:
    """Show what is to be known of a result, in the words of a page."""
    return ui.label(said(text)).classes("text-sm border-l-4 border-warning pl-2")


def refused(error: Exception, what: str = "") -> None:
    """Show a problem with its remedy in the place of what cannot be shown."""
    ui.label(f"{what}: {said(error)}" if what else said(error)).classes("text-negative")


def guarded(action: Callable[[], Awaitable[Any]], what: str = "") -> Callable[..., Awaitable[None]]:
    """Return an action that shows that it runs, once at a time; its problems become messages."""

    async def act() -> None:
        with told():
            await action()

    return Answer(act, what)


def on_event(
    action: Callable[[Any], Awaitable[Any]], what: str = "", *, once: bool = False
) -> Callable[[Any], Awaitable[None]]:
    """Return a handler of events that shows that it runs; its problems become messages."""

    async def act(event: Any) -> None:
        with told():
            await action(event)

    return Answer(act, what, takes_event=True, once=once)


@contextmanager
def told() -> Iterator[None]:
    """Turn problems into messages on the page."""
    try:
        yield
    except MckibbenError as error:
        tell(error)
    except Exception as error:
        unexpected(error)


def unexpected(error: Exception) -> None:
    """Show what nobody has foreseen: a full disk, a value that cannot be, a file made to mislead."""
    if isinstance(error, MckibbenError):
        tell(error)
    elif isinstance(error, OSError):
        place = f"{error.filename}: " if error.filename else ""
        tell(f"{place}{error.strerror or error}. Remedy: see to the disk's room and rights.")
    else:
        tell(f"{type(error).__name__}: {error}. Remedy: check the file or the value.")


async def kept(desk: Desk, file: FileUpload) -> Path:
    """Keep an uploaded file, without holding it in memory, and return where.

    Raises
    ------
    DataError
        If it cannot be kept.
    """
    with desk.workspace.receiving(file.name, file.size()) as (new, path):
        await file.save(new)
    return path
