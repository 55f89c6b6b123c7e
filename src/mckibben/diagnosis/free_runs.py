"""Free runs of a model on recordings, for its check."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mckibben.blocks.base import Block, check_units
from mckibben.blocks.free_runs import free_run
from mckibben.blocks.runs import FreeRun
from mckibben.errors import DataError
from mckibben.recording import Recording, check_sample_times
from mckibben.signals.shared_rows import check_shared

FEWEST, SHORTEST = 60, 10
"""Smallest number of samples that can be tested, in total and per recording."""


def runs_of(block: Block, recordings: Sequence[Recording]) -> tuple[FreeRun, ...]:
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
    return tuple(free_run(block, recording) for recording in recordings)


def check_usable(block: Block, recordings: Sequence[Recording]) -> None:
    """Raise an error for recordings that cannot test a model; see `runs_of`."""
    if not recordings:
        raise DataError("there is no recording to check the model on", remedy="give at least one")
    for recording in recordings:
        _refuse(recording, block)
    check_sample_times(recordings)
    total, source = sum(map(len, recordings)), recordings[0].source
    if total < FEWEST:
        raise DataError(
            f"{total} samples are too few to distinguish a wrong model from noise",
            file=source,
            remedy=f"record at least {FEWEST}, better ten cycles with 50 or more each",
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


def _refuse(recording: Recording, block: Block) -> None:
    check_units(recording, (*block.inputs, *block.outputs))
    if len(recording) < SHORTEST:
        raise DataError(
            f"{len(recording)} samples are too few: the residual is correlated over longer times",
            file=recording.source,
            remedy=f"leave this recording out, or record at least {SHORTEST} samples",
        )


def _constant(recordings: Sequence[Recording], name: str) -> bool:
    return bool(np.ptp(np.concatenate([recording[name] for recording in recordings])) == 0)
