"""Recordings as runs of a paper: its channels, and the role and labels of each."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from importlib import import_module
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from mckibben import registry
from mckibben.channels import by_unit, renamed
from mckibben.errors import DataError
from mckibben.papers.paper import paper
from mckibben.recording import Recording
from mckibben.rigs import load_rig
from mckibben.rigs.physics.compiled import GRAVITY
from mckibben.signals.features import features_of
from mckibben.signals.protocol import Role, protocol

NOTED, UNLIKE = "as its rig noted", "like no run of the paper, not used"

SIZE = 0.1
"""Largest difference from the paper's commands and length, relative to them, that is no other size."""

EXTENSOR = "pressure_extensor"
"""Channel of arms, whose muscles are numbered; recordings of other papers are of one muscle."""

FALLS = -0.5
"""Correlation with the drive below which a shortening has the wrong sign."""


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
    about = paper(name)
    alike = [by_unit(one) for one in data]
    muscle = _moving(renamed(one, names) for one, names in zip(data, alike, strict=True))
    every, measured = dict[str, Recording](), dict[str, str]()
    for one, names in zip(data, alike, strict=True):
        names = {own: names.get(own, own) for own in one}
        names = _of_arm(names) if EXTENSOR in about.channels else _of_muscle(names, muscle)
        measured |= {own: channel for own, channel in names.items() if own != channel}
        whole = renamed(one.select([*names]), names)
        wanted = (re.sub("^length_", "displacement_", channel) for channel in whole)
        whole = whole.with_derived([*about.channels, *wanted])
        whole.matrix(about.channels)  # raises an error for what is absent
        every[f"{one.name}, {len(every) + 1}" if one.name in every else str(one.name)] = whole
    _check_sign(every.values())
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


def _moving(data: Iterable[Recording]) -> str:
    """Return the number of the muscle whose pressure or voltage moves most, empty without numbers."""
    moved = {"": 0.0}
    for one in data:
        for name in one:
            base, _, number = name.rpartition("_")
            if number.isdigit() and base in ("pressure", "voltage"):
                low, high = np.percentile(one[name], (1, 99))
                moved[number] = max(moved.get(number, 0.0), float(high - low))
    return max(moved, key=moved.__getitem__)


def _of_muscle(names: Mapping[str, str], muscle: str) -> dict[str, str]:
    """Return names without numbers of the channels of one muscle, without those of others."""
    found = dict[str, str]()
    for own, channel in names.items():
        base, _, number = channel.rpartition("_")
        if not number.isdigit():
            found[own] = channel
        elif number == muscle and base not in names.values():
            found[own] = base
    return found


def _of_arm(names: Mapping[str, str]) -> dict[str, str]:
    """Return names whose pressure without a number, beside those of muscles, is the extensor's."""
    known = {*names.values()}
    plain = "pressure_1" in known and EXTENSOR not in known
    return {own: EXTENSOR if plain and c == "pressure" else c for own, c in names.items()}


def _check_sign(every: Iterable[Recording]) -> None:
    """Raise an error where a shortening falls as its drive rises: it may be a length."""
    for drive, moved in product(("pressure", "voltage"), ("displacement", "contraction")):
        pairs = [
            (one[drive], one[moved], one) for one in every if {drive, moved} <= {*one.channels}
        ]
        products = [float(np.cov(u, y)[0, 1]) for u, y, _ in pairs]
        spans = [float(np.std(u) * np.std(y)) for u, y, _ in pairs]
        if sum(products) < FALLS * sum(spans):
            remedy = (
                "if it is a length, name it so with `columns[length]=COLUMN` and state `rest_length`; "
                f"else turn it with `calibration[{moved}]=-1:0`"
            )
            problem = f"it falls as {drive} rises, and a shortening rises"
            raise DataError(problem, file=pairs[0][2].source, channel=moved, remedy=remedy)


def _labels(name: str, every: Mapping[str, Recording], noted: Collection[str]) -> dict[str, Labels]:
    others = [one for n, one in every.items() if n not in noted]
    by_signals = import_module(registry.load("protocols", name).__module__).recognised
    found = iter(by_signals(features_of(others)) if others else ())
    return {
        n: Labels(one.meta["role"], one.meta["labels"]) if n in noted else next(found)
        for n, one in every.items()
    }


def of_its_size(name: str, runs: Runs) -> bool:
    """Return whether runs reach as far as those of the paper, of muscles of its length.

    Compared are the highest commands of the kinds of runs that are there, a weight being a force.
    """
    about, plan = paper(name), protocol(name)
    kinds = [about.kind_of(*labels) for labels in runs.labels.values()]
    alike = (run for run in plan.runs if about.kind_of(run.role, run.labels) in kinds)
    weight = {run.name: GRAVITY * run.settings.get("payload", 0.0) for run in plan.runs}
    printed = _highest((run.inputs, {"force": weight[run.name]}) for run in alike)
    printed["length at rest"] = load_rig(plan.rig).rest_length or 0.0
    here = _highest((one, {}) for one in runs.values())
    lengths = [one.rest_length for one in runs.values() if one.rest_length]
    here |= {"length at rest": max(lengths)} if lengths else {}
    pairs = [(here[what], high) for what, high in printed.items() if what in here]
    return all(abs(found - high) <= SIZE * high for found, high in pairs)


def _highest(every: Iterable[tuple[Recording, Mapping[str, float]]]) -> dict[str, float]:
    """Return the highest value of every channel, to which something may be added."""
    highest = dict[str, float]()
    for one, more in every:
        for channel, (_, high) in one.ranges.items():
            value = high + more.get(channel, 0.0)
            highest[channel] = max(value, highest.get(channel, value))
    return highest
