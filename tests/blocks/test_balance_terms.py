"""The table of a balance's terms: every number has one place and one label, in Python and in C."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given

from mckibben.blocks.coupled import balance_terms
from mckibben.blocks.coupled.balance import Balance
from mckibben.blocks.coupled.balance_terms import LIMITS, LINEAR, NONLINEAR, TABLE, Sizes
from mckibben.blocks.fields import rows
from mckibben.exporting.c.translator import Translation
from mckibben.muscles.scaling import resized
from tests.blocks.balances import STEP, balances

ANY = balances() | balances(heavy=True) | balances(crowded=True) | balances(crowded=True, driven=1)


@given(ANY)
def test_every_coefficient_has_one_place(block: Balance) -> None:
    places = np.concatenate([each.ravel() for each in block.places.at.values()])
    np.testing.assert_array_equal(np.sort(places), np.arange(LIMITS, block.places.size))
    c = block.coefficients(STEP)
    assert c.shape == (block.places.size,)
    for name in (*LINEAR["coordinate"], *LINEAR["muscle"]):
        if getattr(block, name):
            np.testing.assert_array_equal(
                c[block.places.at[name]].ravel(), np.ravel(getattr(block, name))
            )


def test_sizes_are_named_in_their_order() -> None:
    assert c_names(range(len(Sizes._fields)))[: len(Sizes._fields)] == [
        *("N_MUSCLES", "N_COORDINATES", "N_SCHEDULES", "DEGREE", "N_LOADS", "N_STOPS"),
        *("N_LAGS", "N_ELASTIC", "N_AREAS", "N_OBSTACLES", "N_DRIVEN", "N_MOVES"),
    ]


def c_names(places: range) -> list[str]:
    """Return the first names of the places of the head."""
    named = [(value, name) for name, value in vars(balance_terms).items() if name.isupper()]
    return [next(name for value, name in named if value == place) for place in places]


@given(ANY)
def test_every_parameter_has_a_label_of_its_own(block: Balance) -> None:
    assert len({*block.parameter_names}) == block.n_parameters
    assert {*block.parameters} == {*TABLE} - {
        "lags",
        "places",
        "filling",
        "venting",
        "dead",
        "contact",
    }
    assert {*TABLE} == {*LINEAR["coordinate"], *LINEAR["muscle"], *NONLINEAR}


@given(balances(n=1, n_loads=1))
def test_a_balance_of_another_size_moves_in_proportion(block: Balance) -> None:
    """Twice as long, at three times the pressures on half the area; loads in proportion."""
    block = replace(
        block,
        springs=rows(np.array(block.springs)[:, :2]),
        scheduled=block.scheduled[-1:],
        friction_slopes=(),
        obstacles=(),
    )
    other = resized(block, area=0.5, length=2.0, pressure=3.0)
    inputs = np.random.default_rng(0).uniform(0.0, 4.0, (20, 2))
    found = other.inverse().simulate(inputs * (3.0, 1.5), sample_time=STEP)
    expected = block.inverse().simulate(inputs, sample_time=STEP)
    np.testing.assert_allclose(found, 2.0 * expected, atol=1e-8)


@pytest.mark.kernel
def test_c_reads_coefficients_and_states_by_name() -> None:
    block, text = Balance.example(), Translation()
    for kernel in (*block.c_kernels, *block.inverse().c_kernels):
        text.add(kernel)
    assert "c[N_MUSCLES]" in text.text()
    assert not re.search(r"\bc\[\d+\]", text.text())
    assert not re.search(r"\bstate_size - \d", text.text())
