"""Recordings as runs of a paper: the role and labels of each, whether planned or recognised."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from mckibben.recording import Recording
from mckibben.signals.protocol import Role


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
