"""Models × recordings: chosen on the training side, tested once on data used for nothing else."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mckibben import registry
from mckibben.comparison.bootstrap import BlockBootstrap, interval, skill_of
from mckibben.comparison.kept import Kept, source
from mckibben.comparison.recommending import CONSTANT
from mckibben.comparison.results import CHOICES, Leaderboard, Row, Standing
from mckibben.comparison.shared_stretches import TESTED, told
from mckibben.comparison.splits import (
    HELD_OUT,
    given_split,
    held_out_tail,
    listed,
    validation_folds,
)
from mckibben.comparison.trying import (
    Data,
    Tried,
    constant_of,
    effort_of,
    errors_on_test,
    joined,
    outcomes,
    outputs_of,
    parts_of,
    processes_for,
)
from mckibben.errors import ModelError
from mckibben.recording import Recording, reading_notes
from mckibben.signals import made_manageable
from mckibben.workers import checked

Array = NDArray[np.float64]
Settings = Mapping[str, Mapping[str, Any]]
Watch = Callable[[str, float, float], None]

N_FOLDS = 4
"""Parts of the cross-validation."""

QUICK = ("bouc-wen", "cpi", "gpi", "kp", "maxwell-slip", "mpi", "p2uz", "pi")
"""Models that are good or well known, and fitted in seconds."""


def compare(
    train: Recording | Sequence[Recording],
    test: Recording | Sequence[Recording] = (),
    *,
    input: str = "pressure",  # noqa: A002  # the field's word, as everywhere in the package
    output: str = "displacement",
    models: str | Sequence[str] = "all",
    settings: Settings | None = None,
    n_folds: int = N_FOLDS,
    seed: int = 0,
    jobs: int | None = None,
    most_samples: int | None = None,
    allow_shared: bool = False,
    folder: str | Path | None = None,
    clear: bool = True,
    progress: Callable[[Standing], None] | None = None,
    found: Callable[[Leaderboard], None] | None = None,
    watch: Watch | None = None,
) -> Leaderboard:
    """Fit models on the same data with the same seeds, choose one, and test all.

    Every figure is free-running. Models are fitted on the training recordings, and chosen by
    cross-validation within them (over recordings, or over blocks of cycles of a single one): that sorts
    the leaderboard. Their errors on the test recordings, which nothing is chosen by, stand beside, with
    their rank. A model that fails is a row with its reason. The mean of the training output is a row as
    well: where no model beats it beyond chance, none is recommended. An interrupt ends the work at once;
    the leaderboard then holds what was finished, and names what is pending.

    Parameters
    ----------
    train : Recording or sequence of Recording
        To fit and to choose.
    test : Recording or sequence of Recording, optional
        To test on. Default: the last quarter of the input's travel over the
        training recordings, which is then left out of training.
    input, output : str
        Channels.
    models : "all", "quick", str or sequence of str
        Short names, in a text with commas between; "all" leaves out models that are made for other
        channels, "quick" is a choice that takes seconds.
    settings : mapping of str to mapping, optional
        Model name to settings of its estimator.
    n_folds : int
        Parts of the cross-validation; those whose input goes beyond that of the rest are not tried.
        1, or too few cycles: a single fit without the last quarter of the training data, tried on that.
        0: none, and the choice is by the error on the data fitted.
    seed : int
        Of everything random.
    jobs : int, optional
        Processes, which share the models and their folds; default as many as there are cores, or none
        for little work. A joblib backend chosen outside, such as Dask's or Ray's, is used instead.
        Results are the same to the bit.
    most_samples : int
        Longer recordings are thinned to so many samples to fit, and to test on, turning points kept.
        Default: 100 000; of more than a million, 40 000, in stretches where thinning would lose the
        motion. Scores are of the samples kept, and notes say what was done.
    allow_shared : bool
        Whether to go on where recordings to test on are those fitted to, or training has some twice; the
        leaderboard then says so.
    folder : path, optional
        Where finished models are kept until all are, so that a comparison that was stopped and is
        called again goes on from there.
    clear : bool
        Whether to forget what was kept when all is done; else the caller does, once it has written
        what is returned, by ``Kept(folder).clear()``.
    progress : callable, optional
        Told how far it is whenever that changes.
    found : callable, optional
        Told the leaderboard of the models finished, whenever one is.
    watch : callable, optional
        Told, while a model is fitted to all of the training set, its name, the share of the search that
        is done, and the least cost so far; not on joblib's backends.

    Returns
    -------
    Leaderboard

    Raises
    ------
    DataError
        On recordings that no model could use, or that share samples, see ``allow_shared``.
    ModelError
        On unknown models.
    """
    plan = plan_of(
        train,
        test,
        input=input,
        output=output,
        models=models,
        settings=settings,
        n_folds=n_folds,
        seed=seed,
        most_samples=most_samples,
        allow_shared=allow_shared,
    )
    kept, board = plan.kept(folder), plan.board()
    try:
        with closing(
            ranked(plan, jobs=jobs, kept=kept, progress=progress, watch=watch)
        ) as rankings:
            for ranking in rankings:
                board = ranking.board
                if found is not None:
                    found(board)
    except KeyboardInterrupt:
        if not board.rows:
            raise
        return replace(board, stopped=True)
    if clear:
        kept.clear()
    return board


@dataclass(frozen=True)
class Plan:
    """What is to be compared, on what.

    Parameters
    ----------
    data : Data
        What all models are given.
    settings : mapping of str to mapping
        Every model's short name, cheapest first, and the settings of its estimator.
    unit : str
        Of the output.
    described : str
        How the data were split, in words.
    seed : int
        Of everything random.
    chosen_by : {"cross-validation", "validation", "fit"}
        What the choice is by.
    left_out : mapping of str to str
        Models without a place on these channels, and why.
    notes : tuple of str
        What was done to the recordings.
    shared : tuple of str
        Where recordings are the same data.
    """

    data: Data
    settings: Mapping[str, Mapping[str, Any]]
    unit: str
    described: str
    seed: int
    chosen_by: str
    left_out: Mapping[str, str]
    notes: tuple[str, ...]
    shared: tuple[str, ...] = ()

    @cached_property
    def constant(self) -> Tried:
        """What comes of predicting the mean of the training output."""
        return constant_of(self.data)

    @cached_property
    def sources(self) -> dict[str, str]:
        """Digests of the files that define the estimators."""
        return {model: source(registry.load("estimators", model)) for model in self.settings}

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
            input=self.data.input,
            output=self.data.output,
            unit=self.unit,
            rows=tuple(rows),
            split=self.described,
            seed=self.seed,
            n_train=sum(len(recording) for recording in self.data.split.train),
            n_test=sum(self.n_scored),
            chosen_by=self.chosen_by,
            left_out=self.left_out,
            pending=tuple(model for model in self.settings if model not in done),
            notes=self.notes,
            constant=self.constant.row,
            shared=self.shared,
        )


@dataclass(frozen=True)
class Ranking:
    """A leaderboard, perhaps of a part of the models, and what they give.

    Parameters
    ----------
    board : Leaderboard
        Models finished.
    outputs : mapping of str to tuple of array
        Model name to its free-running output on every training recording, then every test recording.
    """

    board: Leaderboard
    outputs: Mapping[str, tuple[Array, ...]] = field(repr=False)


def plan_of(
    train: Recording | Sequence[Recording],
    test: Recording | Sequence[Recording],
    *,
    input: str,  # noqa: A002
    output: str,
    models: str | Sequence[str],
    settings: Settings | None,
    n_folds: int,
    seed: int,
    most_samples: int | None = None,
    allow_shared: bool = False,
) -> Plan:
    """Return what a comparison is to do; see `compare`."""
    from mckibben.estimators.data import training_data

    recordings, tests = listed(train), listed(test)
    training_data(recordings, input, output)
    if tests:
        training_data([recordings[0], *tests], input, output)
    roles = {"fit": recordings, "test": tests}
    shared = told(roles, [input], [output], allow=allow_shared)
    recordings, tests, notes = made_manageable(recordings, tests, input, most_samples)
    split = given_split(recordings, tests) if tests else held_out_tail(recordings, input, HELD_OUT)
    parts, chosen_by = validation_folds(split.train, input, n_folds)
    validated = ""
    if chosen_by == "cross-validation":
        validated = f", cross-validated on {len(parts)} part(s) within the range of the rest"
    marked = f"; {TESTED}" if any(one.startswith(TESTED) for one in shared) else ""
    chosen, left_out = _chosen(models, [*recordings, *tests], input, output)
    if not chosen:
        raise ModelError(
            "there are no models to compare. "
            f"Remedy: name some of {', '.join(registry.names('estimators'))}, or all."
        )
    efforts = {model: registry.load("estimators", model).effort for model in chosen}
    given = settings or {}
    return Plan(
        data=Data(split, parts, input, output),
        settings={
            model: {"seed": seed} | dict(given.get(model, {}))
            for model in sorted(chosen, key=efforts.__getitem__)
        },
        unit=recordings[0].units[output],
        described=split.described + validated + marked,
        seed=seed,
        chosen_by=chosen_by,
        left_out=left_out,
        notes=(*notes, *shared, *reading_notes([*recordings, *tests])),
        shared=shared,
    )


def ranked(
    plan: Plan,
    *,
    jobs: int | None,
    kept: Kept,
    progress: Callable[[Standing], None] | None = None,
    watch: Watch | None = None,
) -> Generator[Ranking]:
    """Yield the ranking whenever a model is finished, cheap models first; the last one is whole."""
    checked(jobs)
    data = plan.data
    finished: dict[str, Tried] = {}
    for model, settings in plan.settings.items():
        row = kept.get(model, Row, settings, plan.sources[model])
        if row is not None and row.model == model and row.sound:
            assert row.block is not None
            finished[model] = Tried(row, outputs_of(row.block, data))
    remaining = {m: s for m, s in plan.settings.items() if m not in finished}
    efforts = {m: effort_of(m, data) * (1 + len(data.folds)) for m in remaining}
    workers = jobs or processes_for(sum(efforts.values()))
    large = sum(efforts.values()) / (4 * workers)
    parts = [
        part
        for model, settings in remaining.items()
        for part in parts_of(
            model, settings, len(data.folds), workers > 1 and efforts[model] > large
        )
    ]
    bootstrap = BlockBootstrap(plan.n_scored, plan.seed)
    begun: list[str] = []
    samples: dict[str, Array] = {}

    def resampled(model: str, tried: Tried) -> Array:
        if model not in samples:  # once a model, however often the ranking is made
            samples[model] = bootstrap.rmse(errors_on_test(tried.outputs, data))
        return samples[model]

    def current() -> Ranking:
        return _ranking(plan, finished, resampled)

    def tell() -> None:
        if progress is not None:
            working = tuple(model for model in begun if model not in finished)
            progress(Standing(len(finished), len(plan.settings), working, _best(plan, finished)))

    def tell_of(index: int, *what: float) -> None:
        model = parts[index].model
        if not what and model not in begun:
            begun.append(model)
            tell()
        if what and watch is not None:
            watch(model, *what)

    if finished:
        tell()
        yield current()
    pieces: dict[str, dict[int, Tried]] = {model: {} for model in remaining}
    wanted = Counter(part.model for part in parts)
    for outcome in outcomes(data, parts, workers, tell_of):
        model = parts[outcome.index].model
        if outcome.error is None:
            pieces[model][outcome.index] = outcome.value
        else:
            pieces[model][outcome.index] = Tried(Row(model, reason=str(outcome.error)))
        if len(pieces[model]) == wanted[model]:
            whole = joined([piece for _, piece in sorted(pieces[model].items())])
            finished[model] = _with_skill(whole, plan)
            row = finished[model].row
            if row is not None and row.sound:  # a failure may be the machine's, not the model's
                kept.put(model, row, remaining[model], plan.sources[model])
            tell()
            yield current()


def _with_skill(tried: Tried, plan: Plan) -> Tried:
    """Return what came of a model with its skill over the constant, where it was cross-validated."""
    row = tried.row
    if row is None or row.validation_rmse is None:
        return tried
    skill, least = skill_of(tried.squares, plan.constant.squares, plan.seed)
    return replace(tried, row=replace(row, skill=skill, skill_least=least))


def _ranking(
    plan: Plan, finished: Mapping[str, Tried], resampled: Callable[[str, Tried], Array]
) -> Ranking:
    done = [
        (tried.row, resampled(model, tried))
        for model, tried in finished.items()
        if tried.row is not None and tried.row.test is not None
    ]
    done.sort(key=lambda item: item[0].order)
    by_test = sorted(_rmse(row) for row, _ in done)
    rows = [
        replace(
            row,
            test_rank=1 + by_test.index(_rmse(row)),
            rmse_interval=interval(samples),
            difference_interval=interval(samples - done[0][1]),
        )
        for row, samples in done
    ]
    failed = [t.row for t in finished.values() if t.row is not None and t.row.test is None]
    failed.sort(key=lambda row: row.model)
    outputs = {row.model: finished[row.model].outputs for row in rows}
    board = plan.board([*rows, *failed])
    if done and plan.constant.row is not None:
        samples = resampled(CONSTANT, plan.constant)
        constant = replace(
            plan.constant.row,
            rmse_interval=interval(samples),
            difference_interval=interval(samples - done[0][1]),
        )
        board = replace(board, constant=constant)
    return Ranking(board, outputs)


def _best(plan: Plan, finished: Mapping[str, Tried]) -> str:
    """Return in words which of the models finished would be chosen, and by what figure."""
    rows = [t.row for t in finished.values() if t.row is not None and t.row.test is not None]
    best = plan.board(sorted(rows, key=lambda row: row.order)).best
    if best is None:
        return ""
    heading, _ = CHOICES["fit" if best.validation_rmse is None else plan.chosen_by]
    return f"{best.model}, {heading} {best.chosen_by:.3g} {plan.unit}".strip()


def _chosen(
    models: str | Sequence[str],
    recordings: Sequence[Recording],
    input: str,  # noqa: A002
    output: str,
) -> tuple[tuple[str, ...], dict[str, str]]:
    """Return the models to try, and why others of "all" have no place on these recordings."""
    if models not in ("all", "quick"):
        named = models.split(",") if isinstance(models, str) else models
        return tuple(dict.fromkeys(name.strip() for name in named)), {}
    names = registry.names("estimators") if models == "all" else QUICK
    objections = {
        name: registry.load("estimators", name).objection(recordings, input, output)
        for name in names
    }
    left_out = {name: reason for name, reason in objections.items() if reason is not None}
    return tuple(name for name in names if name not in left_out), left_out


def _rmse(row: Row) -> float:
    if row.test is None:
        raise ModelError(f"{row.model!r} has no test score. Remedy: this is a defect; report it.")
    return row.test.rmse
