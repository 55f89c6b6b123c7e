"""Compositions flattened: which part runs when, on which signals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from mckibben.arrays import Array
from mckibben.blocks.base import Block, Cost
from mckibben.errors import DataError, ModelError


@dataclass(frozen=True)
class Call:
    """A block run on signals.

    Parameters
    ----------
    block : Block
    coefficients : array
        What its kernels read.
    state : array or None
        The starting memory itself, where the model gives it.
    inputs : tuple of str
        C expressions.
    first_output, first_state : int
        Places in the tables of signals and of memory.
    """

    block: Block
    coefficients: Array
    state: Array | None
    inputs: tuple[str, ...]
    first_output: int
    first_state: int


@dataclass(frozen=True)
class Sum:
    """Signals added into one."""

    terms: tuple[str, ...]
    output: int


@dataclass
class Wiring:
    """What a model does in a step, in order.

    Parameters
    ----------
    block : Block
        The model.
    sample_time : float or None
        Time between steps [s].
    from_rest : bool
        As of `mckibben.blocks.base.Board`.
    """

    block: Block
    sample_time: float | None
    from_rest: bool = True
    steps: list[Call | Sum] = field(default_factory=list)
    n_signals: int = 0
    n_numbers: int = 0

    def __post_init__(self) -> None:
        given = [f"in[{index}]" for index in range(len(self.block.inputs))]
        self.outputs = self.block.wired(self, given)

    @property
    def calls(self) -> list[Call]:
        """The blocks that are run, in order."""
        return [step for step in self.steps if isinstance(step, Call)]

    @property
    def cost(self) -> Cost:
        """What a step costs."""
        costs = (call.block.cost(self.sample_time) for call in self.calls)
        return sum(costs, start=Cost(0, 0))

    def call(self, block: Block, taken: Sequence[str]) -> list[str]:
        """Append a block, and return the signals that it gives.

        Raises
        ------
        ModelError
            If it has no kernel of a start.
        """
        if not block.c_kernels:
            raise ModelError(
                f"{block.title!r} has no C. Remedy: declare a start_kernel beside its kernel, as blocks "
                "of the package do."
            )
        zeros = np.zeros(len(block.inputs))
        state = None if isinstance(block.start, str) else block.initial_state(zeros)
        numbers, places = block.coefficients(self.sample_time), (self.n_signals, self.n_numbers)
        self.steps.append(Call(block, numbers, state, tuple(taken), *places))
        self.n_numbers += block.n_states + block.n_scratch
        return self._new_signals(len(block.outputs))

    def add(self, terms: Sequence[str]) -> str:
        """Append a sum, unless it is of one signal, and return the signal that it gives."""
        if len(terms) == 1:
            return terms[0]
        self.steps.append(Sum(tuple(terms), self.n_signals))
        return self._new_signals(1)[0]

    def resume(self, state: Sequence[float]) -> None:
        """Start the blocks called last from the memory of them all."""
        left = np.array(state, dtype=np.float64)
        for place, step in reversed(list(enumerate(self.steps))):
            if isinstance(step, Call) and left.size:
                left, own = np.split(left, [left.size - step.block.n_states])
                self.steps[place] = replace(step, state=own)

    def _new_signals(self, count: int) -> list[str]:
        first = self.n_signals
        self.n_signals += count
        return [f"signals[{first + index}]" for index in range(count)]


def state_of(block: Block, memory: ArrayLike, sample_time: float | None) -> Array:
    """Return the state of a block that its C has in memory, without what it only computes in.

    Parameters
    ----------
    block : Block
        What was exported.
    memory : array-like, shape (n_numbers,)
        ``numbers`` of the C model, as `mckibben.link.Link.memory` reads them.
    sample_time : float or None
        That it was exported with [s].

    Returns
    -------
    array, shape (n_states,)

    Raises
    ------
    DataError
        If it is the memory of another model.
    """
    wiring, numbers = Wiring(block, sample_time), np.asarray(memory, dtype=np.float64)
    if numbers.shape != (wiring.n_numbers,):
        raise DataError(
            f"the memory has {numbers.size} numbers, that of {block.title!r} {wiring.n_numbers}",
            remedy="give the block that was exported",
        )
    states = [numbers[c.first_state :][: c.block.n_states] for c in wiring.calls]
    return np.concatenate([np.empty(0), *states])
