"""Check of the chosen model on the scored samples of the test."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.runs import FreeRun
from mckibben.diagnosis.check import Validation, check_runs, check_usable
from mckibben.errors import DataError
from mckibben.splits import Split


def check_on_test(
    model: Block, split: Split, modelled: Sequence[Array], outputs: Sequence[str]
) -> Validation | str:
    """Return the check of a model on the test, or why it cannot be checked.

    Parameters
    ----------
    modelled : sequence of array, shape (n, k)
        Free-running outputs on every test recording.
    outputs : sequence of str
        Their names.
    """
    given = [channel.name for channel in model.outputs]
    places = [list(outputs).index(name) for name in given]
    trained = np.concatenate([recording.matrix(given) for recording in split.train])
    runs = []
    for recording, rows, found in zip(split.test, split.test_rows, modelled, strict=True):
        scored = np.flatnonzero(rows)
        if not scored.size:
            continue
        start, stop = int(scored[0]), int(scored[-1]) + 1
        run = model.as_run(recording.slice(start, stop))
        runs.append(FreeRun.of(run, found[start:stop, places]))
    try:
        check_usable(model, [run.source for run in runs])
        return check_runs(model, runs, means=trained.mean(axis=0))
    except DataError as error:
        return str(error)
