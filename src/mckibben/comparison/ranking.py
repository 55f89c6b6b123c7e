"""Models × recordings, ranked by free-running error on data not used to fit."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mckibben import registry
from mckibben.blocks.base import Block
from mckibben.comparison.bootstrap import BlockBootstrap, interval
from mckibben.comparison.free_run import run_free
from mckibben.comparison.memory_test import memory_test
from mckibben.comparison.results import Leaderboard, Row
from mckibben.comparison.splits import Fold, Mask, Split, folds, given_split, held_out_tail
from mckibben.errors import MckibbenError, ModelError
from mckibben.estimators.search import Progress
from mckibben.metrics import score
from mckibben.recording import Recording

Array = NDArray[np.float64]
Settings = Mapping[str, Mapping[str, Any]]
Watch = Callable[[str, float, float], None]

HELD_OUT = 0.25
"""Share of the input's travel that is held out where no test recording is given."""

TIMED_SAMPLES = 20_000

WORTH_A_PROCESS = 10_000
"""Training samples below which starting processes takes longer than it saves."""


@dataclass(frozen=True)
class Task:
    """What a worker needs to try one model."""

    model: str
    settings: Mapping[str, Any]
    split: Split
    folds: tuple[Fold, ...]
    input: str
    output: str


def compare(
    train: Recording | Sequence[Recording],
    test: Recording | Sequence[Recording] = (),
    *,
    input: str = "pressure",  # noqa: A002  # the field's word, as everywhere in the package
    output: str = "displacement",
    models: str | Sequence[str] = "all",
    settings: Settings | None = None,
    n_folds: int = 4,
    seed: int = 0,
    jobs: int | None = None,
    progress: Callable[[str, float], None] | None = None,
    watch: Watch | None = None,
) -> Leaderboard:
    """Fit and rank models on the same data with the same seeds.

    Every figure is free-running. Models are fitted on the training recordings, cross-validated within
    them (over recordings, or over blocks of cycles of a single one), and ranked on the test recordings,
    which nothing else looks at. A model that fails is a row with its reason.

    Parameters
    ----------
    train : Recording or sequence of Recording
        To fit and to choose.
    test : Recording or sequence of Recording, optional
        To rank. Default: the last quarter of the input's travel over the
        training recordings, which is then left out of training.
    input, output : str
        Channels.
    models : "all" or sequence of str
        Short names; "all" leaves out models that are made for other channels.
    settings : mapping of str to mapping, optional
        Model name to settings of its estimator.
    n_folds : int
        Parts of the cross-validation; below 2 for none.
    seed : int
        Of everything random.
    jobs : int, optional
        Processes; default as many as there are cores and models, or one for short recordings. A
        joblib backend chosen outside, such as Dask's or Ray's, is used, for as many models at once.
    progress : callable, optional
        Told the model just finished and the share of all that are.
    watch : callable, optional
        Told, while a model is fitted to all of the training set, its name, the share of the search that
        is done, and the least cost so far; only where models are fitted in this process (``jobs=1``).

    Returns
    -------
    Leaderboard

    Raises
    ------
    DataError
        On recordings that no model could use.
    ModelError
        On unknown models.
    """
    from mckibben.estimators.data import training_data

    recordings = _listed(train)
    tests = _listed(test)
    training_data(recordings, input, output)
    if tests:
        training_data([recordings[0], *tests], input, output)
    split = given_split(recordings, tests) if tests else held_out_tail(recordings, input, HELD_OUT)
    parts = tuple(folds(split.train, input, n_folds)) if n_folds >= 2 else ()
    chosen, left_out = _chosen(models, [*recordings, *tests], input, output)
    if jobs is not None and jobs < 1:
        raise ModelError(f"jobs is {jobs}. Remedy: give a number of at least 1, or leave it out.")
    if not chosen:
        raise ModelError(
            "there are no models to compare. "
            f"Remedy: name some of {', '.join(registry.names('estimators'))}, or all."
        )
    for model in chosen:
        registry.load("estimators", model)
    tasks = [
        Task(
            model,
            {"seed": seed} | dict((settings or {}).get(model, {})),
            split,
            parts,
            input,
            output,
        )
        for model in chosen
    ]
    n_train = sum(len(recording) for recording in split.train)
    tried = _run_tasks(tasks, jobs or _default_jobs(n_train), progress, watch)
    lengths = [int(rows.sum()) for rows in split.test_rows]
    described = split.described + (f", {len(parts)}-fold cross-validation" if parts else "")
    return Leaderboard(
        input=input,
        output=output,
        unit=recordings[0].units[output],
        rows=_ranked(tried, BlockBootstrap(lengths, seed)),
        split=described,
        seed=seed,
        n_train=n_train,
        n_test=sum(lengths),
        left_out=left_out,
    )


def _chosen(
    models: str | Sequence[str],
    recordings: Sequence[Recording],
    input: str,  # noqa: A002
    output: str,
) -> tuple[tuple[str, ...], dict[str, str]]:
    """Return the models to try, and why others of "all" have no place on these recordings."""
    if models != "all":
        return tuple(models), {}
    names = registry.names("estimators")
    objections = {
        name: registry.load("estimators", name).objection(recordings, input, output)
        for name in names
    }
    left_out = {name: reason for name, reason in objections.items() if reason is not None}
    return tuple(name for name in names if name not in left_out), left_out


