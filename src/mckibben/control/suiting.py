"""What a loop on a plant tells about the muscle."""

from __future__ import annotations

from typing import Literal

from mckibben.blocks.bands import inside
from mckibben.blocks.base import Block
from mckibben.control.roles import Plant
from mckibben.control.twin import Twin

Kind = Literal["rig", "same model", "another model"]
"""A virtual rig; the model that a compensator inverts; or another model."""


def kind_of(plant: Plant, compensator: Block) -> Kind:
    """Return what kind of plant a compensator is tested on.

    Errors on the same model come from limits, rates and rounding alone, whatever the muscle does.
    """
    if not isinstance(plant, Twin):
        return "rig"
    model = compensator.forward_model
    same = model is not None and inside(model).to_dict() == plant.forward.to_dict()
    return "same model" if same else "another model"


def flatters_feedback(plant: Plant, law: str) -> bool:
    """Return whether feedback performs better on a plant than on a muscle: it responds at once."""
    return isinstance(plant, Twin) and law != "feedforward" and not plant.forward.rate_dependent
