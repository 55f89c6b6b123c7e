"""Fitting, cross-validation and free runs of one model, in tasks for worker processes."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from mckibben import registry
from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.free_run import Mask, run_free
from mckibben.comparison.channels import Channels
from mckibben.comparison.choosing import CONSTANT, skill_of
from mckibben.comparison.leaderboard import Row
from mckibben.comparison.memory_test import Memory, memory_test
from mckibben.comparison.splits import Fold, Split
from mckibben.diagnosis.bands import Held
from mckibben.errors import MckibbenError, unforeseen
from mckibben.estimators.optimisers.tracker import Progress
from mckibben.metrics import Scores, mean_scores, score
from mckibben.recording import Recording
from mckibben.system import workers
from mckibben.system.threads import cores
from mckibben.system.workers import Outcome

TIMED_SAMPLES = 20_000
"""Number of samples of the simulation that measures the time of a step."""

WORTH_A_PROCESS = 4.0
"""Seconds of work below which starting processes costs more time than it saves."""

PIECES = 8
"""Number of consecutive pieces of a held-out recording whose squared errors are summed, for
resampling.
"""


@dataclass(frozen=True)
class Data:
    """Data common to all models: training and test data, folds, channels."""

    split: Split
    folds: tuple[Fold, ...]
    channels: Channels

    @property
    def recordings(self) -> tuple[Recording, ...]:
        """Every training recording, then every test recording."""
        return (*self.split.train, *self.split.test)

    def test_errors(self, outputs: Sequence[Array]) -> Array:
        """Return the errors of outputs on all recordings at the samples scored, shape (n, k)."""
        split, names = self.split, self.channels.outputs
        runs = zip(outputs[len(split.train) :], split.test, split.test_rows, strict=True)
        return np.concatenate([(found - run.matrix(names))[rows] for found, run, rows in runs])

    def held_out(self, predictions: Mapping[int, Sequence[Array]], block: Block) -> list[Held]:
        """Return predictions on all folds, and the measured outputs."""
        return [
            Held(
                run.matrix(channel.name for channel in block.inputs),
                modelled,
                run.matrix(self.channels.outputs),
                rows,
                run.sample_time,
            )
            for place, fold in enumerate(self.folds)
            for run, rows, modelled in zip(
                fold.test, fold.test_rows, predictions[place], strict=True
            )
        ]


@dataclass(frozen=True)
class Item:
    """A model to fit, and its settings."""

    model: str
    settings: Mapping[str, Any]


@dataclass(frozen=True)
class Task:
    """Folds of a model to validate on, and whether to fit on all training data and test.

    Folds come first: they load the compiled kernels, which the fit that is timed then finds ready.
    """

    name: str
    item: Item
    folds: tuple[int, ...]
    whole: bool


@dataclass(frozen=True)
class FitResult:
    """Result of a task, or of all tasks of a model.

    Parameters
    ----------
    predictions : mapping of int to tuple of array, shape (n, k)
        Fold to the free-running outputs on its test recordings.
    invalid, reason : str or None
        Why a fold could not be fitted; why the model failed.
    block : Block or None
        Fitted to all training data; ``seconds``, ``memory`` and ``diagnostics`` are of that fit.
    outputs : tuple of array, shape (n, k)
        Its free-running outputs on every training recording, then every test recording.
    step_ns : float
        Of one simulated sample [ns].
    """

    predictions: Mapping[int, tuple[Array, ...]] = field(default_factory=dict)
    invalid: str | None = None
    reason: str | None = None
    block: Block | None = None
    outputs: tuple[Array, ...] = ()
    seconds: float = 0.0
    step_ns: float = 0.0
    memory: Memory | None = None
    diagnostics: Mapping[str, Any] = field(default_factory=dict)


def tasks_of(name: str, item: Item, n_folds: int, split: bool) -> list[Task]:
    """Return the tasks of a model: one, or one per fold."""
    if n_folds < 2 or not split:
        return [Task(name, item, tuple(range(n_folds)), whole=True)]
    return [Task(name, item, (k,), whole=k == 0) for k in range(n_folds)]


def effort_of(model: str, data: Data) -> float:
    """Return the approximate time of a fit [s]."""
    samples = sum(len(recording) for recording in data.split.train)
    return float(registry.load("estimators", model).effort * max(samples, 2000) / 10_000)


def processes_for(seconds: float) -> int:
    """Return the number of processes for an amount of work."""
    return cores() if seconds > WORTH_A_PROCESS else 1


def results(
    data: Data, tasks: Sequence[Task], n: int, report: Callable[..., None] | None = None
) -> Iterator[Outcome]:
    """Yield the results of tasks as they finish; see `Workers.results`."""
    return workers.outcomes(fit, data, tasks, n, report)


def fit(data: Data, task: Task, tell: Callable[..., None]) -> FitResult:
    """Run a task; any error becomes the reason in the result."""
    try:
        return _fit(data, task, tell)
    except MckibbenError as error:
        return FitResult(reason=str(error))
    except Exception as error:  # one model must not end the comparison, whatever it does
        return FitResult(reason=str(unforeseen(error)))


def _fit(data: Data, task: Task, tell: Callable[..., None]) -> FitResult:
    item, split, channels = task.item, data.split, data.channels
    estimator_class = registry.load("estimators", item.model)
    settings = estimator_class.channel_settings(
        channels.inputs, channels.outputs, channels.scheduling
    ) | dict(item.settings)
    folds = {k: data.folds[k] for k in task.folds}
    # what is fitted to all training data is validated as it is delivered
    own = {k for k, fold in folds.items() if _is_whole(fold, split)}
    n_fits = len(folds) - len(own) + task.whole
    done = 0

    def fitted(recordings: Sequence[Recording], rows: Sequence[Mask] | None = None) -> Any:
        nonlocal done
        place, done = done, done + 1
        progress: Progress | None = None
        if task.whole:  # the share of all fits that is done, by the share of one
            progress = lambda share, cost: tell((place + share) / n_fits, cost)  # noqa: E731
        return estimator_class(**settings).fit(recordings, rows=rows, progress=progress)

    predictions, invalid = {}, None
    try:
        for k in (k for k in folds if k not in own):
            block = fitted(folds[k].train, folds[k].train_rows).model_
            predictions[k] = _predicted(block, folds[k], channels.outputs)
    except MckibbenError as error:  # a part of the data may be too little where all of it is enough
        invalid = str(error)
    if not task.whole:
        return FitResult(predictions, invalid)
    started = time.perf_counter()
    estimator = fitted(split.train)
    seconds = time.perf_counter() - started
    block = estimator.model_
    predictions |= {k: _predicted(block, folds[k], channels.outputs) for k in own}
    outputs = outputs_of(block, data)
    diagnostics = dict(vars(estimator.diagnostics_))
    diagnostics.pop("uncertainty")  # it holds the recordings
    return FitResult(
        predictions,
        invalid,
        block=block,
        outputs=outputs,
        seconds=seconds,
        step_ns=_step_cost(block, split.train[0]),
        memory=memory_test(block, split.test, outputs[len(split.train) :], channels.pairs()),
        diagnostics=diagnostics,
    )


def _predicted(block: Block, fold: Fold, names: Sequence[str]) -> tuple[Array, ...]:
    """Return free-running outputs on a fold's held-out data; a single recording is on both sides."""
    fitted = list(zip(fold.train, fold.train_rows, strict=True))
    found = []
    for recording in fold.test:
        known = [(run, rows) for run, rows in fitted if run is recording]
        own, own_rows = [run for run, _ in known], [rows for _, rows in known]
        found.append(run_free(block, recording, names, own, own_rows))
    return tuple(found)


