"""Recordings as runs of a paper: its channels, and the role and labels of each."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from importlib import import_module
from typing import Any, NamedTuple

from mckibben import registry
from mckibben.channels import by_unit, renamed
from mckibben.errors import DataError
from mckibben.papers.paper import paper
from mckibben.recording import Recording
from mckibben.signals.features import features_of
from mckibben.signals.protocol import Role

NOTED, UNLIKE = "as its rig noted", "like no run of the paper, not used"


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


class Recognised(NamedTuple):
    """Recordings with roles and labels, a row on each, what units name, and what is absent."""

    runs: Runs
    rows: tuple[tuple[str, str | None, str | None, str], ...]
    measured: Mapping[str, str]
    absent: str


def recognise(name: str, data: Sequence[Recording]) -> Recognised:
    """Return which runs of a paper recordings are: as a rig noted, else by their signals.

    Raises
    ------
    DataError
        If a channel is absent, or there are too few runs of a kind to fit anything.
    """
    about, measured = paper(name), dict[str, str]()
    every = dict[str, Recording]()
    for one in data:
        measured |= (names := by_unit(one, about.channels))
        whole = renamed(one, names).with_derived(about.channels)
        whole.matrix(about.channels)  # raises an error for what is absent
        every[f"{one.name}, {len(every) + 1}" if one.name in every else str(one.name)] = whole
    noted = {n for n, one in every.items() if one.meta.get("protocol") == name}
    labels = _labels(name, every, noted)
    kinds = {n: about.kind_of(*own) for n, own in labels.items()}
    counts = [(kind, [*kinds.values()].count(kind)) for kind in about.runs.values()]
    if few := [f"{k.what} ({k.least} needed, {n} there)" for k, n in counts if n < k.least]:
        remedy = "record them: move what the paper moves, at levels of your own"
        raise DataError(f"runs are missing: {'; '.join(few)}", file=data[0].source, remedy=remedy)
    absent = "; ".join(f"{kind.what} (for {kind.gives})" for kind, n in counts if not n)
    rows: list[tuple[str, str | None, str | None, str]] = []
    for n, kind in kinds.items():
        if kind is None:
            rows.append((n, None, None, UNLIKE))
        else:
            why = NOTED if n in noted else kind.why.format(**labels[n].labels)
            rows.append((n, kind.what, labels[n].role, why))
    used = {n: one for n, one in every.items() if kinds[n] is not None}
    return Recognised(Runs(used, {n: labels[n] for n in used}), tuple(rows), measured, absent)


def _labels(name: str, every: Mapping[str, Recording], noted: Collection[str]) -> dict[str, Labels]:
    others = [one for n, one in every.items() if n not in noted]
    by_signals = import_module(registry.load("protocols", name).__module__).recognised
    found = iter(by_signals(features_of(others)) if others else ())
    return {
        n: Labels(one.meta["role"], one.meta["labels"]) if n in noted else next(found)
        for n, one in every.items()
    }
