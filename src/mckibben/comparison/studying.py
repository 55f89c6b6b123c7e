"""The main job: what the muscle does, which model to use, and its inverse."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mckibben.blocks.base import Block
from mckibben.characterization import characterize
from mckibben.comparison.ranking import N_FOLDS, Settings, plan_of, ranked
from mckibben.comparison.recommending import acceptable
from mckibben.comparison.results import InverseCheck, Leaderboard, Standing, Study
from mckibben.comparison.splits import listed
from mckibben.errors import ModelError, ModelWarning
from mckibben.recording import Recording

Array = NDArray[np.float64]

CHECK_SAMPLES = 2000

FOLLOWED = 1e-6
"""Largest error of an inverse that counts as one, relative to the reachable range."""


def study(
    train: Recording | Sequence[Recording],
    test: Recording | Sequence[Recording] = (),
    *,
    input: str = "pressure",  # noqa: A002  # the field's word, as everywhere in the package
    output: str = "displacement",
    models: str | Sequence[str] = "all",
    settings: Settings | None = None,
    seed: int = 0,
    jobs: int | None = None,
    most_samples: int | None = None,
    allow_shared: bool = False,
    folder: str | Path | None = None,
    clear: bool = True,
    progress: Callable[[Standing], None] | None = None,
    found: Callable[[Study], None] | None = None,
    notes: Sequence[str] = (),
) -> Study:
    """Characterize recordings, choose a model by cross-validation, test it, and invert it if it can be.

    Where it cannot, the next in the order of the choice is inverted that can. Where no model is worth
    recommending, none is inverted.

    An interrupt ends the work at once; the study then holds what was finished.

    Parameters
    ----------
    train, test, input, output, models, settings, seed, jobs, most_samples, allow_shared, folder, clear,
    progress
        As for `compare`.
    found : callable, optional
        Told the study as far as it is: when it is known what the muscle does, before any model is
        fitted, then whenever a model is finished.
    notes : sequence of str
        What was assumed or mended while reading, to be passed on.

    Returns
    -------
    Study

    Raises
    ------
    DataError
        On recordings that cannot be used.
    """
    recordings, tests = listed(train), listed(test)
    plan = plan_of(
        recordings,
        tests,
        input=input,
        output=output,
        models=models,
        settings=settings,
        n_folds=N_FOLDS,
        seed=seed,
        most_samples=most_samples,
        allow_shared=allow_shared,
    )
    kept = plan.kept(folder)
    so_far = Study(
        train=plan.data.split.train,
        test=plan.data.split.test,
        characterization=characterize([*recordings, *tests], input, output),
        leaderboard=plan.board(),
        predictions={},
        inverse=None,
        notes=(*notes, *plan.notes),
    )
    if found is not None:
        found(so_far)
    try:
        with closing(ranked(plan, jobs=jobs, kept=kept, progress=progress)) as rankings:
            for ranking in rankings:
                so_far = replace(so_far, leaderboard=ranking.board, predictions=ranking.outputs)
                if ranking.board.pending and found is not None:
                    found(so_far)
    except KeyboardInterrupt:
        if not so_far.leaderboard.rows:
            raise
        return replace(so_far, leaderboard=replace(so_far.leaderboard, stopped=True))
    so_far = replace(so_far, inverse=invert_best(so_far.leaderboard, recordings[0]))
    if found is not None:
        found(so_far)
    if clear:
        kept.clear()
    return so_far


def invert_best(board: Leaderboard, recording: Recording) -> InverseCheck | None:
    """Invert the first model of a leaderboard that has an inverse, and check it.

    None where no model is recommended, for an inverse is as good as its model.
    """
    if board.best is None:
        return None
    for row in board.rows:
        if row.block is None or not acceptable(row, board.constant):
            continue
        try:
            return check_inverse(row.model, row.block, recording)
        except ModelError:
            continue
    return None


def check_inverse(model: str, block: Block, recording: Recording) -> InverseCheck:
    """Send a reference with minor loops through the inverse and back through the model.

    Parameters
    ----------
    model : str
        Short name.
    block : Block
        The model.
    recording : Recording
        Gives the sample time and the pace of the reference.

    Raises
    ------
    ModelError
        If the model has no inverse, nothing can be reached whatever happened before, or the inverse
        does not follow the reference.
    """
    inverse = block.inverse()
    lows, highs = block.reachable()
    low, high = float(lows[0]), float(highs[0])
    if not (np.isfinite([low, high]).all() and low < high):
        raise ModelError(
            f"{model!r} has no output that it can reach whatever happened before. "
            "Remedy: identify it on a recording that covers the range of interest."
        )
    phase = np.linspace(0, 1, CHECK_SAMPLES)
    slow = 1 - np.abs(2 * ((3 * phase) % 1) - 1)
    wave = slow * (1 - 0.5 * phase) + 0.12 * np.sin(2 * np.pi * 11 * phase) * phase
    share = (wave - wave.min()) / np.ptp(wave)
    reference = low + (high - low) * (0.02 + 0.96 * share)
    step = recording.sample_time
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ModelWarning)
        pressure = inverse.simulate(reference, sample_time=step)
    output = block.simulate(pressure, sample_time=step)
    error = float(np.abs(output - reference).max() / (high - low))
    if not error <= FOLLOWED:
        raise ModelError(
            f"the inverse of {model!r} misses a reachable reference by {error:.1e} of its range. "
            "Remedy: invert another model."
        )
    return InverseCheck(
        model=model,
        inverse=inverse,
        reference=reference,
        pressure=pressure,
        output=output,
        time=np.arange(CHECK_SAMPLES, dtype=np.float64) * (1.0 if step is None else step),
        reachable=(low, high),
        error=error,
    )
