"""Blocks that undo others: one class for all, which runs what the block undone declares.

An inverse takes the outputs of its field ``forward``, then what schedules that one, and gives its
driven inputs. Its state begins with the forward block's, unless it is shorter.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import BeforeValidator, InstanceOf
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks.core.block import (
    Block,
    Kernel,
    Primitive,
    Run,
    Start,
    fill,
    kernels_for_c,
    scratch_of,
)
from mckibben.blocks.core.exportable import Cost
from mckibben.blocks.core.fields import STRICT, Channel, Initial, Rule
from mckibben.blocks.core.notation import indexed, lettered
from mckibben.blocks.core.refusals import explicit_state
from mckibben.blocks.core.saving import nested
from mckibben.errors import ModelError, ModelWarning
from mckibben.registry import load
from mckibben.system.compiling import bound


class Invertible(Primitive):
    """A block that declares its inverse: a kernel, what that reads, and how it starts."""

    inverse_kind: ClassVar[Literal["exact", "solved"]] = "exact"
    """Whether the inverse is a formula, or solves equations in every sample."""

    inverse_kernel: ClassVar[Kernel]
    """Runs the inverse, as `kernel` runs the block."""

    inverse_start_kernel: ClassVar[Start | None] = None
    """Fills the inverse's state, as `start_kernel` fills the block's."""

    inverse_path_dependent: ClassVar[bool] = False
    """Whether it matters how a reference goes from one turning point to the next."""

    def inverse(self) -> Block:
        """Return the block that undoes this one.

        Raises
        ------
        ModelError
            If a condition of `check_invertible` fails.
        """
        return Inverse(self)

    def check_invertible(self) -> None:
        """Refuse to be undone where a condition fails, saying which and what to do; none by default."""

    def inverse_numbers(self, own: Array) -> Array:
        """Return the numbers that the inverse reads, given those of this block; the same by default."""
        return own

    @property
    def n_inverse_states(self) -> int:
        """Length of the inverse's state; this block's by default."""
        return self.n_states

    @property
    def n_inverse_scratch(self) -> int:
        """As `n_scratch`, of the inverse; the same by default."""
        return self.n_scratch

    def inverse_start(self, first: Array, start: Rule) -> Array:
        """Return the inverse's state that matches this block started by a named rule.

        Parameters
        ----------
        first : array, shape (n_inputs,)
            The inverse's first sample.
        start : {"first_sample", "virgin"}
            The rule.
        """
        state, kernel = np.zeros(self.n_inverse_states), self.inverse_start_kernel
        if kernel is not None:
            numbers = self.inverse_numbers(self.start_numbers())
            fill(kernel, numbers, state, self.n_inverse_scratch, first, start)
        return state

    def inverse_state(self, state: Array) -> Array:
        """Return the inverse's state that matches a state of this block, where that tells it."""
        raise ModelError(
            f"{len(state)} states of {self.kind!r} do not tell those of its inverse. "
            f"Remedy: give {self.n_inverse_states}, or 'first_sample'."
        )

    def bind_inverse(
        self, sample_time: float | None, state: Array, inputs: Array, outputs: Array
    ) -> Run:
        """Return a function that runs the inverse in place."""
        numbers = self.inverse_numbers(self.coefficients(sample_time))
        kernel = self.inverse_kernel
        scratch = scratch_of(kernel, self.n_inverse_scratch)
        return bound(kernel.batch, numbers, state, *scratch, inputs, outputs)

    def inverse_reachable(self) -> tuple[Array, Array]:
        """Return the lowest and highest inputs that the inverse gives; infinite by default."""
        n = len(self.inputs) - len(self.scheduling)
        return np.full(n, -np.inf), np.full(n, np.inf)

    def inverse_cost(self, sample_time: float | None) -> Cost:
        """Return what a step of the inverse costs; one pass by default."""
        numbers = self.inverse_numbers(self.c_numbers(sample_time))
        return Cost.of(numbers, self.n_inverse_states)

    inverse_counts: ClassVar[bool] = False
    """Whether the last of the inverse's state counts the samples that `inverse_complaint` is about."""

    def inverse_complaint(self, state: Array) -> str:
        """Return what is to be said of a run of the inverse in which samples were counted."""
        del state
        return ""


