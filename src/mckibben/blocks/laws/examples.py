"""One block of every kind, and of every inverse that one declares, to try laws and exporters on."""

from __future__ import annotations

from mckibben.blocks.base import Block
from mckibben.blocks.inverse import Invertible
from mckibben.registry import load, names


def examples() -> dict[str, Block]:
    """Return the examples of all registered blocks and their inverses, by title, in its order."""
    blocks: list[Block] = [load("blocks", kind).example() for kind in names("blocks")]
    blocks += [block.inverse() for block in blocks if isinstance(block, Invertible)]
    found = {block.title: block for block in blocks}
    return {title: found[title] for title in sorted(found)}
