"""Jobs in the background, each a process of its own, so that any can be cancelled at any time.

What a job is, and how it went, is a file in the workspace; results are written by the job itself,
whole or not at all. Killing the workbench ends its jobs, and loses nothing that was finished. Where
another workbench has the folder, its jobs are shown as they stand, and none is started.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

from mckibben.app import kept
from mckibben.app.fields import said
from mckibben.app.workspace import Workspace
from mckibben.errors import DataError
from mckibben.system.ordinary import DESCRIPTION, read_bytes
from mckibben.system.threads import cores
from mckibben.system.workers import context, end_with_parent, prepare

WAITING, RUNNING, DONE, FAILED = "waiting", "running", "done", "failed"
CANCELLED, INTERRUPTED = "cancelled", "interrupted"
ENDED = (DONE, FAILED, CANCELLED, INTERRUPTED)

KINDNESS = 5
"""Niceness of jobs, so that the page stays quick."""

PLACES = {"fit": "models", "force": "forces", "loop": "runs", "review": "reviews"}
"""Kinds of jobs whose results have a name, and where."""

UNWRITTEN = 74
"""What a job leaves with that could not write down how it went; by custom for input and output."""

TELLING = 0.2
"""Least time between two lines of progress [s]."""


@dataclass
class Job:
    """One job.

    Parameters
    ----------
    name : str
        Its name in the workspace.
    kind : str
        What it does; see `mckibben.app.work`.
    given : dict
        Arguments.
    state : str
        waiting, running, done, failed, cancelled or interrupted.
    message : str
        How it went.
    """

    name: str
    kind: str
    given: dict[str, Any]
    state: str = WAITING
    message: str = ""
    process: BaseProcess | None = field(default=None, repr=False)

    @property
    def title(self) -> str:
        """What it is, in a word or two."""
        given = self.given
        return str(given.get("title") or given.get("name") or given.get("model") or self.kind)

    @property
    def said(self) -> str:
        """How it ended, each word once."""
        return self.state if self.message in ("", self.state) else f"{self.state}: {self.message}"


def _nothing() -> None:
    """Do nothing, in a process that shows that processes can be started."""


class Jobs:
    """The jobs of a workspace.

    Parameters
    ----------
    workspace : Workspace
        Where they read and write.
    at_once : int, optional
        How many run at the same time; default as many as cores.
    """

    def __init__(self, workspace: Workspace, at_once: int | None = None) -> None:
        self.workspace = workspace
        self.at_once = at_once or cores()
        self.untold: list[str] = []
        """What could not be written down, for the page to tell."""
        self._seen, self._warmed = -1, False
        self._asked: list[tuple[str, Job]] = []
        self.jobs = self._kept()

    def _kept(self) -> dict[str, Job]:
        found = {}
        for name in self.workspace.names("jobs"):
            noted = kept.checked(kept.Noted, self.workspace.read_json("jobs", name))
            if noted is None:
                continue
            given = noted.given.model_dump(exclude_unset=True)
            job = Job(name, noted.kind, given, noted.state, noted.message)
            if job.state not in ENDED and not self.workspace.read_only:
                job.state = INTERRUPTED
                job.message = "the workbench was closed before it was done"
                self._note(job)
            found[name] = job
        return found

    def submit(self, kind: str, given: dict[str, Any]) -> Job:
        """Queue a job; where its result has a name, it gets one like that wished for, its own.

        One that is asked for again, on the same recordings, while it waits or runs is not begun
        twice: it is returned as it is.

        Raises
        ------
        DataError
            If it cannot be written down.
        """
        asked = self._asked_for(kind, given)
        for known, job in self._asked:
            if known == asked and job.state not in ENDED:
                return job
        name = self.workspace.new_name("jobs", f"{kind}-{given.get('model', '')}")
        place = PLACES.get(kind)
        if place is not None:
            given = given | {"name": self.workspace.new_name(place, str(given["name"]))}
        job = Job(name, kind, given)
        try:
            self._write(job)
        except DataError:
            self._give_back(job)
            raise
        self.jobs[name] = job
        self._asked = [(known, one) for known, one in self._asked if one.state not in ENDED]
        self._asked.append((asked, job))
        self.poll()
        return job

    def _asked_for(self, kind: str, given: dict[str, Any]) -> str:
        """Return what a job is, the same for the same: what it does, and the recordings there are."""
        changed = (self.workspace.folder / "recordings").stat().st_mtime_ns
        return f"{kind} {changed} {sorted(given.items())}"

    def poll(self) -> bool:
        """Start what can be started and see what has ended; tell whether anything changed."""
        changed = False
        if self.workspace.read_only:
            return self._look()
        for job in list(self.jobs.values()):
            if job.state == RUNNING and job.process is not None and not job.process.is_alive():
                self._finish(job)
                changed = True
        running = sum(job.state == RUNNING for job in self.jobs.values())
        for job in list(self.jobs.values()):
            if job.state == WAITING and running < self.at_once:
                self._start(job)
                running += 1
                changed = True
        return changed

    def _look(self) -> bool:
        """See how the jobs of another workbench do."""
        seen = (self.workspace.folder / "jobs").stat().st_mtime_ns
        changed, self._seen = seen != self._seen, seen
        if changed:
            self.jobs = self._kept()
        return changed

    def cancel(self, name: str) -> None:
        """End a job; what it had finished before stays.

        Raises
        ------
        DataError
            If it is another workbench's.
        """
        self.workspace.demand()
        job = self.jobs.get(name)
        if job is None or job.state in ENDED:
            return
        if job.process is not None:
            job.process.terminate()
            job.process.join(2.0)
            if job.process.is_alive():
                job.process.kill()
        job.state, job.message, job.process = CANCELLED, "", None
        self._note(job)
        self._give_back(job)
        self.poll()

    def forget(self, name: str) -> None:
        """Take an ended job off the list."""
        self.workspace.demand()
        if name in self.jobs and self.jobs[name].state in ENDED:
            del self.jobs[name]
            self.workspace.path("jobs", f"{name}.json").unlink(missing_ok=True)
            self._progress(name).unlink(missing_ok=True)

    def close(self) -> None:
        """End all jobs."""
        for job in self.active() if not self.workspace.read_only else []:
            self.cancel(job.name)

    def active(self) -> list[Job]:
        """Return the jobs that wait or run."""
        return [job for job in self.jobs.values() if job.state not in ENDED]

    def progress(self, name: str) -> list[tuple[float, float, float]]:
        """Return what a job told: seconds, share done, least cost so far."""
        try:
            return kept.progress(read_bytes(self._progress(name), most=DESCRIPTION))
        except DataError:
            return []

    def _progress(self, name: str) -> Path:
        return self.workspace.path("jobs", f"{name}.progress")

    def warm(self) -> None:
        """Load what processes will need, so that the first job starts at once; it takes seconds."""
        if not self._warmed and not self.workspace.read_only:
            self._warmed = True
            prepare()
            first = context().Process(target=_nothing, daemon=True)
            first.start()
            first.join()

    def _start(self, job: Job) -> None:
        prepare()
        job.process = context().Process(
            target=run,
            args=(str(self.workspace.folder), job.name, job.kind, job.given),
            daemon=True,
        )
        job.process.start()
        job.state = RUNNING
        self._note(job)

    def _finish(self, job: Job) -> None:
        noted = kept.checked(kept.Noted, self.workspace.read_json("jobs", job.name))
        code = None if job.process is None else job.process.exitcode
        job.process = None
        if noted is not None and noted.state in (DONE, FAILED):
            job.state, job.message = noted.state, noted.message
        else:
            job.state, job.message = FAILED, "the process ended without a word; is memory short?"
            if code == UNWRITTEN:
                job.message = "how it went could not be written down; is the disk full?"
            self._note(job)
        self._give_back(job)
        with self._told():
            self.workspace.log(
                f"{job.kind} {job.title}: {job.state}. {job.message}",
                str(job.given.get("call", "")),
            )

    def _give_back(self, job: Job) -> None:
        """Free the names of a job that came to nothing."""
        self.workspace.give_back("jobs", job.name)
        if job.kind in PLACES:
            self.workspace.give_back(PLACES[job.kind], str(job.given.get("name")))

    def _note(self, job: Job) -> None:
        with self._told():
            self._write(job)

    def _write(self, job: Job) -> None:
        note(self.workspace, job.name, job.kind, job.given, job.state, job.message)

    @contextmanager
    def _told(self) -> Iterator[None]:
        """Keep what could not be written for the page to tell: jobs go on and end without it."""
        try:
            yield
        except DataError as error:
            self.untold.append(str(error))


def note(
    workspace: Workspace, name: str, kind: str, given: dict[str, Any], state: str, message: str
) -> None:
    """Write down what a job is and how it went."""
    content = {"kind": kind, "state": state, "message": message, "given": given}
    workspace.write_json("jobs", name, content)


def by_name(workspace: Workspace, text: str) -> str:
    """Return a text in the words of the workbench: recordings by their names, not by their files."""
    for entry in workspace.entries():
        for file in (str(entry.path), f"{entry.path.parent.name}/{entry.path.name}"):
            text = text.replace(file, entry.name)
    return said(text)


def run(folder: str, name: str, kind: str, given: dict[str, Any]) -> None:
    """Do a job; this is what its process runs."""
    from mckibben.app.work import WORK
    from mckibben.errors import MckibbenError, unforeseen

    end_with_parent()
    if hasattr(os, "nice"):
        os.nice(KINDNESS)
    os.umask(0o077)  # what is written is its user's alone
    workspace = Workspace(folder)
    held = ExitStack()
    held.enter_context(workspace.work())
    path = workspace.path("jobs", f"{name}.progress")
    started, last = time.monotonic(), -TELLING

    def tell(share: float, cost: float) -> None:
        nonlocal last
        now = time.monotonic()
        if now - last >= TELLING or share >= 1.0:
            last = now
            # how far it is can be done without, on a disk that is full
            with suppress(OSError), path.open("a", encoding="utf-8") as file:
                file.write(f"{now - started:.2f} {share:.4f} {cost:.6g}\n")

    try:
        tell(0.0, float("nan"))
        message, state = WORK[kind](workspace, given, tell), DONE
    except MckibbenError as error:
        message, state = str(error), FAILED
    except Exception as error:  # a job that fails must say so, whatever it did
        message, state = str(unforeseen(error)), FAILED
    try:
        note(workspace, name, kind, given, state, by_name(workspace, message)[: kept.LONGEST])
    except DataError:
        sys.exit(UNWRITTEN)
    held.close()
