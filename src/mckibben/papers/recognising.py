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

PEAK = 99.5
"""Percentile that is the highest value of a run, beyond which a regulator overshoots."""

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
    names = _channels(data, of_arm=EXTENSOR in about.channels)
    measured = {own: channel for own, channel in names.items() if own != channel}
    every = dict[str, Recording]()
    for one in data:
        whole = renamed(one.select([own for own in one if own in names]), names)
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


def _channels(data: Sequence[Recording], *, of_arm: bool) -> dict[str, str]:
    """Return own names of channels and what they are: by their names, units, and what moves most."""
    units = {name: one.units.get(name) or "" for one in data for name in one}
    samples = {name: np.concatenate([one[name] for one in data if name in one]) for name in units}
    known = {name: name for name in units} | by_unit(samples, units)
    if of_arm:
        plain = {"pressure_1"} <= {*known.values()} and EXTENSOR not in known.values()
        return {own: EXTENSOR if plain and c == "pressure" else c for own, c in known.items()}
    each: dict[str, dict[str, str]] = {}
    for own, channel in known.items():
        base = re.sub(r"_?\d*$", "", channel)
        each.setdefault(base, {})[channel[len(base) :].lstrip("_")] = own
    muscle = ""
    for drive in ("voltage", "pressure"):
        numbered = each.get(drive, {})
        moved = {n: np.ptp(np.percentile(samples[own], (1, 99))) for n, own in numbered.items()}
        muscle = max(moved, key=moved.__getitem__) if len(moved) > 1 else muscle
    found = dict[str, str]()
    for base, by_number in each.items():
        likely = (muscle, "", *by_number) if len(by_number) == 1 else (muscle, "")
        number = next((one for one in likely if one in by_number), None)
        found |= {} if number is None else {by_number[number]: base}
    return found


def _check_sign(every: Collection[Recording]) -> None:
    """Raise an error where pulls are negative, or a shortening falls as its drive rises."""
    pulls = [(float(one["force"].mean()), one) for one in every if "force" in one]
    if pulls and sum(force for force, _ in pulls) < FALLS * sum(abs(force) for force, _ in pulls):
        problem, remedy = (
            "it is negative, and a pull is positive",
            "turn it with `calibration[force]=-1:0`",
        )
        raise DataError(problem, file=pulls[0][1].source, channel="force", remedy=remedy)
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
        for channel, samples in one.channels.items():
            value = float(np.percentile(samples, PEAK)) + more.get(channel, 0.0)
            highest[channel] = max(value, highest.get(channel, value))
    return highest
