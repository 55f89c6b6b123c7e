"""The models compared: which learn from what, with and without the force."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from mckibben import registry
from mckibben.blocks.base import Block
from mckibben.comparison.checkpoints import Checkpoints
from mckibben.errors import ModelWarning
from mckibben.papers.keeping import fitted
from mckibben.papers.mpi_narmax.protocol import HELD
from mckibben.papers.reproduction import Cell, Progress
from mckibben.recording import Recording

SAMPLE_TIME, QUICK_SAMPLE_TIME = 0.02, 0.05
"""That models are fitted and compared at [s]; the rig records at 1 kHz, as the paper's."""

STATUSES = ("status-1", "status-2", "status-3", "status-4")
TEST = STATUSES[3]
ONE_RATE, PULLS = "free-0.1Hz", "training-pulls-100N"
FREE = ("free-0.05Hz", ONE_RATE, "free-0.2Hz")
MORE = (*FREE, *STATUSES[:3], PULLS, "random-1", "random-2")
RANDOM = "random-3"
HELD_RUNS = tuple(f"held-{volt:g}V" for volt in HELD)
UNLOADED = ("MPI-1", "MPI-2", "MPI-3")
AS_PRINTED = "MPI-NARMAX"
THREE_RATES = "MPI-NARMAX, front end of three rates"
MORE_RECORDS = "MPI-NARMAX, more records"
PLAIN = "MPI-NARMAX, ours"
ONE_RECORD = "balance, one record"
OURS = "balance"
MEMORY = "coupled-memory"
PRESSURE = "balance, on recorded pressure"


@dataclass(frozen=True)
class Told:
    """A model that is told the load: what finds it, and the runs that it learns from."""

    family: str
    settings: Mapping[str, Any]
    runs: tuple[str, ...]
    learned: str


_PAPERS = {"method": "pso", "memory": "rdpi", "constants": False, "learns_from": "loaded"}
_OURS = {"method": "ls", "memory": "rdpi", "n_sets": 2}
TOLD = {
    AS_PRINTED: Told("mpi-narmax", _PAPERS, (ONE_RATE, PULLS), "0.1 Hz; pulls of 100 N"),
    THREE_RATES: Told("mpi-narmax", _PAPERS, (*FREE, PULLS), "three rates; pulls of 100 N"),
    MORE_RECORDS: Told("mpi-narmax", _PAPERS | {"learns_from": "all"}, MORE, "more records"),
    PLAIN: Told("mpi-narmax", _OURS, MORE, "more records"),
    ONE_RECORD: Told("balance", {}, (*FREE, PULLS), "three rates; pulls of 100 N"),
    OURS: Told("balance", {}, MORE, "more records"),
    MEMORY: Told("coupled-memory", {}, MORE, "more records"),
    PRESSURE: Told("balance", {"input": ("pressure",)}, MORE, "more records"),
}


def fit_models(
    recordings: Mapping[str, Recording], quick: bool, seed: int, tell: Progress, kept: Checkpoints
) -> tuple[dict[str, Block], list[tuple[Cell, ...]]]:
    """Return the models by name, and what each learned from, its time and its parameters."""
    models: dict[str, Block] = {}
    facts: list[tuple[Cell, ...]] = []
    for name, status in zip(UNLOADED, STATUSES[:3], strict=True):
        tell(0.15, name)
        recording = recordings[status]
        estimator = registry.load("estimators", "rdpi")(
            input="voltage", rate_time_constant=5 * (recording.sample_time or 0.0), seed=seed
        )
        found = fitted(kept, name, estimator, recording)
        models[name] = found.block
        facts.append((name, status, found.seconds, found.block.n_parameters))
    for place, (name, told) in enumerate(TOLD.items()):
        if quick and name == MORE_RECORDS:  # the swarm on all records takes longest
            continue
        tell(0.2 + 0.55 * place / len(TOLD), name)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ModelWarning)
            settings = {"seed": seed, "input": ("voltage",), **told.settings}
            estimator = registry.load("estimators", told.family)(**settings)
            found = fitted(kept, name, estimator, [recordings[run] for run in told.runs])
        models[name] = found.block
        facts.append((name, told.learned, found.seconds, found.block.n_parameters))
    return models, facts
