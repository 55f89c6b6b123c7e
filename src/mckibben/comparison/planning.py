"""What is to be compared, on what: models that suit the recordings, channels, split and folds."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from mckibben import registry
from mckibben.comparison.belonging import unlike, zeros
from mckibben.comparison.channels import Channels, Names, channels_of, where_held
from mckibben.comparison.constant import constant_of
from mckibben.comparison.coverage import Coverage, coverage_of
from mckibben.comparison.kept import Kept, source
from mckibben.comparison.offered import declared, default_model, objections
from mckibben.comparison.recognising import (
    FORCE,
    OF_FORCE,
    PRESSURE,
    lacks_displacement,
    varies,
)
from mckibben.comparison.results import Leaderboard
from mckibben.comparison.row import Row
from mckibben.comparison.shared_rows import TESTED, check_shared
from mckibben.comparison.splits import split_of, validation_folds
from mckibben.comparison.trying import Data, Item, Tried
from mckibben.errors import DataError, ModelError
from mckibben.estimators.coupled.base import CoupledEstimator, schedules
from mckibben.recording import Recording, listed, reading_notes
from mckibben.signals import made_manageable

Settings = Mapping[str, Mapping[str, Any]]

N_FOLDS = 4
"""Parts of the cross-validation."""

BEYOND = 0.1
"""Share of the range in training by which a test may go beyond it unsaid."""


@dataclass(frozen=True)
class Plan:
    """What is to be compared, on what.

    Parameters
    ----------
    data : Data
        What all models are given.
    items : mapping of str to Item
        What every row is called, and what is tried for it, cheapest first.
    unit : str
        Of the output.
    described : str
        How the data were split, in words.
    seed : int
        Of everything random.
    chosen_by : {"cross-validation", "validation", "given", "fit"}
        What the choice is by.
    left_out : mapping of str to str
        Models without a place on these channels, and why.
    notes : tuple of str
        What was done to the recordings.
    shared : tuple of str
        Where recordings are the same data.
    apart : str
        Why one model cannot follow some recordings: their signs, zeros, muscles; empty where it can.
    """

    data: Data
    items: Mapping[str, Item]
    unit: str
    described: str
    seed: int
    chosen_by: str
    left_out: Mapping[str, str]
    notes: tuple[str, ...]
    shared: tuple[str, ...] = ()
    apart: str = ""

    @cached_property
    def constant(self) -> Tried:
        """What comes of predicting the mean of the training output."""
        return constant_of(self.data)

    @cached_property
    def coverage(self) -> Coverage | None:
        """What training covers of the joint range of what models are told; None of one input."""
        split, channels = self.data.split, self.data.channels
        told = (*channels.inputs, *channels.scheduled([*split.train, *split.test]))
        return coverage_of(split.train, split.test, told)

    @cached_property
    def sources(self) -> dict[str, str]:
        """Digests of the files that define the estimators."""
        models = {item.model for item in self.items.values()}
        return {model: source(registry.load("estimators", model)) for model in models}

    def kept(self, folder: str | Path | None) -> Kept:
        """Return where finished models are kept."""
        return Kept(folder, self.data)

    @property
    def n_scored(self) -> list[int]:
        """Samples of every test recording that are scored."""
        return [int(rows.sum()) for rows in self.data.split.test_rows]

    def board(self, rows: Sequence[Row] = ()) -> Leaderboard:
        """Return the leaderboard of the models that are finished."""
        done = {row.model for row in rows}
        return Leaderboard(
            inputs=self.data.channels.inputs,
            outputs=self.data.channels.outputs,
            unit=self.unit,
            rows=tuple(rows),
            split=self.described,
            seed=self.seed,
            n_train=sum(len(recording) for recording in self.data.split.train),
            n_test=sum(self.n_scored),
            chosen_by=self.chosen_by,
            left_out=self.left_out,
            pending=tuple(name for name in self.items if name not in done),
            notes=self.notes,
            constant=self.constant.row,
            shared=self.shared,
            apart=self.apart,
        )


def plan_of(
    train: Recording | Sequence[Recording],
    test: Recording | Sequence[Recording],
    *,
    inputs: Names = None,
    outputs: Names = None,
    load: str | None = None,
    validation: Sequence[Recording] = (),
    models: str | Sequence[str],
    settings: Settings | None,
    n_folds: int = N_FOLDS,
    seed: int,
    most_samples: int | None = None,
    allow_shared: bool = False,
    allow_early: bool = False,
) -> Plan:
    """Return what a comparison is to do; see `compare`."""
    recordings, tests, checks = listed(train), listed(test), listed(validation)
    if not isinstance(n_folds, int) or n_folds < 0:
        raise ModelError(f"there cannot be {n_folds!r:.60} folds. Remedy: give 0, 1, 2 or more.")
    if not recordings:
        raise DataError("there are no recordings to fit", remedy="give at least one")
    every = [*recordings, *tests, *checks]
    channels = channels_of(every, inputs, outputs, load)
    held: tuple[str, ...] = ()
    if load is None and channels.scheduling:
        load = channels.scheduling[0]
        held = (
            f"{load} is a load: models are told it beside the inputs, and it is never commanded",
        )
    if inputs is None and outputs is None and load is None:
        named, channels = channels, where_held(every, channels)
        if channels != named:
            held = (
                f"{named.outputs[0]} is held throughout, and so {channels.outputs[0]} is modelled",
            )
    if outputs is None and lacks_displacement(every) and channels.outputs == (FORCE,):
        held = ("there is no displacement, and so force is modelled; or name another output",)
    unit = _checked(recordings, [*tests, *checks], channels)
    early = _early(every, channels, allow_early)
    roles = {"fit": recordings, "validate": checks, "test": tests}
    shared = check_shared(
        {role: runs for role, runs in roles.items() if runs or role != "validate"},
        [*channels.inputs, *channels.scheduled(recordings)],
        channels.outputs,
        allow=allow_shared,
    )
    notes: tuple[str, ...] = ()
    if channels.single:
        recordings, tests, notes = made_manageable(
            recordings, tests, channels.inputs[0], most_samples
        )
    elif most_samples is not None:
        raise DataError(
            "recordings of several muscles, or under loads, are not thinned",
            remedy="leave --samples out, or resample them to a longer sample time",
        )
    split = split_of(recordings, tests, channels)
    parts, chosen_by = validation_folds(split.train, channels, n_folds, checks)
    validated = ""
    if chosen_by == "cross-validation":
        validated = f", cross-validated on {len(parts)} part(s) within the range of the rest"
    marked = f"; {TESTED}" if any(one.startswith(TESTED) for one in shared) else ""
    chosen, left_out = _chosen(models, every, channels)
    if not chosen:
        raise ModelError(
            "there are no models to compare. "
            f"Remedy: name some of {', '.join(registry.names('estimators'))}, or all."
        )
    efforts = {model: registry.load("estimators", model).effort for model in chosen}
    given = settings or {}
    some = models not in ("all", "quick")
    per_load = [] if load is None else [default_model("load")]
    known = {*(chosen if some else registry.names("estimators")), *per_load}
    if lost := sorted(set(given) - known):
        raise ModelError(
            f"settings are given for {', '.join(lost)}, and no such model is compared. "
            "Remedy: add it to the models, or leave its settings out."
        )
    items = {
        model: Item(model, {"seed": seed} | dict(given.get(model, {})))
        for model in sorted(chosen, key=efforts.__getitem__)
    }
    if load is not None and not objections(per_load, every, replace(channels, scheduling=None)):
        for model in per_load:
            own = {"seed": seed} | dict(given.get(model, {}))
            items |= _one_for_each_load(split.train, load, model, own)
    different = (*_untold(every, channels), *_unlike(every, channels))
    return Plan(
        data=Data(split, parts, channels, tuple(checks)),
        items=items,
        unit=unit,
        described=split.described + validated + marked,
        seed=seed,
        chosen_by=chosen_by,
        left_out=left_out,
        notes=(
            *notes,
            *early,
            *held,
            *different,
            *_about_load(every, channels, load, chosen),
            *_beyond_training(split.train, tests, channels),
            *shared,
            *reading_notes(every),
        ),
        shared=shared,
        apart=". ".join(f"{one[0].upper()}{one[1:]}" for one in different),
    )


def _early(every: Sequence[Recording], channels: Channels, allow: bool) -> tuple[str, ...]:
    """Refuse an output that moves before its one input, or note it where that is allowed."""
    from mckibben.files.condition import early

    found = early(every, channels.inputs[0], channels.outputs[0]) if channels.single else None
    if found is None:
        return ()
    moves = f"moves {-found} samples before {channels.inputs[0]}"
    if not allow:
        raise DataError(
            f"it {moves}",
            file=every[0].source,
            channel=channels.outputs[0],
            remedy="check that columns are not swapped and clocks agree; or compare all the same with "
            "--allow-early (allow_early=True)",
        )
    return (f"{channels.outputs[0]} {moves}",)


def _checked(
    recordings: Sequence[Recording], others: Sequence[Recording], channels: Channels
) -> str:
    """Refuse recordings that no model could use; return the unit of the outputs."""
    from mckibben.estimators.core.checking import training_data

    names = channels.inputs, channels.outputs
    training_data(recordings, *names, one_rate=channels.single)
    if others:
        training_data([*recordings, *others], *names, one_rate=channels.single)
    units = {name: recordings[0].units[name] for name in channels.outputs}
    if len(set(units.values())) > 1:
        raise DataError(
            f"the outputs have different units: {units}, so that their errors have no mean",
            remedy="compare models of each apart, with --output",
        )
    return next(iter(units.values()))


def _one_for_each_load(
    train: Sequence[Recording], load: str, model: str, settings: Mapping[str, Any]
) -> dict[str, Item]:
    """Return what a model that is not given the load is, fitted to each recording alone."""
    items: dict[str, Item] = {}
    for place, run in enumerate(train):
        name = f"{model} at {run[load].mean():.3g} {run.units[load]} ({run.name})"
        if name in items:
            name += f", {place + 1}"
        items[name] = Item(model, settings, place)
    return items


def _about_load(
    recordings: Sequence[Recording], channels: Channels, load: str | None, models: Sequence[str]
) -> Iterator[str]:
    """Tell of a load that does not change, and of one that does and is not told to most models."""
    finding = [m for m in models if isinstance(registry.load("estimators", m)(), CoupledEstimator)]
    named = (
        schedules(recordings, (*channels.inputs, *channels.outputs)) if load is None else (load,)
    )
    for name in named:
        values = [recording[name] for recording in recordings if name in recording]
        moves = bool(np.ptp(np.concatenate(values)) > 0)
        if load is not None and not moves:
            yield f"{load} is {values[0][0]:g} throughout: what it does cannot be learned"
        elif channels.single and moves:
            told_of = f"no model but {', '.join(finding)}" if finding else "no model"
            yield f"{name} is there, and {told_of} is told it: see --load {name}"


def _untold(recordings: Sequence[Recording], channels: Channels) -> Iterator[str]:
    """Tell of a length that force depends on, and that no model is told."""
    told_of = (*channels.inputs, *channels.scheduled(recordings))
    if channels.outputs != (FORCE,) or any(name in told_of for name in OF_FORCE):
        return
    for name in OF_FORCE:
        if varies([one[name] for one in recordings if name in one]):
            yield (
                f"{name} varies, force depends on it, and no model is told it: leave --input out, or "
                f"give --input {name}, and force is modelled of it and of the pressure"
            )
            return


def _known(recordings: Sequence[Recording], channels: Channels) -> tuple[str, ...]:
    """Return what models are told; those of force by length find the pressure by themselves."""
    names = (*channels.inputs, *channels.scheduled(recordings))
    by_length = channels.outputs == (FORCE,) and any(name in OF_FORCE for name in names)
    found = by_length and PRESSURE not in names and all(PRESSURE in one for one in recordings)
    return (*names, PRESSURE) if found else names


def _unlike(recordings: Sequence[Recording], channels: Channels) -> tuple[str, ...]:
    """Return why one model cannot follow some recordings, in words."""
    if len(channels.outputs) > 1:
        return ()
    loads = schedules(recordings, (*channels.inputs, *channels.outputs))
    names = (*_known(recordings, channels), *loads)
    known = (recordings, names, channels.outputs[0], loads)
    return (*unlike(*known), *zeros(*known))


def _beyond_training(
    train: Sequence[Recording], tests: Sequence[Recording], channels: Channels
) -> Iterator[str]:
    """Tell of tests whose inputs go where those of no training recording do."""
    for name in _known(train, channels):
        trained = np.concatenate([recording[name] for recording in train if name in recording])
        low, high = float(trained.min()), float(trained.max())
        margin = BEYOND * (high - low)
        for recording in tests:
            if name not in recording:
                continue
            least, most = float(recording[name].min()), float(recording[name].max())
            if least < low - margin or most > high + margin:
                yield (
                    f"{recording.name}: {name} goes from {least:.3g} to {most:.3g} "
                    f"{recording.units[name]}, in training from {low:.3g} to {high:.3g}: models "
                    "extrapolate there. Remedy: record more for training"
                )


def _chosen(
    models: str | Sequence[str], recordings: Sequence[Recording], channels: Channels
) -> tuple[tuple[str, ...], dict[str, str]]:
    """Return the models to try, and why others of "all" have no place on these recordings."""
    if models not in ("all", "quick"):
        named = models.split(",") if isinstance(models, str) else models
        if not (isinstance(named, Iterable) and all(isinstance(name, str) for name in named)):
            raise ModelError(
                f"models cannot be {models!r:.60}. Remedy: give 'all', 'quick', or a list of names."
            )
        return tuple(dict.fromkeys(name.strip() for name in named)), {}
    every = registry.names("estimators")
    names = every if models == "all" else [name for name in every if declared(name).quick]
    left_out = objections(names, recordings, channels)
    return tuple(name for name in names if name not in left_out), left_out
