"""Models of several muscles: chosen on the training side, tested on runs used for nothing else."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from mckibben import registry
from mckibben.blocks.base import Block
from mckibben.comparison.bootstrap import skill_of
from mckibben.comparison.kept import Kept
from mckibben.comparison.limits import caution
from mckibben.comparison.recommending import CONSTANT
from mckibben.comparison.results import Standing
from mckibben.comparison.shared_stretches import told
from mckibben.comparison.splits import listed, within
from mckibben.errors import DataError, MckibbenError
from mckibben.estimators.search import whole_searches
from mckibben.recording import Recording
from mckibben.threads import cores
from mckibben.workers import Tell, all_of, checked, outcomes

Array = NDArray[np.float64]
Runs = tuple[Recording, ...]

BLOCKS = 32
"""Pieces of every part of the validation that errors are resampled in."""

Scored = tuple[Recording, int]
"""A run, and its first sample that is scored."""

Item = tuple[str, Mapping[str, Any]]
"""A model's short name, and its settings."""

QUICK = ("coupled-memory", "coupled-pi", "force-balance")
"""Models that are fitted in seconds."""

HELD_OUT = 3
"""Every so many-th level of what schedules, or run, is held out where no test runs are given."""

ENOUGH = 12
"""Fewest training runs of which a third can be spared: of a few, each shows what no other does."""

TAIL = 0.25
"""Share of every run that is held out to choose on, where there are too few runs to leave any out."""


@dataclass(frozen=True)
class Validation:
    """What models are chosen on, within the training side.

    Parameters
    ----------
    parts : tuple of (tuple of Recording or None, tuple of (Recording, int))
        What is fitted for it, None where the model that is to be tested has not seen the runs; and the
        runs, each with its first sample that is scored.
    described : str
        In words.
    """

    parts: tuple[tuple[Runs | None, tuple[Scored, ...]], ...]
    described: str


@dataclass(frozen=True)
class Data:
    """What all models are given.

    Parameters
    ----------
    train, test, early : tuple of Recording
        To fit, to test on, and to stop searches early.
    validation : Validation
        To choose on.
    constant : tuple of float
        Sums of squared errors of the mean on the blocks of the validation.
    """

    train: Runs
    test: Runs
    early: Runs
    validation: Validation
    constant: tuple[float, ...]


@dataclass(frozen=True)
class MuscleRow:
    """One model.

    Parameters
    ----------
    model : str
        Short name.
    n_parameters : int
    seconds : float
        Of the fit.
    train, validation, test : mapping of str to float
        Free-running RMSE of every displacement [mm]; validation is what models are chosen by.
    worst : float
        Largest error on the test runs [mm].
    block : Block or None
    inverse : Block or None
        Where it has one.
    reason : str or None
        Why it failed.
    invalid : str or None
        Why it could not be validated, and so is not chosen unless nothing else can be.
    test_rank : int or None
        Place by mean test RMSE, from 1; nothing is chosen by it.
    skill, skill_least : float or None
        Share of the constant's squared error that the model removes in the validation, and what 99 % of
        resamples exceed; see `mckibben.comparison.results.Row`.
    """

    __pydantic_config__: ClassVar[dict[str, bool]] = {"arbitrary_types_allowed": True}

    model: str
    n_parameters: int = 0
    seconds: float = 0.0
    train: Mapping[str, float] = field(default_factory=dict)
    validation: Mapping[str, float] = field(default_factory=dict)
    test: Mapping[str, float] = field(default_factory=dict)
    worst: float = float("inf")
    block: Block | None = None
    inverse: Block | None = None
    reason: str | None = None
    invalid: str | None = None
    test_rank: int | None = None
    skill: float | None = None
    skill_least: float | None = None

    @property
    def test_error(self) -> float:
        """Mean test RMSE over all displacements [mm]."""
        return self.mean

    @property
    def mean(self) -> float:
        """Mean test RMSE over all displacements [mm]."""
        return _mean(self.test)

    @property
    def mean_validation(self) -> float:
        """Mean validation RMSE over all displacements [mm], infinite where there is none."""
        return _mean(self.validation)

    @property
    def order(self) -> tuple[bool, bool, bool, float, float]:
        """What rows are sorted by: those that failed last, else by validation; not by the test.

        Those that are good only near what they were trained on come after the others.
        """
        cautioned = self.caution is not None
        by = self.mean_validation, _mean(self.train)
        return self.block is None, not self.validation, cautioned, *by

    @property
    def caution(self) -> str | None:
        """Why the model is good only near what it was trained on, or None."""
        return caution(self.model)

    def to_dict(self) -> dict[str, Any]:
        """Return the row as ``leaderboard.json`` holds it."""
        return {
            "model": self.model,
            "n_parameters": self.n_parameters,
            "fit_seconds": self.seconds,
            "train": dict(self.train),
            "validation": dict(self.validation),
            "test": dict(self.test),
            "test_rank": self.test_rank,
            "worst": self.worst if np.isfinite(self.worst) else None,
            "skill": self.skill,
            "invertible": self.inverse is not None,
            "reason": self.reason,
            "invalid": self.invalid,
            "caution": self.caution,
        }


