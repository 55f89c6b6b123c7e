from __future__ import annotations

import numpy as np
import pytest

from mckibben import ModelError
from mckibben.blocks.core.fields import Channel
from mckibben.blocks.coupled.coupling import Coupling
from mckibben.registry import load

CHANNELS = tuple(Channel(f"displacement_{k}", "mm") for k in (1, 2))


def test_printed_gains_have_the_printed_radius() -> None:
    assert load("published", "sdchm-coupling")().radius == pytest.approx(0.456, abs=5e-4)


def test_jacobi_agrees_with_the_direct_solution() -> None:
    block = Coupling.example()
    h = np.array([[10.0, 20.0, 5.0], [0.0, 1.0, -3.0]])
    v = block.inverse().simulate(h)
    np.testing.assert_allclose(block.jacobi(h, tolerance=1e-12), v, atol=1e-10)
    assert np.abs(block.jacobi(h) - v).max() < 0.02


def test_jacobi_refuses_to_diverge_and_solves_directly_instead() -> None:
    block = Coupling(((1.0, 1.5), (1.5, 1.0)), CHANNELS, CHANNELS)
    with pytest.raises(ModelError, match=r"radius is 1\.5.*inverse"):
        block.jacobi([1.0, 2.0])
    h = np.array([[1.0, 2.0]])
    np.testing.assert_allclose(block.simulate(block.inverse().simulate(h)), h)


def test_more_muscles_than_coordinates_are_undone_by_the_least_of_them() -> None:
    tip, muscles = CHANNELS, tuple(Channel(f"shortening_{k}", "mm") for k in (1, 2, 3))
    block = Coupling(((1.0, 0.0), (-0.5, 0.9), (-0.5, -0.9)), muscles, tip)
    h = np.array([[1.0, 2.0], [-3.0, 0.5]])
    v = block.inverse().simulate(h)
    np.testing.assert_allclose(block.simulate(v), h, atol=1e-14)
    np.testing.assert_allclose(v @ [0.9, 0.9, 0.9], 0.0, atol=1e-14)  # they pull together at none
    np.testing.assert_allclose(block.inverse().inverse().simulate(v), h, atol=1e-14)
    with pytest.raises(ModelError, match=r"3 inputs and 2 outputs.*inverse"):
        block.jacobi(h)
