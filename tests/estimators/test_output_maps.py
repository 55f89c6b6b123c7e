"""Output maps: sums of pieces that are rising curves, undone exactly."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from mckibben.blocks.fields import DISPLACEMENT
from mckibben.estimators.hysteresis.output_maps import MAPS

weights = arrays(float, 5, elements=st.floats(1e-3, 10))


@pytest.mark.parametrize("name", MAPS)
@given(weights, st.floats(-5, 5))
def test_block_equals_the_sum_of_the_pieces(name: str, w: np.ndarray, offset: float) -> None:
    family = MAPS[name](5)
    x = np.linspace(0, 1, 41)
    pieces = family.pieces(x)
    w = w[: pieces.shape[1]]
    block = family.build(w, offset, 3.0, 7.0, DISPLACEMENT)
    expected = pieces @ w + offset
    np.testing.assert_allclose(
        block.simulate(3.0 + 4.0 * x), expected, rtol=1e-10, atol=1e-10 * np.abs(w).sum()
    )


@given(weights)
def test_an_increasing_map_increases_and_inverts(w: np.ndarray) -> None:
    block = MAPS["polynomial"](5).build(w, 0.0, 0.0, 1.0, DISPLACEMENT)
    y = block.simulate(np.linspace(0, 1, 101))
    assert np.all(np.diff(y) > 0)
    np.testing.assert_allclose(
        block.simulate(block.inverse().simulate(y)), y, atol=1e-9 * np.ptp(y)
    )


def test_bernstein_pieces_are_integrals_of_bernstein_polynomials() -> None:
    from scipy.stats import binom

    x = np.linspace(0.0, 1.0, 20_001)
    pieces = MAPS["polynomial"](4).pieces(x)
    for k in range(4):
        density = np.asarray(binom.pmf(k, 3, x))
        integral = np.concatenate([[0], np.cumsum(0.5 * (density[1:] + density[:-1]) * np.diff(x))])
        np.testing.assert_allclose(pieces[:, k], integral, atol=1e-8)
