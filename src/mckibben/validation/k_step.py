"""Errors some samples ahead of what was measured last, beside those of the free run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.compose import Series
from mckibben.blocks.dynamics.transfer_function import TransferFunction
from mckibben.blocks.memoryless.negative import Negative
from mckibben.recording import Recording
from mckibben.validation.residuals import Run

AHEAD = (1, 10, 100)
"""Samples ahead."""

PREDICTED = "predicted by the model's own noise model from outputs measured until then"
CORRECTED = "free run, shifted by what it was off when last measured"
FREE = "free run: its inputs, and a start of its memory as in a leaderboard"
BEST_START = (
    "free run: its inputs, and of a few starts of its memory the one that is off least over the whole "
    "recording; a leaderboard starts from the first sample, and may be off by a little more"
)
INPUTS = "free run: its inputs only"

SHARE = 4
"""Part of the longest recording, as one over it, that is looked ahead at most."""


@dataclass(frozen=True)
class Ahead:
    """The error of an output some samples ahead.

    Parameters
    ----------
    samples : int or None
        How many; None for the free run.
    seconds : float or None
        The same as time.
    rmse : float
        Of the model.
    held : float or None
        Of a forecast that the output stays as it was measured last, to compare with.
    how : str
        What the model is told.
    """

    samples: int | None
    seconds: float | None
    rmse: float
    held: float | None
    how: str

    def to_dict(self) -> dict[str, Any]:
        """Return it for JSON."""
        return asdict(self)


def errors_ahead(block: Block, runs: Sequence[Run], output: int) -> tuple[Ahead, ...]:
    """Return errors 1, 10 and 100 samples ahead, and free-running ones."""
    step = runs[0].recording.sample_time
    longest = max(len(run.inputs) for run in runs)
    found = []
    for samples in (k for k in AHEAD if k <= longest // SHARE):
        errors, held = [], []
        for run in (run for run in runs if len(run.inputs) > samples):
            measured, left = run.measured[:, output], run.residual[:, output]
            held.append(measured[samples:] - measured[:-samples])
            foreseen = predicted(block, run.recording, samples)
            if foreseen is not None:
                errors.append((measured - foreseen)[samples:])
            else:
                errors.append(left[samples:] - left[:-samples])
        how = CORRECTED if linear(block) is None else PREDICTED
        seconds = None if step is None else samples * step
        found.append(Ahead(samples, seconds, _rms(errors), _rms(held), how))
    told = BEST_START if any(run.start_chosen for run in runs) else FREE
    told = told if block.n_states else INPUTS
    free = Ahead(None, None, _rms([run.residual[:, output] for run in runs]), None, told)
    return (*found, free)


def linear(block: Block) -> tuple[TransferFunction, float] | None:
    """Return the linear model that a block is, and by what its output is multiplied; None of others."""
    if isinstance(block, TransferFunction):
        return block, 1.0
    if isinstance(block, Series) and len(block.parts) == 2 and isinstance(block.parts[1], Negative):
        found = linear(block.parts[0])
        return None if found is None else (found[0], -found[1])
    return None


def predicted(block: Block, recording: Recording, samples: int) -> Array | None:
    """Return a linear model's output so many samples ahead, shape (n,); None of other models."""
    found = linear(block)
    if found is None:
        return None
    model, sign = found
    name, given = model.output.name, block.outputs[0].name
    units = {name: recording.units[given]}
    turned = recording.with_channels(units, **{name: sign * recording[given]})
    return np.asarray(sign * model.predict(turned, samples)[name])


def _rms(errors: Sequence[Array]) -> float:
    return float(np.sqrt(np.mean(np.concatenate(errors) ** 2)))
