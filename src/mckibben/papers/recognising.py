"""Recordings as runs of a paper: its channels, and the role and labels of each."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

from mckibben.recording import Recording, standard_unit
from mckibben.signals.protocol import Role

MEASURES = {"bar": "pressure", "V": "voltage", "N": "force", "mm": "displacement"}
"""What a channel of another name measures, by its unit."""


def by_unit(one: Recording, wanted: Sequence[str]) -> dict[str, str]:
    """Return what channels of other names measure: by their units, and the number or place in the name.

    So ``p1`` in bar is ``pressure_1``. Where two would be the same channel, neither is.
    """
    kinds = MEASURES | ({"mm": "length"} if "length" in wanted else {})
    found: dict[str, str] = {}
    for name in one.channels:
        unit, place = one.units.get(name) or "", re.search(r"(\d+|extensor)$", name)
        if unit in kinds and standard_unit(name) is None:
            found[name] = f"{kinds[unit]}_{place[1]}" if place else kinds[unit]
    counts = Counter([*found.values(), *one.channels])
    return {name: channel for name, channel in found.items() if counts[channel] == 1}


def renamed(one: Recording, names: Mapping[str, str]) -> Recording:
    """Return a recording with other names of channels."""
    channels, units = (
        {names.get(name, name): value for name, value in each.items()}
        for each in (one.channels, one.units)
    )
    return replace(one, channels=channels, units=units)


class Labels(NamedTuple):
    """Role of a recording, and labels as in the paper's protocol (stage, load, frequency)."""

    role: Role
    labels: Mapping[str, Any]


class Runs(dict[str, Recording]):
    """Recordings by name, in the order of the protocol, with roles and labels."""

    def __init__(self, recordings: Mapping[str, Recording], labels: Mapping[str, Labels]) -> None:
        super().__init__(recordings)
        self.labels = labels

    def names(self, role: Role | None = None, **labels: Any) -> list[str]:
        """Return the names of recordings of a role that have all of the labels."""
        return [
            name
            for name, given in self.labels.items()
            if role in (None, given.role)
            and all(given.labels.get(key) == value for key, value in labels.items())
        ]

    def select(self, role: Role | None = None, **labels: Any) -> list[Recording]:
        """Return the recordings of a role that have all of the labels."""
        return [self[name] for name in self.names(role, **labels)]

    def of(self, name: str, label: str) -> Any:
        """Return a label of a recording."""
        return self.labels[name].labels[label]
