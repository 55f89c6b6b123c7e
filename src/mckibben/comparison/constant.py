"""The mean of what is fitted to as a model, whatever the input: what every model has to beat."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mckibben.arrays import Array
from mckibben.comparison.pieces import squares_of
from mckibben.comparison.recommending import CONSTANT
from mckibben.comparison.row import Row
from mckibben.comparison.splits import Mask
from mckibben.comparison.trying import (
    Data,
    Tried,
    rms_by_output,
    rms_of,
    scores_of,
)
from mckibben.recording import Recording


def constant_of(data: Data) -> Tried:
    """Return what comes of predicting the mean of the outputs that are fitted to, whatever the input."""
    squares: list[tuple[float, ...]] = []
    count, names = 0, data.channels.outputs
    for fold in data.folds:
        mean = _mean(fold.train, names, fold.train_rows)
        for recording, rows in zip(fold.test, fold.test_rows, strict=True):
            errors = mean - recording.matrix(names)[rows]
            squares += squares_of(errors)
            count += len(errors)
    split = data.split
    mean = _mean(split.train, names, [np.ones(len(r), dtype=bool) for r in split.train])
    outputs = tuple(np.tile(mean, (len(recording), 1)) for recording in (*split.train, *split.test))
    found = Tried(None, outputs, tuple(squares), count)
    train, test, by_output = scores_of(outputs, data)
    row = Row(
        model=CONSTANT,
        n_parameters=len(names),
        fit_seconds=0.0,
        step_ns=0.0,
        train=train,
        test=test,
        outputs=by_output,
        validation_rmse=rms_of([found]),
        validation_by_output=dict(zip(names, rms_by_output([found]), strict=False)),
    )
    return replace(found, row=row)


def _mean(recordings: Sequence[Recording], outputs: Sequence[str], rows: Sequence[Mask]) -> Array:
    kept = [r.matrix(outputs)[mask] for r, mask in zip(recordings, rows, strict=True)]
    found: Array = np.concatenate(kept).mean(axis=0)
    return found
