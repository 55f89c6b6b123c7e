"""Fit, held-out predictions and free runs of one model, as a task for a worker process."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from mckibben import registry
from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.free_run import run_free
from mckibben.channels import Channels
from mckibben.comparison.choosing import CONSTANT, skill_of
from mckibben.comparison.leaderboard import Row, Validated
from mckibben.diagnosis.bands import Held
from mckibben.diagnosis.branch_gaps import Memory, memory_test
from mckibben.errors import MckibbenError, unforeseen
from mckibben.estimators.core.estimator import Estimator
from mckibben.estimators.core.leaving_out import held_out
from mckibben.metrics import Scores, mean_scores, score
from mckibben.recording import Recording
from mckibben.splits import Part, Split
from mckibben.system import workers
from mckibben.system.threads import cores
from mckibben.system.workers import Outcome

TIMED_SAMPLES = 20_000
"""Number of samples of the simulation that measures the time of a step."""

WORTH_A_PROCESS = 2.0
"""Seconds of work below which starting processes costs more time than it saves."""

PIECES = 4
"""Number of consecutive pieces of a part whose squared errors are summed, for resampling."""

LEAST_SHARE = 0.1
"""Smallest error of a part that counts, relative to that of all parts together: a rest does not decide.
"""


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

    def test_errors(self, outputs: Sequence[Array]) -> Array:
        """Return the errors of outputs on all recordings at the samples scored, shape (n, k)."""
        split, names = self.split, self.channels.outputs
        runs = zip(outputs[len(split.train) :], split.test, split.test_rows, strict=True)
        return np.concatenate([(found - run.matrix(names))[rows] for found, run, rows in runs])

    def part_errors(self, predictions: Sequence[Array]) -> list[Array]:
        """Return the errors of held-out predictions on every part, shape (n, k) each."""
        names = self.channels.outputs
        pairs = zip(predictions, self.held_out, strict=True)
        errors = [found - run.matrix(names) for found, run in pairs]
        return [
            np.concatenate([error[rows] for error, rows in zip(errors, part, strict=True)])
            for part in self.parts
        ]

    def held(self, predictions: Sequence[Array], block: Block) -> list[Held]:
        """Return the held-out predictions of every recording of the parts, and its measured outputs."""
        inputs = [channel.name for channel in block.inputs]
        each = zip(self.held_out, predictions, zip(*self.parts, strict=True), strict=True)
        return [
            Held(
                run.matrix(inputs),
                found,
                run.matrix(self.channels.outputs),
                np.any(rows, axis=0),
                run.sample_time,
            )
            for run, found, rows in each
        ]


@dataclass(frozen=True)
class Candidate:
    """A model to fit, by its short name or as an estimator, and its settings."""

    model: str | Estimator
    settings: Mapping[str, Any] = field(default_factory=dict)

    @property
    def made(self) -> type[Estimator]:
        """Class of the estimator."""
        if isinstance(self.model, str):
            found: type[Estimator] = registry.load("estimators", self.model)
            return found
        return type(self.model)

    def estimator(self, channels: Channels) -> Estimator:
        """Return the estimator of the channels of a comparison."""
        named = self.made.channel_settings(channels.inputs, channels.outputs, channels.scheduling)
        own = {} if isinstance(self.model, str) else self.model.get_params()
        return self.made(**own | named | dict(self.settings))


@dataclass(frozen=True)
class Task:
    """A model to fit, and its name in the leaderboard."""

    name: str
    item: Candidate


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
    return float(item.made.effort * max(samples, 2000) / 10_000)


def processes_for(seconds: float) -> int:
    """Return the number of processes for an amount of work."""
    return cores() if seconds > WORTH_A_PROCESS else 1


def results(
    data: Data,
    tasks: Sequence[Task],
    n: int,
    report: Callable[..., None] | None = None,
    executor: Executor | None = None,
) -> Iterator[Outcome]:
    """Yield the results of tasks as they finish; see `workers.outcomes`."""
    return workers.outcomes(fit, data, tasks, n, report, executor)


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
    estimator = task.item.estimator(channels).fit(split.train, progress=tell)
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
        memory=memory_test(block, split.test, outputs[len(split.train) :], channels.pairs()),
        diagnostics=diagnostics,
        caution=estimator.caution,
    )


def _held_out(
    estimator: Estimator, data: Data, outputs: Sequence[Array]
) -> tuple[tuple[Array, ...], Validated]:
    """Return the outputs over the recordings of the parts, each part by the model without it."""
    block, train, names = estimator.fitted, data.split.train, data.channels.outputs
    if data.checks:
        return tuple(run_free(block, recording, names) for recording in data.checks), "given"
    if not data.parts:
        return tuple(outputs[: len(train)]), "fit"
    found = held_out(estimator, train, data.parts)
    if found is None:
        return tuple(outputs[: len(train)]), "fit"
    given = [channel.name for channel in block.outputs]
    return tuple(table[:, [given.index(name) for name in names]] for table in found), "step"


def outputs_of(block: Block, data: Data) -> tuple[Array, ...]:
    """Return a model's free-running outputs on every training recording, then every test recording."""
    return tuple(run_free(block, one, data.channels.outputs) for one in data.recordings)


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


