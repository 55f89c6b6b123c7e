"""What the re-run records: the arm's protocol, or a short version of it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

from mckibben.comparison.checkpoints import Checkpoints
from mckibben.papers.keeping import recorded
from mckibben.papers.reproduction import Progress
from mckibben.papers.sdchm.protocol import PERIOD
from mckibben.recording import Recording
from mckibben.signals.protocol import Protocol, Role, Run, protocol

OUTPUTS = ("displacement_1", "displacement_2", "displacement_3")
EXTENSOR = "pressure_extensor"

STAGES = ("hysteresis", "network", "prediction", "joint")

QUICK_LEVELS = {"train": (0.0, 1.2, 2.5), "test": (1.3,)}
"""Pressures of the extensor whose patterns the quick run records [bar]."""

QUICK_LAST = {"hysteresis": 2, "network": 1, "prediction": 1}
"""Cycles of each run that the quick run records: the last ones, which have the highest peaks."""

QUICK_JOINT = 75.0
"""How much of each joint run the quick run records [s]."""

QUICK_JOINT_RUNS = ("joint-validation-p0-0.5", "joint-test-p0-1.1", "joint-test-moving-3")


@dataclass(frozen=True)
class Recordings:
    """Recorded runs, by name."""

    runs: dict[str, tuple[Run, Recording]]

    def select(self, role: Role | None = None, **labels: Any) -> list[Recording]:
        """Return the recordings of a role, and with all of the labels."""
        return list(self._selected(role, labels))

    def _selected(self, role: Role | None, labels: dict[str, Any]) -> Iterator[Recording]:
        for run, recording in self.runs.values():
            fits = all(run.labels.get(name) == value for name, value in labels.items())
            if fits and role in (None, run.role):
                yield recording

    @property
    def patterns(self) -> list[Recording]:
        """What the paper trains on: each muscle's hysteresis, then the patterns."""
        return self.select("train", stage="hysteresis") + self.select("train", stage="network")


def plan(quick: bool) -> tuple[Protocol, list[str]]:
    """Return the protocol, and the names of the runs of it that are recorded."""
    whole = protocol("sdchm")
    if not quick:
        return whole, [run.name for run in whole.runs if run.labels["stage"] in STAGES]
    short = replace(whole, name="sdchm-quick", runs=tuple(map(_shortened, whole.runs)))
    return short, [run.name for run in short.runs if _quick(run)]


def record_arm(quick: bool, seed: int, tell: Progress, kept: Checkpoints) -> Recordings:
    """Record the protocol on the arm."""
    what, names = plan(quick)
    return Recordings(
        {run.name: (run, made) for run, made in recorded(kept, what, names, seed, tell)}
    )


def _quick(run: Run) -> bool:
    stage, p0 = run.labels["stage"], run.labels["p0"]
    if stage == "network":
        return p0 in QUICK_LEVELS.get(run.role, ())
    if stage == "prediction":
        return bool(p0 == 0.1)
    return stage == "hysteresis" or run.name in QUICK_JOINT_RUNS


def _shortened(run: Run) -> Run:
    stage, inputs = run.labels["stage"], run.inputs
    rate = 1 / (inputs.sample_time or 1.0)
    first, last = 0, len(inputs)
    if stage in QUICK_LAST:
        first = last - round(QUICK_LAST[stage] * PERIOD * rate)
    elif stage == "joint":
        last = round(QUICK_JOINT * rate)
    return replace(run, inputs=replace(inputs.slice(first, last), start_time=0.0))
