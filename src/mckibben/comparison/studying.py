"""The main job: what the muscle does, which model is best, and its inverse."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from mckibben.blocks.base import Block
from mckibben.characterization import characterize
from mckibben.comparison.free_run import run_free
from mckibben.comparison.ranking import HELD_OUT, Settings, compare
from mckibben.comparison.results import InverseCheck, Leaderboard, Study
from mckibben.comparison.splits import given_split, held_out_tail
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
    progress: Callable[[str, float], None] | None = None,
    notes: Sequence[str] = (),
) -> Study:
    """Characterize recordings, rank models on them, and invert the best that can be inverted.

    Parameters
    ----------
    train, test, input, output, models, settings, seed, jobs, progress
        As for `compare`.
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
    recordings = [train] if isinstance(train, Recording) else list(train)
    tests = [test] if isinstance(test, Recording) else list(test)
    found = characterize([*recordings, *tests], input, output)
    board = compare(
        recordings,
        tests,
        input=input,
        output=output,
        models=models,
        settings=settings,
        seed=seed,
        jobs=jobs,
        progress=progress,
    )
    split = given_split(recordings, tests) if tests else held_out_tail(recordings, input, HELD_OUT)
    predictions = {
        row.model: tuple(
            run_free(row.block, recording, output, split.train if index >= len(split.train) else ())
            for index, recording in enumerate((*split.train, *split.test))
        )
        for row in board.rows
        if row.block is not None
    }
    return Study(
        train=split.train,
        test=split.test,
        characterization=found,
        leaderboard=board,
        predictions=predictions,
        inverse=invert_best(board, recordings[0]),
        notes=tuple(notes),
    )


def invert_best(board: Leaderboard, recording: Recording) -> InverseCheck | None:
    """Invert the first model of a leaderboard that has an inverse, and check it."""
    for row in board.rows:
        if row.block is None:
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
