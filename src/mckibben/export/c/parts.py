"""What the C of a block needs: its kernels, its numbers, and how it starts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.errors import ModelError
from mckibben.export.c.language import Kernel


@dataclass(frozen=True)
class Part:
    """A block that is a step and, where it has memory, a start.

    Parameters
    ----------
    block : Block
        What it is.
    coefficients : array
        What its kernels read.
    virgin : bool
        Whether it starts as if nothing had happened before.
    state : array or None
        The starting memory itself, where the model gives it.
    kernels : tuple of callable
        Those of a step, and of the start if it has memory, from which its C is translated.
    """

    block: Block
    coefficients: Array
    virgin: bool
    state: Array | None
    kernels: tuple[Kernel, ...]


def check_single(block: Block) -> None:
    """Refuse places that single precision cannot tell apart.

    Raises
    ------
    ModelError
        If two knots, levels or thresholds that follow one another become one, or the block says that
        it needs more.
    """
    if block.needs_double:
        raise ModelError(
            f"{block.title!r} {block.needs_double}. Remedy: export in double precision."
        )
    for name, places in block.kept_apart():
        if np.any(np.diff(np.array(places, dtype=np.float32)) <= 0) and np.all(np.diff(places) > 0):
            raise ModelError(
                f"{name} of {block.title!r} are too close for single precision. "
                "Remedy: export in double precision, or identify with fewer of them."
            )


def part_of(block: Block, sample_time: float | None) -> Part:
    """Return a block as a part.

    Raises
    ------
    ModelError
        If it has no kernel of a start.
    """
    if not block.c_kernels:
        raise ModelError(
            f"{block.title!r} has no C. Remedy: declare a start_kernel beside its kernel, as blocks of "
            "the package do."
        )
    start, given = block.start, None
    if not isinstance(start, str):
        given = block.initial_state(np.zeros(len(block.inputs)))
    numbers = block.coefficients(sample_time)
    return Part(block, numbers, start == "virgin", given, block.c_kernels)
