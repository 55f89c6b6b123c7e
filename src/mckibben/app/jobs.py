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
from dataclasses import dataclass, field
from typing import Any

from pydantic import Field, ValidationError

from mckibben.app.steps import Plain, Text
from mckibben.app.terms import said
from mckibben.app.workspace import Workspace
from mckibben.errors import MckibbenError, MckibbenWarning, unforeseen
from mckibben.system.threads import cores
from mckibben.system.workers import context, end_with_parent, prepare

WAITING, RUNNING, DONE, FAILED = "waiting", "running", "done", "failed"
CANCELLED, INTERRUPTED = "cancelled", "interrupted"

KINDNESS = 5
"""Niceness of jobs, so that the page stays quick."""

SPACING = 0.2
"""Least time between two reports of progress [s]."""

PRELOADED = "mckibben.app.preloaded"
"""What jobs need, loaded once for all."""

Tell = Callable[..., None]
"""Called with the share done, and words or the least cost so far."""

Work = Callable[..., str]


class Note(Plain):
    """What a folder keeps of a job."""

    kind: Text
    state: Text
    message: Text = ""
    given: dict[str, Any] = Field(default_factory=dict)


@dataclass
class Job:
    """A job: what it does, how far it is, how it went.

    Parameters
    ----------
    name : str
        Of its file.
    kind : str
        Name of the work, such as ``"fit"``.
    title : str
        What a person calls it.
    given : dict
        Arguments of the work.
    state : {"waiting", "running", "done", "failed", "cancelled", "interrupted"}
    message : str
        How it went.
    progress : list of (seconds, share, words or cost)
    """

    name: str
    kind: str
    title: str
    given: dict[str, Any] = field(default_factory=dict)
    state: str = WAITING
    message: str = ""
    progress: list[tuple[float, float, Any]] = field(default_factory=list)
    work: Work | None = field(default=None, repr=False)
    process: Any = field(default=None, repr=False)
    pipe: Any = field(default=None, repr=False)

    @property
    def active(self) -> bool:
        """Whether it waits or runs."""
        return self.state in (WAITING, RUNNING)

    @property
    def share(self) -> float:
        """Share done, from 0 to 1."""
        return self.progress[-1][1] if self.progress else 0.0


class Jobs:
    """The jobs of a folder; unfinished ones of an earlier server are interrupted.

    Parameters
    ----------
    workspace : Workspace
    at_once : int, optional
        How many run at the same time; default as many as cores.
    """

    def __init__(self, workspace: Workspace, at_once: int | None = None) -> None:
        self.workspace, self.at_once = workspace, at_once or cores()
        self.jobs: dict[str, Job] = {}
        for name in workspace.names("jobs"):
            with suppress(ValidationError):
                note = Note.model_validate(workspace.read("jobs", name))
                title = str(note.given.get("title") or note.given.get("name") or note.kind)
                job = Job(name, note.kind, title, note.given, note.state, note.message)
                if job.active:
                    job.state = INTERRUPTED
                    job.message = "the workbench was closed before it was done"
                    _write(workspace, job)
                self.jobs[name] = job

    def submit(self, work: Work, title: str, **given: Any) -> Job:
        """Queue a job; one that is the same as one that waits or runs is returned instead.

        Raises
        ------
        DataError
            If the folder cannot be written to.
        """
        kind = work.__name__
        for job in self.active():
            if (job.kind, job.title, job.given) == (kind, title, given):
                return job
        job = Job(self.workspace.new_name("jobs", f"{kind}-{title}"), kind, title, given, work=work)
        _write(self.workspace, job)
        self.jobs[job.name] = job
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
        begun = waiting[: max(free, 0)]
        for job in begun:
            self._start(job)
        return any(ended) or bool(begun)

    def _hear(self, job: Job) -> bool:
        ended = not job.process.is_alive()  # before the last words, so that none is missed
        with suppress(EOFError, OSError):
            while job.pipe.poll():
                job.progress.append(job.pipe.recv())
        if ended:
            note = self.workspace.read("jobs", job.name) or {}
            job.state, job.message = str(note.get("state")), str(note.get("message", ""))
            if job.state not in (DONE, FAILED):
                job.state, job.message = FAILED, "its process ended early; is memory or disk full?"
                _write(self.workspace, job)
            job.pipe.close()
            job.process = job.pipe = None
        return ended

    def _start(self, job: Job) -> None:
        prepare(PRELOADED)
        job.pipe, there = context(PRELOADED).Pipe(duplex=False)
        arguments = (str(self.workspace.folder), job.name, job.title, job.work, job.given, there)
        job.process = context(PRELOADED).Process(target=_run, args=arguments, daemon=True)
        job.process.start()
        there.close()
        job.state = RUNNING

    def cancel(self, name: str) -> None:
        """End a job; what it wrote before stays."""
        job = self.jobs[name]
        if not job.active:
            return
        if job.process is not None:
            job.process.terminate()
            job.process.join(2.0)
            if job.process.is_alive():
                job.process.kill()
            job.pipe.close()
        job.process = job.pipe = None
        job.state = CANCELLED
        _write(self.workspace, job)
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
            if job.process is not None:
                job.process.terminate()


def warm() -> None:
    """Load what jobs will need, so that the first one starts at once; it takes seconds."""
    prepare(PRELOADED)
    first = context(PRELOADED).Process(target=int, daemon=True)
    first.start()
    first.join()


def _write(workspace: Workspace, job: Job) -> None:
    given = job.given | {"title": job.title}
    note = Note(kind=job.kind, state=job.state, message=job.message[:5000], given=given)
    workspace.write("jobs", job.name, note.model_dump(mode="json"))


def _run(folder: str, name: str, title: str, work: Work, given: dict[str, Any], pipe: Any) -> None:
    """Do the work; this runs in the job's process."""
    end_with_parent()
    if hasattr(os, "nice"):
        os.nice(KINDNESS)
    os.umask(0o077)
    started, last = time.monotonic(), -SPACING

    def tell(share: float, what: str | float = "", *_: Any) -> None:
        nonlocal last
        now = time.monotonic()
        if now - last >= SPACING or share >= 1:
            last = now
            pipe.send((now - started, float(share), what))

    warnings.simplefilter("ignore", MckibbenWarning)  # results have notes
    workspace = Workspace(folder)
    job = Job(name, work.__name__, title, given)
    try:
        tell(0.0)
        job.message, job.state = work(workspace, tell, **given), DONE
    except MckibbenError as error:
        job.message, job.state = said(error), FAILED
    except Exception as error:
        job.message, job.state = str(unforeseen(error)), FAILED
    _write(workspace, job)
