"""Comparison of models on recordings: chosen on training data, tested once on independent data.

Fit, held-out predictions and free runs of one model are a task for a worker process.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import closing, contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.runs import FreeRun, run_of
from mckibben.channels import Channels
from mckibben.checkpoints import Checkpoints, source
from mckibben.comparison.leaderboard import CONSTANT, Leaderboard, Row, Validated
from mckibben.comparison.planning import Candidate, Data, Plan, plan_of
from mckibben.diagnosis.bands import tested_band
from mckibben.diagnosis.branch_gaps import Memory, memory_test
from mckibben.errors import MckibbenError, unforeseen
from mckibben.estimators.core.estimator import Estimator
from mckibben.metrics import Scores, mean_scores, score
from mckibben.numerals import duration
from mckibben.numerics.blocks import (
    RESAMPLES,
    BlockBootstrap,
    block_length,
    difference_intervals,
    interval,
)
from mckibben.numerics.statistics import correlation_length
from mckibben.options import CompareOptions, given_options
from mckibben.recording import Recording
from mckibben.system.progress import FORECAST_SHARE, telling
from mckibben.system.threads import cores
from mckibben.system.workers import checked, outcomes

TIMED_SAMPLES = 20_000
"""Number of samples of the simulation that measures the time of a step."""


Task = tuple[str, Candidate]
"""The name of a model in the leaderboard, and what is fitted."""


@dataclass(frozen=True)
class FitResult:
    """Result of a task.

    Parameters
    ----------
    predictions : tuple of array, shape (n, k)
        Outputs over every recording of the parts, a part's by the model as it would be without it.
    validated : {"step", "given", "fit"}
        How these were found; see `Row`.
    reason : str or None
        Why the model failed.
    block : Block or None
        Fitted to all training data; ``seconds``, ``memory`` and ``diagnostics`` are of that fit.
    outputs : tuple of array, shape (n, k)
        Its free-running outputs on every training recording, then every test recording.
    step_ns : float
        Of one simulated sample [ns].
    """

    predictions: tuple[Array, ...] = ()
    validated: Validated = "step"
    reason: str | None = None
    block: Block | None = None
    outputs: tuple[Array, ...] = ()
    seconds: float = 0.0
    step_ns: float = 0.0
    memory: Memory | None = None
    diagnostics: Mapping[str, Any] = field(default_factory=dict)
    caution: str | None = None


def effort_of(item: Candidate, data: Data) -> float:
    """Return the approximate time of a fit [s]."""
    samples = sum(len(recording) for recording in data.split.train)
    return float(item.estimator_class.effort * max(samples, 2000) / 10_000)


def fit(data: Data, task: Task, tell: Callable[..., None]) -> FitResult:
    """Run a task; any error becomes the reason in the result."""
    try:
        return _fit(data, task, tell)
    except MckibbenError as error:
        return FitResult(reason=str(error))
    except Exception as error:  # one model must not end the comparison, whatever it does
        return FitResult(reason=str(unforeseen(error)))


def _fit(data: Data, task: Task, tell: Callable[..., None]) -> FitResult:
    split, channels = data.split, data.channels
    started = time.perf_counter()
    estimator = task[1].estimator(channels).fit(split.train, progress=tell)
    seconds = time.perf_counter() - started
    block = estimator.fitted
    outputs = outputs_of(block, data)
    predictions, validated = _held_out(estimator, data, outputs)
    diagnostics = dict(vars(estimator.diagnostics_))
    diagnostics.pop("uncertainty")  # it holds the recordings
    return FitResult(
        predictions,
        validated,
        block=block,
        outputs=outputs,
        seconds=seconds,
        step_ns=_step_cost(block, split.train[0]),
        memory=memory_test(block, split.test, outputs[len(split.train) :], channels.pairs),
        diagnostics=diagnostics,
        caution=estimator.caution,
    )


def _held_out(
    estimator: Estimator, data: Data, outputs: Sequence[Array]
) -> tuple[tuple[Array, ...], Validated]:
    """Return the outputs over the recordings of the parts, each part by the model without it."""
    block, train, names = estimator.fitted, data.split.train, data.channels.outputs
    if data.checks:
        return tuple(block.simulate(recording).matrix(names) for recording in data.checks), "given"
    if not data.parts:
        return tuple(outputs[: len(train)]), "fit"
    predictions = estimator.held_out(train, data.parts)
    if predictions is None:
        return tuple(outputs[: len(train)]), "fit"
    names_of_model = [channel.name for channel in block.outputs]
    return tuple(
        table[:, [names_of_model.index(name) for name in names]] for table in predictions
    ), "step"


def outputs_of(block: Block, data: Data) -> tuple[Array, ...]:
    """Return a model's free-running outputs on every training recording, then every test recording."""
    return tuple(
        block.simulate(recording).matrix(data.channels.outputs) for recording in data.recordings
    )