def compare_muscles(
    train: Sequence[Recording],
    test: Sequence[Recording],
    *,
    validation: Sequence[Recording] = (),
    models: str | Sequence[str] = "all",
    settings: Mapping[str, Mapping[str, Any]] | None = None,
    seed: int = 0,
    jobs: int | None = None,
    allow_shared: bool = False,
    folder: str | Path | None = None,
    progress: Callable[[Standing], None] | None = None,
    found: Callable[[tuple[MuscleRow, ...]], None] | None = None,
) -> tuple[MuscleRow, ...]:
    """Fit models of several muscles, choose one within the training side, and test all, free-running.

    Parameters
    ----------
    train, test : sequence of Recording
        Channels ``pressure_1`` ..., ``displacement_1`` ... and what schedules.
    validation : sequence of Recording
        To stop searches early, and to choose on; without any, see `validation_of`.
    models : "all", "quick" or sequence of str
        Short names.
    settings : mapping of str to mapping, optional
        By model.
    seed : int
        Of everything random.
    jobs : int, optional
        Processes; default as many as there are cores and models.
    allow_shared : bool
        Whether to go on where runs to fit, to choose and to test on are the same data; `shared_runs`
        tells which.
    folder : path, optional
        Where finished models are kept, so that a comparison that was stopped goes on from there;
        whoever calls clears it.
    progress : callable, optional
        Told how far it is.
    found : callable, optional
        Told the rows so far, whenever a model is finished.

    Returns
    -------
    tuple of MuscleRow
        By validation error, so that the first is the choice unless `recommended` finds something
        against it beside `constant_row`; models that failed last, with their reasons.

    Raises
    ------
    DataError
        If there is nothing to fit to or to test on, or runs share samples.
    """
    train, test, validation = listed(train), listed(test), listed(validation)
    if not test:
        raise DataError("there is no run to test on", remedy="give --test, or more runs")
    if not train:
        raise DataError("there is no run to fit to", remedy="give some beside those to test on")
    shared_runs(train, validation, test, allow=allow_shared)
    names = {"all": registry.names("coupled"), "quick": QUICK}.get(str(models), tuple(models))
    efforts = {name: registry.load("coupled", name).effort for name in names}
    items = [
        (name, {"seed": seed} | dict((settings or {}).get(name, {})))
        for name in sorted(names, key=efforts.__getitem__)
    ]
    on = validation_of(train, validation)
    _, squares = _constant(train, test, on)
    data = Data(tuple(train), tuple(test), tuple(validation), on, squares)
    kept = Kept(folder, data)
    found_before = {name: kept.get(name, MuscleRow, own) for name, own in items}
    rows = {
        name: row
        for name, row in found_before.items()
        if row is not None and row.model == name and row.block is not None
    }
    remaining = [item for item in items if item[0] not in rows]
    begun: list[str] = []

    def ranked() -> tuple[MuscleRow, ...]:
        return in_order(rows.values())

    def tell_of(index: int, *_: Any) -> None:
        begun.append(remaining[index][0])
        tell()

    def tell() -> None:
        best = next(
            (f"{row.model}, validation RMSE {row.mean_validation:.3g} mm" for row in ranked()), ""
        )
        fitting = tuple(name for name in begun if name not in rows)
        if progress is not None:
            progress(Standing(len(rows), len(items), fitting, best))

    if rows:
        tell()
    for outcome in outcomes(_try, data, remaining, checked(jobs) or cores(), tell_of):
        name, own = remaining[outcome.index]
        rows[name] = outcome.value or MuscleRow(name, reason=str(outcome.error))
        if rows[name].block is not None:
            kept.put(name, rows[name], own)
        tell()
        if found is not None:
            found(ranked())
    return ranked()


