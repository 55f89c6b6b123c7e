"""Jobs: a process each; what is finished is in the folder, whatever happens to the server."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from mckibben import example
from mckibben.app.jobs import CANCELLED, DONE, FAILED, INTERRUPTED, RUNNING, WAITING, Jobs
from mckibben.app.terms import GAPS
from mckibben.app.workspace import Workspace
from tests.app import work


def holds(true: Callable[[], object], seconds: float = 60.0) -> None:
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end, "it is never so"
        time.sleep(0.05)


def finished(jobs: Jobs) -> bool:
    jobs.poll()
    return not jobs.active()


@pytest.fixture
def workspace(tmp_path: Path) -> Workspace:
    return Workspace(tmp_path)


def test_a_job_reports_and_leaves_its_result(workspace: Workspace) -> None:
    jobs = Jobs(workspace)
    job = jobs.submit(work.count, "counting", to=3)
    assert jobs.submit(work.count, "counting", to=3) is job  # the same is not done twice
    holds(lambda: finished(jobs))
    assert (job.state, job.message, job.kind) == (DONE, "3", "count")
    assert job.progress[0][1] == 0.0
    assert workspace.read("runs", "count-3") == {"to": 3}
    kept = Jobs(Workspace(workspace.folder)).jobs[job.name]
    assert (kept.state, kept.message, kept.title) == (DONE, "3", "counting")


def test_errors_are_in_terms_of_controls_and_deaths_are_noticed(workspace: Workspace) -> None:
    jobs = Jobs(workspace)
    refused, died = jobs.submit(work.refuse, "refused"), jobs.submit(work.die, "died")
    holds(lambda: finished(jobs))
    assert (refused.state, died.state) == (FAILED, FAILED)
    assert GAPS["split"] in refused.message
    assert died.message


def test_jobs_wait_for_their_turn_and_can_be_cancelled(workspace: Workspace) -> None:
    jobs = Jobs(workspace, at_once=1)
    first, second = (jobs.submit(work.sleep, word, mark=word) for word in ("one", "two"))
    holds(lambda: workspace.read("runs", "one"))
    assert (first.state, second.state) == (RUNNING, WAITING)
    jobs.cancel(first.name)
    assert (first.state, second.state) == (CANCELLED, RUNNING)
    jobs.cancel(second.name)
    jobs.forget(second.name)
    assert list(Jobs(workspace).jobs) == [first.name]


SERVER = """
import sys, time
from mckibben.app.jobs import Jobs
from mckibben.app.terms import GAPS
from mckibben.app.workspace import Workspace
from tests.app import work
jobs = Jobs(Workspace(sys.argv[1]))
jobs.submit(work.count, "count", to=1)
while jobs.active():
    jobs.poll(); time.sleep(0.05)
jobs.submit(work.sleep, "sleep", mark="asleep")
time.sleep(600)
"""


def test_a_killed_server_loses_nothing_finished_and_leaves_no_process(workspace: Workspace) -> None:
    server = subprocess.Popen([sys.executable, "-c", SERVER, str(workspace.folder)])
    try:
        holds(lambda: workspace.read("runs", "asleep"))
    finally:
        os.kill(server.pid, signal.SIGKILL)
        server.wait()
    found = {job.kind: job.state for job in Jobs(workspace).jobs.values()}
    assert found == {"count": DONE, "sleep": INTERRUPTED}
    assert workspace.read("runs", "count-1") == {"to": 1}
    pid = (workspace.read("runs", "asleep") or {})["pid"]
    holds(lambda: not Path(f"/proc/{pid}/cmdline").exists() or not _alive(pid))


def _alive(pid: int) -> bool:
    try:
        return "\nState:\tZ" not in Path(f"/proc/{pid}/status").read_text()
    except OSError:
        return False


@pytest.mark.filterwarnings("ignore::mckibben.errors.DataWarning")
def test_a_fit_is_in_the_results(workspace: Workspace) -> None:
    for path, role in ((example.TRAIN, "train"), (example.TEST, "test")):
        with workspace.receiving(path.name, path.stat().st_size) as (part, kept):
            part.write_bytes(path.read_bytes())
        (name,) = workspace.add(kept.name)
        workspace.change(name, role=role)
    jobs = Jobs(workspace)
    job = jobs.submit(work.fit, "p1", name="poly", model="p1")
    holds(lambda: finished(jobs), 300.0)
    assert job.state == DONE, job.message
    (row,) = workspace.results()
    assert (row["name"], row["current"]) == ("poly", True)
    assert workspace.models() == ["poly"]
    assert workspace.model("poly").outputs[0].name == "displacement"
    workspace.change(name, role="unused")
    assert [one["current"] for one in workspace.results()] == [False]
