"""Whether a model can be undone, and how, in a word."""

from __future__ import annotations

from typing import Literal

from mckibben.blocks.core.block import Block
from mckibben.blocks.core.inverse import Inverse

Kind = Literal["exact", "solved", "none"]


def inverse_of(inverse: Block | None) -> Kind:
    """Return how an inverse is found: by a formula, by solving in every step, or not at all.

    Parameters
    ----------
    inverse : Block or None
        Of a model; None where it has none.
    """
    if inverse is None:
        return "none"
    return "solved" if _solves(inverse) else "exact"


def _solves(block: Block) -> bool:
    if isinstance(block, Inverse):
        return block.forward.inverse_kind == "solved"
    parts = [getattr(block, name, None) for name in block.parameters]
    nested = [part for some in parts for part in (some if isinstance(some, tuple) else (some,))]
    return any(_solves(part) for part in nested if isinstance(part, Block))
