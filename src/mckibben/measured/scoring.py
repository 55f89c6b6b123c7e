"""Predictions of any model scored on fixed splits: free-run error, hysteresis width reproduced."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import count, groupby
from pathlib import Path

import numpy as np
import pandas as pd

from mckibben.arrays import Array, Mask
from mckibben.channels import Channels, channels_of
from mckibben.diagnosis.branch_gaps import gap_ratio, moving_pairs, paired_gaps
from mckibben.errors import DataError
from mckibben.files import write
from mckibben.measured.running import span_of
from mckibben.measured.sets import Set, Task, fit_and_test_data
from mckibben.metrics import rmse
from mckibben.numerals import numeral
from mckibben.recording import Recording
from mckibben.splits import Split, split_of

START_SAMPLES = 20
"""Measured outputs of a test recording that any model may start from, and that are not scored."""

LEAST_WIDTH = 0.01
"""RMS of the measured branch gaps over the range tested on, below which no width is scored."""

KEYS = ("set", "task", "recording", "row")
"""Columns of predictions in addition to the outputs; rows are samples from 0."""

HEAD = "model,set,task,rmse,unit,percent,width"
"""Of the leaderboard's lines."""


@dataclass(frozen=True)
class Part:
    """A task, or what it is without what is left out: its split, channels, and rows that are scored."""

    task: Task
    split: Split
    channels: Channels
    rows: tuple[Mask, ...] = field(repr=False)
    span: float


@dataclass(frozen=True)
class Entry:
    """A line of the leaderboard.

    Parameters
    ----------
    model, set, task, unit : str
    rmse : float
        Of the free run, in the unit of the output; of several outputs the mean, of a task that leaves
        out in turn over all that is left out.
    percent : float
        The same in per cent of the range of what is tested on.
    width : float or None
        Hysteresis width reproduced [%]: 100 is exact, 0 a model without hysteresis. None where the tests
        have none to speak of, see `LEAST_WIDTH`.
    """

    model: str
    set: str
    task: str
    rmse: float
    unit: str
    percent: float
    width: float | None

    def line(self) -> str:
        """Return the line as leaderboard.csv has it."""
        width = "" if self.width is None else f"{self.width:.1f}"
        names = (self.model, self.set, f'"{self.task}"')
        return ",".join((*names, numeral(self.rmse, 4), self.unit, f"{self.percent:.3f}", width))


def parts_of(data_set: Set, recordings: Sequence[Recording]) -> Iterator[Part]:
    """Give all tasks of a set, each as often as it leaves out in turn."""
    for task in data_set.tasks():
        train, test = fit_and_test_data(task, recordings, data_set.folder)
        channels = channels_of([*train, *test], task.inputs, task.outputs, task.load)
        split = split_of(train, test, channels)
        rows = tuple(mask & (np.arange(len(mask)) >= START_SAMPLES) for mask in split.test_rows)
        yield Part(task, split, channels, rows, span_of(task, train, test, channels.outputs))


def write_splits(sets: Sequence[Set], out: Path) -> None:
    """Write what each task trains and tests on, as recordings in ``SET/TASK/train`` and ``test``."""
    for data_set in sets:
        for part in parts_of(data_set, data_set.recordings()):
            name = " without ".join([part.task.name or "task", *part.task.leave_out])
            folder = out / data_set.name / name.replace("*", "")
            for side, runs in (("train", part.split.train), ("test", part.split.test)):
                (folder / side).mkdir(parents=True, exist_ok=True)
                numbers = count(1)  # periods of a recording have the same name
                same_names = len({run.name for run in runs}) < len(runs)
                for run in runs:
                    number = f"_{next(numbers)}" if same_names else ""
                    write(run, folder / side / f"{run.name}{number}.csv")


def entries(file: Path, sets: Sequence[Set]) -> list[Entry]:
    """Return the scores of a file of predictions, a line for each task that it has predictions for.

    Raises
    ------
    DataError
        If columns, recordings or scored rows are missing, or a prediction is not a finite number.
    """
    table = pd.read_csv(file, dtype={"set": str, "task": str, "recording": str})
    if lost := [name for name in KEYS if name not in table]:
        remedy = f"its columns are {', '.join(KEYS)} and the outputs"
        raise DataError(f"there is no column {lost[0]}", file=file, remedy=remedy)
    table["task"] = table["task"].fillna("")
    if table.duplicated([*KEYS]).any():
        twice = table.loc[table.duplicated([*KEYS]), [*KEYS]].iloc[0].to_dict()
        raise DataError(f"it has a row twice: {twice}", file=file, remedy="predict each row once")
    scores = []
    for data_set in sets:
        of_set = table[table["set"] == data_set.name]
        if of_set.empty:
            continue
        for task, parts in groupby(
            parts_of(data_set, data_set.recordings()), key=lambda part: part.task.name
        ):
            of_task = of_set[of_set["task"] == task]
            if not of_task.empty:
                scores.append(_entry(file, data_set, list(parts), of_task))
    if not scores:
        known = ", ".join(data_set.name for data_set in sets)
        remedy = f"see docs/measured/rules.md; the sets here are {known}"
        raise DataError("it has predictions for none of the tasks", file=file, remedy=remedy)
    return scores


def _entry(file: Path, data_set: Set, parts: Sequence[Part], table: pd.DataFrame) -> Entry:
    channels = parts[0].channels
    runs, predicted, errors = [], [], []
    for part in parts:
        for run, rows in zip(part.split.test, part.rows, strict=True):
            outputs = _predicted(file, table, run, rows, channels.outputs)
            runs.append(run)
            predicted.append(outputs)
            errors.append((run.matrix(channels.outputs) - outputs)[rows])
    all_errors = np.concatenate(errors)
    error = float(np.mean([rmse(column, np.zeros_like(column)) for column in all_errors.T]))
    pairs = moving_pairs(runs, channels.pairs, channels.inputs_in(runs))
    gaps = paired_gaps(runs, predicted, pairs)
    has_width = len(gaps) > 0 and np.sqrt(np.mean(gaps[:, 0] ** 2)) > LEAST_WIDTH * parts[0].span
    ratio = gap_ratio(gaps) if has_width else None
    unit = runs[0].units[channels.outputs[0]]
    percent = 100 * error / parts[0].span
    width = None if ratio is None else 100 * ratio
    return Entry(file.stem, data_set.name, parts[0].task.name, error, unit, percent, width)


def _predicted(
    file: Path, table: pd.DataFrame, run: Recording, rows: Mask, outputs: Sequence[str]
) -> Array:
    """Return predictions (n, k) on a recording, NaN where they are not scored."""
    rows_of_run = table[table["recording"] == run.name].set_index("row")
    rows_of_run = rows_of_run.reindex(index=range(len(run)), columns=[*outputs])
    predictions = rows_of_run.apply(pd.to_numeric, errors="coerce").to_numpy(float)
    lacking = np.flatnonzero(rows & ~np.isfinite(predictions).all(axis=1))
    if lacking.size:
        problem = f"{lacking.size} scored rows of {run.name} have no finite {' and '.join(outputs)}"
        remedy = f"predict every row of it from {int(rows.argmax())} to {len(run) - 1}"
        raise DataError(f"{problem}, the first is row {lacking[0]}", file=file, remedy=remedy)
    return np.where(rows[:, np.newaxis], predictions, np.nan)
