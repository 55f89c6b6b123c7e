"""Free-running outputs of a model on recordings, started by the one rule of `mckibben.blocks.starts`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.errors import ModelError
from mckibben.recording import Recording

Mask = NDArray[np.bool_]

PERIODIC = "periodic"
"""Key in the ``meta`` of a recording that is one period of a periodic motion."""

AWAY = 1e3
"""Error, in ranges of the measured output, above which a model has diverged."""


def run_free(block: Block, recording: Recording, output: str | Sequence[str]) -> Array:
    """Return modelled outputs over a recording, shape (n,) of one that is named, (n, k) of several.

    The run begins by the rule of `mckibben.blocks.starts`; a recording of one period is answered by the
    periodic response. After that nothing measured but the inputs is used.

    Raises
    ------
    ModelError
        If the output is not finite.
    """
    outputs = (output,) if isinstance(output, str) else output
    if recording.meta.get(PERIODIC):
        found = _repeated(block, recording, outputs)
    else:
        found = block.simulate(recording).matrix(outputs)
    return found[:, 0] if isinstance(output, str) else found


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


def _repeated(block: Block, recording: Recording, outputs: Sequence[str]) -> Array:
    """Return the periodic response to a repeated period: at least the second."""
    if hasattr(block, "steady_state"):
        return block.steady_state(recording).matrix(outputs)
    names = [channel.name for channel in block.inputs]
    twice = np.tile(recording.matrix(names), (2, 1))
    found = block.simulate(twice, sample_time=recording.sample_time)[len(recording) :]
    given = [channel.name for channel in block.outputs]
    return np.asarray(found[:, [given.index(name) for name in outputs]])
