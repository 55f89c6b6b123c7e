"""Trying one model: fitted, cross-validated, run free and scored; in parts that processes can share."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mckibben import registry
from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.comparison.channels import Channels
from mckibben.comparison.cluster import outcomes_outside, outer_backend, processes_outside
from mckibben.comparison.free_run import run_free
from mckibben.comparison.memory_test import memory_test
from mckibben.comparison.offered import objections
from mckibben.comparison.pieces import PIECES, squares_of
from mckibben.comparison.row import Row
from mckibben.comparison.splits import Fold, Mask, Split
from mckibben.diagnosis.bands import Held
from mckibben.errors import MckibbenError, unforeseen
from mckibben.estimators.optimisers.tracker import Progress, whole_searches
from mckibben.metrics import Scores, mean_scores, score
from mckibben.recording import Recording
from mckibben.system import workers
from mckibben.system.threads import cores
from mckibben.system.workers import Outcome, WorkerError

TIMED_SAMPLES = 20_000

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
    channels : Channels
        What drives, what is to be modelled, and what schedules.
    early : tuple of Recording
        For searches that stop early.
    """

    split: Split
    folds: tuple[Fold, ...]
    channels: Channels
    early: tuple[Recording, ...] = ()


@dataclass(frozen=True)
class Item:
    """A model to try.

    Parameters
    ----------
    model : str
        Short name.
    settings : mapping
        Of its estimator.
    only : int or None
        Place of the only recording that it is fitted to; None for all of them.
    """

    model: str
    settings: Mapping[str, Any]
    only: int | None = None


@dataclass(frozen=True)
class Part:
    """Part of trying a model: the folds to cross-validate on, and whether to fit to everything.

    Parameters
    ----------
    name : str
        What its row is called.
    item : Item
        The model.
    folds : tuple of int
        Places of folds. They come first: they load the compiled kernels, which the fit that is timed
        then finds ready.
    whole : bool
        Whether to fit to all of the training data, and to test.
    """

    name: str
    item: Item
    folds: tuple[int, ...]
    whole: bool


@dataclass(frozen=True)
class Tried:
    """What came of a part, or of all parts of a model together.

    Parameters
    ----------
    row : Row or None
        Of the leaderboard; None in parts that do not fit the whole.
    outputs : tuple of array, shape (n, k)
        Free-running outputs on every training recording, then every test recording.
    squares : tuple of tuple of float or None
        Sums of squared errors of the cross-validation, `PIECES` a recording tested on, each of all k
        outputs; None for those of the only recording that a model was fitted to.
    count : int
        Samples in them.
    invalid : str or None
        Why a fold could not be fitted.
    held : tuple of Held
        What the cross-validation's models gave on what they were not fitted to.
    """

    row: Row | None = None
    outputs: tuple[Array, ...] = ()
    squares: tuple[tuple[float, ...] | None, ...] = ()
    count: int = 0
    invalid: str | None = None
    held: tuple[Held, ...] = ()


def parts_of(name: str, item: Item, n_folds: int, split: bool) -> list[Part]:
    """Return the parts of trying a model: one, or as many as there are folds."""
    if not split or n_folds < 2 or item.only is not None:
        return [Part(name, item, tuple(range(n_folds)), whole=True)]
    others = [Part(name, item, (k,), whole=False) for k in range(1, n_folds)]
    return [Part(name, item, (0,), whole=True), *others]


def try_part(data: Data, part: Part, tell: Callable[..., None]) -> Tried:
    """Do a part of trying a model; whatever goes wrong is in the row."""
    try:
        if refused := _refused(part.item.model, data):
            return Tried(Row(part.name, reason=refused))
        return _try(data, part, tell)
    except MckibbenError as error:
        return Tried(Row(part.name, reason=str(error)))
    except Exception as error:  # one model must not take the comparison down, whatever it does
        return Tried(Row(part.name, reason=unforeseen(error)))


def _refused(model: str, data: Data) -> str | None:
    """Return why a model has no place on the channels; that it is told no load is no reason."""
    asked, channels = data.split.train, data.channels
    if not objections([model], asked, channels):
        return None
    return objections([model], asked, replace(channels, scheduling=None)).get(model)


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
            words = f"its process gave something that is not what came of {part.name}"
            outcome = Outcome(outcome.index, error=WorkerError(words))
        yield outcome


