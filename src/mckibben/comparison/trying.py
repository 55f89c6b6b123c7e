"""Trying one model: fitted, cross-validated, run free and scored; in parts that processes can share."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mckibben import registry, workers
from mckibben.blocks.base import Block
from mckibben.comparison.cluster import outcomes_outside, outer_backend, processes_outside
from mckibben.comparison.free_run import run_free
from mckibben.comparison.memory_test import memory_test
from mckibben.comparison.recommending import CONSTANT
from mckibben.comparison.results import Row
from mckibben.comparison.splits import Fold, Mask, Split
from mckibben.errors import MckibbenError
from mckibben.estimators.search import Progress, whole_searches
from mckibben.metrics import score
from mckibben.recording import Recording
from mckibben.threads import cores
from mckibben.workers import Outcome, WorkerError

Array = NDArray[np.float64]

TIMED_SAMPLES = 20_000

PIECES = 8
"""Blocks that the errors on a recording of the cross-validation are summed in, so that models pair."""

WORTH_A_PROCESS = 4.0
"""Seconds of work below which starting processes takes longer than it saves."""


@dataclass(frozen=True)
class Data:
    """What all models are given.

    Parameters
    ----------
    split : Split
        Data to fit and to test on.
    folds : tuple of Fold
        Parts of the cross-validation within the training data.
    input, output : str
        Channels.
    """

    split: Split
    folds: tuple[Fold, ...]
    input: str
    output: str


@dataclass(frozen=True)
class Part:
    """Part of trying a model: the folds to cross-validate on, and whether to fit to everything.

    Parameters
    ----------
    model : str
        Short name.
    settings : mapping
        Of its estimator.
    folds : tuple of int
        Places of folds. They come first: they load the compiled kernels, which the fit that is timed
        then finds ready.
    whole : bool
        Whether to fit to all of the training data, and to test.
    """

    model: str
    settings: Mapping[str, Any]
    folds: tuple[int, ...]
    whole: bool


@dataclass(frozen=True)
class Tried:
    """What came of a part, or of all parts of a model together.

    Parameters
    ----------
    row : Row or None
        Of the leaderboard; None in parts that do not fit the whole.
    outputs : tuple of array
        Free-running output on every training recording, then every test recording.
    squares : tuple of float
        Sums of squared errors of the cross-validation, `PIECES` a recording tested on.
    count : int
        Samples in them.
    invalid : str or None
        Why a fold could not be fitted.
    """

    row: Row | None = None
    outputs: tuple[Array, ...] = ()
    squares: tuple[float, ...] = ()
    count: int = 0
    invalid: str | None = None


def parts_of(model: str, settings: Mapping[str, Any], n_folds: int, split: bool) -> list[Part]:
    """Return the parts of trying a model: one, or as many as there are folds."""
    if not split or n_folds < 2:
        return [Part(model, settings, tuple(range(n_folds)), whole=True)]
    others = [Part(model, settings, (k,), whole=False) for k in range(1, n_folds)]
    return [Part(model, settings, (0,), whole=True), *others]


def try_part(data: Data, part: Part, tell: Callable[..., None]) -> Tried:
    """Do a part of trying a model; whatever goes wrong is in the row."""
    try:
        return _try(data, part, tell)
    except MckibbenError as error:
        return Tried(Row(part.model, reason=str(error)))
    except Exception as error:  # one model must not take the comparison down, whatever it does
        return Tried(Row(part.model, reason=f"{type(error).__name__}: {error}"))


def effort_of(model: str, data: Data) -> float:
    """Return about how many seconds a fit of a model takes."""
    samples = sum(len(recording) for recording in data.split.train)
    return float(registry.load("estimators", model).effort * max(samples, 2000) / 10_000)


def processes_for(seconds: float) -> int:
    """Return how many processes should share so much work, here or on the backend chosen outside."""
    if outer_backend():
        return processes_outside()
    return cores() if seconds > WORTH_A_PROCESS else 1


def outcomes(
    data: Data, parts: Sequence[Part], n: int, told: Callable[..., None] | None = None
) -> Iterator[Outcome]:
    """Yield what comes of every part, as it comes, from so many processes; see `Workers.results`."""
    found = (
        outcomes_outside(try_part, data, parts)
        if outer_backend()
        else workers.outcomes(try_part, data, parts, n, told)
    )
    for outcome in found:
        part = parts[outcome.index]
        if outcome.error is None and not _is_of(outcome.value, part, data):
            words = f"its process gave something that is not what came of {part.model}"
            outcome = Outcome(outcome.index, error=WorkerError(words))
        yield outcome


def _is_of(tried: Any, part: Part, data: Data) -> bool:
    """Tell whether this is what came of a part: complete, of its model, and scored as it says."""
    if not isinstance(tried, Tried):
        return False
    row = tried.row
    if row is None:
        return not part.whole and all(isinstance(square, float) for square in tried.squares)
    if not isinstance(row, Row) or row.model != part.model:
        return False
    if row.reason is not None:
        return isinstance(row.reason, str)
    recordings = (*data.split.train, *data.split.test)
    if (
        not (part.whole and isinstance(row.block, Block) and row.sound)
        or row.test is None
        or not all(isinstance(output, np.ndarray) for output in tried.outputs)
        or [output.shape for output in tried.outputs] != [(len(r),) for r in recordings]
    ):
        return False
    errors = errors_on_test(tried.outputs, data)
    rmse = math.sqrt(float(errors @ errors) / errors.size)
    most = max(float(np.abs(recording[data.output]).max()) for recording in recordings)
    return math.isclose(rmse, row.test.rmse, rel_tol=1e-6, abs_tol=1e-9 * most)


def joined(parts: Sequence[Tried]) -> Tried:
    """Return what came of all parts of a model, given in their order, as one."""
    failed = [tried for tried in parts if tried.row is not None and tried.row.reason is not None]
    if failed:
        return failed[0]
    (whole,) = (tried for tried in parts if tried.row is not None)
    assert whole.row is not None
    invalid = next((tried.invalid for tried in parts if tried.invalid is not None), None)
    if invalid is None and not math.isfinite(rms_of(parts) or 0.0):
        invalid = "its outputs ran away on a part of the data that it was not fitted to"
    if invalid is not None:
        noted = dict(whole.row.diagnostics) | {"validation_failed": invalid}
        return replace(whole, row=replace(whole.row, diagnostics=noted))
    squares = tuple(square for tried in parts for square in tried.squares)
    return replace(whole, row=replace(whole.row, validation_rmse=rms_of(parts)), squares=squares)


def squares_of(errors: Array) -> list[float]:
    """Return the sums of squared errors of consecutive pieces."""
    return [float(piece @ piece) for piece in np.array_split(errors, PIECES)]


def constant_of(data: Data) -> Tried:
    """Return what comes of predicting the mean of the output that is fitted to, whatever the input."""
    squares: list[float] = []
    count = 0
    for fold in data.folds:
        mean = _mean(fold.train, data.output, fold.train_rows)
        for recording, rows in zip(fold.test, fold.test_rows, strict=True):
            errors = mean - recording[data.output][rows]
            squares += squares_of(errors)
            count += errors.size
    split = data.split
    mean = _mean(split.train, data.output, [np.ones(len(r), dtype=bool) for r in split.train])
    outputs = tuple(np.full(len(recording), mean) for recording in (*split.train, *split.test))
    scored, measured = _tested(outputs, data)
    trained = np.concatenate([recording[data.output] for recording in split.train])
    found = Tried(None, outputs, tuple(squares), count)
    row = Row(
        model=CONSTANT,
        n_parameters=1,
        fit_seconds=0.0,
        step_ns=0.0,
        train=score(trained, np.full(trained.size, mean)),
        test=score(measured, scored),
        validation_rmse=rms_of([found]),
    )
    return replace(found, row=row)


def _mean(recordings: Sequence[Recording], output: str, rows: Sequence[Mask]) -> float:
    return float(
        np.concatenate([r[output][kept] for r, kept in zip(recordings, rows, strict=True)]).mean()
    )


def rms_of(parts: Sequence[Tried]) -> float | None:
    """Return the root mean square of the cross-validation, or None where there was none."""
    count = sum(tried.count for tried in parts)
    total = math.fsum(square for tried in parts for square in tried.squares)  # in any order
    return math.sqrt(total / count) if count else None


def outputs_of(block: Block, data: Data) -> tuple[Array, ...]:
    """Return a model's free-running output on every training recording, then every test recording."""
    split = data.split
    on_train = [run_free(block, recording, data.output, (recording,)) for recording in split.train]
    on_test = [run_free(block, recording, data.output, split.train) for recording in split.test]
    return (*on_train, *on_test)