def _step_cost(block: Block, recording: Recording) -> float:
    inputs = np.resize(
        recording.matrix(channel.name for channel in block.inputs),
        (TIMED_SAMPLES, len(block.inputs)),
    )
    times = []
    for _ in range(3):
        started = time.perf_counter()
        block.simulate(inputs, sample_time=recording.sample_time)
        times.append(time.perf_counter() - started)
    return min(times) / TIMED_SAMPLES * 1e9


PIECES_PER_PART = 4
"""Number of consecutive pieces of a part whose squared errors are summed, for resampling."""

LEAST_SHARE = 0.1
"""Smallest error of a part that counts, relative to that of all parts together: a rest does not decide.
"""

SECONDS_WORTH_PROCESSES = 2.0
"""Seconds of work below which starting processes costs more time than it saves."""


@dataclass(frozen=True)
class Standing:
    """Progress of a comparison: finished and running models, and the best so far.

    ``seconds`` is about how long the rest takes.
    """

    done: int
    total: int
    fitting: tuple[str, ...] = ()
    best: Row | None = None
    unit: str = ""
    seconds: float = 0.0

    @property
    def share(self) -> float:
        """Share of finished models."""
        return self.done / max(self.total, 1)

    def __str__(self) -> str:
        """Return the text of a progress bar.

        >>> str(Standing(12, 28, ("gpi",)))
        '12 of 28 models, fitting gpi'
        """
        fitting = f", fitting {self.fitting[-1]}" if self.fitting else ""
        best = self.best
        so_far = "" if best is None else f"; best {best.model}, {best.chosen_by:.3g} {self.unit}"
        time_left = f"; about {duration(self.seconds)} left" if self.seconds >= 1 else ""
        return f"{self.done} of {self.total} models{fitting}{so_far}{time_left}".rstrip()


def compare(
    train: Recording | Sequence[Recording],
    test: Recording | Sequence[Recording] = (),
    options: CompareOptions | None = None,
    *,
    validation: Recording | Sequence[Recording] = (),
    channels: Channels | None = None,
    executor: Executor | None = None,
    folder: str | Path | None = None,
    clear: bool = True,
    progress: bool | Callable[[Standing], None] | None = None,
    found: Callable[[Leaderboard], None] | None = None,
    **keywords: Any,
) -> Leaderboard:
    """Fit models to the same data, choose one by cross-validation, and test all.

    Every error is free-running. Models are fitted to the training recordings, and chosen by
    cross-validation within them: parts are left out in turn, and the error on each is that of the model
    as it would be without the part (`mckibben.estimators.core.leaving_out`); nothing is chosen by the
    test. A model that fails is a row with its reason. The mean of the training output is
    a row as well: if no model is significantly better, none is recommended. An interrupt ends the
    work at once; the leaderboard then holds what was finished, and names what is pending.

    Parameters
    ----------
    train : Recording or sequence of Recording
        To fit and to choose.
    test : Recording or sequence of Recording, optional
        To test on. Default: the last quarter of the input's travel over the training recordings in
        which the output moves, which is then left out of training; of several muscles, or under loads,
        every third level of what schedules, or every third recording.
    options : CompareOptions, optional
        Its fields may also be given by name.
    validation : Recording or sequence of Recording
        To choose on; nothing is fitted to them.
    channels : Channels, optional
        Of all these recordings; default those that the options name, or `channels_of` finds.
    executor : concurrent.futures.Executor, optional
        What fits the models instead of own processes: one over several machines, say, of Dask
        (``client.get_executor()``) or MPI.
    folder : path, optional
        Folder for finished models, from which an interrupted comparison is resumed.
    clear : bool
        Whether to remove these at the end; otherwise the caller does, by
        ``Checkpoints(folder).clear()``.
    progress : bool or callable, optional
        Whether to show a bar; or a callback for every change of the `Standing`.
    found : callable, optional
        Called with the leaderboard of the finished models after each one.

    Raises
    ------
    DataError
        On recordings that no model could use, or that share samples, unless options allow it.
    ModelError
        On unknown models or options.
    """
    options = given_options(CompareOptions, options, keywords)
    plan = plan_of(train, test, options, validation=validation, channels=channels)
    board = plan.empty
    try:
        with rankings_of(plan, "comparing", options.jobs, executor, folder, progress) as rankings:
            for ranking in rankings:
                board = ranking.board
                if found is not None:
                    found(board)
    except KeyboardInterrupt:
        if not board.rows:
            raise
        return replace(board, stopped=True)
    if clear:
        Checkpoints(folder).clear()
    return board


