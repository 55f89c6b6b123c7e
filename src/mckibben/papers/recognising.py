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
            for name, run_labels in self.labels.items()
            if role in (None, run_labels.role)
            and all(run_labels.labels.get(key) == value for key, value in labels.items())
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
    by_units: Mapping[str, str]
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
    by_units = {original: channel for original, channel in names.items() if original != channel}
    recordings = dict[str, Recording]()
    for recording in data:
        standard = _standard(recording, names, about.channels)
        is_repeated = recording.name in recordings
        key = f"{recording.name}, {len(recordings) + 1}" if is_repeated else str(recording.name)
        recordings[key] = standard
    _check_sign(recordings.values())
    noted = {key for key, run in recordings.items() if run.meta.get("protocol") == name}
    labels = _labels(name, recordings, noted)
    kinds = {key: about.kind_of(*run_labels) for key, run_labels in labels.items()}
    counts = [(kind, [*kinds.values()].count(kind)) for kind in about.runs.values()]
    if few := [f"{k.what} ({k.least} needed, {n} there)" for k, n in counts if n < k.least]:
        remedy = "record them: move what the paper moves, at levels of your own"
        raise DataError(f"runs are missing: {'; '.join(few)}", file=data[0].source, remedy=remedy)
    absent = "; ".join(f"{kind.what} (for {kind.gives})" for kind, n in counts if not n)
    rows: list[tuple[str, str | None, str | None, str]] = []
    for key, kind in kinds.items():
        if kind is None:
            rows.append((key, None, None, UNLIKE))
        else:
            reason = NOTED if key in noted else kind.why.format(**labels[key].labels)
            rows.append((key, kind.what, labels[key].role, reason))
    used = {key: run for key, run in recordings.items() if kinds[key] is not None}
    return Recognised(Runs(used, {key: labels[key] for key in used}), tuple(rows), by_units, absent)


def _standard(recording: Recording, names: Mapping[str, str], channels: Sequence[str]) -> Recording:
    """Return a recording with the paper's names and channels; raise an error for an absent one."""
    standard = renamed(recording.select([name for name in recording if name in names]), names)
    displacements = (re.sub("^length_", "displacement_", channel) for channel in standard)
    standard = standard.with_derived([*channels, *displacements])
    standard.matrix(channels)  # raises the error
    return standard


def _channels(data: Sequence[Recording], *, of_arm: bool) -> dict[str, str]:
    """Return own names of channels and what they are: by their names, units, and what moves most."""
    units = {name: run.units.get(name) or "" for run in data for name in run}
    samples = {name: np.concatenate([run[name] for run in data if name in run]) for name in units}
    channels = {name: name for name in units} | by_unit(samples, units)
    if of_arm:
        is_misnamed = {"pressure_1"} <= {*channels.values()} and EXTENSOR not in channels.values()
        return {
            column: EXTENSOR if is_misnamed and c == "pressure" else c
            for column, c in channels.items()
        }
    by_quantity: dict[str, dict[str, str]] = {}
    for column, channel in channels.items():
        base = re.sub(r"_?\d*$", "", channel)
        by_quantity.setdefault(base, {})[channel[len(base) :].lstrip("_")] = column
    muscle = ""
    for drive in ("voltage", "pressure"):
        numbered = by_quantity.get(drive, {})
        spans = {
            n: np.ptp(np.percentile(samples[column], (1, 99))) for n, column in numbered.items()
        }
        muscle = max(spans, key=spans.__getitem__) if len(spans) > 1 else muscle
    result = dict[str, str]()
    for base, by_number in by_quantity.items():
        likely = (muscle, "", *by_number) if len(by_number) == 1 else (muscle, "")
        number = next((n for n in likely if n in by_number), None)
        result |= {} if number is None else {by_number[number]: base}
    return result


def _check_sign(runs: Collection[Recording]) -> None:
    """Raise an error where pulls are negative, or a shortening falls as its drive rises."""
    pulls = [(float(run["force"].mean()), run) for run in runs if "force" in run]
    if pulls and sum(force for force, _ in pulls) < FALLS * sum(abs(force) for force, _ in pulls):
        problem, remedy = (
            "it is negative, and a pull is positive",
            "turn it with `calibration[force]=-1:0`",
        )
        raise DataError(problem, file=pulls[0][1].source, channel="force", remedy=remedy)
    for drive, output in product(("pressure", "voltage"), ("displacement", "contraction")):
        pairs = [
            (run[drive], run[output], run) for run in runs if {drive, output} <= {*run.channels}
        ]
        products = [float(np.cov(u, y)[0, 1]) for u, y, _ in pairs]
        spans = [float(np.std(u) * np.std(y)) for u, y, _ in pairs]
        if sum(products) < FALLS * sum(spans):
            remedy = (
                "if it is a length, name it so with `columns[length]=COLUMN` and state `rest_length`; "
                f"else turn it with `calibration[{output}]=-1:0`"
            )
            problem = f"it falls as {drive} rises, and a shortening rises"
            raise DataError(problem, file=pairs[0][2].source, channel=output, remedy=remedy)


def _labels(name: str, runs: Mapping[str, Recording], noted: Collection[str]) -> dict[str, Labels]:
    unnoted = [run for n, run in runs.items() if n not in noted]
    by_signals = import_module(registry.load("protocols", name).__module__).recognised
    recognised = iter(by_signals(features_of(unnoted)) if unnoted else ())
    return {
        n: Labels(run.meta["role"], run.meta["labels"]) if n in noted else next(recognised)
        for n, run in runs.items()
    }


def of_its_size(name: str, runs: Runs) -> bool:
    """Return whether runs reach as far as those of the paper, of muscles of its length.

    Compared are the highest commands of the kinds of runs that are there, a weight being a force.
    """
    about, plan = paper(name), protocol(name)
    kinds = [about.kind_of(*labels) for labels in runs.labels.values()]
    paper_runs = (run for run in plan.runs if about.kind_of(run.role, run.labels) in kinds)
    weight = {run.name: GRAVITY * run.settings.get("payload", 0.0) for run in plan.runs}
    printed = _highest((run.inputs, {"force": weight[run.name]}) for run in paper_runs)
    printed["length at rest"] = load_rig(plan.rig).rest_length or 0.0
    highest = _highest((one, {}) for one in runs.values())
    lengths = [one.rest_length for one in runs.values() if one.rest_length]
    highest |= {"length at rest": max(lengths)} if lengths else {}
    pairs = [
        (highest[quantity], paper_value)
        for quantity, paper_value in printed.items()
        if quantity in highest
    ]
    return all(abs(value - paper_value) <= SIZE * paper_value for value, paper_value in pairs)


def _highest(runs: Iterable[tuple[Recording, Mapping[str, float]]]) -> dict[str, float]:
    """Return the highest value of every channel, to which something may be added."""
    highest = dict[str, float]()
    for run, additions in runs:
        for channel, samples in run.channels.items():
            value = float(np.percentile(samples, PEAK)) + additions.get(channel, 0.0)
            highest[channel] = max(value, highest.get(channel, value))
    return highest
