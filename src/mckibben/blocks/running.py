"""Running blocks sample by sample, and many at once."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from math import isfinite, nan
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from mckibben.arrays import Array
from mckibben.blocks.fields import Initial
from mckibben.blocks.ranges import input_bounds
from mckibben.errors import DataError, require
from mckibben.system.threads import cores

if TYPE_CHECKING:
    from mckibben.blocks.base import Block


class Stream:
    """A block running sample by sample.

    An input that is NaN, infinite, or beyond what it was identified for with a margin
    (`mckibben.blocks.ranges.input_bounds`) is a fault: the last good value of that input is held, and
    the block steps on with it, so that the fault never reaches memory. A measurement that may be
    missing is then missing. Before every input has had a good value, nothing happens and outputs are 0.
    Outputs are always finite: where one would not be, they are those of the last good step, and memory
    that is lost starts afresh at the next. Exported C does the same.

    Parameters
    ----------
    block : Block
        What runs.
    sample_time : float, optional
        Time between steps [s]; needed by rate-dependent blocks.
    initial : {"first_sample", "virgin"} or sequence of float, optional
        Memory before the first step; default is the block's own.

    Attributes
    ----------
    state : array, shape (n_states,)
        Memory; of no meaning before the first step.
    status : int
        Of the last step: `GOOD`, or a sum of `BAD_INPUT`, an input was held; `BAD_OUTPUT`, the outputs
        were; and `CLIPPED`, what was asked for is out of reach.
    """

    GOOD, BAD_INPUT, BAD_OUTPUT, CLIPPED = 0, 1, 2, 4

    def __init__(
        self, block: Block, sample_time: float | None = None, initial: Initial | None = None
    ) -> None:
        self.block, self.sample_time, self.initial = block, sample_time, initial
        inputs, outputs = np.zeros((1, len(block.inputs))), np.zeros((1, len(block.outputs)))
        self.state = np.zeros(block.n_states)
        refuse_time(sample_time)
        block.check_time(sample_time)
        self._run = block.bind(sample_time, self.state, inputs, outputs)
        self._input, self._output = inputs[0], outputs[0]
        # Python's own numbers are faster than arrays so small
        self._given, self._gives = _scalars(self._input), _scalars(self._output)
        self._needed = self._input.size - block.n_missable
        self._one_given, self._one_gives = self._input.size == 1, self._output.size == 1
        self._bounds: list[tuple[float, float]] = [(a, b) for a, b in input_bounds(block).tolist()]
        self._counts, self._counted = block.clip_counts, _scalars(self.state)
        self._begin()

    def reset(self) -> None:
        """Reset to the initial state."""
        self._begin()

    def _begin(self) -> None:
        self._started, self._clipped = False, 0.0
        self._last = [nan] * self._input.size
        self._kept: float | list[float] = 0.0
        self.status = self.GOOD

    def step(self, inputs: float | ArrayLike) -> Array:
        """Take one sample of every input and return the outputs, shape (n_outputs,).

        The array returned is reused by the next step: copy what you keep.
        """
        given, gives = self._given, self._gives
        if self._one_given and isinstance(inputs, float):  # also NumPy's
            given[0] = inputs
        else:
            try:
                self._input[...] = inputs
            except (TypeError, ValueError, OverflowError) as error:
                raise self._misfit(error) from None
            if not self._one_given and np.size(inputs) != self._input.size:  # spread, not given
                raise self._misfit(ValueError(f"{np.size(inputs)} number(s)"))
        status, last = self.GOOD, self._last
        for place, (low, high) in enumerate(self._bounds):
            value = given[place]
            if low <= value <= high:
                last[place] = value
            elif place >= self._needed:  # missing
                status |= self.BAD_INPUT * (value == value)
                given[place] = nan
            else:
                status |= self.BAD_INPUT
                given[place] = last[place]
        if status and not all(map(isfinite, last[: self._needed])):
            return self._held(status)
        if not self._started:
            self.state[:] = self.block.initial_state(self._input, self.initial, self.sample_time)
            self._clipped = sum(map(self._counted.__getitem__, self._counts))
            self._started = True
        self._run()
        if self._counts:
            clipped = sum(map(self._counted.__getitem__, self._counts))
            if clipped > self._clipped:
                status |= self.CLIPPED
            self._clipped = clipped
        kept: Any = gives[0] if self._one_gives else gives.tolist()
        # a sum is finite only if all terms are; it may overflow, and infinity less itself is NaN
        total = kept if self._one_gives else sum(kept)
        if total - total and not all(map(isfinite, gives)):
            if not np.isfinite(self.state).all():
                self._started = False
            return self._held(status | self.BAD_OUTPUT)
        self._kept = kept
        self.status = status
        return self._output

    def _held(self, status: int) -> Array:
        self.status = status
        self._output[...] = self._kept
        return self._output

    def _misfit(self, error: Exception) -> DataError:
        names = ", ".join(channel.name for channel in self.block.inputs)
        return DataError(
            f"a step cannot take these inputs ({error})", remedy=f"give one number each: {names}"
        )


def refuse_time(sample_time: float | None) -> None:
    """Raise an error for an invalid sample time."""
    possible = sample_time is None or (isfinite(sample_time) and sample_time > 0)
    require(possible, "sample_time", sample_time, "a positive time [s]")


def _scalars(array: Array) -> memoryview[float]:
    return array.data.cast("B").cast("d")


def run_many(
    blocks: Sequence[Block],
    inputs: Array,
    *,
    sample_time: float | None = None,
    initial: Initial | None = None,
) -> Array:
    """Return outputs of blocks with the same channels, shape (blocks, n, n_outputs), on all cores."""
    refuse_time(sample_time)
    outputs = np.empty((len(blocks), inputs.shape[0], len(blocks[0].outputs)))

    def run(share: Iterable[int]) -> None:
        for index in share:
            state = blocks[index].initial_state(inputs[0], initial, sample_time)
            blocks[index].bind(sample_time, state, inputs, outputs[index])()

    workers = min(cores(), len(blocks))
    if workers == 1:
        run(range(len(blocks)))
    else:
        with ThreadPoolExecutor(workers) as pool:
            list(pool.map(run, [range(first, len(blocks), workers) for first in range(workers)]))
    return outputs
