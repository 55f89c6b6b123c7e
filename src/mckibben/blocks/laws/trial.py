"""Random trials of a block: inputs that wander with minor loops and holds, and demands on it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.fields import Initial
from mckibben.errors import ContractError, ModelError

DEFAULT_LIMITS = (0.0, 5.0)
"""Inputs to try where a block names no input range of its own."""

MARGIN = 0.02
"""Share of a range left out at both ends, so that rounding does not decide what is reachable."""


@dataclass
class Trial:
    """A block, inputs to try it on, and what it makes of them.

    Parameters
    ----------
    block : Block
        What is tried.
    sample_time : float
        Time between samples [s].
    inputs : array, shape (n, n_inputs)
        A path with minor loops and holds.
    rng : Generator
        Where chance comes from.
    pace : int
        Samples from one turning point to the next, on average.
    """

    block: Block
    sample_time: float
    inputs: Array
    rng: np.random.Generator
    pace: int

    def __post_init__(self) -> None:
        self.outputs = self.run(self.inputs)
        # where outputs hardly move, rounding of their size is all there is to see
        least = 1e-4 * np.abs(self.outputs).max(axis=0) + np.finfo(float).tiny
        self.span = np.maximum(np.ptp(self.outputs, axis=0), least)
        self.n_driven = len(self.block.inputs) - len(self.block.scheduling)

    @classmethod
    def of(cls, block: Block, sample_time: float, seed: int, n_turns: int = 24) -> Trial:
        """Return a trial on random inputs, slower where the rate matters."""
        rng = np.random.default_rng(seed)
        pace = 200 if block.rate_dependent else 12
        inputs = wander(*input_limits(block), rng, pace, n_turns)
        return cls(block, sample_time, inputs, rng, pace)

    def run(self, inputs: Array, initial: Initial | None = None) -> Array:
        """Simulate the block over other inputs, shape (n, n_inputs)."""
        return self.block.simulate(inputs, initial=initial, sample_time=self.sample_time)

    def demand(self, holds: bool, law: str) -> None:
        """Raise a `ContractError` that names the law, unless it holds."""
        if not holds:
            raise ContractError(
                f"{self.block.kind!r} breaks the contract of blocks: {law}. "
                "Remedy: mend the block; mckibben.check_block lists the laws."
            )

    def agree(self, outputs: Array, references: Array, tolerance: float, law: str) -> None:
        """Demand outputs near references, relative to the range of the block's outputs."""
        error = np.abs(outputs - references)
        holds = bool((error <= tolerance * self.span).all())
        self.demand(holds, f"{law} (the error is {error.max():.3g})")

    def refused(
        self, kind: type[Exception], about: str, attempt: Callable[..., object], *given: object
    ) -> None:
        """Demand that an attempt raises an error of a kind whose text names what it is about."""
        try:
            attempt(*given)
        except kind as error:
            told = about in str(error) and "Remedy:" in str(error)
            self.demand(told, f"{str(error)!r} names {about!r} and ends with a remedy")
        else:
            self.demand(False, f"bad input raises a {kind.__name__} ({about})")


def input_limits(block: Block) -> tuple[Array, Array]:
    """Return the lowest and highest of every input to try a block on, each of shape (n_inputs,)."""
    lowest = np.full(len(block.inputs), DEFAULT_LIMITS[0])
    highest = np.full(len(block.inputs), DEFAULT_LIMITS[1])
    driven = slice(0, len(block.inputs) - len(block.scheduling))
    if hasattr(block, "input_range"):
        low, high = np.array([block.input_limits[0]]), np.array([block.input_limits[1]])
    else:
        try:
            low, high = block.inverse().reachable()
        except ModelError:
            return lowest, highest
    with np.errstate(over="ignore", invalid="ignore"):
        known = np.isfinite(high - low)
    lowest[driven] = np.where(known, low, lowest[driven])
    highest[driven] = np.where(known, high, highest[driven])
    return narrowed(lowest, highest)


def narrowed(lowest: Array, highest: Array) -> tuple[Array, Array]:
    """Return a range without its margins."""
    margin = MARGIN * (highest - lowest)
    return lowest + margin, highest - margin


def wander(
    lowest: Array, highest: Array, rng: np.random.Generator, pace: int, n_turns: int = 24
) -> Array:
    """Return a path between random turning points, shape (n, n_channels), with a hold at each.

    Parameters
    ----------
    lowest, highest : array, shape (n_channels,)
        Range of the turning points.
    rng : Generator
        Where chance comes from.
    pace : int
        Samples from one turning point to the next, on average.
    n_turns : int
        Number of turning points.
    """
    turns = rng.uniform(lowest, highest, (n_turns, lowest.size))
    return through(turns, rng.integers(pace // 2, pace * 3 // 2 + 1, n_turns - 1))


def through(turns: Array, samples: NDArray[np.int64]) -> Array:
    """Return straight lines through turning points, so many samples each, with a hold at each."""
    corners = np.concatenate([[0], np.cumsum(samples + 1)])
    places = np.sort(np.concatenate([corners, corners[1:-1] + 1]))
    values = np.insert(turns, np.arange(1, len(turns) - 1), turns[1:-1], axis=0)
    grid = np.arange(places[-1] + 1)
    return np.column_stack([np.interp(grid, places, column) for column in values.T])