@dataclass(frozen=True)
class Ranking:
    """A leaderboard of the finished models, and their outputs on all recordings, training first."""

    board: Leaderboard
    outputs: Mapping[str, tuple[Array, ...]] = field(repr=False)


@contextmanager
def rankings_of(
    plan: Plan,
    label: str,
    jobs: int | None,
    executor: Executor | None,
    folder: str | Path | None,
    progress: bool | Callable[[Standing], None] | None,
) -> Iterator[Iterator[Ranking]]:
    """Open the rankings of `ranked` with a bar, or a callback; closed, no model is fitted any more."""
    with (
        telling(progress, label, lines=True) as tell,
        closing(
            ranked(plan, jobs=jobs, executor=executor, folder=folder, progress=tell)
        ) as rankings,
    ):
        yield rankings


def ranked(
    plan: Plan,
    *,
    jobs: int | None,
    executor: Executor | None = None,
    folder: str | Path | None = None,
    progress: Callable[[Standing], None] | None = None,
    watch: Callable[[str, float, float], None] | None = None,
) -> Generator[Ranking]:
    """Yield the ranking after every model; the last ranking is complete.

    Models that the folder has rows of are not fitted again. In one process fast models are first, in
    several the slow ones, so that none is left for the end. ``watch`` is called, while a model is
    fitted, with its name, the share done of its fit, and the least cost so far.
    """
    checked(jobs)
    data, table, checkpoints = plan.data, _Table(plan), Checkpoints(folder, plan.data)
    keys = {name: (item, source(item.estimator_class)) for name, item in plan.items.items()}
    _add_finished(table, plan, checkpoints, keys)
    remaining = {name: item for name, item in plan.items.items() if name not in table.rows}
    efforts = {name: effort_of(item, data) for name, item in remaining.items()}
    workers = jobs or (cores() if sum(efforts.values()) > SECONDS_WORTH_PROCESSES else 1)
    tasks = sorted(remaining.items(), key=lambda task: -efforts[task[0]] if workers > 1 else 0.0)
    work = _Work(plan, table, efforts, workers, progress)

    def report(index: int, *fit_progress: float) -> None:
        name, _ = tasks[index]
        if not fit_progress:
            work.begin(name)
        elif watch is not None:
            watch(name, *fit_progress)

    work.tell()
    if table.rows:
        yield table.ranking()
    for outcome in outcomes(fit, data, tasks, workers, report, executor):
        name, result = tasks[outcome.index][0], outcome.value
        if not isinstance(result, FitResult):
            result = FitResult(reason=str(outcome.error or "its process gave no result"))
        row = _row(plan, name, result, table)
        if row.sound:  # a failure may be the machine's, not the model's
            checkpoints.put(name, row, *keys[name])
        table.add(row, result.outputs)
        work.tell()
        yield table.ranking()


