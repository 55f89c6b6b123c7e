"""All that came of the runs and the models, which tables and sentences are written from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.control import (
    Tracked,
)
from mckibben.papers.mpi_narmax.models import FREE, HELD_RUNS, TOLD
from mckibben.papers.mpi_narmax.protocol import HELD_CYCLE, PULLED_FROM
from mckibben.papers.reproduction import Cell, rms
from mckibben.recording import Recording


@dataclass(frozen=True)
class Found:
    """All that the report is written from; displacements are by model, then by run."""

    recordings: Mapping[str, Recording]
    models: Mapping[str, Block]
    displacements: Mapping[str, Mapping[str, Array]]
    facts: list[tuple[Cell, ...]]
    estimate: Block
    half_width: float
    loops: Mapping[str, Tracked]
    drift: Mapping[str, float]
    warned: list[str]
    quick: bool

    def counted(self, run: str, values: Array) -> Array:
        """Return what counts of a run: of a held voltage, the time in which the force is cycled."""
        first = PULLED_FROM if run in HELD_RUNS else 0.0
        return values[round(first / (self.recordings[run].sample_time or 1.0)) :]

    def errors(self, model: str, *runs: str) -> tuple[float, float]:
        """Return MAE and RMSE over runs [mm]."""
        missed = np.concatenate(
            [
                self.counted(run, self.displacements[model][run])
                - self.counted(run, self.recordings[run]["displacement"])
                for run in runs
            ]
        )
        return float(np.mean(np.abs(missed))), rms(missed)

    def swing(self, run: str, model: str | None = None) -> float:
        """Return the range of the displacement over the last cycle of the force [mm]."""
        recording = self.recordings[run]
        given = recording["displacement"] if model is None else self.displacements[model][run]
        n = round(HELD_CYCLE / (recording.sample_time or 1.0))
        return round(float(np.ptp(given[-n:])), 6)  # what moves less does not move

    @property
    def told(self) -> list[str]:
        """Models that are told the force."""
        return [name for name in self.models if name in TOLD]

    @property
    def forces(self) -> dict[str, tuple[Array, Array]]:
        """Measured and estimated force of the runs with a load that is not held."""
        return {
            name: (recording["force"], self.estimate.simulate(recording)["force"])
            for name, recording in self.recordings.items()
            if name not in FREE and name not in HELD_RUNS
        }
