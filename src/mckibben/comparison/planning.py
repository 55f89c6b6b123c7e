"""Set-up of a comparison: channels, data, split and parts, and the models that apply."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from mckibben import registry
from mckibben.channels import Channels, channels_of
from mckibben.comparison.leaderboard import CONSTANT, Leaderboard
from mckibben.errors import DataError, ModelError
from mckibben.estimators.catalogue import declared, settings_of_all
from mckibben.estimators.core.estimator import Estimator
from mckibben.numerals import counted
from mckibben.options import CompareOptions, given_options
from mckibben.recording import Recording, listed, reading_notes
from mckibben.signals import made_manageable
from mckibben.signals.shared_rows import check_shared
from mckibben.splits import Part, Split, parts_of, spans_of, split_of

REASON_LONG = "it takes long, and is fitted where it is named"
"""Why a model is left out of all."""

Models = str | Sequence[str] | Mapping[str, str | Estimator]
"""Models of a comparison: "all", "quick", short names, or labels with short names or estimators."""


@dataclass(frozen=True)
class Data:
    """Data common to all models: training and test data, what is left out in turn, channels.

    Parameters
    ----------
    checks : tuple of Recording
        Recordings to choose on, to which nothing is fitted; none to leave out parts of
        the training data.
    parts : tuple of Part
        Of these, or else of the training recordings.
    """

    split: Split
    parts: tuple[Part, ...]
    channels: Channels
    checks: tuple[Recording, ...] = ()

    @property
    def recordings(self) -> tuple[Recording, ...]:
        """Every training recording, then every test recording."""
        return (*self.split.train, *self.split.test)

    @property
    def held_out(self) -> tuple[Recording, ...]:
        """Recordings of the parts."""
        return self.checks or self.split.train


@dataclass(frozen=True)
class Candidate:
    """A model to fit, by its short name or as an estimator, and its settings."""

    model: str | Estimator
    settings: Mapping[str, Any] = field(default_factory=dict)

    @property
    def estimator_class(self) -> type[Estimator]:
        """Class of the estimator."""
        if isinstance(self.model, str):
            kind: type[Estimator] = registry.load("estimators", self.model)
            return kind
        return type(self.model)

    def estimator(self, channels: Channels) -> Estimator:
        """Return the estimator of the channels of a comparison."""
        channel_settings = self.estimator_class.channel_settings(channels)
        parameters = {} if isinstance(self.model, str) else self.model.get_params()
        return self.estimator_class(**parameters | channel_settings | dict(self.settings))


@dataclass(frozen=True)
class Plan:
    """Set-up of a comparison.

    Parameters
    ----------
    items : mapping of str to Candidate
        What every row is called, and what is fitted for it, cheapest first.
    empty : Leaderboard
        The leaderboard before any model is finished.
    refused : mapping of str to str
        Models asked for by name that do not apply to these channels, and why.
    """

    data: Data
    items: Mapping[str, Candidate]
    empty: Leaderboard
    refused: Mapping[str, str]


def plan_of(
    train: Recording | Sequence[Recording],
    test: Recording | Sequence[Recording] = (),
    options: CompareOptions | None = None,
    *,
    validation: Recording | Sequence[Recording] = (),
    channels: Channels | None = None,
    **keywords: Any,
) -> Plan:
    """Return the set-up of a comparison; see `compare`."""
    options = given_options(CompareOptions, options, keywords)
    data, empty = _data_of(train, test, validation, options, channels)
    recordings = [*data.recordings, *data.checks]
    items, left_out = _candidates(options.models, recordings, data.channels, options.seed)
    classes = {name: item.estimator_class for name, item in items.items()}
    classes |= {name: declared(name) for name in left_out}
    settings_by_name = settings_of_all(classes, options.settings) if options.settings else {}
    refused = refusals(items, data.split.train, data.channels)
    items = {
        name: replace(
            items[name], settings={**items[name].settings, **settings_by_name.get(name, {})}
        )
        for name in sorted(items, key=lambda name: items[name].estimator_class.effort)
    }
    return Plan(data, items, replace(empty, left_out=left_out, pending=tuple(items)), refused)


def _data_of(
    train: Recording | Sequence[Recording],
    test: Recording | Sequence[Recording],
    validation: Recording | Sequence[Recording],
    options: CompareOptions,
    channels: Channels | None,
) -> tuple[Data, Leaderboard]:
    """Return the data of a comparison, and what a leaderboard states of them."""
    sides = [listed(train), listed(validation), listed(test)]
    recordings = [recording for side in sides for recording in side]
    notes = reading_notes(recordings)
    if not sides[0]:
        raise DataError("there are none to fit", parameter="recordings", remedy="give at least one")
    channels = channels or channels_of(recordings, options.input, options.output, options.load)
    unit = _unit_of(sides, channels)
    sides = [[recording.with_derived(channels.sides) for recording in side] for side in sides]
    shared = check_shared(
        dict(zip(("fit", "validate", "test"), sides, strict=True)),
        [*channels.inputs, *channels.scheduling],
        channels.outputs,
        allow=options.allow_shared,
    )
    if channels.single:
        sides, thinned = made_manageable(sides, channels.inputs[0], options.most_samples)
        notes = (*thinned, *notes)
    elif options.most_samples is not None:
        raise DataError(
            "recordings of several muscles, or under loads, are not thinned",
            remedy="leave `most_samples` out, or resample them to a longer sample time",
        )
    fitted, checks, tests = sides
    split = split_of(fitted, tests, channels)
    parts = parts_of(checks or split.train, channels)
    data = Data(split, parts, channels, tuple(checks))
    empty = _empty_leaderboard(data, unit, options.seed)
    return data, replace(empty, notes=notes, shared=shared)


def _empty_leaderboard(data: Data, unit: str, seed: int) -> Leaderboard:
    """Return a leaderboard without models: what it states of its data."""
    split, parts, channels = data.split, data.parts, data.channels
    chosen_by = ("given" if data.checks else "cross-validation") if parts else "fit"
    described = split.described
    if chosen_by == "cross-validation":
        described += f", cross-validated on {counted(len(parts), 'part')}"
    return Leaderboard(
        inputs=channels.inputs,
        outputs=channels.outputs,
        unit=unit,
        rows=(),
        split=described,
        n_train=sum(map(len, split.train)),
        n_test=sum(int(rows.sum()) for rows in split.test_rows),
        seed=seed,
        chosen_by=chosen_by,
        loads=channels.scheduling,
        offered=channels.offered,
        ignored=channels.unused,
        outside=_outside(split, (*channels.inputs, *channels.further)),
        parts=tuple(spans_of(part, data.held_out) for part in parts),
    )


def _unit_of(sides: Sequence[Sequence[Recording]], channels: Channels) -> str:
    """Return the outputs' unit; raise an error for recordings that no model can use."""
    from mckibben.estimators.core.data import training_data

    for recordings in (sides[0], [recording for side in sides for recording in side]):
        data = training_data(
            recordings, channels.inputs, channels.outputs, one_rate=channels.single
        )
    units = {channel.name: channel.unit for channel in data.outputs}
    if len(set(units.values())) > 1:
        raise DataError(
            f"the outputs have different units: {units}, so that their errors have no mean",
            parameter="output",
            remedy="compare models of each separately, with `output`",
        )
    return data.outputs[0].unit


