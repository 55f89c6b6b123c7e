"""A block in a loop: read, step, write, whatever comes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mckibben.blocks.base import Block
from mckibben.blocks.fields import Initial
from mckibben.stream.fixed_rate import Deadlines, FixedRate

Array = NDArray[np.float64]


class Step:
    """A block stepped safely: an input that is not finite changes nothing, and outputs always are.

    The same rule as in exported C: after a bad input, memory is untouched and the outputs are those
    of the last good step, 0 before the first.

    Parameters
    ----------
    block : Block
        What runs.
    sample_time : float, optional
        Time between steps [s]; needed by rate-dependent blocks.
    initial : {"first_sample", "virgin"} or sequence of float, optional
        Memory before the first step; default is the block's own.
    """

    GOOD, BAD_INPUT, BAD_OUTPUT = 0, 1, 2

    def __init__(
        self, block: Block, sample_time: float | None = None, *, initial: Initial | None = None
    ) -> None:
        self._stream = block.stream(sample_time, initial=initial)
        self._last = np.zeros(len(block.outputs))
        self.status = self.GOOD

    def __call__(self, inputs: ArrayLike) -> Array:
        """Take one sample of every input and return the outputs, shape (n_outputs,)."""
        given = np.asarray(inputs, dtype=np.float64)
        if not np.isfinite(given).all():
            self.status = self.BAD_INPUT
            return self._last.copy()
        outputs = self._stream.step(given)
        if np.isfinite(outputs).all():
            self.status = self.GOOD
            self._last[:] = outputs
        else:
            self.status = self.BAD_OUTPUT
            if not np.isfinite(self._stream.state).all():
                self._stream.reset()  # the memory is lost: the next step starts it afresh
        return self._last.copy()

    def reset(self) -> None:
        """Forget everything: the next step is a first one."""
        self._stream.reset()
        self._last[:] = 0.0
        self.status = self.GOOD


def run(
    block: Block,
    read: Callable[[], ArrayLike],
    write: Callable[[Array], None],
    *,
    period: float,
    duration: float = float("inf"),
) -> Deadlines:
    """Run a block at a fixed rate between a sensor and an actuator, until time is up or Ctrl-C.

    Parameters
    ----------
    block : Block
        A compensator or controller.
    read : callable
        Gives the inputs, shape (n_inputs,), without waiting.
    write : callable
        Takes the outputs, shape (n_outputs,).
    period : float
        Time between steps [s].
    duration : float
        When to end [s].

    Returns
    -------
    Deadlines
        How well the rate was kept.
    """
    step = Step(block, period)
    rate = FixedRate(period, duration)
    try:
        for _ in rate:
            write(step(read()))
    except KeyboardInterrupt:
        pass
    return rate.deadlines
