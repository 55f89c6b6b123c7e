"""Preisach: against relays counted one by one, and the laws that characterise the model."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from mckibben import ModelError
from mckibben.blocks.preisach_type.krasnoselskii_pokrovskii import KrasnoselskiiPokrovskii
from mckibben.blocks.preisach_type.preisach import DEPTH, Preisach

Array = NDArray[np.float64]
PATHS = st.lists(st.floats(0.0, 5.0), min_size=1, max_size=20)


def relays(model: Preisach, inputs: Array) -> Array:
    """Count relays, one to every cell: they switch at the level above and at the level below."""
    n = len(model.levels) - 1
    cells = [(i, j) for i in range(n) for j in range(i + 1)]
    up = np.zeros(len(cells), dtype=bool)
    outputs = []
    for u in inputs:
        for k, (i, j) in enumerate(cells):
            if u >= model.levels[i + 1]:
                up[k] = True
            elif u <= model.levels[j]:
                up[k] = False
        outputs.append(model.offset + 2 * float(np.array(model.weights)[up].sum()))
    return np.array(outputs)


@given(st.lists(st.integers(0, 5), min_size=2, max_size=60))
@settings(max_examples=100, deadline=None)
def test_at_the_levels_it_is_a_sum_of_relays(places: list[int]) -> None:
    model = Preisach.example()
    inputs = np.array(model.levels)[places]
    np.testing.assert_allclose(model.simulate(inputs), relays(model, inputs), atol=1e-12)


@given(PATHS, st.floats(0.0, 5.0), st.floats(0.0, 5.0), PATHS)
@settings(max_examples=60, deadline=None)
def test_wiping_out(before: list[float], low: float, high: float, inside: list[float]) -> None:
    low, high = min(low, high), max(low, high)
    within = [low + (high - low) * u / 5.0 for u in inside]
    model = Preisach.example()
    plain = model.simulate([*before, high, low, high, 0.0, 5.0])
    looped = model.simulate([*before, high, low, *within, high, 0.0, 5.0])
    np.testing.assert_allclose(looped[-3:], plain[-3:], atol=1e-12)


@given(PATHS, PATHS, st.floats(0.0, 5.0), st.floats(0.0, 5.0), st.floats(0.0, 1.0))
@settings(max_examples=60, deadline=None)
def test_congruency(
    first: list[float], second: list[float], low: float, high: float, share: float
) -> None:
    low, high = min(low, high), max(low, high)
    loop = [high, low, low + share * (high - low), high]
    model = Preisach.example()
    one, other = model.simulate([*first, *loop])[-4:], model.simulate([*second, *loop])[-4:]
    np.testing.assert_allclose((one - one[1])[1:], (other - other[1])[1:], atol=1e-12)


@pytest.mark.parametrize("model", [Preisach.example(), KrasnoselskiiPokrovskii.example()])
def test_return_point_memory(model: Preisach | KrasnoselskiiPokrovskii) -> None:
    y = model.simulate([4.0, 1.0, 3.0, 2.0, 3.0, 1.0, 4.0])
    np.testing.assert_allclose([y[2], y[1], y[0]], [y[4], y[5], y[6]], atol=1e-12)


def test_deep_nests_of_loops_stay_within_the_memory() -> None:
    model = Preisach.example()
    amplitude = np.repeat(np.linspace(2.5, 0.01, DEPTH), 2)
    inputs = 2.5 + amplitude * np.tile([1.0, -1.0], DEPTH)
    out = model.simulate([*inputs, 0.0, 5.0])
    assert np.isfinite(out).all()
    assert out[-1] == pytest.approx(model.simulate([5.0])[0], abs=1e-12)


def test_weights_without_an_inverse_are_refused() -> None:
    model = Preisach.example()
    with pytest.raises(ModelError, match=r"positive on the diagonal.*Remedy"):
        model.unpack([0.0] * (model.n_parameters - 1) + [1.0]).inverse()
    with pytest.raises(ModelError, match="give 15"):
        Preisach(model.levels, (1.0,))
