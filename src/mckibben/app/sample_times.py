"""Sample times of recordings, which models need to be equal."""

from __future__ import annotations

from mckibben.app.steps import Step
from mckibben.app.workspace import Workspace


def sample_times(workspace: Workspace) -> tuple[float, float] | None:
    """Return the shortest and the longest sample time in use [s]; None where they are alike."""
    times = [run.sample_time for run in workspace.used().values() if run.sample_time is not None]
    if not times or max(times) - min(times) <= 1e-3 * min(times):
        return None
    return min(times), max(times)


def resample(workspace: Workspace, sample_time: float) -> None:
    """Resample the recordings in use that have another sample time."""
    for name, run in workspace.used().items():
        if run.sample_time is not None and abs(run.sample_time - sample_time) > 1e-9 * sample_time:
            workspace.do(name, Step(do="resample", sample_time=sample_time))
