"""Fit, held-out predictions and free runs of one model, as a task for a worker process."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.comparison.leaderboard import Validated
from mckibben.comparison.planning import Candidate, Data
from mckibben.diagnosis.branch_gaps import Memory, memory_test
from mckibben.errors import MckibbenError, unforeseen
from mckibben.estimators.core.estimator import Estimator
from mckibben.recording import Recording
from mckibben.system import workers
from mckibben.system.threads import cores
from mckibben.system.workers import Outcome

TIMED_SAMPLES = 20_000
"""Number of samples of the simulation that measures the time of a step."""

WORTH_A_PROCESS = 2.0
"""Seconds of work below which starting processes costs more time than it saves."""


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
        return tuple(block.simulate(one).matrix(names) for one in data.checks), "given"
    if not data.parts:
        return tuple(outputs[: len(train)]), "fit"
    found = estimator.held_out(train, data.parts)
    if found is None:
        return tuple(outputs[: len(train)]), "fit"
    given = [channel.name for channel in block.outputs]
    return tuple(table[:, [given.index(name) for name in names]] for table in found), "step"


def outputs_of(block: Block, data: Data) -> tuple[Array, ...]:
    """Return a model's free-running outputs on every training recording, then every test recording."""
    return tuple(block.simulate(one).matrix(data.channels.outputs) for one in data.recordings)


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