def errors_on_test(outputs: Sequence[Array], data: Data) -> Array:
    """Return the errors at all samples of the test that are scored."""
    scored, measured = _tested(outputs, data)
    return scored - measured


def _tested(outputs: Sequence[Array], data: Data) -> tuple[Array, Array]:
    split = data.split
    on_test = outputs[len(split.train) :]
    rows = list(zip(on_test, split.test, split.test_rows, strict=True))
    return (
        np.concatenate([modelled[kept] for modelled, _, kept in rows]),
        np.concatenate([recording[data.output][kept] for _, recording, kept in rows]),
    )


def _try(data: Data, part: Part, tell: Callable[..., None]) -> Tried:
    estimator_class = registry.load("estimators", part.model)
    settings = {"input": data.input, "output": data.output} | dict(part.settings)

    def fitted(
        recordings: Sequence[Recording], rows: Sequence[Mask] | None, progress: Progress | None
    ) -> Any:
        with whole_searches():
            return estimator_class(**settings).fit(recordings, rows=rows, progress=progress)

    squares: list[float] = []
    count, invalid = 0, None
    try:
        for fold in (data.folds[place] for place in part.folds):
            block = fitted(fold.train, fold.train_rows, None).model_
            # a single recording is fitted and tested on samples of its own
            fitted_to = list(zip(fold.train, fold.train_rows, strict=True))
            for recording, rows in zip(fold.test, fold.test_rows, strict=True):
                known = [pair for pair in fitted_to if pair[0] is recording]
                own, own_rows = [r for r, _ in known], [kept for _, kept in known]
                modelled = run_free(block, recording, data.output, own, own_rows)
                errors = (modelled - recording[data.output])[rows]
                squares += squares_of(errors)
                count += errors.size
    except MckibbenError as error:  # a part of the data may be too little where all of it is enough
        invalid = str(error)
    if not part.whole:
        return Tried(squares=tuple(squares), count=count, invalid=invalid)
    split = data.split
    started = time.perf_counter()
    estimator = fitted(split.train, None, tell)
    seconds = time.perf_counter() - started
    block = estimator.model_
    outputs = outputs_of(block, data)
    on_train, on_test = outputs[: len(split.train)], outputs[len(split.train) :]
    diagnostics = asdict(estimator.diagnostics_)
    diagnostics.pop("covariance")
    scored, measured = _tested(outputs, data)
    row = Row(
        model=part.model,
        n_parameters=block.n_parameters,
        fit_seconds=seconds,
        step_ns=_step_cost(block, split.train[0]),
        train=score(
            np.concatenate([recording[data.output] for recording in split.train]),
            np.concatenate(on_train),
        ),
        test=score(measured, scored),
        memory=memory_test(block, split.test, on_test, data.input, data.output),
        block=block,
        diagnostics=diagnostics,
    )
    return Tried(row, outputs, tuple(squares), count, invalid)


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
