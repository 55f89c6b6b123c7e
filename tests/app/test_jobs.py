"""Jobs run in processes of their own, can be cancelled, and lose nothing that was finished."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from mckibben.app.jobs import Jobs
from mckibben.app.workspace import Workspace
from tests.app.simulated import asked, filled

pytestmark = pytest.mark.long

PATIENCE = 120.0


def wait(jobs: Jobs) -> None:
    until = time.monotonic() + PATIENCE
    while jobs.active():
        assert time.monotonic() < until, "the jobs do not end"
        jobs.poll()
        time.sleep(0.05)


def test_cancelled_at_once_and_restarted(tmp_path: Path) -> None:
    workspace = filled(tmp_path)
    jobs = Jobs(workspace, at_once=1)
    slow = jobs.submit("fit", asked("gpi", "slow", n_starts=5000))
    waiting = jobs.submit("fit", asked("pi", "quick"))
    while slow.state != "running":
        jobs.poll()
    started = time.monotonic()
    jobs.cancel(slow.name)
    assert time.monotonic() - started < 3.0
    assert slow.state == "cancelled"
    wait(jobs)
    assert waiting.state == "done"
    assert workspace.models() == ["quick"]
    jobs.forget(slow.name)
    assert slow.name not in Jobs(workspace).jobs


SCRIPT = """
import sys, time
from mckibben.app.jobs import Jobs
from mckibben.app.workspace import Workspace
from tests.app.simulated import asked
workspace = Workspace(sys.argv[1])
jobs = Jobs(workspace, at_once=2)
if __name__ == "__main__":
    for number in range(6):
        jobs.submit("fit", asked("pi", f"m{number}", n_operators=5 + number))
    print("ready", flush=True)
    while jobs.active():
        jobs.poll()
        time.sleep(0.02)
    time.sleep(60)
"""


def killed(folder: Path, after: float, finished: int = 0) -> None:
    """Start a batch of fits, and kill the workbench a time after so many have ended."""
    script = folder.parent / "batch.py"
    script.write_text(SCRIPT)
    process = subprocess.Popen(
        [sys.executable, str(script), str(folder)],
        stdout=subprocess.PIPE,
        env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])},
    )
    assert process.stdout is not None
    process.stdout.readline()
    until = time.monotonic() + PATIENCE
    while len(list((folder / "results").glob("*.json"))) < finished and time.monotonic() < until:
        time.sleep(0.02)
    time.sleep(after)
    process.send_signal(signal.SIGKILL)
    process.wait()
    process.stdout.close()


def check_after_kill(folder: Path) -> int:
    """Demand that everything finished is there and whole; return how many fits were finished."""
    workspace = Workspace(folder)
    jobs = [workspace.read_json("jobs", name) for name in workspace.names("jobs")]
    done = [job["given"]["name"] for job in jobs if job and job["state"] == "done"]
    assert None not in jobs
    for name in {*done, *workspace.names("models")}:
        assert workspace.model(name).kind == "pi"
    for name in {*done, *workspace.names("results")}:
        assert (workspace.read_json("results", name) or {})["test"]["rmse"] > 0
    assert len(workspace.with_role("train")) == 1
    reopened = Jobs(workspace)
    assert {job.state for job in reopened.jobs.values()} <= {"done", "interrupted"}
    return len(done)


def test_killed_while_it_fits_it_keeps_what_was_finished(tmp_path: Path) -> None:
    filled(tmp_path / "ws")
    killed(tmp_path / "ws", 0.2, finished=3)
    # of those with a result, one may have been killed before it said so
    assert check_after_kill(tmp_path / "ws") >= 1


def test_jobs_end_with_the_workbench(tmp_path: Path) -> None:
    folder = tmp_path / "ws"
    filled(folder)
    killed(folder, 1.0)
    time.sleep(2.5)
    before = sorted(path.name for path in (folder / "results").iterdir())
    time.sleep(2.0)
    assert sorted(path.name for path in (folder / "results").iterdir()) == before
