"""Coupling of several muscles, linear and by fuzzy networks, and what drove them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from mckibben import ModelError
from mckibben.blocks.core.fields import Channel
from mckibben.blocks.coupled.coupling import Coupling
from mckibben.blocks.coupled.fuzzy_network import FuzzyNetwork

Array = NDArray[np.float64]


# -- gains ---------------------------------------------------------------------------------------


CHANNELS = tuple(Channel(f"displacement_{k}", "mm") for k in (1, 2))


def test_jacobi_agrees_with_the_direct_solution() -> None:
    block = Coupling.example()
    h = np.array([[10.0, 20.0, 5.0], [0.0, 1.0, -3.0]])
    v = block.inverse().simulate(h)
    np.testing.assert_allclose(block.jacobi(h, tolerance=1e-12), v, atol=1e-10)
    assert np.abs(block.jacobi(h) - v).max() < 0.02


def test_more_muscles_than_coordinates_are_undone_by_the_least_of_them() -> None:
    tip, muscles = CHANNELS, tuple(Channel(f"shortening_{k}", "mm") for k in (1, 2, 3))
    block = Coupling(((1.0, 0.0), (-0.5, 0.9), (-0.5, -0.9)), muscles, tip)
    h = np.array([[1.0, 2.0], [-3.0, 0.5]])
    v = block.inverse().simulate(h)
    np.testing.assert_allclose(block.simulate(v), h, atol=1e-14)
    np.testing.assert_allclose(v @ [0.9, 0.9, 0.9], 0.0, atol=1e-14)  # they pull together at none
    np.testing.assert_allclose(block.inverse().inverse().simulate(v), h, atol=1e-14)
    with pytest.raises(ModelError, match="3 inputs and 2 outputs"):
        block.jacobi(h)


# -- networks ------------------------------------------------------------------------------------


def network(m: int, scheduled: int, constants: bool, seed: int) -> FuzzyNetwork:
    """Return a network of m muscles that mostly drive their own output, of sets of unlike numbers."""
    rng = np.random.default_rng(seed)
    sets = [int(rng.integers(1, 4)) for _ in range(m + scheduled)]
    width = m + scheduled + constants
    rows = 0.08 * rng.standard_normal((int(np.prod(sets)), m, width))
    rows[:, range(m), range(m)] += 2.0
    return FuzzyNetwork(
        tuple(tuple(np.sort(rng.uniform(-10.0, 10.0, n)).tolist()) for n in sets),
        tuple(tuple(rng.uniform(8.0, 15.0, n).tolist()) for n in sets),
        tuple(rows.ravel().tolist()),
        tuple(Channel(f"free_{k}", "mm") for k in range(m)),
        tuple(Channel(f"displacement_{k}", "mm") for k in range(m)),
        tuple(Channel(f"extensor_{k}", "bar") for k in range(scheduled)),
        constants,
        ((-30.0, 30.0),) * m,
    )


networks = st.builds(
    network, st.integers(1, 3), st.integers(0, 2), st.booleans(), st.integers(0, 1000)
)


@given(networks, st.integers(0, 1000))
@settings(max_examples=30, deadline=None)
def test_what_drove_a_network_is_found(block: FuzzyNetwork, seed: int) -> None:
    rng, m, n = np.random.default_rng(seed), len(block.driven), 12
    smooth = np.cumsum(rng.uniform(-1.0, 1.0, (n, m)), axis=0)
    scheduling = rng.uniform(-5.0, 5.0, (n, len(block.scheduled)))
    outputs = block.simulate(np.column_stack([smooth, scheduling]))
    found = block.inverse().simulate(np.column_stack([outputs, scheduling]))
    np.testing.assert_allclose(found, smooth, atol=1e-9)


@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
def test_references_at_the_ends_of_the_limits_are_reached(share: float) -> None:
    block = network(2, 1, False, 5)
    x = np.array([[-30.0 + 60.0 * share, 30.0 - 60.0 * share]])
    wanted = np.column_stack([block.simulate(np.column_stack([x, [[1.0]]])), [[1.0]]])
    np.testing.assert_allclose(block.inverse().simulate(wanted), x, atol=1e-8)