def outputs_of(block: Block, data: Data) -> tuple[Array, ...]:
    """Return a model's free-running outputs on every training recording, then every test recording."""
    split, names = data.split, data.channels.outputs
    on_train = [run_free(block, recording, names, (recording,)) for recording in split.train]
    on_test = [run_free(block, recording, names, split.train) for recording in split.test]
    return (*on_train, *on_test)


def _is_whole(fold: Fold, split: Split) -> bool:
    return fold.train is split.train and all(rows.all() for rows in fold.train_rows)


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


def joined(tasks: Sequence[FitResult]) -> FitResult:
    """Return the combined result of all tasks of a model."""
    failed = next((one for one in tasks if one.reason is not None), None)
    if failed is not None:
        return failed
    (whole,) = (one for one in tasks if one.block is not None)
    predictions = {k: found for one in tasks for k, found in one.predictions.items()}
    invalid = next((one.invalid for one in tasks if one.invalid is not None), None)
    return replace(whole, predictions=predictions, invalid=invalid)


def row_of(data: Data, name: str, found: FitResult, constant: Array | None, seed: int) -> Row:
    """Return the row of a model: all scores, and its skill over the constant.

    Parameters
    ----------
    found : FitResult
        Of all its tasks.
    constant : array, shape (pieces, k), or None
        Squared errors of the mean of the training output; see `squares_of`.
    """
    if found.reason is not None:
        return Row(name, reason=found.reason)
    names, block, n_train = data.channels.outputs, found.block, len(data.split.train)
    rows = [*(np.ones(len(run), dtype=bool) for run in data.split.train), *data.split.test_rows]
    measured = [run.matrix(names)[kept] for run, kept in zip(data.recordings, rows, strict=True)]
    modelled = [given[kept] for given, kept in zip(found.outputs, rows, strict=True)]

    def scores(part: slice) -> dict[str, Scores]:
        columns = (np.concatenate(some[part]).T for some in (measured, modelled))
        return {name: score(*pair) for name, *pair in zip(names, *columns, strict=True)}

    on_train, on_test = scores(slice(n_train)), scores(slice(n_train, None))
    invalid, by_output, skill, least = found.invalid, {}, None, None
    if invalid is None and found.predictions:
        squares = squares_of(data, found.predictions)
        if np.isfinite(squares).all():
            by_output = validated(data, squares)
            if constant is not None:
                skill, least = skill_of(squares.sum(axis=1), constant.sum(axis=1), seed)
        else:
            invalid = "its outputs diverged on data that it was not fitted to"
    return Row(
        model=name,
        n_parameters=found.diagnostics.get("n_free", len(names)),
        fit_seconds=found.seconds,
        step_ns=found.step_ns,
        train=mean_scores(list(on_train.values())),
        test=mean_scores(list(on_test.values())),
        outputs=on_test,
        validation_rmse=float(np.mean(list(by_output.values()))) if by_output else None,
        validation_by_output=by_output,
        validation_failed=invalid,
        skill=skill,
        skill_least=least,
        memory=found.memory,
        block=block,
        diagnostics=found.diagnostics,
    )