def _is_of(tried: Any, part: Part, data: Data) -> bool:
    """Tell whether this is what came of a part: complete, of its model, and scored as it says."""
    if not isinstance(tried, Tried):
        return False
    row = tried.row
    if row is None:
        return not part.whole and all(
            isinstance(square, float) for piece in tried.squares for square in piece or ()
        )
    if not isinstance(row, Row) or row.model != part.name:
        return False
    if row.reason is not None:
        return isinstance(row.reason, str)
    recordings = (*data.split.train, *data.split.test)
    if (
        not (part.whole and isinstance(row.block, Block) and row.sound)
        or row.test is None
        or not all(isinstance(output, np.ndarray) for output in tried.outputs)
        or [output.shape for output in tried.outputs]
        != [(len(r), len(data.channels.outputs)) for r in recordings]
    ):
        return False
    rmse = np.sqrt(np.mean(errors_on_test(tried.outputs, data) ** 2, axis=0)).mean()
    measured = [recording[name] for recording in recordings for name in data.channels.outputs]
    most = max(float(np.abs(samples).max()) for samples in measured)
    return math.isclose(rmse, row.test.rmse, rel_tol=1e-6, abs_tol=1e-9 * most)


def joined(parts: Sequence[Tried], names: Sequence[str]) -> Tried:
    """Return what came of all parts of a model, given in their order, as one.

    Parameters
    ----------
    names : sequence of str
        Of the outputs.
    """
    failed = [tried for tried in parts if tried.row is not None and tried.row.reason is not None]
    if failed:
        return failed[0]
    (whole,) = (tried for tried in parts if tried.row is not None)
    assert whole.row is not None
    invalid = next((tried.invalid for tried in parts if tried.invalid is not None), None)
    by_output = rms_by_output(parts)
    if invalid is None and not np.isfinite(by_output).all():
        invalid = "its outputs ran away on a part of the data that it was not fitted to"
    if invalid is not None:
        noted = dict(whole.row.diagnostics) | {"validation_failed": invalid}
        return replace(whole, row=replace(whole.row, diagnostics=noted))
    squares = tuple(square for tried in parts for square in tried.squares)
    row = replace(
        whole.row,
        validation_rmse=rms_of(parts),
        validation_by_output=dict(zip(names, by_output, strict=False)),
        squares=tuple(piece for piece in squares if piece is not None),
    )
    held = tuple(one for tried in parts for one in tried.held)
    return replace(whole, row=row, squares=squares, held=held)


def rms_by_output(parts: Sequence[Tried]) -> list[float]:
    """Return the root mean square of the cross-validation of every output; none without one."""
    count = sum(tried.count for tried in parts)
    squares = (square for tried in parts for square in tried.squares if square is not None)
    columns = zip(*squares, strict=True)
    return [math.sqrt(math.fsum(column) / count) for column in columns]  # in any order


def rms_of(parts: Sequence[Tried]) -> float | None:
    """Return the mean of that over the outputs, or None where there was no cross-validation."""
    found = rms_by_output(parts)
    return math.fsum(found) / len(found) if found else None


def outputs_of(block: Block, data: Data) -> tuple[Array, ...]:
    """Return a model's free-running outputs on every training recording, then every test recording."""
    split, names = data.split, data.channels.outputs
    on_train = [run_free(block, recording, names, (recording,)) for recording in split.train]
    on_test = [run_free(block, recording, names, split.train) for recording in split.test]
    return (*on_train, *on_test)


def errors_on_test(outputs: Sequence[Array], data: Data) -> Array:
    """Return the errors at all samples of the test that are scored, shape (n, k)."""
    scored, measured = _tested(outputs, data)
    return scored - measured


def scores_of(outputs: Sequence[Array], data: Data) -> tuple[Scores, Scores, dict[str, Scores]]:
    """Return the errors on the training data and on the test, and on the test by output."""
    split, names = data.split, data.channels.outputs
    trained = np.concatenate([recording.matrix(names) for recording in split.train])
    modelled = np.concatenate(outputs[: len(split.train)])
    scored, measured = _tested(outputs, data)
    by_output = {
        name: score(measured[:, place], scored[:, place]) for place, name in enumerate(names)
    }
    on_train = [score(trained[:, place], modelled[:, place]) for place in range(len(names))]
    return mean_scores(on_train), mean_scores(list(by_output.values())), by_output


