"""Models: chosen by need, fitted in the background, compared by cross-validation, and seen closer."""

from __future__ import annotations

import math

import numpy as np
from nicegui import ui

from mckibben.app import fields, plots, scripts
from mckibben.app.desk import Desk, hinted, named, tell
from mckibben.app.drawn import picture
from mckibben.app.jobs import DONE, ENDED, RUNNING, Job
from mckibben.app.pages import leaderboard
from mckibben.app.pages.choosing import Choice
from mckibben.app.together import obstacle
from mckibben.errors import ModelError
from mckibben.estimators.catalogue import settings_of
from mckibben.estimators.core.settings import setting_value

FIT, FIT_MORE = "Models, by what they are for", "Fit more models, by what they are for"

SHARED = (
    "A model tested on what it was fitted to looks better than it is; every result then says so."
)

JUDGED = "fitted; now tested, and its inverse and band tried"
"""Of a fit whose search has ended: the first of its kind compiles what these need."""

FITS = 12
"""The latest fits that are shown."""


def build(desk: Desk) -> None:
    """Build the page: what was found, once there is any, comes before what may be fitted."""
    with ui.column().classes("w-full"):
        board = ui.column().classes("w-full order-2")
        with ui.column().classes("w-full order-1 gap-0"):
            _running(desk)
        with board:
            leaderboard.build(desk)
        head = ui.expansion(FIT, value=True).props("dense header-class=text-lg")
        with named(head.classes("w-full"), "choose-models"):
            _choosing(desk)

    def arrange() -> None:
        """Put the choice of models first until there is something to compare."""
        any_there = bool(desk.results())
        head.classes(add="order-3" if any_there else "order-0", remove="order-0 order-3")
        head.props["label"] = FIT_MORE if any_there else FIT
        head.update()

    for topic in ("results", "channels"):
        desk.when(topic, arrange)
    arrange()


def _choosing(desk: Desk) -> None:
    choice = Choice(desk)
    with choice.actions:
        fit = named(ui.button("Fit", on_click=lambda: _fit(desk, choice)), "fit")
        fit.bind_enabled_from(choice, "possible")
        ui.button("The usual ones", on_click=choice.start).props("flat")
        named(ui.button("None", on_click=lambda: choice.only([])).props("flat"), "untick")
        shared = ui.checkbox("Allow the same data in training and test")
        hinted(named(shared.bind_value(desk, "allow_shared"), "allow-shared"), SHARED)


def _fit(desk: Desk, choice: Choice) -> None:
    if said := obstacle(desk):
        tell(said)
        return
    if all(entry.role != "train" for entry in desk.workspace.entries()):
        tell(
            "There is no recording to train on. Remedy: add one under Data, with the role 'train'."
        )
        return
    if not choice.ticked:
        tell("No model is chosen. Remedy: tick one at least.")
        return
    for model in choice.ticked:
        written = choice.settings.get(model, {})
        try:
            given = settings_of(
                model, {name: setting_value(text) for name, text in written.items()}
            )
        except ModelError as error:
            tell(error)
            continue
        call = scripts.fit_call(model, desk.channels, given, 0, desk.allow_shared)
        desk.jobs.submit(
            "fit",
            {"model": model, "name": model, **desk.channels}
            | {"settings": given, "seed": 0, "call": call, "allow_shared": desk.allow_shared},
        )
        desk.did(f"started fitting {model}", call)
    desk.changed("jobs")


def _running(desk: Desk) -> None:
    # as the user has left it; until then open while any runs, or has failed
    folded: dict[str, bool | None] = {"by": None}

    @ui.refreshable
    def shown() -> None:
        fits = [job for job in desk.jobs.jobs.values() if job.kind == "fit"]
        if not fits:
            return
        ended = [job for job in fits if job.state in ENDED]
        done = sum(job.state == DONE for job in ended)
        title = f"Fits: {done} done, {len(ended) - done} not, {len(fits) - len(ended)} to go"
        open_ = done < len(fits) if folded["by"] is None else folded["by"]
        head = ui.expansion(title, value=open_, on_value_change=lambda e: folded.update(by=e.value))
        with named(head.classes("w-full").props("dense"), "fits"):
            if ended:
                clear = ui.button("Clear what has ended", on_click=lambda: _forget(desk, *ended))
                named(clear.props("flat dense"), "clear-fits")
            said: set[str] = set()
            for job in reversed(fits[-FITS:]):
                _job(desk, job, said)
            _best_so_far(desk, fits)

    desk.when("jobs", shown.refresh)
    shown()


def _job(desk: Desk, job: Job, said: set[str]) -> None:
    """Show how a fit does; a reason that was said of another one above is not said again."""
    told = desk.jobs.progress(job.name)
    with named(ui.row().classes("items-center w-full gap-2 no-wrap"), f"job-{job.title}"):
        ui.label(job.title).classes("w-28 sm:w-56 break-words min-w-0 text-sm")
        if job.state in ENDED:
            again = job.said in said and job.said != job.state
            ui.label(f"{job.state}, as above" if again else fields.said(job.said)).classes(
                "flex-1 text-xs"
            )
            said.add(job.said)
            if job.state != "done":
                ui.button(icon="replay", on_click=lambda: _again(desk, job)).props(
                    'flat dense aria-label="Again"'
                )
            ui.button(icon="close", on_click=lambda: _forget(desk, job)).props(
                'flat dense aria-label="Forget"'
            )
            return
        share = told[-1][1] if told and job.state == RUNNING else 0.0
        bar = ui.linear_progress(value=round(share, 2), show_value=False).classes("flex-1")
        if job.state == RUNNING and not share:
            bar.props("indeterminate")
        done = f" {100 * share:.0f} %, validation included" if share else ""
        ui.label(JUDGED if share >= 1.0 else f"{job.state}{done}").classes("text-xs")
        named(
            ui.button("Cancel", on_click=lambda: _cancel(desk, job)).props("flat dense"),
            f"cancel-{job.title}",
        )


def _cancel(desk: Desk, job: Job) -> None:
    desk.jobs.cancel(job.name)
    desk.changed("jobs")


def _forget(desk: Desk, *jobs: Job) -> None:
    for job in jobs:
        desk.jobs.forget(job.name)
    desk.changed("jobs")


def _again(desk: Desk, job: Job) -> None:
    desk.jobs.submit(job.kind, job.given)
    desk.jobs.forget(job.name)
    desk.changed("jobs")


def _best_so_far(desk: Desk, fits: list[Job]) -> None:
    """Plot the least cost that each search has found, over time."""
    curves = []
    for place, job in enumerate(fits[-6:]):
        told = [(s, cost) for s, _, cost in desk.jobs.progress(job.name) if math.isfinite(cost)]
        if len(told) >= 2:
            seconds, costs = np.array(told).T
            begun = np.flatnonzero(np.diff(costs) > 0) + 1  # each fold is searched anew
            seconds, costs = np.insert(seconds, begun, np.nan), np.insert(costs, begun, np.nan)
            curves.append((job.title, seconds, costs, f"series-{place % 6 + 1}"))
    if curves:
        ui.label(
            "Best so far, in each fold of the cross-validation anew: what each search makes smaller, "
            "on a scale of its own"
        ).classes("text-sm")
        figure = plots.lines(curves, x="time [s]", y="cost of the search", logarithmic=True)
        figure["layout"]["xaxis"]["rangemode"] = "tozero"
        picture(desk, figure, "best-so-far")
