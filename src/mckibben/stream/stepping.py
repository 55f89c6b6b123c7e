"""A block in a real-time loop: read, step, write."""

from __future__ import annotations

from collections.abc import Callable

from numpy.typing import ArrayLike

from mckibben.arrays import Array
from mckibben.blocks.base import Block, Stream
from mckibben.stream.fixed_rate import Deadlines, FixedRate


class Step(Stream):
    """A callable stream whose outputs are newly allocated."""

    def __call__(self, inputs: ArrayLike) -> Array:
        """Take one sample of every input and return the outputs, shape (n_outputs,)."""
        return self.step(inputs).copy()


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
