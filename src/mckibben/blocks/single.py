"""Blocks with one input and one output, and inverses that clip at a forward block's input limits."""

from __future__ import annotations

import warnings
from abc import abstractmethod

import numpy as np
from numpy.typing import NDArray

from mckibben.blocks.backward import Backward
from mckibben.blocks.base import Block
from mckibben.blocks.fields import Channel, Initial, Rule
from mckibben.blocks.refusals import explicit_state
from mckibben.errors import ModelError, ModelWarning

Array = NDArray[np.float64]


class SingleChannel(Block):
    """A block with fields ``input`` and ``output``."""

    input: Channel
    output: Channel

    @property
    def inputs(self) -> tuple[Channel, ...]:
        """The driven channel."""
        return (self.input,)

    @property
    def outputs(self) -> tuple[Channel, ...]:
        """The output channel."""
        return (self.output,)


class Memoryless(SingleChannel):
    """A single-channel block without state."""

    @property
    def n_states(self) -> int:
        """None."""
        return 0

    def initial_state(self, first: Array, initial: Initial | None = None) -> Array:
        """Return an empty state."""
        del first, initial
        return np.empty(0)


class Ranged(SingleChannel):
    """A single-channel block whose output rises with its input, within an optional input range."""

    input_range: tuple[float, float] | None

    @property
    def limits(self) -> tuple[float, float]:
        """Lowest and highest input; infinite where the block has no input range."""
        return (-np.inf, np.inf) if self.input_range is None else self.input_range

    def reachable(self) -> tuple[Array, Array]:
        """Return the outputs that can be reached whatever happened before, each of shape (1,).

        How far the output falls at the lowest input depends on the highest peak before: the least
        favourable one counts.
        """
        if self.input_range is None:
            return super().reachable()
        low, high = self.input_range

        def last(*inputs: float) -> float:
            return float(self.simulate(inputs, initial="first_sample")[-1])

        peaks = [low, *self.peaks().clip(low, high).tolist(), high]
        return np.array([max(last(low, peak, low) for peak in peaks)]), np.array([last(low, high)])

    def peaks(self) -> Array:
        """Return the peaks at which one operator more keeps a memory; none without operators."""
        return np.empty(0)


class Inverse(Backward):
    """The inverse of a `Ranged` block: wished-for output in, input out.

    References beyond what the input range can reach are clipped there, and `simulate` says so. The
    last state counts the samples clipped.
    """

    def reachable(self) -> tuple[Array, Array]:
        """Return the input range of the forward block, each end of shape (1,)."""
        low, high = self.forward.limits
        return np.array([low]), np.array([high])

    def initial_state(self, first: Array, initial: Initial | None = None) -> Array:
        """Return the state before the first sample that matches the forward block's.

        An explicit state may be this block's own, or the forward block's.
        """
        start: Initial = self.forward.initial if initial is None else initial
        if isinstance(start, str):
            return self.matching_state(float(first[0]), start)
        if len(start) == self.forward.n_states:
            return self.state_from_forward(explicit_state(self.forward, start))
        return explicit_state(self, start)

    @abstractmethod
    def matching_state(self, first: float, start: Rule) -> Array:
        """Return the state that matches a forward block started by a named rule."""

    @abstractmethod
    def state_from_forward(self, state: Array) -> Array:
        """Return the state that matches a state of the forward block."""

    def report(self, state: Array) -> None:
        """Warn if references were clipped."""
        if state[-1] > 0:
            low, high = self.forward.reachable()
            wanted, given = self.inputs[0], self.outputs[0]
            warnings.warn(
                f"{int(state[-1])} sample(s) of the reference {wanted.name!r} were clipped: they "
                f"need {given.name} outside its limits. Reachable whatever happened before is "
                f"{low[0]:.6g} to {high[0]:.6g} {wanted.unit}",
                ModelWarning,
                stacklevel=4,
            )


NARROWEST, NARROWEST_SHARE = 1e-30, 1e-9
"""Width of an input range, in the unit of the input and as a share of its larger end, at least."""


def check_input_range(kind: str, input_range: tuple[float, float] | None) -> None:
    """Refuse an input range that is empty, or that steps through it could not be told apart in."""
    if input_range is None:
        return
    low, high = input_range
    narrowest = max(NARROWEST, NARROWEST_SHARE * max(abs(low), abs(high)))
    if not narrowest <= high - low < np.inf:
        raise ModelError(
            f"the input range {input_range} of {kind!r} is empty, or too narrow or wide to compute "
            "with. Remedy: give (lowest, highest)."
        )
