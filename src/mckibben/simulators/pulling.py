"""What a fitted muscle pulls with: a block's force, by where the muscle is and its pressure."""

from __future__ import annotations

from dataclasses import dataclass

from mckibben.blocks.base import Block
from mckibben.blocks.compose import Composition
from mckibben.blocks.coupled.balance import balance_in
from mckibben.blocks.coupled.load_estimate import LoadEstimate, load_of
from mckibben.errors import ModelError

ALONG = {"displacement": "mm", "length": "mm"}
"""Where a muscle is: how much shorter than at rest, or how long."""


@dataclass(frozen=True)
class Pulling:
    """A block that gives the force with which a muscle pulls.

    Parameters
    ----------
    block : Block
        Of two inputs, where the muscle is and its pressure, to one force.
    share : float
        Pull by what the block gives.
    along, pressure : int
        Places of the inputs.
    shortening : bool
        Whether the muscle's place is told by how much it has shortened, or else by its length.
    """

    block: Block
    share: float
    along: int
    pressure: int
    shortening: bool


def pulling(model: Block) -> Pulling:
    """Return what a model says of a muscle's pull.

    Parameters
    ----------
    model : Block
        One that gives a force in N by length or displacement in mm and pressure in bar (``force-...``,
        ``multistate``, ``balance-force``), or a ``balance`` of one muscle that was identified under a
        measured load.

    Raises
    ------
    ModelError
        If the model tells no force, or needs more than a muscle's place and pressure.
    """
    block = load_of(model) if balance_in(model) is not None else model
    units = [channel.unit for channel in block.inputs]
    stems = [channel.name.partition("_")[0] for channel in block.inputs]
    along = [k for k, stem in enumerate(stems) if ALONG.get(stem) == units[k]]
    pressure = [k for k, stem in enumerate(stems) if stem == "pressure" and units[k] == "bar"]
    gives = [channel.unit for channel in block.outputs]
    if len(units) != 2 or len(along) != 1 or len(pressure) != 1 or gives != ["N"]:
        told = ", ".join(f"{channel.name} [{channel.unit or 1}]" for channel in block.inputs)
        raise ModelError(
            f"{model.title!r} does not give a muscle's force from its position and pressure: "
            f"it takes {told}",
            remedy="identify 'balance' on recordings with a measured force, 'multistate' or "
            "a force law",
        )
    estimate = _estimate_in(block)
    share = 1.0
    if estimate is not None:
        if any(estimate.forward.mass):
            raise ModelError(
                "the balance has a mass of its own, which belongs to the simulator's bodies",
                remedy="identify it without mass",
            )
        share = estimate.forward.loads[0][0]
    return Pulling(block, share, along[0], pressure[0], stems[along[0]] == "displacement")


def _estimate_in(block: Block) -> LoadEstimate | None:
    parts = block.parts if isinstance(block, Composition) else (block,)
    return next((part for part in parts if isinstance(part, LoadEstimate)), None)