def row_of(data: Data, name: str, found: FitResult, constant: Array | None, seed: int) -> Row:
    """Return the row of a model: all scores, and its skill over the constant.

    Parameters
    ----------
    found : FitResult
    constant : array, shape (pieces, k), or None
        Squared errors of the mean of the training output; see `squares_of`.
    """
    if found.reason is not None:
        return Row(name, reason=found.reason)
    names, block, n_train = data.channels.outputs, found.block, len(data.split.train)
    rows = [*(~run.bridged for run in data.split.train), *data.split.test_rows]
    measured = [run.matrix(names)[kept] for run, kept in zip(data.recordings, rows, strict=True)]
    modelled = [given[kept] for given, kept in zip(found.outputs, rows, strict=True)]

    def scores(part: slice) -> dict[str, Scores]:
        columns = (np.concatenate(some[part]).T for some in (measured, modelled))
        return {name: score(*pair) for name, *pair in zip(names, *columns, strict=True)}

    on_train, on_test = scores(slice(n_train)), scores(slice(n_train, None))
    errors = data.part_errors(found.predictions)
    invalid, by_output, parts, skill, least = None, {}, (), None, None
    if not all(np.isfinite(error).all() for error in errors):
        invalid = "its outputs diverged without a part of the data"
    elif errors:
        by_part = np.sqrt([(error**2).mean(axis=0) for error in errors])
        pooled = np.sqrt((np.concatenate(errors) ** 2).mean(axis=0))
        least_error = np.maximum(LEAST_SHARE * pooled, np.finfo(float).tiny)
        means = np.exp(np.log(np.maximum(by_part, least_error)).mean(axis=0))
        by_output = dict(zip(names, means.tolist(), strict=True))
        parts = tuple(by_part.mean(axis=1).tolist())
        if constant is not None:
            skill, least = skill_of(squares_of(errors).sum(axis=1), constant.sum(axis=1), seed)
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
        validation_by_part=parts,
        validation_failed=invalid,
        validated=found.validated,
        caution=found.caution,
        skill=skill,
        skill_least=least,
        memory=found.memory,
        block=block,
        diagnostics=found.diagnostics,
    )


def squares_of(errors: Sequence[Array]) -> Array:
    """Return summed squared errors of consecutive pieces of every part, shape (pieces, k)."""
    pieces = [piece for error in errors for piece in np.array_split(error, PIECES)]
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
        rest = [table[~rows] for table, rows in zip(tables, part, strict=True)]
        for table, rows in zip(predictions, part, strict=True):
            table[rows] = np.concatenate(rest).mean(axis=0)
    squares = squares_of(data.part_errors(predictions)) if data.parts else None
    found = FitResult(predictions, outputs=outputs)
    return Constant(row_of(data, CONSTANT, found, None, 0), outputs, squares)
