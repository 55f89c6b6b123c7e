"""Plan of the next recording: random motion within limits, and runs that close data gaps."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from mckibben.arrays import Array
from mckibben.diagnosis.data_gaps import Gap, excitation, gaps_of
from mckibben.diagnosis.excitation import Excitation
from mckibben.errors import DataError, require
from mckibben.planning.limits import (
    Limits,
    check_possible,
    limits_as_wanted,
    limits_of_recordings,
    limits_of_rig,
)
from mckibben.planning.motion import motion
from mckibben.recording import Recording, listed, sample_time_of
from mckibben.rigs import Rig, load_rig
from mckibben.signals.checking import generator
from mckibben.system.showing import Result

MOST_MINUTES = 60.0
"""Longest plan [min]; a longer one is better made in two."""


@dataclass(frozen=True)
class Step:
    """A part of a plan: start and stop [s], kind of motion, and the data gaps it closes."""

    start: float
    stop: float
    what: str
    gaps: tuple[str, ...]


@dataclass(frozen=True, repr=False)
class Plan(Result):
    """Plan of the next recording: commands over time, and the purpose of each part.

    Parameters
    ----------
    recording : Recording
    steps : tuple of Step
    gaps : tuple of Gap
        What the recordings so far cannot identify.
    extrapolated : tuple of str
        Channels that go beyond the recordings.
    """

    recording: Recording
    steps: tuple[Step, ...] = field(repr=False)
    gaps: tuple[Gap, ...] = field(default=(), repr=False)
    extrapolated: tuple[str, ...] = ()

    face: ClassVar[str] = "plan"

    @property
    def drawn(self) -> Recording:
        """What a plot of it draws."""
        return self.recording

    def to_dict(self) -> dict[str, Any]:
        """Return all but the samples, for JSON."""
        return {
            "seconds": self.recording.duration,
            "steps": [vars(part) for part in self.steps],
            "gaps": [part.to_dict() for part in self.gaps],
            "extrapolated": list(self.extrapolated),
            "start": {name: float(v[0]) for name, v in self.recording.channels.items()},
        }


def plan(
    recordings: Recording | Sequence[Recording] = (),
    *,
    rig: str | Path | Rig | None = None,
    minutes: float = 3.0,
    limits: Mapping[str, Sequence[float | None]] | None = None,
    seed: int = 0,
) -> Plan:
    """Return a plan of the next recording.

    Parameters
    ----------
    recordings : Recording or sequence of Recording
        Earlier recordings, which give limits and data gaps.
    rig : str, path or Rig, optional
        Rig to drive: its channels and limits. Needed without recordings.
    minutes : float
        How long to record.
    limits : mapping of str to sequence of float, optional
        By channel its lowest and highest command and its rate per second; None for the default: the
        limits of the rig, or those of the recordings.
    seed : int
        Of the random motion.

    Raises
    ------
    DataError
        On limits without motion, or recordings and a rig of other channels.
    """
    recorded, seconds = listed(recordings), 60 * minutes
    if not recorded and rig is None:
        raise DataError("a plan needs recordings or a rig", remedy="give files, or `rig`")
    possible = 0 < minutes <= MOST_MINUTES
    require(possible, "minutes", minutes, f"3, or up to {MOST_MINUTES:g}", DataError)
    generator(seed)  # raises an error for an invalid seed
    plant = rig if isinstance(rig, Rig) or rig is None else load_rig(rig)
    channel_limits = {} if plant is None else limits_of_rig(plant)
    recorded_limits: Limits = {}
    gaps: tuple[Gap, ...] = ()
    holds = True
    step = 0.0 if plant is None else plant.sample_time
    if recorded:
        measured = _excitation_of(recorded, plant)
        gaps, recorded_limits = gaps_of(measured), limits_of_recordings(measured)
        channel_limits, holds = (
            recorded_limits | channel_limits,
            any(gap.run == "holds" for gap in gaps),
        )
        step = max(step, min(recording.sample_time or math.inf for recording in recorded))
    allowed = limits_as_wanted(channel_limits, limits or {})
    check_possible(allowed, seconds, plant)
    parts = motion(allowed, seconds, step, holds, np.random.default_rng(seed))
    commands = np.concatenate([part for _, part in parts])
    commands_recording = Recording(dict(zip(allowed, commands.T, strict=True)), step)
    return Plan(
        commands_recording if plant is None else commands_recording.select(plant.inputs),
        _steps(parts, step, gaps),
        gaps,
        tuple(name for name, limit in allowed.items() if limit.beyond(recorded_limits.get(name))),
    )


def _steps(
    parts: Sequence[tuple[str, Array]], step: float, gaps: Sequence[Gap]
) -> tuple[Step, ...]:
    """Return the purpose and the times of each part."""
    steps, start = [], 0.0
    for purpose, group in groupby(parts, key=lambda part: part[0]):
        stop = start + step * sum(len(commands) for _, commands in group)
        runs = ("random", "speeds") if purpose == "random" else (purpose,)
        closed = tuple(gap.what for gap in gaps if gap.run in runs)
        steps.append(Step(round(start, 9), round(stop, 9), purpose, closed))
        start = stop
    return tuple(steps)


def _excitation_of(recordings: list[Recording], rig: Rig | None) -> Excitation:
    """Return the excitation of recordings."""
    for recording in recordings:
        sample_time_of(recording, "be planned from")
        if lacking := [name for name in (rig.inputs if rig else ()) if name not in recording]:
            raise DataError(
                "the recording lacks it, and the rig has it",
                file=recording.source,
                channel=lacking[0],
                remedy="give recordings of this rig, or leave `rig` out",
            )
    return excitation(recordings, None if rig is None else rig.inputs)
