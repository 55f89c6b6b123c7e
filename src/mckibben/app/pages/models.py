"""Models: chosen by need, fitted in the background, compared by cross-validation, and seen closer."""

from __future__ import annotations

import math

import numpy as np
from nicegui import ui

from mckibben.app import fields, plots, scripts
from mckibben.app.desk import Desk, named, tell
from mckibben.app.jobs import ENDED, RUNNING, Job
from mckibben.app.pages import apart, leaderboard
from mckibben.app.pages.choosing import Choice
from mckibben.comparison.offered import settings_of
from mckibben.errors import ModelError


def build(desk: Desk) -> None:
    """Build the page."""
    ui.label("Models, by what they are for").classes("text-lg")
    choice = Choice(desk)
    with choice.actions:
        named(ui.button("Fit", on_click=lambda: _fit(desk, choice)), "fit")
        ui.button("The usual ones", on_click=choice.start).props("flat")
        named(ui.button("None", on_click=lambda: choice.only([])).props("flat"), "untick")
        named(
            ui.checkbox("Go on where recordings share data").bind_value(desk, "allow_shared"),
            "allow-shared",
        )
    with ui.row().classes("w-full items-start gap-4"):
        with ui.column().classes("min-w-72 flex-1"):
            _running(desk)
        with ui.column().classes("min-w-96 flex-[2]"):
            leaderboard.build(desk)


def _fit(desk: Desk, choice: Choice) -> None:
    if all(entry.role != "train" for entry in desk.workspace.entries()):
        tell(
            "There is no recording to train on. Remedy: add one under Data, with the role 'train'."
        )
        return
    if not choice.ticked:
        tell("No model is chosen. Remedy: tick one at least.")
        return
    if (times := apart.sample_times(desk)) is not None:
        tell(
            f"Recordings have sample times from {times[0]:.4g} to {times[1]:.4g} s, and models need "
            f"one. Remedy: press 'Resample all to {apart.common(times):g} s' under Data."
        )
        return
    for model in choice.ticked:
        written = choice.settings.get(model, {})
        try:
            given = settings_of(model, [f"{name}={text}" for name, text in written.items()])
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
    ui.label("Fits").classes("text-lg")

    @ui.refreshable
    def shown() -> None:
        fits = [job for job in desk.jobs.jobs.values() if job.kind == "fit"]
        if not fits:
            ui.label("None yet.").classes("opacity-70")
        said: set[str] = set()
        for job in reversed(fits[-12:]):
            _job(desk, job, said)
        _best_so_far(desk, fits)

    desk.when("jobs", shown.refresh)
    desk.when("theme", shown.refresh)
    shown()


def _job(desk: Desk, job: Job, said: set[str]) -> None:
    """Show how a fit does; a reason that was said of another one above is not said again."""
    told = desk.jobs.progress(job.name)
    with named(ui.row().classes("items-center w-full gap-2 no-wrap"), f"job-{job.title}"):
        ui.label(job.title).classes("w-28")
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
        ui.linear_progress(value=round(share, 2), show_value=False).classes("flex-1")
        ui.label(job.state).classes("text-xs")
        named(
            ui.button("Cancel", on_click=lambda: _cancel(desk, job)).props("flat dense"),
            f"cancel-{job.title}",
        )


def _cancel(desk: Desk, job: Job) -> None:
    desk.jobs.cancel(job.name)
    desk.changed("jobs")


def _forget(desk: Desk, job: Job) -> None:
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
        ui.label("Best so far, in each fold of the cross-validation anew").classes("text-sm")
        figure = plots.lines(curves, x="time [s]", y="cost of the search", dark=desk.dark)
        figure["layout"]["yaxis"]["type"] = "log"
        named(ui.plotly(figure).classes("w-full"), "best-so-far")