def shared_runs(
    train: Sequence[Recording],
    validation: Sequence[Recording],
    test: Sequence[Recording],
    *,
    allow: bool = False,
) -> tuple[str, ...]:
    """Return in words where runs for different ends are the same data; refuse that unless allowed.

    Raises
    ------
    DataError
        If runs share samples, and that is not allowed.
    """
    runs = [*train, *validation, *test]
    common = [name for name in runs[0].channels if all(name in run for run in runs)]
    outputs = [name for name in common if name.startswith("displacement")]
    inputs = [name for name in common if name not in outputs]
    return told({"fit": train, "validate": validation, "test": test}, inputs, outputs, allow=allow)


def constant_row(
    train: Sequence[Recording], test: Sequence[Recording], validation: Sequence[Recording] = ()
) -> MuscleRow:
    """Return the row of the mean of every displacement fitted to: what every model has to beat."""
    return _constant(train, test, validation_of(train, validation))[0]


def _constant(
    train: Sequence[Recording], test: Sequence[Recording], on: Validation
) -> tuple[MuscleRow, tuple[float, ...]]:
    """Return the constant's row, and its sums of squared errors on the blocks of the validation."""
    names = [name for name in train[0].channels if name.startswith("displacement")]

    def errors(fitted: Sequence[Recording], scored: Sequence[Scored]) -> dict[str, Array]:
        means = {name: np.concatenate([run[name] for run in fitted]).mean() for name in names}
        return {
            name: np.concatenate([means[name] - run[name][start:] for run, start in scored])
            for name in names
        }

    def rms(found: Sequence[Mapping[str, Array]]) -> dict[str, float]:
        return {name: _rms(np.concatenate([one[name] for one in found])) for name in names}

    parts = [errors(fitted or train, scored) for fitted, scored in on.parts]
    tested = errors(train, [(run, 0) for run in test])
    row = MuscleRow(
        CONSTANT,
        len(names),
        train=rms([errors(train, [(run, 0) for run in train])]),
        validation=rms(parts) if parts else {},
        test=rms([tested]),
        worst=float(max(np.abs(error).max() for error in tested.values())),
    )
    return row, tuple(square for part in parts for square in _squares(part))


def _squares(errors: Mapping[str, Array]) -> list[float]:
    """Return the sums of squared errors over all displacements, of consecutive pieces."""
    total = np.sum([error**2 for error in errors.values()], axis=0)
    return [float(piece.sum()) for piece in np.array_split(total, BLOCKS)]


def _try(data: Data, item: Item, tell: Tell) -> MuscleRow:
    del tell
    name, settings = item
    try:
        estimator = registry.load("coupled", name)(**settings)
        row = _row(name, estimator.fit(list(data.train), validation=list(data.early)), data.test)
        return _validated(row, settings, data.validation, data.constant)
    except MckibbenError as error:
        return MuscleRow(name, reason=str(error))
    except Exception as error:  # one model must not take the comparison down, whatever it does
        return MuscleRow(name, reason=f"{type(error).__name__}: {error}")


