"""Every task of every set through one comparison each."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mckibben.checkpoints import Checkpoints
from mckibben.comparison.leaderboard import Leaderboard
from mckibben.comparison.ranking import Standing, compare
from mckibben.errors import DataError, MckibbenError
from mckibben.measured.sets import Set, Task, fit_and_test_data
from mckibben.recording import Recording


@dataclass(frozen=True)
class Outcome:
    """What came of a task.

    Parameters
    ----------
    set : Set
    task : Task
    board : Leaderboard or None
        None where it failed.
    span : float
        Range of what is tested on, the largest of all outputs'; of a task that leaves out in turn, of
        all its recordings.
    seconds : float
        Of the whole comparison.
    reason : str
        Why it failed.
    notes : tuple of str
        What was assumed or mended in reading, by recording.
    """

    set: Set
    task: Task
    board: Leaderboard | None
    span: float = float("nan")
    seconds: float = float("nan")
    reason: str = ""
    notes: tuple[str, ...] = ()

    @property
    def left_out(self) -> str:
        """What was left out, of a task that leaves out in turn; else empty."""
        return "".join(self.task.leave_out)

    @property
    def heading(self) -> str:
        """The set, and the task where there are several."""
        return ": ".join(filter(None, (self.set.title, self.task.name)))

    @property
    def label(self) -> str:
        """The same, with what is left out."""
        return f"{self.heading}, without {self.left_out}" if self.left_out else self.heading

    def to_dict(self) -> dict[str, Any]:
        """Return the leaderboard, or why there is none, for JSON."""
        if self.board is None:
            return {"reason": self.reason}
        return self.board.to_dict() | {"range": self.span, "seconds": self.seconds}

    @property
    def failed(self) -> str:
        """Why no model was fitted; empty where one was."""
        rows = self.board.rows if self.board else ()
        if any(row.test is not None for row in rows):
            return ""
        reasons = dict.fromkeys(row.reason for row in rows if row.reason)
        return self.reason or " ".join(reasons) or "no model applies to these channels"


def outcomes(
    sets: Sequence[Set],
    *,
    models: str | Sequence[str] = "all",
    seed: int = 0,
    jobs: int | None = None,
    executor: Executor | None = None,
    folder: Path | None = None,
    tell: Callable[[float, str], None] | None = None,
) -> Iterator[Outcome]:
    """Give what comes of every task, one after another.

    Parameters
    ----------
    sets : sequence of Set
    models : "all", "quick" or sequence of str
        Instead of those that a task asks for, unless "all".
    seed, jobs, executor
        As of `mckibben.compare`.
    folder : path, optional
        Where finished models are kept, so that what was stopped goes on from there.
    tell : callable, optional
        Called with the share of tasks done, and words.
    """
    tasks = [(data_set, task) for data_set in sets for task in data_set.tasks()]
    recordings_of: dict[str, list[Recording]] = {}
    models_named = models not in ("all", "quick")
    for number, (data_set, task) in enumerate(tasks):
        label = " ".join(filter(None, [data_set.name, task.name, *task.leave_out]))

        def progress(standing: Standing, number: int = number, label: str = label) -> None:
            if tell is not None:
                tell((number + standing.share) / len(tasks), f"{label}: {standing}")

        started = time.perf_counter()
        try:
            if data_set.name not in recordings_of:
                recordings_of = {data_set.name: data_set.recordings()}  # of one set at a time
            train, test = fit_and_test_data(task, recordings_of[data_set.name], data_set.folder)
            board = compare(
                train,
                test,
                inputs=task.inputs,
                outputs=task.outputs,
                load=task.load,
                models=task.models if models == "all" else models,
                settings={
                    m: values
                    for m, values in task.settings.items()
                    if not models_named or m in models
                },
                seed=seed,
                jobs=jobs,
                executor=executor,
                folder=Checkpoints(folder).inside(f"{data_set.name}-{number}"),
                clear=False,
                progress=progress,
            )
        except MckibbenError as error:
            if models_named and not isinstance(error, DataError):
                raise
            yield Outcome(data_set, task, None, reason=str(error))
            continue
        if board.stopped:
            raise KeyboardInterrupt
        span = span_of(task, train, test, board.outputs)
        seconds = time.perf_counter() - started
        notes = tuple(f"{r.name}: {note}" for r in (*train, *test) for note in r.notes)
        yield Outcome(data_set, task, board, span, seconds, notes=notes)


def span_of(
    task: Task, train: Sequence[Recording], test: Sequence[Recording], outputs: Sequence[str]
) -> float:
    """Return the range of what is tested on, the largest of all outputs'; see `Outcome`."""
    tested = test if test and not task.leave_out else [*train, *test]
    return max(float(np.ptp(np.concatenate([run[y] for run in tested]))) for y in outputs)
