"""Recordings of virtual muscles: runs of a paper's protocol on its rig."""

from __future__ import annotations

from mckibben.app.jobs import Tell
from mckibben.app.steps import Role
from mckibben.app.workspace import Workspace

FIRST = "field-models"
"""The protocol that is offered first."""

TITLES = {
    "activation-pressure": "One muscle that moves a carriage under several forces",
    "field-models": "One muscle with a hanging load",
    "mpi-narmax": "One muscle on a rail, driven by a valve's voltage, under several loads",
    "multistate-friction": "One muscle in a test stand: force at held lengths, and in motion",
    "sdchm": "A soft arm of three muscles, and one in its middle that stiffens it",
}
"""What the rigs of protocols are; others are called by their names."""


def record(workspace: Workspace, tell: Tell, *, protocol: str, runs: list[str]) -> str:
    """Record runs of a protocol; a job."""
    from mckibben.rigs import record as recorded

    names = []
    for done, (run, recording) in enumerate(recorded(protocol, runs=runs, seed=0)):
        tell(done / len(runs), run.name)
        role: Role = "test" if run.role == "test" else "train"
        names.append(workspace.add_recording(recording, name=run.name, role=role))
    return f"Recorded {', '.join(names)}"