def _add_finished(
    table: _Table, plan: Plan, checkpoints: Checkpoints, keys: Mapping[str, tuple[Candidate, str]]
) -> None:
    """Add the models that are refused, and those that an earlier run has finished."""
    for name, reason in plan.refused.items():
        table.add(Row(name, reason=reason), ())
    for name in plan.items.keys() - plan.refused.keys():
        row = checkpoints.get(name, Row, *keys[name])
        if row is not None and row.model == name and row.sound and row.block is not None:
            table.add(row, outputs_of(row.block, plan.data))


@dataclass
class _Work:
    """Models that remain to be fitted when it begins, by their ``efforts`` [s], and their progress."""

    plan: Plan
    table: _Table
    efforts: Mapping[str, float]
    workers: int
    progress: Callable[[Standing], None] | None
    begun: list[str] = field(default_factory=list)
    started: float = field(default_factory=time.monotonic)

    def begin(self, name: str) -> None:
        """Note that a model is being fitted."""
        if name not in self.begun:
            self.begun.append(name)
            self.tell()

    def tell(self) -> None:
        """Call ``progress`` with what is done, and how long the rest takes at the pace so far."""
        if self.progress is None:
            return
        waiting = [name for name in self.efforts if name not in self.table.rows]
        remaining = sum(self.efforts[name] for name in waiting)
        finished = sum(self.efforts.values()) - remaining
        spent = time.monotonic() - self.started
        pace = (
            spent / finished
            if finished > FORECAST_SHARE * (finished + remaining)
            else 1 / self.workers
        )
        self.progress(
            Standing(
                done=len(self.table.rows),
                total=len(self.plan.items),
                fitting=tuple(name for name in self.begun if name in waiting),
                best=self.table.board(self.table.sorted()).best,
                unit=self.plan.empty.unit,
                seconds=remaining * pace,
            )
        )


def _row(plan: Plan, name: str, result: FitResult, table: _Table) -> Row:
    """Return the row of a model, with its band if it is the best so far."""
    data = plan.data
    try:
        row = row_of(data, name, result, table.constant.squares, plan.empty.seed)
    except MckibbenError as error:  # its outputs overflow
        return Row(name, reason=str(error))
    is_beaten = any(earlier.sound and earlier.order < row.order for earlier in table.rows.values())
    if is_beaten or not row.sound or row.block is None or row.validation_rmse is None:
        return row
    if tuple(channel.name for channel in row.block.outputs) != data.channels.outputs:
        return row
    predictions = held_out_runs(data, result.predictions, row.block)
    with_band = tested_band(row.block, predictions, result.outputs, data.split)
    if with_band is None:
        return row
    banded, band = with_band
    return replace(row, band=band, banded=None if band.unknown else banded)