@dataclass(frozen=True, config=STRICT)
class Inverse(Block):
    """The block that undoes another.

    Parameters
    ----------
    forward : Block
        The block undone, which declares how.
    """

    kind: ClassVar[str] = "inverse"
    undoing: ClassVar[bool] = True
    parameters: ClassVar[tuple[str, ...]] = ("forward",)

    forward: Annotated[InstanceOf[Invertible], BeforeValidator(nested)]

    def __post_init__(self) -> None:
        self.forward.check_invertible()

    @property
    def title(self) -> str:
        """That of the block undone, and that it is undone."""
        return f"{self.forward.title}-inverse"

    @property
    def rate_dependent(self) -> bool:  # type: ignore[override]
        """Whether the forward block is."""
        return self.forward.rate_dependent

    @property
    def path_dependent(self) -> bool:  # type: ignore[override]
        """As the forward block says."""
        return self.forward.inverse_path_dependent

    @property
    def inputs(self) -> tuple[Channel, ...]:
        """The forward block's outputs, then what schedules it."""
        return (*self.forward.outputs, *self.forward.inputs[len(self.outputs) :])

    @property
    def scheduling(self) -> tuple[str, ...]:
        """What schedules the forward block."""
        return self.forward.scheduling

    @property
    def outputs(self) -> tuple[Channel, ...]:
        """The forward block's driven inputs."""
        channels = self.forward.inputs
        return channels[: len(channels) - len(self.forward.scheduling)]

    @property
    def n_states(self) -> int:
        """As the forward block says."""
        return self.forward.n_inverse_states

    @property
    def n_scratch(self) -> int:
        """As the forward block says."""
        return self.forward.n_inverse_scratch

    @property
    def start(self) -> Initial:
        """The forward block's."""
        return self.forward.start

    def initial_state(self, first: Array, initial: Initial | None = None) -> Array:
        """Return the state before the first sample that matches the forward block's.

        An explicit state may be this block's own, or the forward block's.
        """
        start = self.start if initial is None else initial
        if isinstance(start, str):
            return self.forward.inverse_start(first, start)
        n = self.forward.n_states
        if len(start) == n != self.n_states:
            return self.forward.inverse_state(self.forward.initial_state(first, start))
        state = explicit_state(self, start)
        if n <= self.n_states:
            self.forward.initial_state(first, state[:n].tolist())  # which knows what states can be
        return state

    def bind(self, sample_time: float | None, state: Array, inputs: Array, outputs: Array) -> Run:
        """Return a function that runs the forward block's inverse kernel in place."""
        return self.forward.bind_inverse(sample_time, state, inputs, outputs)

    @property
    def c_kernels(self) -> tuple[Callable[..., Any], ...]:
        """Those of the forward block's inverse."""
        own = self.forward
        return kernels_for_c(own.inverse_kernel, own.inverse_start_kernel, self.n_states)

    def c_numbers(self, sample_time: float | None) -> Array:
        """Return the forward block's, as the inverse reads them."""
        return self.forward.inverse_numbers(self.forward.c_numbers(sample_time))

    def cost(self, sample_time: float | None) -> Cost:
        """Return what the forward block says."""
        return self.forward.inverse_cost(sample_time)

    def kept_apart(self) -> Iterator[tuple[str, tuple[float, ...]]]:
        """Give the forward block's."""
        return self.forward.kept_apart()

    def reachable(self) -> tuple[Array, Array]:
        """Return the lowest and highest inputs of the forward block that are given."""
        return self.forward.inverse_reachable()

    def inverse(self) -> Block:
        """Return the forward block."""
        return self.forward

    def report(self, state: Array) -> None:
        """Warn of what the forward block complains of, as references clipped."""
        if self.n_clipped(state):
            warnings.warn(self.forward.inverse_complaint(state), ModelWarning, stacklevel=4)

    def n_clipped(self, state: Array) -> int:
        """Return how many samples the forward block complains of."""
        return int(state[-1]) if self.forward.inverse_counts and state[-1] > 0 else 0

    def equations(self) -> tuple[str, ...]:
        """Return that it solves the equations of the block undone, which follow."""
        return (r"\hat{u} = P^{-1}[y] \quad\text{such that}\quad P[\hat{u}] = y",)

    def worked(self) -> tuple[str, ...]:
        """Return which channels go in and come out; P is the block that follows."""
        letters = []
        for letter, channels in (("y", self.forward.outputs), (r"\hat{u}", self.outputs)):
            for place, channel in enumerate(channels):
                own = indexed(letter, (place,), 1) if len(channels) > 1 else letter
                letters.append(lettered(own, channel.name, channel.unit))
        return (r",\quad ".join([*letters, r"P\text{: the model below}"]),)

    @classmethod
    def example(cls) -> Self:
        """Return the inverse of a Prandtl-Ishlinskii model."""
        return cls(load("blocks", "pi").example())