def squares_of(data: Data, predictions: Mapping[int, Sequence[Array]]) -> Array:
    """Return summed squared errors of consecutive pieces of held-out data, shape (pieces, k)."""
    names = data.channels.outputs
    return np.array(
        [
            (piece**2).sum(axis=0)
            for place, fold in enumerate(data.folds)
            for run, rows, modelled in zip(
                fold.test, fold.test_rows, predictions[place], strict=True
            )
            for piece in np.array_split((modelled - run.matrix(names))[rows], PIECES)
        ]
    )


def validated(data: Data, squares: Array) -> dict[str, float]:
    """Return the held-out RMSE of every output from its squared errors."""
    count = sum(int(rows.sum()) for fold in data.folds for rows in fold.test_rows)
    errors = np.sqrt(squares.sum(axis=0) / count)
    return dict(zip(data.channels.outputs, errors.tolist(), strict=True))


class Constant(NamedTuple):
    """The mean of the training output as a model, for any input."""

    row: Row
    outputs: tuple[Array, ...]
    squares: Array | None


def constant_of(data: Data) -> Constant:
    """Return the row of the mean of the training output, its outputs, and its squared errors."""
    names = data.channels.outputs

    def means(fold: Fold, recordings: Sequence[Recording]) -> tuple[Array, ...]:
        runs = zip(fold.train, fold.train_rows, strict=True)
        mean = np.concatenate([run.matrix(names)[rows] for run, rows in runs]).mean(axis=0)
        return tuple(np.tile(mean, (len(recording), 1)) for recording in recordings)

    train = data.split.train
    whole = Fold(train, tuple(np.ones(len(run), dtype=bool) for run in train), (), ())
    found = FitResult(
        {place: means(fold, fold.test) for place, fold in enumerate(data.folds)},
        outputs=means(whole, data.recordings),
    )
    squares = squares_of(data, found.predictions) if data.folds else None
    return Constant(row_of(data, CONSTANT, found, None, 0), found.outputs, squares)