class _Table:
    """Finished rows, and the resamples of their test errors, on common blocks."""

    def __init__(self, plan: Plan) -> None:
        self.rows: dict[str, Row] = {}
        self.constant = constant_of(plan.data)
        self._plan = plan
        self._outputs: dict[str, tuple[Array, ...]] = {}
        self._lengths = [int(rows.sum()) for rows in plan.data.split.test_rows if rows.any()]
        self._errors = {CONSTANT: test_errors(plan.data, self.constant.outputs)}
        self._correlation: dict[str, float] = {}
        self._resamples: dict[tuple[str, tuple[int, ...]], Array] = {}

    def add(self, row: Row, outputs: tuple[Array, ...]) -> None:
        """Add the row of a finished model, and its outputs on all recordings."""
        self.rows[row.model] = row
        if row.test is not None:
            errors = self._errors[row.model] = test_errors(self._plan.data, outputs)
            self._outputs[row.model] = outputs
            squares = errors**2 / np.maximum((errors**2).mean(axis=0), np.finfo(float).tiny)
            ends = np.cumsum(self._lengths)[:-1]
            self._correlation[row.model] = correlation_length(np.split(squares.mean(axis=1), ends))

    def sorted(self) -> list[Row]:
        """Return the tested rows in the order of the choice."""
        tested = [row for row in self.rows.values() if row.test is not None]
        return sorted(tested, key=lambda row: row.order)

    def board(self, rows: Sequence[Row]) -> Leaderboard:
        """Return the leaderboard of some rows."""
        pending = tuple(name for name in self._plan.items if name not in self.rows)
        constant = self.constant.row
        return replace(self._plan.empty, rows=tuple(rows), pending=pending, constant=constant)

    def ranking(self) -> Ranking:
        """Return the leaderboard of all rows."""
        rows = self.sorted()
        failed = [row for row in self.rows.values() if row.test is None]
        failed.sort(key=lambda row: row.model)
        if not rows:
            return Ranking(self.board(failed), {})
        tested = [*rows, self.constant.row]
        errors = np.array([row.test_error for row in tested])
        samples = np.array(self._resampled([row.model for row in tested]))
        best = self.board(rows).best or rows[0]
        by_test = sorted(errors[:-1])
        ends = difference_intervals(samples, errors, rows.index(best))
        complete = [
            replace(
                row,
                test_rank=None if row.model == CONSTANT else 1 + by_test.index(row.test_error),
                rmse_interval=interval(resamples),
                difference_interval=difference,
                # others have a band if they were the best when they were done, which is chance
                band=row.band if row is best else None,
                banded=row.banded if row is best else None,
            )
            for row, resamples, difference in zip(tested, samples, ends, strict=True)
        ]
        board = self.board([*complete[:-1], *failed])
        outputs = {row.model: self._outputs[row.model] for row in rows}
        return Ranking(replace(board, constant=complete[-1]), outputs)

    def _resampled(self, models: Sequence[str]) -> list[Array]:
        """Return resampled test RMSE of models; block lengths fit their median correlation length."""
        correlation = float(np.median(list(self._correlation.values())))
        blocks = tuple(block_length(n, correlation) for n in self._lengths)
        missing = [model for model in models if (model, blocks) not in self._resamples]
        if missing:
            bootstrap = BlockBootstrap(self._lengths, self._plan.empty.seed, correlation)
            for model in missing:
                self._resamples[model, blocks] = bootstrap.rmse(self._errors[model])
        return [self._resamples[model, blocks] for model in models]


def test_errors(data: Data, outputs: Sequence[Array]) -> Array:
    """Return the errors of outputs on all recordings at the samples scored, shape (n, k)."""
    split, names = data.split, data.channels.outputs
    runs = zip(outputs[len(split.train) :], split.test, split.test_rows, strict=True)
    return np.concatenate([(table - run.matrix(names))[rows] for table, run, rows in runs])


def part_errors(data: Data, predictions: Sequence[Array]) -> list[Array]:
    """Return the errors of held-out predictions on every part, shape (n, k) each."""
    names = data.channels.outputs
    pairs = zip(predictions, data.held_out, strict=True)
    errors = [table - run.matrix(names) for table, run in pairs]
    return [
        np.concatenate([error[rows] for error, rows in zip(errors, part, strict=True)])
        for part in data.parts
    ]


def held_out_runs(data: Data, predictions: Sequence[Array], block: Block) -> list[FreeRun]:
    """Return the held-out predictions of every recording of the parts, as runs."""
    inputs, outputs = [channel.name for channel in block.inputs], data.channels.outputs
    parts_of_runs = zip(data.held_out, predictions, zip(*data.parts, strict=True), strict=True)
    return [
        FreeRun.of(run_of(run, inputs, outputs, counts=np.any(rows, axis=0)), table)
        for run, table, rows in parts_of_runs
    ]


def row_of(data: Data, name: str, result: FitResult, constant: Array | None, seed: int) -> Row:
    """Return the row of a model: all scores, and its skill over the constant of `squares_of`."""
    if result.reason is not None:
        return Row(name, reason=result.reason)
    on_train, on_test = _scores(data, result.outputs)
    validation = _validation(data, result.predictions, constant, seed)
    return Row(
        model=name,
        n_parameters=result.diagnostics.get("n_free", len(data.channels.outputs)),
        fit_seconds=result.seconds,
        step_ns=result.step_ns,
        train=mean_scores(list(on_train.values())),
        test=mean_scores(list(on_test.values())),
        outputs=on_test,
        validated=result.validated,
        caution=result.caution,
        memory=result.memory,
        block=result.block,
        diagnostics=result.diagnostics,
        **validation,
    )