def _row(name: str, estimator: Any, test: Sequence[Recording]) -> MuscleRow:
    block: Block = estimator.model_
    names = [channel.name for channel in block.outputs]
    errors = _errors(block, [(run, 0) for run in test])
    try:
        inverse: Block | None = block.inverse()
    except MckibbenError:
        inverse = None
    return MuscleRow(
        name,
        block.n_parameters,
        estimator.diagnostics_.seconds,
        dict(zip(names, estimator.diagnostics_.rmse, strict=True)),
        test={name: _rms(error) for name, error in errors.items()},
        worst=float(max(np.abs(error).max() for error in errors.values())),
        block=block,
        inverse=inverse,
    )


def _validated(
    row: MuscleRow, settings: Mapping[str, Any], on: Validation, constant: Sequence[float]
) -> MuscleRow:
    """Return a row with its validation error, or why there is none."""
    errors: list[dict[str, Array]] = []
    try:
        for fitted, runs in on.parts:
            block = row.block
            if fitted is not None:
                block = registry.load("coupled", row.model)(**settings).fit(list(fitted)).model_
            assert block is not None
            errors.append(_errors(block, runs))
    except MckibbenError as error:  # a part of the runs may be too little where all are enough
        return replace(row, invalid=str(error))
    names = row.test
    squares = [square for found in errors for square in _squares(found)]
    skill, least = skill_of(squares, constant, int(settings.get("seed", 0)))
    return replace(
        row,
        validation={name: _rms(np.concatenate([e[name] for e in errors])) for name in names},
        skill=skill,
        skill_least=least,
    )


def _errors(block: Block, runs: Sequence[Scored]) -> dict[str, Array]:
    """Return the errors of every output on runs, free-running, from their first sample that counts.

    Blocks are shown the inputs alone: no start may be fitted to outputs that are tested on.
    """
    names = [channel.name for channel in block.inputs]
    outputs = [block.simulate(run.select(names)) for run, _ in runs]
    return {
        name: np.concatenate(
            [
                (out[name] - run[name])[start:]
                for out, (run, start) in zip(outputs, runs, strict=True)
            ]
        )
        for name in (channel.name for channel in block.outputs)
    }


def _rms(errors: Array) -> float:
    return float(np.sqrt(np.mean(errors**2)))


def _mean(errors: Mapping[str, float]) -> float:
    return float(np.mean(list(errors.values()))) if errors else float("inf")


def in_order(rows: Iterable[MuscleRow]) -> tuple[MuscleRow, ...]:
    """Return rows in the order of the choice, each with its rank by test."""
    listed = sorted(rows, key=lambda row: row.order)
    by_test = sorted(row.mean for row in listed)
    return tuple(
        replace(row, test_rank=None if row.block is None else 1 + by_test.index(row.mean))
        for row in listed
    )


def validation_of(train: Sequence[Recording], given: Sequence[Recording] = ()) -> Validation:
    """Return what models are chosen on: given runs, the training runs in turn, or the end of each.

    Runs given for it are not fitted to, so that a model is scored as it is. Else it is fitted three
    times more, each time without every third run, and scored on those; not on runs whose pressures or
    loads go beyond what is left, where no model is asked to know anything. Of fewer runs than twelve,
    the last quarter of each is left out of one more fit.
    """
    if given:
        scored = tuple((run, 0) for run in given)
        return Validation(((None, scored),), f"{len(scored)} validation runs")
    parts = []
    if len(train) >= ENOUGH:
        for first in range(HELD_OUT):
            kept = tuple(run for place, run in enumerate(train) if place % HELD_OUT != first)
            left = tuple((run, 0) for run in train[first::HELD_OUT] if _within(run, kept))
            if left:
                parts.append((kept, left))
    if parts:
        n = sum(len(left) for _, left in parts)
        return Validation(
            tuple(parts), f"{n} of {len(train)} training runs, left in turn out of fits for it"
        )
    starts = [len(run) - round(TAIL * len(run)) for run in train]
    fitted = tuple(run.slice(0, start) for run, start in zip(train, starts, strict=True))
    return Validation(
        ((fitted, tuple(zip(train, starts, strict=True))),),
        "the last quarter of every training run, left out of a fit for it",
    )


