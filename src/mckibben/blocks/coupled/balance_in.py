"""Where in a model its balance of forces is."""

from __future__ import annotations

from typing import NamedTuple

from mckibben.blocks.base import Block
from mckibben.blocks.compose import Series
from mckibben.blocks.coupled.balance import Balance
from mckibben.blocks.inverse import Inverse


class Placed(NamedTuple):
    """A balance, whether the model solves it for displacements, and what comes before and behind."""

    balance: Balance
    solved: bool
    before: tuple[Block, ...]
    behind: tuple[Block, ...]


def balance_in(model: Block) -> Placed | None:
    """Return the balance of a model, a compensator or its inverse; None if it has none."""
    parts = model.parts if isinstance(model, Series) else (model,)
    for place, part in enumerate(parts):
        solved = isinstance(part, Inverse)
        balance = part.forward if isinstance(part, Inverse) else part
        if isinstance(balance, Balance):
            return Placed(balance, solved, parts[:place], parts[place + 1 :])
    return None
