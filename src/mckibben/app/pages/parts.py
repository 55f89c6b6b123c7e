"""What several pages share: parts that are built again only when they must be, choices, and jobs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial, wraps
from typing import Any

from nicegui import events, ui

from mckibben.app import widgets
from mckibben.app.jobs import Job, Work
from mckibben.app.state import State, view
from mckibben.app.terms import message_of
from mckibben.app.widgets import mark
from mckibben.app.workspace import Workspace
from mckibben.system.progress import time_left


def steady(
    *kinds: str, jobs: Sequence[str] = (), own: bool = False
) -> Callable[[Callable[[State], None]], Any]:
    """Make a part of a page that is built again only when it must be; `refresh` does so at once.

    That is where the model, channels or data are others, or files of some kinds (with ``own`` only
    those of the model), or jobs. Fields in it outlive what happens else, and no click on it is lost.
    """

    def current_state(state: State) -> Any:
        files = stamps(state.workspace, *kinds, of=state.model if own else "")
        going = [(job.name, job.state) for job in jobs_of(state, jobs)]
        sides = state.model, (*state.inputs,), (*state.outputs,), state.load
        return widgets.theme.dark, sides, state.workspace.digest(), files, going

    def decorate(build: Callable[[State], None]) -> Any:
        last_state: list[Any] = [None]

        @ui.refreshable
        @widgets.shielded
        def part(state: State) -> None:
            if state.ready.is_set():
                build(state)
                last_state[0] = current_state(state)

        @view
        def watch(state: State) -> None:
            if last_state[0] != current_state(state):
                part.refresh()

        @wraps(build)
        def build_part(state: State) -> None:
            part(state)
            watch(state)

        build_part.refresh = part.refresh  # type: ignore[attr-defined]
        return build_part

    return decorate


def stamps(workspace: Workspace, *kinds: str, of: str = "") -> tuple[Any, ...]:
    """Return when files of some kinds were written, or those of one name, as a key."""
    return tuple(
        (kind, name, workspace.path(kind, f"{name}.json").stat().st_mtime_ns)
        for kind in kinds
        for name in workspace.names(kind)
        if of in ("", name)
    )


def jobs_of(state: State, kinds: Sequence[str]) -> list[Job]:
    """Return the jobs of some kinds that are not done."""
    return [job for job in state.jobs.jobs.values() if job.kind in kinds and job.state != "done"]


# -- choices ----------------------------------------------------------------------------------------


def select(
    state: State, key: str, options: dict[str, str], label: str, changed: Callable[[], Any]
) -> str:
    """Let one of some options be chosen, the first by default; return which is, empty without any."""
    if state.chosen.get(key) not in options:
        state.chosen[key] = next(iter(options), None)  # what a field without options has
    field = ui.select(options, label=label).bind_value(state.chosen, key).props("dense outlined")
    mark(field, key.partition(".")[2]).on_value_change(lambda _: changed())
    return str(state.chosen[key] or "")


def several(
    label: str, options: list[str], value: Sequence[str], changed: Callable[[list[str]], Any]
) -> Any:
    """Let some of several be chosen; ``changed`` gets them once the menu is closed, which stays open.

    A chip that is removed is a change at once.
    """
    last_choice, is_open = [[*value]], [False]

    def turn(now_open: bool) -> Any:
        is_open[0] = now_open
        if not now_open and field.value != last_choice[0]:
            last_choice[0] = [*field.value]
            return changed(last_choice[0])
        return None

    field = ui.select(options, value=[*value], multiple=True, label=label)
    field.props("dense outlined use-chips")
    field.on("popup-show", partial(turn, True), []).on(
        "popup-hide", widgets.guarded(partial(turn, False)), []
    )
    field.on_value_change(widgets.guarded(lambda _: None if is_open[0] else turn(False)))
    return field


def model_of(state: State, names: Sequence[str]) -> str:
    """Return the model that is chosen, or else the first of some."""
    return state.model if state.model in names else names[0]


def warn_of_other_data(state: State, name: str) -> None:
    """Say where a model is of other recordings."""
    if name in state.workspace.on_other_data():
        with mark(ui.element("div"), "other-data"):
            widgets.error_box(f"{name} was fitted to other recordings than those in use now.")


def select_model(state: State, names: Sequence[str], name: str = "model") -> None:
    """Let one of some models be chosen."""

    def choose(event: events.ValueChangeEventArguments[Any]) -> None:
        state.model = str(event.value)
        state.changed()

    stale = state.workspace.on_other_data()
    options = {model: f"{model} · other data" if model in stale else model for model in names}
    field = ui.select(options, value=model_of(state, names), label="Model", on_change=choose)
    mark(field.props("dense outlined"), name)


# -- jobs -------------------------------------------------------------------------------------------


def end(state: State, jobs: Sequence[Job]) -> None:
    """Cancel jobs, or take those that ended off the list."""
    for job in reversed(jobs):  # those that wait first, or they would begin
        state.jobs.cancel(job.name)
        state.jobs.forget(job.name)
    state.changed()


def again(state: State, jobs: Sequence[Job], work: Work) -> None:
    """Do jobs that ended again."""
    for job in jobs:
        state.jobs.forget(job.name)
        state.jobs.submit(work, job.title, **job.given)
    state.changed()


def show_job(state: State, job: Job, title: str = "") -> None:
    """Show how far a job is, or why it did not work."""

    def tell() -> None:
        bar.set_value(round(job.share, 3))
        left = time_left(job.share, job.progress[-1][0]) if job.progress else ""
        share.set_text(", ".join(filter(None, [f"{100 * job.share:.0f} %", left])))

    with widgets.row(classes="spread"):
        with ui.element("div").classes("grow"):
            ui.label(title or job.title)
            if not job.active:
                ui.label(message_of(job.message or job.state)).classes("muted")
        if job.active:
            bar = ui.linear_progress(show_value=False, color="primary").classes("meter")
            widgets.labelled(bar, "Progress")
            share = ui.label().classes("muted")
            tell()
            ui.timer(0.3, tell)
        text = f"Cancel {job.title}" if job.active else f"Take {job.title} off the list"
        stop = widgets.icon_button("close", text, lambda: end(state, [job]))
        mark(stop, f"cancel-{job.title}")