def _tested(outputs: Sequence[Array], data: Data) -> tuple[Array, Array]:
    split = data.split
    on_test = outputs[len(split.train) :]
    rows = list(zip(on_test, split.test, split.test_rows, strict=True))
    names = data.channels.outputs
    return (
        np.concatenate([modelled[kept] for modelled, _, kept in rows]),
        np.concatenate([recording.matrix(names)[kept] for _, recording, kept in rows]),
    )


def _try(data: Data, part: Part, tell: Callable[..., None]) -> Tried:
    item, split, names = part.item, data.split, data.channels.outputs
    estimator_class = registry.load("estimators", item.model)
    channels = data.channels
    settings = estimator_class.channel_settings(
        channels.inputs, channels.outputs, channels.scheduling
    ) | dict(item.settings)

    def fitted(
        recordings: Sequence[Recording], rows: Sequence[Mask] | None, progress: Progress | None
    ) -> Any:
        with whole_searches():
            return estimator_class(**settings).fit(
                recordings, rows=rows, validation=data.early, progress=progress
            )

    squares: list[tuple[float, ...] | None] = []
    held: list[Held] = []
    count, invalid = 0, None

    def validate(block: Block, fold: Fold) -> None:
        nonlocal count
        # a single recording is fitted and tested on samples of its own
        fitted_to = list(zip(fold.train, fold.train_rows, strict=True))
        for recording, rows in zip(fold.test, fold.test_rows, strict=True):
            known = [pair for pair in fitted_to if pair[0] is recording]
            own, own_rows = [r for r, _ in known], [kept for _, kept in known]
            modelled = run_free(block, recording, names, own, own_rows)
            measured, step = recording.matrix(names), recording.sample_time
            driving = recording.matrix(channel.name for channel in block.inputs)
            held.append(Held(driving, modelled, measured, rows, step))
            errors = (modelled - measured)[rows]
            squares.extend(squares_of(errors))
            count += len(errors)

    folds = [data.folds[place] for place in part.folds]
    if item.only is not None:  # not validated, since no other model is by the same samples
        squares.extend([None] * (PIECES * sum(len(fold.test) for fold in folds)))
        folds = []
    # what is fitted to all there is is validated as it is delivered
    delivered = [_is_whole(fold, split) for fold in folds]
    apart = [fold for fold, later in zip(folds, delivered, strict=True) if not later]
    fits = len(apart) + part.whole

    def told(place: int) -> Progress | None:
        """Return what is told the share of all fits that is done, by the share of one."""
        return (lambda share, cost: tell((place + share) / fits, cost)) if part.whole else None

    try:
        for place, fold in enumerate(apart):
            validate(fitted(fold.train, fold.train_rows, told(place)).model_, fold)
    except MckibbenError as error:  # a part of the data may be too little where all of it is enough
        invalid = str(error)
    if not part.whole:
        return Tried(None, (), tuple(squares), count, invalid, tuple(held))
    started = time.perf_counter()
    learned = split.train if item.only is None else (split.train[item.only],)
    estimator = fitted(learned, None, told(len(apart)))
    seconds = time.perf_counter() - started
    block = estimator.model_
    for fold, now in zip(folds, delivered, strict=True):
        if now:
            validate(block, fold)
    outputs = outputs_of(block, data)
    diagnostics = dict(vars(estimator.diagnostics_))
    diagnostics.pop("uncertainty")  # it holds the recordings
    train, test, by_output = scores_of(outputs, data)
    row = Row(
        model=part.name,
        n_parameters=block.n_parameters,
        fit_seconds=seconds,
        step_ns=_step_cost(block, split.train[0]),
        train=train,
        test=test,
        outputs=by_output,
        memory=memory_test(block, split.test, outputs[len(split.train) :], channels.pairs()),
        block=block,
        diagnostics=diagnostics,
    )
    return Tried(row, outputs, tuple(squares), count, invalid, tuple(held))


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
