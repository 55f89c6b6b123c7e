"""Fuzzy networks solved for their driven inputs: exact slopes, and Newton's method by differences."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from mckibben.blocks.core.fields import Channel
from mckibben.blocks.coupled.fuzzy_network import FuzzyNetwork
from mckibben.blocks.coupled.fuzzy_rules import contract, sloped_answer

Array = NDArray[np.float64]


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


def sloped(block: FuzzyNetwork, x: Array, scheduling: Array) -> tuple[Array, Array]:
    """Return the outputs and their slopes by the driven inputs, as the inverse computes them."""
    c, m = block.coefficients(None), len(block.driven)
    n, most = len(block.centres), max(map(len, block.centres))
    rules = int(np.prod([len(row) for row in block.centres[:m]]))
    memberships, left = np.empty(n * most), np.empty(rules * m * (m + 1))
    contract(c, m, scheduling, memberships, left)
    y, slopes = np.empty(m), np.empty((m, m))
    sloped_answer(c, left, x, memberships, np.empty(m * most + m), y, slopes)
    return y, slopes


@given(networks, st.integers(0, 1000))
@settings(max_examples=40, deadline=None)
def test_slopes_are_those_of_the_answer(block: FuzzyNetwork, seed: int) -> None:
    rng, m = np.random.default_rng(seed), len(block.driven)
    x, scheduling = rng.uniform(-20.0, 20.0, m), rng.uniform(-5.0, 5.0, len(block.scheduled))
    y, slopes = sloped(block, x, scheduling)
    np.testing.assert_allclose(y, block.simulate([[*x, *scheduling]])[0], atol=1e-11)
    h = 1e-4
    for i in range(m):
        move = h * np.eye(m)[i]
        ends = block.simulate([[*(x + move), *scheduling], [*(x - move), *scheduling]])
        np.testing.assert_allclose(slopes[:, i], (ends[0] - ends[1]) / (2 * h), atol=1e-6)


def solved_by_differences(block: FuzzyNetwork, wanted: Array) -> Array:
    """Return the driven inputs by Newton's method on the whole network, slopes by differences."""
    m, h = len(block.driven), 1e-5
    x, found = np.zeros(m), []
    for row in wanted:
        for _ in range(60):
            tried = np.array([x, *(x + h * np.eye(m))])
            outputs = block.simulate(np.column_stack([tried, np.tile(row[m:], (m + 1, 1))]))
            missed = outputs[0] - row[:m]
            x = x - np.linalg.solve((outputs[1:] - outputs[0]).T / h, missed)
        found.append(x)
    return np.array(found)


@given(networks, st.integers(0, 1000))
@settings(max_examples=15, deadline=None)
def test_the_solution_is_that_of_slopes_by_differences(block: FuzzyNetwork, seed: int) -> None:
    rng, m, n = np.random.default_rng(seed), len(block.driven), 12
    smooth = np.cumsum(rng.uniform(-1.0, 1.0, (n, m)), axis=0)
    scheduling = rng.uniform(-5.0, 5.0, (n, len(block.scheduled)))
    outputs = block.simulate(np.column_stack([smooth, scheduling]))
    wanted = np.column_stack([outputs, scheduling])
    solution = block.inverse().simulate(wanted)
    np.testing.assert_allclose(solution, solved_by_differences(block, wanted), atol=1e-9)
    np.testing.assert_allclose(solution, smooth, atol=1e-9)


@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
def test_references_at_the_ends_of_the_limits_are_reached(share: float) -> None:
    block = network(2, 1, False, 5)
    x = np.array([[-30.0 + 60.0 * share, 30.0 - 60.0 * share]])
    wanted = np.column_stack([block.simulate(np.column_stack([x, [[1.0]]])), [[1.0]]])
    np.testing.assert_allclose(block.inverse().simulate(wanted), x, atol=1e-8)
