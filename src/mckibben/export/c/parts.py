"""What a primitive of C needs to know of a block: its numbers, its sizes, and how it starts.

A block says all of it itself, see `mckibben.blocks.core.exportable`.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.core.block import Block
from mckibben.errors import ModelError

PRIMITIVES = Path(__file__).parent / "primitives"

RULES = {
    "first_sample": "MCK_FIRST_SAMPLE",
    "virgin": "MCK_VIRGIN",
    "fitted": "MCK_FIRST_SAMPLE",
}
"""Starting memories, by what C calls them; no outputs are known there to fit one to."""


@dataclass(frozen=True)
class Part:
    """A block that is one primitive of C.

    Parameters
    ----------
    block : Block
        What it is.
    function : str
        Start of its functions' names, behind ``mck_``.
    source : Path
        Where its C is; the header is beside it.
    coefficients : array
        Numbers, in the order that the header says.
    rule : str
        Macro of its starting memory.
    state : array or None
        The starting memory itself, where the model gives it.
    """

    block: Block
    function: str
    source: Path
    coefficients: Array
    rule: str
    state: Array | None


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
        If no C has been written for it.
    """
    beside = block.c_file
    sources = [path for path in (PRIMITIVES / beside.name, beside) if path.is_file()]
    if not sources:
        raise ModelError(
            f"{block.title!r} has no C. Remedy: write {beside.name} and its header beside the block, as "
            "those of the package are."
        )
    function, start = block.title.replace("-", "_"), block.start
    explicit = None
    if not isinstance(start, str):
        explicit, start = block.initial_state(np.zeros(len(block.inputs))), "first_sample"
    numbers = block.c_numbers(sample_time)
    return Part(block, function, sources[0], numbers, RULES[start], explicit)
