"""Blocks with one input and one output, and what is common to inverses that clip at input limits."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np

from mckibben.arrays import NARROWEST, Array
from mckibben.blocks.core.block import Block
from mckibben.blocks.core.fields import Channel
from mckibben.blocks.core.inverse import Invertible
from mckibben.blocks.core.kernels import kernel
from mckibben.blocks.core.stateless import Stateless
from mckibben.errors import ModelError


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


class ScheduledChannel(Block):
    """A block with fields ``input`` and ``output``, and a third, named by a class, that schedules it."""

    scheduled_by: ClassVar[str]

    input: Channel
    output: Channel

    @property
    def inputs(self) -> tuple[Channel, ...]:
        """The driven channel, then the one that schedules."""
        return (self.input, getattr(self, self.scheduled_by))

    @property
    def outputs(self) -> tuple[Channel, ...]:
        """The output channel."""
        return (self.output,)

    @property
    def scheduling(self) -> tuple[str, ...]:
        """Name of the one that schedules."""
        return (self.inputs[1].name,)


@kernel
def nothing_clipped(coefficients: Array, state: Array, inputs: Array, virgin: bool) -> None:
    """Start with no samples clipped, where the inverse has no other memory."""
    state[0] = 0.0


class Memoryless(Stateless, SingleChannel):
    """A single-channel block without state."""


class Ranged(SingleChannel, Invertible):
    """A single-channel block whose output rises with its input, within an optional input range.

    Its inverse clips references beyond what the input range can reach. The state of the inverse is this
    block's, then what the inverse remembers, then the count of samples clipped.
    """

    input_range: tuple[float, float] | None

    inverse_remembers: ClassVar[Literal["input", "output"] | None] = None
    """What the inverse knows of the last sample beside this block's state."""

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

    def inverse_numbers(self, own: Array) -> Array:
        """Return [this block's, lowest, highest input]."""
        return np.array([*own, *self.limits])

    @property
    def n_inverse_states(self) -> int:
        """Those of this block, what is remembered, and the count of samples clipped."""
        return self.n_states + (self.inverse_remembers is not None) + 1

    def inverse_state(self, state: Array) -> Array:
        """Return the inverse's state that matches a state of this block."""
        return np.array([*state, *self.remembered(state), 0.0])

    def remembered(self, state: Array) -> tuple[float, ...]:
        """Return what the inverse remembers, as a state of this block tells it."""
        del state
        return ()

    def inverse_reachable(self) -> tuple[Array, Array]:
        """Return the limits, each of shape (1,)."""
        low, high = self.limits
        return np.array([low]), np.array([high])

    inverse_counts: ClassVar[bool] = True

    def inverse_complaint(self, state: Array) -> str:
        """Tell of references that were clipped."""
        low, high = self.reachable()
        wanted, given = self.output, self.input
        return (
            f"{int(state[-1])} sample(s) of the reference {wanted.name!r} were clipped: they "
            f"need {given.name} outside its limits. Reachable whatever happened before is "
            f"{low[0]:.6g} to {high[0]:.6g} {wanted.unit}"
        )


NARROWEST_SHARE = 1e-9
"""Least width of an input range as a share of the sizes of its ends."""


def check_input_range(kind: str, input_range: tuple[float, float] | None) -> None:
    """Refuse an input range that is empty, or that steps through it could not be told apart in."""
    if input_range is None:
        return
    low, high = input_range
    width = high - low
    if not (NARROWEST <= width < np.inf and width >= NARROWEST_SHARE * (abs(low) + abs(high))):
        raise ModelError(
            f"the input range {input_range} of {kind!r} is empty, or too narrow or wide to compute "
            "with. Remedy: give (lowest, highest)."
        )
