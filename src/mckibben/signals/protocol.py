"""A protocol: driving signals of a rig, run by run, with the role of each run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from inspect import signature
from typing import Any, Literal, NamedTuple

from mckibben import registry
from mckibben.errors import DataError
from mckibben.recording import Recording

Role = Literal["train", "validation", "test"]


@dataclass(frozen=True)
class PlannedRun:
    """One run of a protocol.

    Parameters
    ----------
    name : str
        Unique within the protocol; good as a file name.
    role : {"train", "validation", "test"}
        What it is for.
    inputs : Recording
        Commands, on the grid that is to be recorded.
    settings : mapping
        Parameters of the rig that differ in this run, as `mckibben.Rig.changed` takes them.
    labels : mapping
        What else tells it from the others: stage of the identification, load, frequency.
    lead : float
        Time at the beginning that is driven but not recorded [s].
    """

    name: str
    role: Role
    inputs: Recording
    settings: Mapping[str, Any] = field(default_factory=dict)
    labels: Mapping[str, Any] = field(default_factory=dict)
    lead: float = 0.0


@dataclass(frozen=True)
class Protocol:
    """A labelled set of runs on one rig.

    Parameters
    ----------
    name : str
        As registered.
    rig : str
        Name of the rig it was made for.
    source : str
        The paper and its sections.
    runs : tuple of PlannedRun
        In the order in which they are to be recorded.
    notes : str
        What the source leaves open, and what is done here.
    """

    name: str
    rig: str
    source: str
    runs: tuple[PlannedRun, ...]
    notes: str = ""

    def select(self, role: Role | None = None, **labels: Any) -> tuple[PlannedRun, ...]:
        """Return the runs of a role, and with all of the labels.

        >>> from mckibben.signals.protocol import protocol
        >>> [run.name for run in protocol("field-models").select("test")]
        ['irregular-triangle']
        """
        return tuple(
            run
            for run in self.runs
            if (role is None or run.role == role)
            and all(run.labels.get(name) == value for name, value in labels.items())
        )

    def __getitem__(self, name: str) -> PlannedRun:
        """Return the run of that name."""
        for run in self.runs:
            if run.name == name:
                return run
        raise DataError(
            f"the protocol {self.name!r} has no run {name!r}",
            remedy=f"use one of {', '.join(run.name for run in self.runs)}",
        )


def protocol(name: str, rig: object = None) -> Protocol:
    """Return a protocol by name.

    Parameters
    ----------
    name : str
    rig : Rig, optional
        That is to be driven; protocols that can adapt their levels to a rig do.

    Raises
    ------
    ModelError
        If there is none of that name; the text lists those there are.
    """
    maker = registry.load("protocols", name)
    adapts = rig is not None and signature(maker).parameters
    made: Protocol = maker(rig) if adapts else maker()
    return made


Extent = tuple[float, float]
"""Lowest and highest value."""


class Scaled(NamedTuple):
    """A command of a protocol: its extent for the paper's rig and for another, and the factor."""

    what: str
    printed: Extent
    here: Extent
    factor: float


def scaling(name: str, rig: object) -> list[Scaled]:
    """Return how the commands of a protocol, loads and times are scaled for a rig."""
    printed, scaled = (_extents(protocol(name, one)) for one in (None, rig))
    return [
        Scaled(command, *extents, extents[1][1] / extents[0][1] if extents[0][1] else 1.0)
        for command, extents in zip(
            scaled, zip(printed.values(), scaled.values(), strict=True), strict=True
        )
    ]


def _extents(plan: Protocol) -> dict[str, Extent]:
    limits: dict[str, list[float]] = {}
    for run in plan.runs:
        for channel, extent in run.inputs.ranges.items():
            limits.setdefault(f"{channel} [{run.inputs.units.get(channel, '')}]", []).extend(extent)
        if "payload" in run.settings:
            limits.setdefault("payload [kg]", []).append(run.settings["payload"])
        limits.setdefault("time [s]", []).append(len(run.inputs) * run.inputs.step)
    return {what: (min(values), max(values)) for what, values in limits.items()}
