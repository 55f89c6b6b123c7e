"""Fields of saved models that are not identified, set anew."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest

from mckibben import Block, ModelError, ModelWarning, Series, registry
from mckibben.blocks.force.activation import ActivationPressure
from mckibben.blocks.memoryless import Affine
from mckibben.blocks.setting import settable, with_fields
from mckibben.papers.paper import printed
from tests.refusals import mentions, refused


@pytest.mark.parametrize("kind", registry.names("blocks"))
def test_what_can_be_set_is_a_field_that_is_not_identified(kind: str) -> None:
    block = registry.load("blocks", kind)
    ranges = {ends for ends in block.settable.values() if ends}
    assert {*block.settable, *ranges} <= {field.name for field in fields(block)}
    if isinstance(block.parameters, tuple):  # else of each block its own
        assert not set(block.settable) & set(block.parameters)


def test_it_is_set_in_whichever_part_has_it_and_nothing_else_moves() -> None:
    model = printed("activation-pressure-profile")
    pressure = model.outputs[0]
    whole = Series((model, Affine(2.0, 0.0, pressure, pressure)))
    faster = with_fields(whole, {"frequency": 2})
    assert settable(faster) == settable(whole) | {"frequency": 2.0}
    assert with_fields(faster, {"frequency": 1.0}) == whole
    given = np.column_stack([np.linspace(0.0, 0.2, 50), np.full(50, 100.0)])
    rates = [
        one.simulate(given, sample_time=0.01) - with_still(one).simulate(given, sample_time=0.01)
        for one in (whole, faster)
    ]
    np.testing.assert_allclose(rates[1] * (0.267 + 0.667), rates[0] * (2 * 0.267 + 0.667))


def with_still(model: Block) -> Series:
    """Return the model without its term in the rate."""
    assert isinstance(model, Series)
    first = model.parts[0]
    assert isinstance(first, ActivationPressure)
    still = ActivationPressure(first.contractions, first.pressures, (0.0,) * 4, (0.0, 0.0), 1.0)
    return Series((still, *model.parts[1:]))


def test_beyond_what_was_identified_it_warns_and_what_was_is_refused() -> None:
    model = printed("activation-pressure-profile")
    with pytest.warns(ModelWarning) as caught:
        with_fields(model, {"frequency": 3.0})
    assert mentions(str(caught[0].message), ("frequency", "3.00", "0.500", "2.00"))
    with refused(ModelError, parameter="gamma", names=("frequency", "rate_time_constant")):
        with_fields(model, {"gamma": (0.0, 1.0)})
    with refused(ModelError, parameter="frequency", names=("'activation-pressure'", 0, -1.0)):
        with_fields(model, {"frequency": -1.0})
    with refused(ModelError, parameter="frequency", names="'affine'"):
        with_fields(Affine.example(), {"frequency": 1.0})
