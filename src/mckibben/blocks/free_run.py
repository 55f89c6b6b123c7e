"""Free-running outputs of a model on recordings, started by the one rule of `mckibben.blocks.starts`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.errors import ModelError
from mckibben.recording import Recording

AWAY = 1e3
"""Error, in ranges of the measured output, above which a model has diverged."""


def run_free(block: Block, recording: Recording, output: str | Sequence[str]) -> Array:
    """Return modelled outputs over a recording, shape (n,) of one that is named, (n, k) of several.

    The run begins by the rule of `mckibben.blocks.starts`. After that nothing measured but the inputs is
    used.

    Raises
    ------
    ModelError
        If the output is not finite.
    """
    found = block.simulate(recording)
    return found[output] if isinstance(output, str) else found.matrix(output)


def refuse_runaway(block: Block, recording: Recording, modelled: Array, measured: Array) -> None:
    """Raise a `ModelError` if a model's outputs (n, k) diverge from the measured ones."""
    if not (np.abs(modelled - measured) <= AWAY * np.ptp(measured, axis=0)).all():
        far, wide = float(np.abs(modelled).max()), float(np.ptp(measured, axis=0).max())
        raise ModelError(
            f"the output of {block.kind!r} runs away on {recording.name}: to {far:.4g}, "
            f"where what is measured spans {wide:.4g}",
            remedy="see whether units are those that it was identified in; if so, this "
            "model does not suit these data: identify it again",
        )