def _default_jobs(n_train: int) -> int:
    from joblib.parallel import LokyBackend, get_active_backend

    backend, wanted = get_active_backend()
    if not isinstance(backend, LokyBackend):
        return int(backend.effective_n_jobs(wanted or -1))
    return 1 if n_train < WORTH_A_PROCESS else os.cpu_count() or 1


def _run_tasks(
    tasks: Sequence[Task],
    jobs: int,
    progress: Callable[[str, float], None] | None,
    watch: Watch | None,
) -> list[tuple[Row, Array | None]]:
    from joblib import Parallel, delayed
    from joblib.parallel import get_active_backend

    workers = min(jobs, len(tasks))
    one_by_one = get_active_backend()[0].supports_return_generator
    results: dict[int, tuple[Row, Array | None]] = {}
    try:
        pool = Parallel(
            n_jobs=workers,
            return_as="generator_unordered" if one_by_one else "list",
            max_nbytes=None,
        )
        seen = watch if workers == 1 and one_by_one else None
        calls = (delayed(_try_numbered)(i, task, seen) for i, task in enumerate(tasks))
        for index, result in pool(calls):
            results[index] = result
            if progress is not None:
                progress(tasks[index].model, len(results) / len(tasks))
    except KeyboardInterrupt:
        if not results:
            raise
    return [
        results.get(index, (Row(task.model, reason="interrupted before it was fitted"), None))
        for index, task in enumerate(tasks)
    ]


def _try_numbered(
    index: int, task: Task, watch: Watch | None
) -> tuple[int, tuple[Row, Array | None]]:
    return index, try_model(task, watch)


def try_model(task: Task, watch: Watch | None = None) -> tuple[Row, Array | None]:
    """Fit, cross-validate and test one model; return its row, and its errors on the test set."""
    try:
        return _try_model(task, watch)
    except MckibbenError as error:
        return Row(task.model, reason=str(error)), None
    except Exception as error:  # one model must not take the comparison down, whatever it does
        return Row(task.model, reason=f"{type(error).__name__}: {error}"), None


def _try_model(task: Task, watch: Watch | None) -> tuple[Row, Array | None]:
    estimator_class = registry.load("estimators", task.model)
    names = {"input": task.input, "output": task.output}

    def fitted(
        recordings: Sequence[Recording], rows: Sequence[Mask] | None, tell: Progress | None = None
    ) -> Any:
        estimator = estimator_class(**(names | dict(task.settings)))
        return estimator.fit(recordings, rows=rows, progress=tell)

    def seen(share: float, cost: float) -> None:
        if watch is not None:
            watch(task.model, share, cost)

    # The folds come first: they load the compiled kernels, which the timed fit then finds ready.
    try:
        validation, unvalidated = _validate(task, fitted), None
    except MckibbenError as error:  # a part of the data may be too little where all of it is enough
        validation, unvalidated = None, str(error)
    split = task.split
    started = time.perf_counter()
    estimator = fitted(split.train, None, None if watch is None else seen)
    seconds = time.perf_counter() - started
    block: Block = estimator.model_
    on_train = [run_free(block, recording, task.output) for recording in split.train]
    on_test = [run_free(block, recording, task.output, split.train) for recording in split.test]
    scored = [modelled[rows] for modelled, rows in zip(on_test, split.test_rows, strict=True)]
    measured = [
        recording[task.output][rows]
        for recording, rows in zip(split.test, split.test_rows, strict=True)
    ]
    diagnostics = asdict(estimator.diagnostics_)
    diagnostics.pop("covariance")
    if unvalidated is not None:
        diagnostics["validation_failed"] = unvalidated
    row = Row(
        model=task.model,
        n_parameters=block.n_parameters,
        fit_seconds=seconds,
        step_ns=_step_cost(block, split.train[0]),
        train=score(
            np.concatenate([recording[task.output] for recording in split.train]),
            np.concatenate(on_train),
        ),
        test=score(np.concatenate(measured), np.concatenate(scored)),
        validation_rmse=validation,
        memory=memory_test(block, split.test, on_test, task.input, task.output),
        block=block,
        diagnostics=diagnostics,
    )
    return row, np.concatenate(scored) - np.concatenate(measured)


def _validate(task: Task, fitted: Callable[..., Any]) -> float | None:
    if not task.folds:
        return None
    squares, count = 0.0, 0
    for fold in task.folds:
        block = fitted(fold.train, fold.train_rows).model_
        for recording, rows in zip(fold.test, fold.test_rows, strict=True):
            errors = (run_free(block, recording, task.output) - recording[task.output])[rows]
            squares, count = squares + float(errors @ errors), count + errors.size
    return float(np.sqrt(squares / count))


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


def _ranked(
    tried: Sequence[tuple[Row, Array | None]], bootstrap: BlockBootstrap
) -> tuple[Row, ...]:
    done = [(row, bootstrap.rmse(errors)) for row, errors in tried if errors is not None]
    done.sort(key=lambda item: _rmse(item[0]))
    rows = [
        replace(
            row,
            rmse_interval=interval(samples),
            difference_interval=interval(samples - done[0][1]),
        )
        for row, samples in done
    ]
    return (*rows, *(row for row, errors in tried if errors is None))


def _rmse(row: Row) -> float:
    if row.test is None:
        raise ModelError(f"{row.model!r} has no test score. Remedy: this is a defect; report it.")
    return row.test.rmse


def _listed(recordings: Recording | Sequence[Recording]) -> list[Recording]:
    return [recordings] if isinstance(recordings, Recording) else list(recordings)
