"""Jobs in the background, each a process of its own, so that any can be cancelled at any time.

What a job is, and how it went, is a file in the workspace; results are written by the job itself,
whole or not at all. Killing the workbench ends its jobs, and loses nothing that was finished.
"""

from __future__ import annotations

import os
import time
from dataclasses import dataclass, field
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

from mckibben.app.workspace import Workspace
from mckibben.threads import cores
from mckibben.workers import context, end_with_parent, prepare

WAITING, RUNNING, DONE, FAILED = "waiting", "running", "done", "failed"
CANCELLED, INTERRUPTED = "cancelled", "interrupted"
ENDED = (DONE, FAILED, CANCELLED, INTERRUPTED)

KINDNESS = 5
"""Niceness of jobs, so that the page stays quick."""

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
        return str(self.given.get("title") or self.given.get("model") or self.kind)


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
        self.jobs: dict[str, Job] = {}
        for name in workspace.names("jobs"):
            content = workspace.read_json("jobs", name)
            if content is None or not isinstance(content.get("given"), dict):
                continue
            job = Job(
                name,
                str(content.get("kind")),
                content["given"],
                str(content.get("state")),
                str(content.get("message", "")),
            )
            if job.state not in ENDED:
                job.state = INTERRUPTED
                job.message = "the workbench was closed before it was done"
            self.jobs[name] = job

    def submit(self, kind: str, given: dict[str, Any]) -> Job:
        """Queue a job."""
        name = self.workspace.new_name("jobs", f"{kind}-{given.get('model', '')}")
        job = Job(name, kind, given)
        self.jobs[name] = job
        self._note(job)
        self.poll()
        return job

    def poll(self) -> bool:
        """Start what can be started and see what has ended; tell whether anything changed."""
        changed = False
        for job in self.jobs.values():
            if job.state == RUNNING and job.process is not None and not job.process.is_alive():
                self._finish(job)
                changed = True
        running = sum(job.state == RUNNING for job in self.jobs.values())
        for job in self.jobs.values():
            if job.state == WAITING and running < self.at_once:
                self._start(job)
                running += 1
                changed = True
        return changed

    def cancel(self, name: str) -> None:
        """End a job; what it had finished before stays."""
        job = self.jobs[name]
        if job.state in ENDED:
            return
        if job.process is not None:
            job.process.terminate()
            job.process.join(2.0)
            if job.process.is_alive():
                job.process.kill()
        job.state, job.message, job.process = CANCELLED, "cancelled", None
        self._note(job)
        self.poll()

    def forget(self, name: str) -> None:
        """Take an ended job off the list."""
        if self.jobs[name].state in ENDED:
            del self.jobs[name]
            self.workspace.path("jobs", f"{name}.json").unlink(missing_ok=True)
            self._progress(name).unlink(missing_ok=True)

    def close(self) -> None:
        """End all jobs."""
        for name in list(self.jobs):
            self.cancel(name)

    def active(self) -> list[Job]:
        """Return the jobs that wait or run."""
        return [job for job in self.jobs.values() if job.state not in ENDED]

    def progress(self, name: str) -> list[tuple[float, float, float]]:
        """Return what a job told: seconds, share done, least cost so far."""
        try:
            lines = self._progress(name).read_text(encoding="utf-8").splitlines()
        except OSError:
            return []
        told = []
        for line in lines:
            words = line.split()
            if len(words) == 3:
                told.append((float(words[0]), float(words[1]), float(words[2])))
        return told

    def _progress(self, name: str) -> Path:
        return self.workspace.path("jobs", f"{name}.progress")

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
        content = self.workspace.read_json("jobs", job.name) or {}
        job.process = None
        if content.get("state") in (DONE, FAILED):
            job.state, job.message = content["state"], str(content.get("message", ""))
        else:
            job.state, job.message = FAILED, "the process ended without a word; is memory short?"
            self._note(job)
        self.workspace.log(
            f"{job.kind} {job.title}: {job.state}. {job.message}", job.given.get("call", "")
        )

    def _note(self, job: Job) -> None:
        note(self.workspace, job.name, job.kind, job.given, job.state, job.message)


def note(
    workspace: Workspace, name: str, kind: str, given: dict[str, Any], state: str, message: str
) -> None:
    """Write down what a job is and how it went."""
    content = {"kind": kind, "state": state, "message": message, "given": given}
    workspace.write_json("jobs", name, content)


def run(folder: str, name: str, kind: str, given: dict[str, Any]) -> None:
    """Do a job; this is what its process runs."""
    from mckibben.app.work import WORK
    from mckibben.errors import MckibbenError

    if hasattr(os, "nice"):
        os.nice(KINDNESS)
    end_with_parent()
    workspace = Workspace(folder)
    path = workspace.path("jobs", f"{name}.progress")
    started, last = time.monotonic(), -TELLING

    with path.open("w", encoding="utf-8") as file:

        def tell(share: float, cost: float) -> None:
            nonlocal last
            now = time.monotonic()
            if now - last >= TELLING or share >= 1.0:
                last = now
                file.write(f"{now - started:.2f} {share:.4f} {cost:.6g}\n")
                file.flush()

        tell(0.0, float("nan"))
        try:
            message, state = WORK[kind](workspace, given, tell), DONE
        except MckibbenError as error:
            message, state = str(error), FAILED
        except Exception as error:  # a job that fails must say so, whatever it did
            message, state = f"{type(error).__name__}: {error}", FAILED
    note(workspace, name, kind, given, state, message)


def parse_settings(text: str) -> dict[str, Any]:
    """Return settings given as ``name=value`` lines, values as JSON where they are that."""
    from mckibben.estimators.settings import setting_value

    settings: dict[str, Any] = {}
    for line in filter(None, (part.strip() for part in text.replace(",", "\n").splitlines())):
        name, _, value = line.partition("=")
        settings[name.strip()] = setting_value(value.strip())
    return settings
