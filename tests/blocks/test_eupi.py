"""Extended unparallel Prandtl-Ishlinskii models: what they contain, and their inverse."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from numpy.typing import NDArray

from mckibben import EUPI, PI, ModelError, ModelWarning
from mckibben.blocks.play_type.eupi import eupi_matrix
from tests.blocks.strategies import HIGH, LOW, eupi_models, paths, pi_models

Array = NDArray[np.float64]


def scale(model: EUPI) -> float:
    """Return the size against which errors of the output count."""
    a1, a2, a3 = map(abs, model.polynomial)
    span = HIGH - LOW
    smooth = a1 * span + a2 * span**2 + a3 * span**3
    return smooth + sum(model.weights) * 2 * span


@given(eupi_models(), paths(0.1, 4.9))
def test_model_undoes_its_inverse(model: EUPI, u: Array) -> None:
    references = model.simulate(u)
    recovered = model.inverse().simulate(references)
    error = np.abs(model.simulate(recovered) - references).max()
    assert error <= 1e-9 * scale(model)
    assert np.abs(recovered - u).max() <= 1e-7


@given(eupi_models(), paths(0.1, 4.9), paths(0.1, 4.9))
def test_inverse_goes_on_from_where_the_model_is(model: EUPI, before: Array, after: Array) -> None:
    stream = model.stream()
    for u in before:
        stream.step(u)
    state = stream.state.tolist()
    references = model.simulate(after, initial=state)
    recovered = model.inverse().simulate(references, initial=state)
    error = np.abs(model.simulate(recovered, initial=state) - references).max()
    assert error <= 1e-9 * scale(model)


@given(pi_models(), paths())
def test_contains_the_classical_model(model: PI, u: Array) -> None:
    same = EUPI(model.thresholds, model.weights, 1.0, 1.0, (0.0, 0.0, 0.0), 0.0, (LOW, HIGH))
    expected = model.simulate(u) - model.offset
    np.testing.assert_allclose(same.simulate(u), expected, atol=1e-12)


@given(eupi_models(), paths())
def test_polynomial_has_no_memory(model: EUPI, u: Array) -> None:
    bare = replace(model, polynomial=(0.0, 0.0, 0.0))
    a1, a2, a3 = model.polynomial
    expected = bare.simulate(u) + a1 * u + a2 * u**2 + a3 * u**3
    np.testing.assert_allclose(model.simulate(u), expected, atol=1e-12 * (1 + scale(model)))


@given(eupi_models(), paths())
def test_operators_side_by_side_are_the_model(model: EUPI, u: Array) -> None:
    bare = replace(model, polynomial=(0.0, 0.0, 0.0), offset=0.0)
    r = np.array(model.thresholds)
    operators = np.empty((u.size, r.size))
    edges = model.falling_slope, model.falling_threshold
    eupi_matrix(u - LOW, *edges, r, u[0] - LOW - r, operators)
    expected = bare.simulate(u)
    np.testing.assert_allclose(operators @ model.weights, expected, atol=1e-12 * scale(model))


@given(eupi_models(), paths())
def test_reachable_is_reached_whatever_happened_before(model: EUPI, history: Array) -> None:
    low, high = (float(end[0]) for end in model.reachable())
    lowest = model.simulate(np.concatenate([history, [LOW]]))[-1]
    highest = model.simulate(np.concatenate([history, [HIGH]]))[-1]
    assert lowest <= low + 1e-9 * scale(model)
    assert highest >= high - 1e-9 * scale(model)


def test_edges_by_hand() -> None:
    """Rises along x - 1; falls along 2 x + 0.5 once it meets it."""
    model = EUPI((1.0,), (1.0,), 2.0, 0.5, (0.0, 0.0, 0.0), 0.0, (0.0, 5.0))
    assert model.simulate([0.0, 4.0, 2.0, 1.0, 0.5, 3.0]).tolist() == [-1, 3, 3, 2.5, 1.5, 2]


def test_touching_the_limits_is_not_being_clipped() -> None:
    model = EUPI.example()
    for u in ([0.0, 5.0, 0.0, 5.0], [0.0, 5.0, 5.0, 4.0], [5.0, 0.0, 0.0, 0.3, 0.0, 5.0]):
        references = model.simulate(u)
        recovered = model.inverse().simulate(references)
        np.testing.assert_allclose(model.simulate(recovered), references, atol=1e-12)


def test_references_out_of_reach_are_clipped_and_forgotten() -> None:
    model = EUPI.example()
    low, high = (float(end[0]) for end in model.reachable())
    references = np.array([low + 1, high + 5, high + 9, high - 1, low - 1, low - 1, low + 2])
    with pytest.warns(ModelWarning, match=r"4 sample\(s\) of the reference 'displacement'"):
        recovered = model.inverse().simulate(references)
    outputs = model.simulate(recovered)
    np.testing.assert_allclose(outputs[[0, 3, 6]], references[[0, 3, 6]], rtol=1e-10)


@pytest.mark.parametrize(
    ("weights", "polynomial"),
    [((1.0, -0.5), (1.0, 0.0, 0.0)), ((0.0, 1.0), (0.0, 0.0, 0.0)), ((0.0, 1.0), (1.0, -0.2, 0.0))],
)
def test_says_why_there_is_no_inverse(
    weights: tuple[float, float], polynomial: tuple[float, float, float]
) -> None:
    with pytest.raises(ModelError, match=r"'eupi' has no inverse.*Remedy:"):
        EUPI((0.0, 0.5), weights, 1.0, 1.0, polynomial, 0.0, (LOW, HIGH)).inverse()


@pytest.mark.parametrize(("alpha", "beta"), [(0.0, 1.0), (-1.0, 1.0), (1.0, -0.1)])
def test_refuses_edges_that_make_no_sense(alpha: float, beta: float) -> None:
    with pytest.raises(ModelError, match=r"falling_.* of 'eupi'.*Remedy:"):
        EUPI((0.0,), (1.0,), alpha, beta, (0.0, 0.0, 0.0), 0.0, (LOW, HIGH))
