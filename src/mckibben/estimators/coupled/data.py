"""Recordings of several muscles as identification sees them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mckibben.blocks.fields import Channel
from mckibben.errors import DataError
from mckibben.recording import Recording

Array = NDArray[np.float64]

MOVES = 0.1
"""An input moves in a run where it covers this share of the range it has over all runs."""

RESTS = 0.03
"""An input rests where it stays below this share of that range above its lowest value."""

SCHEDULES = ("pressure_extensor", "force")
"""Channels that schedule a model by default, where there are any."""

FEWEST_SAMPLES = 50
"""Fewer samples than this identify nothing of several muscles."""


@dataclass(frozen=True)
class CoupledRun:
    """One recording: pressures (n, k), displacements (n, k) and what schedules (n, s)."""

    name: str
    pressures: Array
    displacements: Array
    scheduled: Array
    sample_time: float | None

    @property
    def inputs(self) -> Array:
        """Pressures, then what schedules, as models take them."""
        return np.ascontiguousarray(np.hstack([self.pressures, self.scheduled]))


@dataclass(frozen=True)
class CoupledData:
    """All runs, and the channels that they share."""

    runs: tuple[CoupledRun, ...]
    pressures: tuple[Channel, ...]
    displacements: tuple[Channel, ...]
    scheduled: tuple[Channel, ...]

    @property
    def lowest(self) -> Array:
        """Lowest pressure of every muscle over all runs."""
        return np.min([run.pressures.min(axis=0) for run in self.runs], axis=0)

    @property
    def highest(self) -> Array:
        """Highest pressure of every muscle over all runs."""
        return np.max([run.pressures.max(axis=0) for run in self.runs], axis=0)

    def alone(self, muscle: int) -> list[CoupledRun]:
        """Return the runs in which one muscle moves and all others rest."""
        span = self.highest - self.lowest
        found = []
        for run in self.runs:
            travel = np.ptp(run.pressures, axis=0)
            above = run.pressures.max(axis=0) - self.lowest
            others = np.delete(above <= RESTS * span, muscle)
            if travel[muscle] > MOVES * span[muscle] and others.all():
                found.append(run)
        return found

    def check_pairs(self, source: str | None) -> None:
        """Refuse data without one displacement to every pressure."""
        n_pressures, n_displacements = len(self.pressures), len(self.displacements)
        if n_pressures != n_displacements:
            raise DataError(
                f"there are {n_pressures} pressures and {n_displacements} displacements",
                file=source,
                remedy="record as many of both, or fit coupled-memory or tsfnn",
            )

    def stacked(self, what: str) -> Array:
        """Return a field of all runs, one under another."""
        return np.concatenate([getattr(run, what) for run in self.runs])


def coupled_data(
    recordings: Sequence[Recording],
    pressures: Sequence[str] | None = None,
    displacements: Sequence[str] | None = None,
    scheduling: Sequence[str] | None = None,
) -> CoupledData:
    """Return recordings as runs, their channels found by name where they are not given.

    Raises
    ------
    DataError
        If channels are absent or differ between recordings, pressures never move, or a recording is
        too short.
    """
    if not recordings:
        raise DataError("there are no recordings", remedy="give at least one")
    first = recordings[0]
    pressures = list(pressures or numbered(first, "pressure") or one(first, "voltage", "pressure"))
    displacements = list(
        displacements or numbered(first, "displacement") or one(first, "displacement")
    )
    if scheduling is None:
        scheduling = [name for name in SCHEDULES if name in first]
    for what, names in (("pressure", pressures), ("displacement", displacements)):
        if not names:
            raise DataError(
                f"there is no channel {what}_1, nor {what}",
                file=first.source,
                remedy=f"name the columns {what}_1, {what}_2 and so on, or use --column",
            )
    runs = []
    for recording in recordings:
        for name in (*pressures, *displacements, *scheduling):
            if name not in recording:
                raise DataError(
                    "the model needs it, and the recording has no such channel",
                    file=recording.source,
                    channel=name,
                    remedy="give all recordings the same channels, or name others",
                )
        if len(recording) < FEWEST_SAMPLES:
            raise DataError(
                f"{len(recording)} samples are too few for several muscles",
                file=recording.source,
                remedy=f"give recordings of at least {FEWEST_SAMPLES} samples",
            )
        runs.append(
            CoupledRun(
                recording.name,
                recording.matrix(pressures),
                recording.matrix(displacements),
                recording.matrix(scheduling) if scheduling else np.empty((len(recording), 0)),
                recording.sample_time,
            )
        )

    def channels(names: Iterable[str]) -> tuple[Channel, ...]:
        return tuple(Channel(name, first.units[name]) for name in names)

    data = CoupledData(
        tuple(runs), channels(pressures), channels(displacements), channels(scheduling)
    )
    for name, travel in zip(pressures, data.highest - data.lowest, strict=True):
        if not travel > 0:
            raise DataError(
                "it never changes",
                channel=name,
                remedy="give recordings in which every muscle is driven",
            )
    return data


def one(recording: Recording, *names: str) -> list[str]:
    """Return the first of some channels that a recording has, if any."""
    return [name for name in names if name in recording][:1]


def numbered(recording: Recording, quantity: str) -> list[str]:
    """Return the channels ``quantity_1``, ``quantity_2`` ... of a recording, in order."""
    found = {
        int(match.group(1)): name
        for name in recording.channels
        if (match := re.fullmatch(rf"{quantity}_(\d+)", name))
    }
    return [found[number] for number in sorted(found)]
