"""Results of jobs that are kept with their curves: how far they are, and their pictures."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from nicegui import ui

from mckibben.app import plots
from mckibben.app.desk import Desk, named
from mckibben.app.drawn import picture
from mckibben.app.fields import said
from mckibben.app.jobs import ENDED, FAILED, RUNNING, Job
from mckibben.app.kept import Line2D

MOST = 3
"""Results shown, the newest."""


def showing(
    desk: Desk,
    kind: str,
    known: Callable[[], Mapping[str, Any]],
    show: Callable[[str, Any], None],
) -> None:
    """Show jobs of a kind as they work, and what came of them, newest first."""
    ends: list[str] = []

    @ui.refreshable
    def waiting() -> None:
        going(desk, [job for job in desk.jobs.jobs.values() if job.kind == kind])

    @ui.refreshable
    def shown() -> None:
        for name, one in reversed(list(known().items())[-MOST:]):
            show(name, one)

    def moved() -> None:
        waiting.refresh()
        ended = [job.name for job in desk.jobs.jobs.values() if job.kind == kind and job.message]
        if ended != ends:  # pictures are drawn anew only where there is something new
            ends[:] = ended
            shown.refresh()

    desk.when("jobs", moved)
    waiting()
    shown()


def going(desk: Desk, jobs: Iterable[Job]) -> None:
    """Show how far jobs are, and why those failed that were not run again."""
    for job in {job.title: job for job in jobs}.values():
        if job.state == FAILED:
            text = ui.label(said(f"{job.title}: {job.message}")).classes("text-sm text-negative")
            named(text, f"failed-{job.kind}")
        elif job.state not in ENDED:
            told = desk.jobs.progress(job.name)
            with ui.row().classes("items-center gap-2"):
                ui.spinner()
                share = told[-1][1] if told and job.state == RUNNING else 0.0
                ui.label(f"{job.title}: {job.state}, {100 * share:.0f} %").classes("text-sm")


def drawn(desk: Desk, curves: Sequence[Line2D], above: str, below: str, name: str) -> None:
    """Draw kept curves: those above in one plane, those below in another."""
    for place, (label, own) in enumerate(
        ((above, [c for c in curves if not c.below]), (below, [c for c in curves if c.below]))
    ):
        if own:
            found = [(c.name, _array(c.x), _array(c.y), _colour(c.colour)) for c in own]
            figure = plots.lines(found, x="time [s]", y=label, height=260)
            picture(desk, figure, f"{name}-error" if place else name)


def _array(values: Sequence[float | None]) -> Any:
    return np.array([np.nan if value is None else value for value in values], dtype=np.float64)


def _colour(name: str) -> str:
    return name if name in plots.colours(False) else "series-1"
