"""Running blocks: sample by sample, and many at once."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mckibben.blocks.base import Block
from mckibben.blocks.fields import Initial
from mckibben.threads import cores

Array = NDArray[np.float64]


@dataclass
class Stream:
    """A block running sample by sample; `step` allocates nothing.

    Parameters
    ----------
    block : Block
        What runs.
    sample_time : float or None
        Time between steps [s].
    initial : {"first_sample", "virgin"} or sequence of float or None
        Memory before the first step.
    """

    block: Block
    sample_time: float | None = None
    initial: Initial | None = None

    def __post_init__(self) -> None:
        self._inputs = np.zeros((1, len(self.block.inputs)))
        self._outputs = np.zeros((1, len(self.block.outputs)))
        self._output = self._outputs[0]
        self.state = np.zeros(self.block.n_states)
        self._run = self.block.bind(self.sample_time, self.state, self._inputs, self._outputs)
        self.reset()

    def reset(self) -> None:
        """Return to the memory before the first step."""
        self._started = False

    def step(self, inputs: float | ArrayLike) -> Array:
        """Take one sample of every input and return the outputs, shape (n_outputs,).

        The array returned is reused by the next step: copy what you keep.
        """
        self._inputs[0] = inputs
        if not self._started:
            self.state[:] = self.block.initial_state(self._inputs[0], self.initial)
            self._started = True
        self._run()
        return self._output


def run_many(
    blocks: Sequence[Block],
    inputs: Array,
    *,
    sample_time: float | None = None,
    initial: Initial | None = None,
) -> Array:
    """Run several blocks with the same channels over the same inputs, on all cores.

    Returns
    -------
    array, shape (len(blocks), n, n_outputs)
    """
    outputs = np.empty((len(blocks), inputs.shape[0], len(blocks[0].outputs)))

    def run(share: Iterable[int]) -> None:
        for index in share:
            state = blocks[index].initial_state(inputs[0], initial)
            blocks[index].bind(sample_time, state, inputs, outputs[index])()

    workers = min(cores(), len(blocks))
    if workers == 1:
        run(range(len(blocks)))
    else:
        with ThreadPoolExecutor(workers) as pool:
            list(pool.map(run, [range(first, len(blocks), workers) for first in range(workers)]))
    return outputs
