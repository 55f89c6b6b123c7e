"""Inverses of blocks: one class for all, which runs the declared inverse kernel.

An inverse takes the outputs of its field ``forward``, then its scheduling inputs, and returns its
driven inputs. Its state begins with the forward block's, unless it is shorter.
"""

from __future__ import annotations

import warnings
from functools import cached_property
from typing import Annotated, ClassVar, Literal, Self

import numpy as np
from pydantic import BeforeValidator, InstanceOf
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks.base import Block, Start
from mckibben.blocks.fields import STRICT, Channel, Initial, drives
from mckibben.blocks.kernels import Step, kernel
from mckibben.blocks.learning import Learnable
from mckibben.blocks.parameters import same_as
from mckibben.blocks.saving import nested
from mckibben.blocks.starts import stated
from mckibben.errors import ModelError, ModelWarning
from mckibben.registry import load


@kernel
def nothing_clipped(coefficients: Array, state: Array, inputs: Array, virgin: bool) -> None:
    """Start with a clip count of 0, for an inverse without other states."""
    state[0] = 0.0


class Invertible(Block):
    """A block that declares its inverse: a kernel, its coefficients, and its start.

    By default its output rises with its one input, within its field ``input_range``, and the inverse
    clips references beyond what that can reach. The inverse's state is then this block's, what the
    inverse remembers, and the count of samples clipped; its numbers are this block's and the limits.
    """

    inverse_kernel: ClassVar[Step]
    """Runs the inverse, as `kernel` runs the block."""

    inverse_start_kernel: ClassVar[Start | None] = None
    """Fills the inverse's state, as `start_kernel` fills the block's."""

    inverse_path_dependent: ClassVar[bool] = False
    """Whether the path of a reference between two turning points matters."""

    inverse_memory: ClassVar[Literal["input", "output"] | None] = None
    """What the inverse stores of the last sample in addition to this block's state."""

    counts_clipped: ClassVar[bool] = True
    """Whether the last number of the inverse's state counts the samples of `inverse_complaint`."""

    solved: ClassVar[bool] = False
    """Whether the inverse is solved iteratively in every sample, having no closed form."""

    def inverse(self) -> Block:
        """Return the inverse of this block; raise an error if `check_invertible` does."""
        return Inverse(self)

    def check_invertible(self) -> None:
        """Raise an error if there is no inverse, naming the condition and a remedy.

        By default, of one input solved for: a range of it, over which the output rises.
        """
        if not (self.solved and hasattr(self, "input_range")):
            return
        if self.input_range is None:
            raise ModelError(
                f"{self.kind!r} has no inverse without it",
                parameter="input_range",
                remedy="give the lowest and highest input",
            )
        steepness = self.least_slope()
        if not steepness > 0:
            raise ModelError(
                f"{self.kind!r} has no inverse: its output may fall while its input rises "
                f"(least slope {steepness:.3g})",
                remedy="identify it with `settings[nonnegative]=true` where it has that setting, or "
                "invert another model",
            )

    def least_slope(self) -> float:
        """Return a lower bound of the slope of the output by the input."""
        return np.inf

    def inverse_numbers(self, own: Array) -> Array:
        """Return the numbers that the inverse reads, given this block's: with the limits behind them."""
        return np.array([*own, *self.input_limits]) if hasattr(self, "input_range") else own

    @property
    def n_inverse_states(self) -> int:
        """Number of states of the inverse."""
        return self.n_states + (self.inverse_memory is not None) + self.counts_clipped

    @property
    def n_inverse_scratch(self) -> int:
        """`n_scratch` of the inverse; by default the same."""
        return self.n_scratch

    def inverse_state(self, state: Array) -> Array:
        """Return the state of the inverse for a state of this block, if it is determined."""
        found = np.array(
            [*state, *self.stored_for_inverse(state), *([0.0] if self.counts_clipped else [])]
        )
        if found.size != self.n_inverse_states:
            raise ModelError(
                f"{len(state)} states of {self.kind!r} do not determine those of its inverse",
                remedy=f"give {self.n_inverse_states}, or 'first_sample'",
            )
        return found

    def stored_for_inverse(self, state: Array) -> tuple[float, ...]:
        """Return the additional states of the inverse for a state of this block."""
        return (float(state[-1]),) if self.inverse_memory == "input" else ()

    @property
    def learnable(self) -> Learnable | None:
        """Adaptive parameters of the inverse; None if it has none."""
        return None

    def reachable(self) -> tuple[Array, Array]:
        """Return the lowest and highest outputs that are reachable from every state.

        How far the output falls at the lowest input depends on the highest peak before: the least
        favourable one counts.
        """
        if getattr(self, "input_range", None) is None:
            return super().reachable()
        low, high = self.input_limits

        def last(*inputs: float) -> float:
            return float(self.simulate(inputs, initial="first_sample")[-1])

        peaks = [low, *self.peaks().clip(low, high).tolist(), high]
        return np.array([max(last(low, peak, low) for peak in peaks)]), np.array([last(low, high)])

    def peaks(self) -> Array:
        """Return the peaks at which one more operator has memory; empty without operators."""
        return np.empty(0)

    def inverse_complaint(self, state: Array) -> str:
        """Return the warning about counted samples in a run of the inverse."""
        low, high = self.reachable()
        output, input_ = self.outputs[0], self.inputs[0]
        return (
            f"{int(state[-1])} sample(s) of the reference {output.name!r} were clipped: they "
            f"need {input_.name} outside its limits. Reachable whatever happened before is "
            f"{low[0]:.6g} to {high[0]:.6g} {output.unit}"
        )