def _within(run: Recording, others: Sequence[Recording]) -> bool:
    """Tell whether the inputs of a run stay within the range of those of others, nearly."""
    return all(
        within(run[name], np.concatenate([other[name] for other in others]))
        for name in run.channels
        if not name.startswith("displacement") and all(name in other for other in others)
    )


def held_out_levels(
    recordings: Sequence[Recording], scheduling: str = "pressure_extensor"
) -> tuple[list[Recording], list[Recording], str]:
    """Return runs to fit and to test, and how they were chosen, in words.

    Every third level of what schedules, ends excepted, is tested on; without several levels, every
    third run.
    """
    if all(scheduling in recording for recording in recordings):
        means = [round(float(recording[scheduling].mean()), 1) for recording in recordings]
        levels = sorted(set(means))
        unseen = set(levels[1:-1][::HELD_OUT])
        if unseen:
            train = [r for r, m in zip(recordings, means, strict=True) if m not in unseen]
            test = [r for r, m in zip(recordings, means, strict=True) if m in unseen]
            listed = ", ".join(f"{level:g}" for level in sorted(unseen))
            return train, test, f"runs at {scheduling} {listed} bar held out"
    test = list(recordings[HELD_OUT - 1 :: HELD_OUT])
    train = [r for place, r in enumerate(recordings) if place % HELD_OUT != HELD_OUT - 1]
    return train, test, "every third run held out"


def per_load(
    train: Sequence[Recording],
    test: Sequence[Recording],
    *,
    validation: Sequence[Recording] = (),
    load: str = "force",
    input: str = "voltage",  # noqa: A002
    output: str = "displacement",
    model: str = "mpi",
    seed: int = 0,
    jobs: int | None = None,
) -> tuple[MuscleRow, ...]:
    """Return one model of a single muscle for every load it was recorded under, tested on all loads.

    Parameters
    ----------
    train, test : sequence of Recording
        Each training run is taken to be at its mean load.
    validation : sequence of Recording
        As for `compare_muscles`; the run that a model is fitted to is left out.
    load, input, output : str
        Channels.
    model : str
        Short name of the model to fit to each run.
    seed : int
        Of everything random.
    jobs : int, optional
        Processes; default as many as there are cores.
    """
    names = [f"{model} at {run[load].mean():.0f} {run.units[load]} ({run.name})" for run in train]
    how = {"input": input, "output": output, "seed": seed}
    checks = [scored for _, left in validation_of(train, validation).parts for scored in left]
    items = [
        (name, model, how, run, tuple((r, s) for r, s in checks if r is not run), tuple(test))
        for name, run in zip(names, train, strict=True)
    ]
    return tuple(all_of(_try_single, items, jobs))


def _try_single(common: None, item: Any, tell: Tell) -> MuscleRow:
    del common, tell
    name, model, how, run, checks, test = item
    output = how["output"]
    try:
        with whole_searches():
            estimator = registry.load("estimators", model)(**how).fit(run)
        block: Block = estimator.model_
        errors = _errors(block, [(r, 0) for r in test])[output]
        missed = _errors(block, checks) if checks else {}
        validation = {output: _rms(missed[output])} if checks else {}
        mean = run[output].mean()
        flat = {output: np.concatenate([mean - r[output][s:] for r, s in checks])} if checks else {}
        skill = (
            skill_of(_squares({output: missed[output]}), _squares(flat), how["seed"])
            if checks
            else (None, None)
        )
    except MckibbenError as error:
        return MuscleRow(name, reason=str(error))
    return MuscleRow(
        name,
        block.n_parameters,
        estimator.diagnostics_.seconds,
        {output: estimator.diagnostics_.rmse},
        validation,
        {output: _rms(errors)},
        float(np.abs(errors).max()),
        block,
        skill=skill[0],
        skill_least=skill[1],
    )
