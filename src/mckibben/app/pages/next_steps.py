"""What comes after a fit: is the model right, and what is to be recorded next."""

from __future__ import annotations

import asyncio

from nicegui import ui

from mckibben.app import fields
from mckibben.app.desk import Desk, guarded, named
from mckibben.app.jobs import DONE, ENDED, RUNNING, Job
from mckibben.app.pages.taking_code import LARGEST
from mckibben.system.ordinary import read_bytes

KINDS = ("check", "plan")

SHOWN = 4
"""Checks and plans that are listed."""


def buttons(desk: Desk, name: str) -> None:
    """Offer to check a model, and to plan for it, and show what came of that."""
    with ui.row().classes("items-end gap-2"):
        named(
            ui.button(f"Is {name} right?", on_click=lambda: _check(desk, name)).props("outline"),
            "check",
        )
        if all(one.sample_time is not None for one in desk.workspace.used().values()):
            minutes = ui.number("Minutes to record", value=3.0, min=0.2, max=60.0).classes("w-36")
            named(
                ui.button(
                    "What to record next",
                    on_click=lambda: plan(desk, name, float(minutes.value or 3.0)),
                ).props("outline"),
                "plan",
            )
        else:
            ui.label("What to record next is planned in time, which these recordings do not have.")
    done(desk, name)


def _check(desk: Desk, name: str) -> None:
    call = f"mckibben.check(mckibben.load('models/{name}.json'), test)"
    given = {"name": name, "title": f"check {name}", "call": call}
    desk.jobs.submit("check", given | {"file": f"{name}-check.html"})
    desk.did(f"started checking {name}", call)
    desk.changed("jobs")


def plan(desk: Desk, name: str | None, minutes: float) -> None:
    """Start planning what to record, for a model; None for the usual one."""
    model = f"mckibben.load('models/{name}.json')" if name else "None"
    call = f"mckibben.plan(recordings, model={model}, minutes={minutes:g})"
    given = {"name": name or "", "minutes": minutes, "title": "plan", "call": call, "seed": 0}
    file = f"{desk.workspace.new_name('takeaway', 'record-next', '.csv')}.csv"
    desk.jobs.submit("plan", given | {"file": file})
    desk.did("started planning", call)
    desk.changed("jobs")


def done(desk: Desk, name: str) -> None:
    """Show checks of a model and plans for it: how far they are, what they say, and their files."""

    @ui.refreshable
    def shown() -> None:
        every = desk.jobs.jobs.values()
        jobs = [job for job in every if job.kind in KINDS and job.given.get("name") in (name, "")]
        for job in list(reversed(jobs))[:SHOWN]:
            _line(desk, job)

    desk.when("jobs", shown.refresh)
    with named(ui.column().classes("w-full gap-1"), "checks-and-plans"):
        shown()


def _line(desk: Desk, job: Job) -> None:
    with ui.row().classes("w-full items-center gap-2 no-wrap"):
        if job.state not in ENDED:
            told = desk.jobs.progress(job.name)
            share = told[-1][1] if told and job.state == RUNNING else 0.0
            ui.spinner()
            ui.label(f"{job.title}: {100 * share:.0f} %").classes("text-sm flex-1")
            return
        text = job.message if job.state == DONE else job.said
        said = ui.label(fields.said(f"{job.title}: {text}")).classes(
            "text-sm flex-1 min-w-0 break-words"
        )
        named(said, f"{job.kind}-said")
        file = str(job.given.get("file", ""))
        path = desk.workspace.path("takeaway", file)
        if job.state == DONE and path.is_file():

            async def get() -> None:
                content = await asyncio.to_thread(read_bytes, path, most=LARGEST)
                ui.download(content, file)

            button = ui.button(f"Get {file}", on_click=guarded(get)).props("outline dense no-caps")
            named(button, f"get-{job.kind}")