@dataclass(frozen=True, config=STRICT)
class Inverse(Block):
    """Inverse of another block.

    Parameters
    ----------
    forward : Block
        The inverted block, which declares how.
    """

    kind = "inverse"
    inverts = True
    parameters = ("forward",)

    forward: Annotated[InstanceOf[Invertible], BeforeValidator(nested)]

    kernel = same_as("forward.inverse_kernel")
    start_kernel = same_as("forward.inverse_start_kernel")
    rate_dependent = same_as("forward.rate_dependent")
    path_dependent = same_as("forward.inverse_path_dependent")
    scheduling = same_as("forward.scheduling")
    complex_step = same_as("forward.complex_step")
    n_states = same_as("forward.n_inverse_states")
    n_scratch = same_as("forward.n_inverse_scratch")
    start = same_as("forward.start")
    strictly_increasing = same_as("forward.strictly_increasing")

    def __post_init__(self) -> None:
        self.forward.check_invertible()

    @property
    def title(self) -> str:
        return f"{self.forward.title}-inverse"

    @property
    def inputs(self) -> tuple[Channel, ...]:
        return (*self.forward.outputs, *self.forward.inputs[self.forward.n_driven :])

    @property
    def outputs(self) -> tuple[Channel, ...]:
        return self.forward.inputs[: self.forward.n_driven]

    def initial_state(
        self, first: Array, initial: Initial | None = None, sample_time: float | None = None
    ) -> Array:
        """Return the initial state that corresponds to the forward block's.

        An explicit state may be this block's own, or the forward block's.
        """
        start: Initial = self.start if initial is None else initial
        if isinstance(start, str):
            return super().initial_state(first, start, sample_time)
        n = self.forward.n_states
        if len(start) == n != self.n_states:
            return self.forward.inverse_state(self.forward.initial_state(first, start, sample_time))
        state = stated(self.kind, self.n_states, start)
        if n <= self.n_states:
            self.forward.initial_state(first, state[:n].tolist(), sample_time)  # which checks it
        return state

    def coefficients(self, sample_time: float | None) -> Array:
        return self.forward.inverse_numbers(self.forward.coefficients(sample_time))

    def reachable(self) -> tuple[Array, Array]:
        if len(self.outputs) == 1:
            low, high = self.forward.input_limits
            return np.array([low]), np.array([high])
        return super().reachable()

    def inverse(self) -> Block:
        return self.forward

    def report(self, state: Array) -> None:
        if self.n_clipped(state):
            warnings.warn(self.forward.inverse_complaint(state), ModelWarning, stacklevel=4)

    @property
    def clip_counts(self) -> tuple[int, ...]:
        return (self.n_states - 1,) if self.forward.counts_clipped else ()

    @cached_property
    def known_inputs(self) -> Array:
        forward = self.forward
        return np.vstack([forward.known_outputs, forward.known_inputs[forward.n_driven :]])

    @cached_property
    def known_outputs(self) -> Array:
        return self.forward.known_inputs[: self.forward.n_driven]

    def equations(self) -> tuple[str, ...]:
        return (r"\hat{u} = P^{-1}[y] \quad\text{such that}\quad P[\hat{u}] = y",)

    @classmethod
    def example(cls) -> Self:
        return cls(load("blocks", "pi").example())


def commands(block: Block) -> bool:
    """Return whether a block is an inverse whose outputs drive a muscle.

    Not every inverse does: a forward model solved from a law of forces is an inverse too, and returns a
    displacement.
    """
    return block.inverts and drives(block.outputs[0])
