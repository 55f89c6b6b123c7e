"""Every task of every set through one comparison each."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mckibben.comparison.checkpoints import Checkpoints
from mckibben.comparison.leaderboard import Leaderboard
from mckibben.comparison.ranking import Standing, compare
from mckibben.errors import DataError, MckibbenError
from mckibben.measured.sets import Set, parted
from mckibben.measured.splits import Task
from mckibben.recording import Recording


@dataclass(frozen=True)
class Outcome:
    """What came of a task.

    Parameters
    ----------
    set : Set
    left_out : str
        What was left out, of a task that leaves out in turn; else empty.
    task : Task
    board : Leaderboard or None
        None where it failed.
    span : float
        Range of what is tested on, the largest of all outputs'; of a task that leaves out in turn, of
        all its recordings.
    seconds : float
        Of the whole comparison, cross-validation and tests included.
    reason : str
        Why it failed.
    notes : tuple of str
        What was assumed or mended in reading, by recording.
    """

    set: Set
    left_out: str
    task: Task
    board: Leaderboard | None
    span: float = float("nan")
    seconds: float = float("nan")
    reason: str = ""
    notes: tuple[str, ...] = ()

    @property
    def heading(self) -> str:
        """The set, and the task where there are several."""
        return f"{self.set.title}: {self.task.name}" if self.task.name else self.set.title

    @property
    def label(self) -> str:
        """The same, with what is left out."""
        return f"{self.heading}, without {self.left_out}" if self.left_out else self.heading

    @property
    def failed(self) -> str:
        """Why no model was fitted; empty where one was."""
        if self.board is None:
            return self.reason
        if any(row.test is not None for row in self.board.rows):
            return ""
        reasons = dict.fromkeys(row.reason for row in self.board.rows if row.reason)
        return " ".join(reasons) or "no model has a place on these channels"

    @property
    def regret(self) -> float | None:
        """Test RMSE of the model chosen over the least of all, less 1; None where none is chosen."""
        board = self.board
        if board is None or board.best is None or board.lowest is None:
            return None
        return board.best.test_error / board.lowest.test_error - 1.0


Tell = Callable[[float, str], None]


def outcomes(
    sets: Sequence[Set],
    *,
    models: str | Sequence[str] = "all",
    seed: int = 0,
    jobs: int | None = None,
    folder: Path | None = None,
    tell: Tell | None = None,
) -> Iterator[Outcome]:
    """Give what comes of every task, one after another.

    Parameters
    ----------
    sets : sequence of Set
    models : "all", "quick" or sequence of str
        Of those that a task asks for.
    seed, jobs
        As of `mckibben.compare`.
    folder : path, optional
        Where finished models are kept, so that what was stopped goes on from there.
    tell : callable, optional
        Told the share of tasks done, and words.
    """
    listed = [(one, left, task) for one in sets for left, task in one.tasks()]
    read: dict[str, list[Recording]] = {}
    for place, (one, left, task) in enumerate(listed):
        whose = " ".join(filter(None, [one.name, task.name, left and f"without {left}"]))

        def progress(standing: Standing, at: int = place, whose: str = whose) -> None:
            if tell is not None:
                share = standing.done / max(standing.total, 1)
                tell((at + share) / len(listed), f"{whose}: {standing}")

        started = time.perf_counter()
        try:
            if one.name not in read:
                read = {one.name: one.recordings()}  # of one set at a time
            train, test = parted(task, read[one.name], one.folder)
            board = compare(
                train,
                test,
                inputs=task.inputs,
                outputs=task.outputs,
                load=task.load,
                models=task.models if models == "all" else models,
                settings={
                    model: own
                    for model, own in task.settings.items()
                    if models in ("all", "quick") or model in models
                },
                n_folds=task.folds,
                seed=seed,
                jobs=jobs,
                folder=Checkpoints(folder).inside(f"{one.name}-{place}"),
                clear=False,
                progress=progress,
            )
        except MckibbenError as error:
            if isinstance(error, DataError) or models in ("all", "quick"):
                yield Outcome(one, left, task, None, reason=str(error))
                continue
            raise
        if board.stopped:
            raise KeyboardInterrupt
        tested = [*train, *test] if left or not test else test
        span = max(
            float(np.ptp(np.concatenate([r[name] for r in tested]))) for name in board.outputs
        )
        seconds = time.perf_counter() - started
        notes = tuple(f"{r.name}: {note}" for r in (*train, *test) for note in r.notes)
        yield Outcome(one, left, task, board, span, seconds, notes=notes)
