"""Free runs of a model on recordings, for its check."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.fields import check_units
from mckibben.blocks.free_run import refuse_runaway, run_free
from mckibben.errors import DataError
from mckibben.recording import Recording
from mckibben.signals.shared_rows import check_shared

FEWEST_IN_ALL, FEWEST_IN_EACH = 60, 10
"""Smallest number of samples that can be tested, in total and per recording."""

SAME_TIME = 1e-3
"""Relative difference up to which sample times are equal."""


@dataclass(frozen=True, eq=False)
class Run:
    """One recording, and the model's free run.

    Parameters
    ----------
    recording : Recording
        Measured.
    inputs : array, shape (n, k)
        What the model is given.
    measured, modelled : array, shape (n, m)
        Outputs; the model runs free.
    """

    recording: Recording
    inputs: Array
    measured: Array
    modelled: Array

    @property
    def residual(self) -> Array:
        """Measured minus modelled output, shape (n, m)."""
        return self.measured - self.modelled


def runs_of(block: Block, recordings: Sequence[Recording]) -> tuple[Run, ...]:
    """Return a model's free runs over recordings.

    Raises
    ------
    DataError
        On no recordings, absent channels, too few samples, sample times that differ, or channels that
        are constant throughout.
    ModelError
        Where the model's output is not finite.
    """
    check_usable(block, recordings)
    inputs = [channel.name for channel in block.inputs]
    outputs = [channel.name for channel in block.outputs]
    check_shared({"check": recordings}, inputs, outputs)
    found = []
    for recording in recordings:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore", RuntimeWarning)
            modelled = run_free(block, recording, outputs)
        measured = recording.matrix(outputs)
        refuse_runaway(block, recording, modelled, measured)
        found.append(Run(recording, recording.matrix(inputs), measured, modelled))
    return tuple(found)


def check_usable(block: Block, recordings: Sequence[Recording]) -> None:
    """Raise an error for recordings that cannot test a model; see `runs_of`."""
    if not recordings:
        raise DataError("there is no recording to check the model on", remedy="give at least one")
    for recording in recordings:
        _refuse(recording, block, recordings[0].sample_time)
    total, source = sum(map(len, recordings)), recordings[0].source
    if total < FEWEST_IN_ALL:
        raise DataError(
            f"{total} samples are too few to distinguish a wrong model from noise",
            file=source,
            remedy=f"record at least {FEWEST_IN_ALL}, better ten cycles with 50 or more each",
        )
    driven = [c.name for c in block.inputs if c.name not in block.scheduling]
    still = [driven[0]] if all(_constant(recordings, name) for name in driven) else []
    still += [c.name for c in block.outputs if _constant(recordings, c.name)]
    if still:
        raise DataError(
            "the channel is constant, which does not test the model",
            file=source,
            channel=still[0],
            remedy="record while it moves, or name another column with `columns[CHANNEL]=COLUMN`",
        )


def _refuse(recording: Recording, block: Block, step: float | None) -> None:
    check_units(recording, (*block.inputs, *block.outputs))
    if len(recording) < FEWEST_IN_EACH:
        raise DataError(
            f"{len(recording)} samples are too few: the residual is correlated over longer times",
            file=recording.source,
            remedy=f"leave this recording out, or record at least {FEWEST_IN_EACH} samples",
        )
    own = recording.sample_time
    if abs((own or 0.0) - (step or 0.0)) > SAME_TIME * (step or 0.0):
        said = ["without time" if t is None else f"{t:g} s" for t in (step, own)]
        raise DataError(
            f"recordings differ in sample time: {said[0]} and {said[1]}",
            file=recording.source,
            remedy="check them one by one, or resample them with `resample`",
        )


def _constant(recordings: Sequence[Recording], name: str) -> bool:
    return bool(np.ptp(np.concatenate([recording[name] for recording in recordings])) == 0)
