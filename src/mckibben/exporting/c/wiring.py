"""Compositions flattened to calls of blocks on signals, in order."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.compose import Layout
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


class Wiring:
    """The calls of a step, in order, as in the C code.

    Parameters
    ----------
    block : Block
        The model.
    sample_time : float or None
        Time between steps [s].

    Raises
    ------
    ModelError
        If a part has no kernel of a start.
    """

    def __init__(self, block: Block, sample_time: float | None) -> None:
        layout, n = Layout(block, from_rest=True), len(block.inputs)

        def named(signals: Iterable[int]) -> tuple[str, ...]:
            return tuple(f"in[{k}]" if k < n else f"signals[{k - n}]" for k in signals)

        self.steps: list[Call | Sum] = []
        self.outputs, self.n_signals = list(named(layout.given)), layout.n_signals - n
        self.memory_size, self.clip_counts = 0, list[int]()
        for step in layout.steps:
            part, input_names, first = step.block, named(step.taken), step.given[0] - n
            if part is None:
                self.steps.append(Sum(input_names, first))
                continue
            coefficients = part.coefficients(sample_time)
            if not part.c_kernels:
                raise ModelError(
                    f"{part.title!r} has no C",
                    remedy="declare a start_kernel with its kernel, as blocks of the package do",
                )
            state = step.state
            if state is None and not isinstance(part.start, str):
                state = part.initial_state(np.zeros(len(part.inputs)), sample_time=sample_time)
            self.clip_counts += [self.memory_size + place for place in part.clip_counts]
            if state is not None:  # what was clipped before is not counted again
                state = state.copy()
                state[[*part.clip_counts]] = 0.0
            self.steps.append(Call(part, coefficients, state, input_names, first, self.memory_size))
            self.memory_size += part.n_states + part.n_scratch
        self.calls = [step for step in self.steps if isinstance(step, Call)]


def state_of(block: Block, memory: ArrayLike, sample_time: float | None) -> Array:
    """Return the state of a block as stored by its C code, without working memory.

    Parameters
    ----------
    block : Block
        What was exported.
    memory : array-like, shape (memory_size,)
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
    if numbers.shape != (wiring.memory_size,):
        raise DataError(
            f"the memory has {numbers.size} numbers, that of {block.title!r} {wiring.memory_size}",
            remedy="give the block that was exported",
        )
    states = [numbers[c.first_state :][: c.block.n_states] for c in wiring.calls]
    return np.concatenate([np.empty(0), *states])
