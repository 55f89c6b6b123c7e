"""Plants on which a controller looks better than on the muscle."""

from __future__ import annotations

from mckibben.blocks.bands import inside
from mckibben.blocks.base import Block
from mckibben.control.roles import Plant
from mckibben.control.twin import Twin


def caveats(compensator: Block, plant: Plant, law: str = "feedforward") -> list[str]:
    """Return why the errors of a loop on a twin underestimate those on the muscle."""
    if not isinstance(plant, Twin):
        return []
    notes, model = [], compensator.forward_model
    if model is not None and inside(model).to_dict() == plant.forward.to_dict():
        notes.append(
            "the plant is the model that the compensator inverts, so errors come from limits and rates "
            "alone: test it on another model of the muscle"
        )
    if law != "feedforward" and not plant.forward.rate_dependent:
        notes.append(
            "the plant is a static model, which responds within one sample: feedback performs better on "
            "it than on the muscle; test feedback on a model with dynamics, such as balance fitted to "
            "recordings that have time"
        )
    return notes