def _outside(split: Split, names: Sequence[str]) -> dict[str, float]:
    """Return channels outside their training range, and the share of scored samples where they are."""
    shares = {}
    for name in names:
        trained = [recording[name] for recording in split.train if name in recording]
        runs = zip(split.test, split.test_rows, strict=True)
        tested = [recording[name][rows] for recording, rows in runs if name in recording]
        if trained and tested:
            low, high = min(map(np.min, trained)), max(map(np.max, trained))
            values = np.concatenate(tested)
            shares[name] = float(np.mean((values < low) | (values > high)))
    return {name: share for name, share in shares.items() if share > 0}


def _candidates(
    models: Models, recordings: Sequence[Recording], channels: Channels, seed: int
) -> tuple[dict[str, Candidate], dict[str, str]]:
    """Return the models to fit, and why others of "all" do not apply to these recordings."""
    seeded = {"seed": seed}
    if models in ("all", "quick"):
        all_names = registry.names("estimators")
        names = (
            all_names if models == "all" else [name for name in all_names if declared(name).quick]
        )
        items = {name: Candidate(name, seeded) for name in names}
        left_out = objections(items, recordings, channels)
        for name, item in items.items():
            if item.estimator_class.long:
                left_out.setdefault(name, REASON_LONG)
        return {name: item for name, item in items.items() if name not in left_out}, left_out
    if isinstance(models, Mapping):
        candidates = {str(label): _item(model, seeded) for label, model in models.items()}
    else:
        labels = models.split(",") if isinstance(models, str) else models
        if not (isinstance(labels, Iterable) and all(isinstance(name, str) for name in labels)):
            raise ModelError(
                f"models cannot be {models!r:.60}", remedy="give 'all', 'quick', or a list of names"
            )
        candidates = {name.strip(): _item(name.strip(), seeded) for name in labels}
    if CONSTANT in candidates:
        raise ModelError(f"{CONSTANT!r} is the mean of the output", remedy="choose another label")
    if not candidates:
        raise ModelError(
            "there are no models to compare",
            remedy=f"name some of {', '.join(registry.names('estimators'))}, or all",
        )
    return candidates, {}


def _item(model: object, seeded: Mapping[str, Any]) -> Candidate:
    """Return what is fitted for a short name, or for an estimator with its own settings."""
    if isinstance(model, str):
        registry.load("estimators", model)  # refuses unknown names
        return Candidate(model, seeded)
    if isinstance(model, Estimator):
        return Candidate(model)
    raise ModelError(
        f"a model cannot be {model!r:.60}", remedy="give a short name, or an estimator"
    )


def objections(
    items: Mapping[str, Candidate], recordings: Sequence[Recording], channels: Channels
) -> dict[str, str]:
    """Return which models do not apply to recordings, and why."""
    reasons: dict[str, str] = {}
    for name, item in items.items():
        try:
            reason = item.estimator_class.objection(
                recordings, channels
            ) or _missing_time_objection(item.estimator_class, recordings)
        except ModelError as error:  # a plug-in that is broken is not the end of all others
            reason = str(error)
        if reason is not None:
            reasons[name] = reason
    return reasons


def refusals(
    items: Mapping[str, Candidate], recordings: Sequence[Recording], channels: Channels
) -> dict[str, str]:
    """Return which models asked for by name cannot be fitted, and why.

    That a model is not given the load is no reason against it.
    """
    refused = objections(items, recordings, channels)
    unloaded = replace(channels, scheduling=(), offered=channels.further)
    return objections({name: items[name] for name in refused}, recordings, unloaded)


def _missing_time_objection(
    estimator: type[Estimator], recordings: Sequence[Recording]
) -> str | None:
    """Return why a model that needs time cannot be fitted to recordings without it, or None."""
    missing = [recording.name for recording in recordings if recording.sample_time is None]
    if not (missing and estimator.needs_time):
        return None
    more = f" and {len(missing) - 1} more" if len(missing) > 1 else ""
    return f"it needs time, and {missing[0]}{more} has none: give a rate, or a column of times"
