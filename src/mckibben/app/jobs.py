"""Jobs: a queue of functions, each in a process of its own, so that any can be cancelled at any time.

A job is a function at the top of a module, ``work(workspace, tell, **given) -> str``. It calls an
operation of `mckibben.workflow`, writes the result into the folder, and returns what to say. As it
writes by itself, a workbench that is killed loses nothing that was finished. ``given`` is JSON.
"""

from __future__ import annotations

import os
import time
import warnings
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from pydantic import Field, ValidationError

from mckibben.app.steps import StoredModel
from mckibben.app.terms import message_of
from mckibben.app.workspace import Workspace
from mckibben.errors import MckibbenError, MckibbenWarning, unforeseen
from mckibben.system.threads import cores
from mckibben.system.workers import context, end_with_parent, prepare

WAITING, RUNNING, DONE, FAILED = "waiting", "running", "done", "failed"
CANCELLED, INTERRUPTED = "cancelled", "interrupted"

NICENESS = 5
"""Niceness of jobs, so that the page stays quick."""

REPORT_INTERVAL = 0.2
"""Least time between two reports of progress [s]."""

PRELOADED = "mckibben.app.preloaded"
"""What jobs need, loaded once for all."""

Tell = Callable[..., None]
"""Called with the share done, and words or the least cost so far."""

Work = Callable[..., str]


class Job(StoredModel):
    """A job: ``kind`` is the name of its work, ``given`` the arguments of that, ``title`` for people.

    ``progress`` has seconds, shares, and words or costs; ``message`` says how it went.
    """

    name: str = Field(exclude=True)
    kind: str
    title: str = ""
    given: dict[str, Any] = Field(default_factory=dict)
    state: str = WAITING
    message: str = ""
    progress: list[tuple[float, float, Any]] = Field(default_factory=list, exclude=True)
    _process: Any = None
    _pipe: Any = None

    @property
    def active(self) -> bool:
        """Whether it waits or runs."""
        return self.state in (WAITING, RUNNING)

    @property
    def share(self) -> float:
        """Share done, from 0 to 1."""
        return self.progress[-1][1] if self.progress else 0.0


class Jobs:
    """The jobs of a folder, some ``at_once``; unfinished ones of an earlier server are interrupted."""

    def __init__(self, workspace: Workspace, at_once: int | None = None) -> None:
        self.workspace, self.at_once = workspace, at_once or cores()
        self.jobs: dict[str, Job] = {}
        self._works: dict[str, Work] = {}
        for name in workspace.names("jobs"):
            with suppress(ValidationError):
                job = Job.model_validate((workspace.read("jobs", name) or {}) | {"name": name})
                if job.active:
                    self._now(job, INTERRUPTED, "the workbench was closed before it was done")
                self.jobs[name] = job

    def submit(self, work: Work, title: str, **given: Any) -> Job:
        """Queue a job; one that is the same as one that waits or runs is returned instead."""
        kind = work.__name__
        for job in self.active():
            if (job.kind, job.title, job.given) == (kind, title, given):
                return job
        name = self.workspace.new_name("jobs", f"{kind}-{title}")
        job = self.jobs[name] = Job(name=name, kind=kind, title=title, given=given)
        self._works[name] = work
        self._now(job, WAITING)
        self.poll()
        return job

    def active(self) -> list[Job]:
        """Return the jobs that wait or run."""
        return [job for job in self.jobs.values() if job.active]

    def poll(self) -> bool:
        """Hear what jobs report, and start what can be started; return whether any began or ended."""
        ended = [self._hear(job) for job in self.active() if job.state == RUNNING]
        free = self.at_once - sum(job.state == RUNNING for job in self.active())
        waiting = [job for job in self.active() if job.state == WAITING]
        waiting.sort(key=lambda job: job.kind == "fit")  # what else there is takes seconds
        for job in (begun := waiting[: max(free, 0)]):
            self._start(job)
        return any(ended) or bool(begun)

    def _hear(self, job: Job) -> bool:
        ended = not job._process.is_alive()  # before the last words, so that none is missed
        with suppress(EOFError, OSError):
            while job._pipe.poll():
                job.progress.append(job._pipe.recv())
        if ended:
            note = self.workspace.read("jobs", job.name) or {}
            job.state, job.message = str(note.get("state")), str(note.get("message", ""))
            if job.state not in (DONE, FAILED):
                self._now(job, FAILED, "its process ended early; is memory or disk full?")
            job._pipe.close()
        return ended

    def _start(self, job: Job) -> None:
        prepare(PRELOADED)
        pipe, there = context(PRELOADED).Pipe(duplex=False)
        arguments = (str(self.workspace.folder), job, self._works[job.name], there)
        process = context(PRELOADED).Process(target=_run, args=arguments, daemon=True)
        process.start()
        there.close()
        job._process, job._pipe, job.state = process, pipe, RUNNING

    def _now(self, job: Job, state: str, message: str = "") -> None:
        job.state, job.message = state, message
        self.workspace.write("jobs", job.name, job.model_dump())

    def cancel(self, name: str) -> None:
        """End a job; what it wrote before stays."""
        job = self.jobs[name]
        if not job.active:
            return
        if job.state == RUNNING:
            job._process.terminate()
            job._process.join(2.0)
            if job._process.is_alive():
                job._process.kill()
            job._pipe.close()
        self._now(job, CANCELLED)
        self.poll()

    def forget(self, name: str) -> None:
        """Take an ended job off the list."""
        if not self.jobs[name].active:
            del self.jobs[name]
            self.workspace.delete("jobs", name)

    def forget_ended(self, kind: str) -> None:
        """Take all ended jobs of a kind off the list."""
        for job in [job for job in self.jobs.values() if job.kind == kind]:
            self.forget(job.name)

    def close(self) -> None:
        """End all jobs."""
        for job in self.active():
            if job.state == RUNNING:
                job._process.terminate()


def warm() -> None:
    """Load what jobs will need, so that the first one starts at once; it takes seconds."""
    prepare(PRELOADED)
    first = context(PRELOADED).Process(target=int, daemon=True)
    first.start()
    first.join()


def _run(folder: str, job: Job, work: Work, pipe: Any) -> None:
    """Do the work; this runs in the job's process."""
    end_with_parent()
    if hasattr(os, "nice"):
        os.nice(NICENESS)
    os.umask(0o077)
    started, last = time.monotonic(), -REPORT_INTERVAL

    def tell(share: float, what: str | float = "", *_: Any) -> None:
        nonlocal last
        now = time.monotonic()
        if now - last >= REPORT_INTERVAL or share >= 1:
            last = now
            pipe.send((now - started, float(share), what))

    warnings.simplefilter("ignore", MckibbenWarning)  # results have notes
    workspace = Workspace(folder)
    try:
        tell(0.0)
        job.message, job.state = work(workspace, tell, **job.given), DONE
    except MckibbenError as error:
        job.message, job.state = message_of(error), FAILED
    except Exception as error:
        job.message, job.state = str(unforeseen(error)), FAILED
    workspace.write("jobs", job.name, job.model_dump())
