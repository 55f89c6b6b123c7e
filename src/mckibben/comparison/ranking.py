"""Models × recordings: chosen on the training side, tested once on data used for nothing else."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path

import numpy as np

from mckibben.arrays import Array
from mckibben.comparison.bootstrap import skill_of
from mckibben.comparison.channels import Names
from mckibben.comparison.choosing import Choice, choice_of
from mckibben.comparison.coverage import OffTraining
from mckibben.comparison.drift import Drift, Stretch, drift_of
from mckibben.comparison.kept import Kept
from mckibben.comparison.pieces import counts_of
from mckibben.comparison.planning import N_FOLDS, Plan, Settings, plan_of
from mckibben.comparison.recommending import CONSTANT
from mckibben.comparison.resampling import Resampling
from mckibben.comparison.results import CHOICES, Leaderboard
from mckibben.comparison.row import Row
from mckibben.comparison.standing import Standing
from mckibben.comparison.starts import start_of
from mckibben.comparison.trying import (
    Tried,
    effort_of,
    errors_on_test,
    joined,
    outcomes,
    outputs_of,
    parts_of,
    processes_for,
)
from mckibben.diagnosis.bands import tested_band
from mckibben.errors import ModelError
from mckibben.recording import Recording
from mckibben.statistics import differences, interval
from mckibben.system.progress import telling
from mckibben.system.workers import checked

Watch = Callable[[str, float, float], None]


def compare(
    train: Recording | Sequence[Recording],
    test: Recording | Sequence[Recording] = (),
    *,
    inputs: Names = None,
    outputs: Names = None,
    load: str | None = None,
    validation: Sequence[Recording] = (),
    models: str | Sequence[str] = "all",
    settings: Settings | None = None,
    n_folds: int = N_FOLDS,
    seed: int = 0,
    jobs: int | None = None,
    most_samples: int | None = None,
    allow_shared: bool = False,
    allow_early: bool = False,
    folder: str | Path | None = None,
    clear: bool = True,
    progress: bool | Callable[[Standing], None] | None = None,
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
        training recordings, which is then left out of training; of several muscles, or under loads,
        every third level of what schedules, or every third recording.
    inputs, outputs : str or sequence of str, optional
        Channels. Default ``pressure`` and ``displacement``; of several muscles ``pressure_1`` and so on,
        and ``displacement_1`` and so on. Of several outputs, models are chosen by the mean error.
    load : str, optional
        Channel of a load that varies: models are told it, and `mpi` for each load stands beside.
    validation : sequence of Recording
        To stop searches early and to choose on; nothing is fitted to them.
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
    allow_early : bool
        Whether to go on where the output moves before its input.
    folder : path, optional
        Where finished models are kept until all are, so that a comparison that was stopped and is
        called again goes on from there.
    clear : bool
        Whether to forget what was kept when all is done; else the caller does, once it has written
        what is returned, by ``Kept(folder).clear()``.
    progress : bool or callable, optional
        Whether to show a bar; or who is told how far it is, whenever that changes.
    found : callable, optional
        Told the leaderboard of the models finished, whenever one is.
    watch : callable, optional
        Told, while a model is fitted, its name, the share done of the fits of this process, those of
        the cross-validation first, and the least cost so far of this one; not on joblib's backends.

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
        inputs=inputs,
        outputs=outputs,
        load=load,
        validation=validation,
        models=models,
        settings=settings,
        n_folds=n_folds,
        seed=seed,
        most_samples=most_samples,
        allow_shared=allow_shared,
        allow_early=allow_early,
    )
    kept, board = plan.kept(folder), plan.board()
    try:
        with (
            telling(progress, "comparing") as tell,
            closing(ranked(plan, jobs=jobs, kept=kept, progress=tell, watch=watch)) as rankings,
        ):
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
    for name, item in plan.items.items():
        row = kept.get(name, Row, item, plan.sources[item.model])
        if row is not None and row.model == name and row.sound:
            assert row.block is not None
            finished[name] = Tried(row, outputs_of(row.block, data))
    remaining = {name: item for name, item in plan.items.items() if name not in finished}
    efforts = {
        name: effort_of(item.model, data) * (1 + len(data.folds))
        for name, item in remaining.items()
    }
    workers = jobs or processes_for(sum(efforts.values()))
    large = sum(efforts.values()) / (4 * workers)
    parts = [
        part
        for name, item in remaining.items()
        for part in parts_of(name, item, len(data.folds), workers > 1 and efforts[name] > large)
    ]
    resampling = Resampling(plan.n_scored, plan.seed)
    begun: list[str] = []

    @cache
    def drift(model: str) -> Drift | None:
        return _drift(finished[model].outputs, plan)

    def current() -> Ranking:
        return _ranking(plan, finished, resampling, drift)

    def tell() -> None:
        if progress is not None:
            working = tuple(model for model in begun if model not in finished)
            progress(Standing(len(finished), len(plan.items), working, _best(plan, finished)))

    def tell_of(index: int, *what: float) -> None:
        model = parts[index].name
        if not what and model not in begun:
            begun.append(model)
            tell()
        if what and watch is not None:
            watch(model, *what)

    if finished:
        tell()
        yield current()
    pieces: dict[str, dict[int, Tried]] = {model: {} for model in remaining}
    wanted = Counter(part.name for part in parts)
    for outcome in outcomes(data, parts, workers, tell_of):
        model = parts[outcome.index].name
        if outcome.error is None:
            pieces[model][outcome.index] = outcome.value
        else:
            pieces[model][outcome.index] = Tried(Row(model, reason=str(outcome.error)))
        if len(pieces[model]) == wanted[model]:
            whole = joined(
                [piece for _, piece in sorted(pieces[model].items())], data.channels.outputs
            )
            whole = _with_skill(whole, plan)
            finished[model] = _with_band(whole, finished, plan)
            row = finished[model].row
            if row is not None and row.sound:  # a failure may be the machine's, not the model's
                item = remaining[model]
                kept.put(model, row, item, plan.sources[item.model])
            tell()
            yield current()


def _with_skill(tried: Tried, plan: Plan) -> Tried:
    """Return what came of a model with its skill over the constant, where it was cross-validated."""
    row = tried.row
    if row is None or row.validation_rmse is None:
        return tried
    pairs = [
        (sum(own), sum(constant))
        for own, constant in zip(tried.squares, plan.constant.squares, strict=True)
        if own is not None and constant is not None
    ]
    skill, least = skill_of([one for one, _ in pairs], [other for _, other in pairs], plan.seed)
    return replace(tried, row=replace(row, skill=skill, skill_least=least))


def _with_band(tried: Tried, others: Mapping[str, Tried], plan: Plan) -> Tried:
    """Return what came of a model with its band, where it is the best until now; it may be chosen."""
    row, held = tried.row, tried.held
    tried = replace(tried, held=())  # they are large
    if row is None or not row.sound or row.block is None:
        return tried
    if any(o.row is not None and o.row.sound and o.row.order < row.order for o in others.values()):
        return tried
    found = tested_band(row.block, held, tried.outputs, plan.data)
    if found is None:
        return tried
    return replace(tried, row=replace(row, banded=found[0], band=found[1]))


def _ranking(
    plan: Plan,
    finished: Mapping[str, Tried],
    resampling: Resampling,
    drift: Callable[[str], Drift | None],
) -> Ranking:
    tested = {
        model: tried
        for model, tried in finished.items()
        if tried.row is not None and tried.row.test is not None
    }
    errors = {model: errors_on_test(tried.outputs, plan.data) for model, tried in tested.items()}
    samples = resampling.of(errors, CONSTANT, errors_on_test(plan.constant.outputs, plan.data))
    done = sorted((t.row for t in tested.values() if t.row is not None), key=lambda row: row.order)
    by_test = sorted(map(_rmse, done))
    rows = [
        replace(
            row,
            test_rank=1 + by_test.index(_rmse(row)),
            rmse_interval=interval(samples[row.model]),
            off_training=_off_training(row, finished[row.model].outputs, plan),
            drift=drift(row.model),
            start=start_of(errors[row.model], plan.data.split),
        )
        for row in done
    ]
    failed = [t.row for t in finished.values() if t.row is not None and t.row.test is None]
    failed.sort(key=lambda row: row.model)
    outputs = {row.model: finished[row.model].outputs for row in rows}
    constant = plan.constant.row
    if not rows or constant is None:
        return Ranking(plan.board([*rows, *failed]), outputs)
    constant = replace(constant, rmse_interval=interval(samples[CONSTANT]))
    best = plan.board(rows).best or rows[0]
    every = (*rows, constant)
    apart = differences(
        np.array([samples[row.model] for row in every]),
        np.array([_rmse(row) for row in every]),
        rows.index(best),
    )
    *rows, constant = (
        # others have a band if they were the best when they were done, which is chance
        replace(
            row if row is best else replace(row, band=None, banded=None), difference_interval=ends
        )
        for row, ends in zip(every, apart, strict=True)
    )
    board = replace(plan.board([*rows, *failed]), constant=constant, choice=_choice(rows, plan))
    return Ranking(board, outputs)


def _choice(rows: Sequence[Row], plan: Plan) -> Choice | None:
    """Return the choice among the models that could have been chosen beside the first."""
    rivals = [
        row
        for row in rows
        if row.order[:3] == rows[0].order[:3] and (row.skill_least is None or row.skill_least > 0)
    ]
    squares = {row.model: row.squares for row in rivals if row.squares}
    return choice_of(squares, counts_of(plan.data.folds), plan.seed)


def _off_training(row: Row, outputs: Sequence[Array], plan: Plan) -> OffTraining | None:
    """Return how a model of local rules does off its training, if there are several inputs."""
    if row.block is None or not row.block.of_local_rules or plan.coverage is None:
        return None
    errors = errors_on_test(outputs, plan.data)
    fitted = None if row.train is None else row.train.rmse
    return plan.coverage.of(errors, plan.data.split.test_rows, fitted, plan.unit)


def _drift(outputs: Sequence[Array], plan: Plan) -> Drift | None:
    """Return the slow part of a model's error on the test, of the output where that is largest."""
    split, channels = plan.data.split, plan.data.channels
    step = split.test[0].sample_time
    if step is None:
        return None
    recordings = (*split.train, *split.test)
    rows = [*(np.ones(len(recording), dtype=bool) for recording in split.train), *split.test_rows]
    inputs = [recording.matrix(channels.inputs) for recording in recordings]
    n, found = len(split.train), []
    for place, name in enumerate(channels.outputs):
        stretches = [
            Stretch(recording[name] - modelled[:, place], given, counts)
            for recording, modelled, given, counts in zip(
                recordings, outputs, inputs, rows, strict=True
            )
        ]
        found.append(drift_of(stretches[:n], stretches[n:], step, name, split.test[0].units[name]))
    told = [drift for drift in found if drift is not None]
    return max(told, key=lambda drift: (drift.certain, drift.share), default=None)


def _best(plan: Plan, finished: Mapping[str, Tried]) -> str:
    """Return in words which of the models finished would be chosen, and by what figure."""
    rows = [t.row for t in finished.values() if t.row is not None and t.row.test is not None]
    best = plan.board(sorted(rows, key=lambda row: row.order)).best
    if best is None:
        return ""
    heading, _ = CHOICES["fit" if best.validation_rmse is None else plan.chosen_by]
    return f"{best.model}, {heading} {best.chosen_by:.3g} {plan.unit}".strip()


def _rmse(row: Row) -> float:
    if row.test is None:
        raise ModelError(f"{row.model!r} has no test score. Remedy: this is a defect; report it.")
    return row.test.rmse