def _scores(data: Data, outputs: Sequence[Array]) -> tuple[dict[str, Scores], dict[str, Scores]]:
    """Return the scores of every output on the training and on the test recordings."""
    names, n_train = data.channels.outputs, len(data.split.train)
    rows = [*(~run.bridged for run in data.split.train), *data.split.test_rows]
    measured = [run.matrix(names)[part] for run, part in zip(data.recordings, rows, strict=True)]
    modelled = [table[part] for table, part in zip(outputs, rows, strict=True)]

    def scores(part: slice) -> dict[str, Scores]:
        columns = (np.concatenate(tables[part]).T for tables in (measured, modelled))
        return {name: score(*pair) for name, *pair in zip(names, *columns, strict=True)}

    return scores(slice(n_train)), scores(slice(n_train, None))


def _validation(
    data: Data, predictions: Sequence[Array], constant: Array | None, seed: int
) -> dict[str, Any]:
    """Return the fields of a row of held-out predictions: RMSE by output and part, and skill.

    The RMSE of an output is the geometric mean over parts, each of at least a share of the RMSE of all.
    """
    errors = part_errors(data, predictions)
    if not all(np.isfinite(error).all() for error in errors):
        return {"validation_failed": "its outputs diverged without a part of the data"}
    if not errors:
        return {}
    by_part = np.sqrt([(error**2).mean(axis=0) for error in errors])
    pooled = np.sqrt((np.concatenate(errors) ** 2).mean(axis=0))
    least_error = np.maximum(LEAST_SHARE * pooled, np.finfo(float).tiny)
    means = np.exp(np.log(np.maximum(by_part, least_error)).mean(axis=0))
    by_output = dict(zip(data.channels.outputs, means.tolist(), strict=True))
    skill, least = None, None
    if constant is not None:
        skill, least = skill_of(squares_of(errors).sum(axis=1), constant.sum(axis=1), seed)
    return {
        "validation_rmse": float(np.mean(list(by_output.values()))),
        "validation_by_output": by_output,
        "validation_by_part": tuple(by_part.mean(axis=1).tolist()),
        "skill": skill,
        "skill_least": least,
    }


def squares_of(errors: Sequence[Array]) -> Array:
    """Return summed squared errors of consecutive pieces of every part, shape (pieces, k)."""
    pieces = [piece for error in errors for piece in np.array_split(error, PIECES_PER_PART)]
    return np.array([(piece**2).sum(axis=0) for piece in pieces])


class Constant(NamedTuple):
    """The mean of the training output as a model, for any input."""

    row: Row
    outputs: tuple[Array, ...]
    squares: Array | None


def constant_of(data: Data) -> Constant:
    """Return the row of the mean of the training output, its outputs, and its squared errors."""
    train, names = data.split.train, data.channels.outputs
    tables = [recording.matrix(names) for recording in train]
    mean = np.concatenate(tables).mean(axis=0)
    outputs = tuple(np.tile(mean, (len(recording), 1)) for recording in data.recordings)
    predictions = tuple(np.tile(mean, (len(recording), 1)) for recording in data.held_out)
    for part in () if data.checks else data.parts:
        others = [table[~rows] for table, rows in zip(tables, part, strict=True)]
        for table, rows in zip(predictions, part, strict=True):
            table[rows] = np.concatenate(others).mean(axis=0)
    squares = squares_of(part_errors(data, predictions)) if data.parts else None
    result = FitResult(predictions, outputs=outputs)
    return Constant(row_of(data, CONSTANT, result, None, 0), outputs, squares)


def skill_of(squares: Array, constant: Array, seed: int) -> tuple[float, float]:
    """Return the share of a constant's squared error that a model explains, and its lower bound.

    The bound is exceeded by 99 % of resamples of blocks, the same for both. Both are sums of squared
    errors, shape (pieces,).
    """
    both = np.array([squares, constant])
    if not np.isfinite(both).all() or both[1].sum() == 0:
        return float("-inf"), float("-inf")
    resamples = np.random.default_rng(seed).integers(0, both.shape[1], (RESAMPLES, both.shape[1]))
    model, mean = both[:, resamples].sum(axis=2)
    remaining = model / np.maximum(mean, np.finfo(float).tiny)
    return float(1 - both[0].sum() / both[1].sum()), float(1 - np.quantile(remaining, 0.99))
