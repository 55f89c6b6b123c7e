"""The laws of generalised Prandtl-Ishlinskii models under every kind of envelope."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from numpy.typing import NDArray

from mckibben import GPI, PI, ModelError, ModelWarning
from mckibben.blocks.core.fields import vector
from mckibben.blocks.play_type.envelopes.exponential import Exponential
from mckibben.blocks.play_type.envelopes.piecewise_linear import PiecewiseLinear
from mckibben.blocks.play_type.envelopes.tanh import Tanh
from mckibben.blocks.play_type.gpi import gpi_matrix
from tests.blocks.strategies import HIGH, LOW, gpi_models, numbers, paths, pi_models

Array = NDArray[np.float64]


def scale(model: GPI) -> float:
    """Return the size against which errors of the output count."""
    edges = float(np.ptp([*model.rising([LOW, HIGH]), *model.falling([LOW, HIGH])]))
    return float(np.abs(model.weights).sum()) * edges


@given(gpi_models(), paths(0.1, 4.9))
def test_model_undoes_its_inverse(model: GPI, u: Array) -> None:
    references = model.simulate(u)
    recovered = model.inverse().simulate(references)
    error = np.abs(model.simulate(recovered) - references).max()
    assert error <= 1e-9 * scale(model)


@given(gpi_models(), paths(0.0, 1.0))
def test_model_undoes_its_inverse_over_all_that_is_reachable(model: GPI, share: Array) -> None:
    """References that no input was thought of for, anywhere in the reachable set."""
    low, high = (float(end[0]) for end in model.reachable())
    if high <= low:
        return
    references = low + (0.02 + 0.96 * share) * (high - low)
    recovered = model.inverse().simulate(references)
    assert recovered.min() >= LOW
    assert recovered.max() <= HIGH
    error = np.abs(model.simulate(recovered) - references).max()
    assert error <= 1e-9 * scale(model)


@given(gpi_models(), paths(0.1, 4.9), paths(0.1, 4.9))
def test_inverse_goes_on_from_where_the_model_is(model: GPI, before: Array, after: Array) -> None:
    stream = model.stream()
    for u in before:
        stream.step(u)
    state = stream.state.tolist()
    references = model.simulate(after, initial=state)
    recovered = model.inverse().simulate(references, initial=state)
    error = np.abs(model.simulate(recovered, initial=state) - references).max()
    assert error <= 1e-9 * scale(model)


@given(gpi_models(), paths(1.0, 4.0))
def test_wiping_out(model: GPI, inner: Array) -> None:
    after = [5.0, 0.0, 2.0, 0.5]
    framed = model.simulate(np.concatenate([[0.0, 5.0], inner, after]))
    plain = model.simulate(np.array([0.0, 5.0, *after]))
    np.testing.assert_array_equal(framed[-4:], plain[-4:])


@given(gpi_models(), paths(), paths(), numbers(0.5, 2.0), numbers(2.5, 4.5))
def test_congruency(model: GPI, one: Array, other: Array, low: float, high: float) -> None:
    loop = np.concatenate([np.linspace(low, high, 20), np.linspace(high, low, 20)])
    shapes = []
    for history in (one, other):
        outputs = model.simulate(np.concatenate([history, loop, loop]))[-loop.size :]
        shapes.append(outputs - outputs[0])
    np.testing.assert_allclose(shapes[0], shapes[1], atol=1e-9)


@given(gpi_models(), paths(), numbers(0.5, 2.0), numbers(2.5, 4.5))
def test_return_point_memory(model: GPI, history: Array, low: float, high: float) -> None:
    outputs = model.simulate(np.concatenate([history, [low, high, low, high]]))
    assert abs(outputs[-1] - outputs[-3]) <= 1e-12 * scale(model)


@given(gpi_models(), paths())
def test_pace_does_not_matter(model: GPI, u: Array) -> None:
    slow = model.simulate(np.repeat(u, 3))
    np.testing.assert_array_equal(slow[::3], model.simulate(u))


@given(gpi_models(), paths())
def test_output_rises_and_falls_with_the_input(model: GPI, u: Array) -> None:
    steps, changes = np.diff(u), np.diff(model.simulate(u))
    tolerance = 1e-12 * scale(model)
    assert (changes[steps > 0] >= -tolerance).all()
    assert (changes[steps < 0] <= tolerance).all()


@given(gpi_models(), paths())
def test_operators_side_by_side_are_the_model(model: GPI, u: Array) -> None:
    r, w = np.array(model.thresholds), np.array(model.weights)
    rising, falling = model.rising(u), model.falling(u)
    operators = np.empty((u.size, r.size))
    gpi_matrix(u, rising, falling, r, rising[0] - r, operators)
    np.testing.assert_allclose(operators @ w, model.simulate(u), atol=1e-12 * scale(model))


@given(pi_models(), paths())
def test_identical_straight_envelopes_give_the_classical_model(model: PI, u: Array) -> None:
    straight = PiecewiseLinear((LOW, HIGH), (LOW, HIGH))
    general = GPI(model.thresholds, model.weights, straight, straight, (LOW, HIGH))
    expected = model.simulate(u) - model.offset
    np.testing.assert_allclose(general.simulate(u), expected, atol=1e-10)


@given(gpi_models(), paths())
def test_reachable_is_reached_whatever_happened_before(model: GPI, history: Array) -> None:
    low, high = (float(end[0]) for end in model.reachable())
    lowest = model.simulate(np.concatenate([history, [LOW]]))[-1]
    highest = model.simulate(np.concatenate([history, [HIGH]]))[-1]
    assert lowest <= low + 1e-9 * scale(model)
    assert highest >= high - 1e-9 * scale(model)


def test_references_out_of_reach_are_clipped_and_forgotten() -> None:
    model = GPI.example()
    low, high = (float(end[0]) for end in model.reachable())
    references = np.array([low + 1, high + 5, high + 9, high - 1, low - 1, low - 1, low + 2])
    with pytest.warns(ModelWarning, match=r"4 sample\(s\) of the reference 'displacement'"):
        recovered = model.inverse().simulate(references)
    assert recovered[[1, 2, 4, 5]].tolist() == [5.0, 5.0, 0.0, 0.0]
    outputs = model.simulate(recovered)
    np.testing.assert_allclose(outputs[[0, 3, 6]], references[[0, 3, 6]], rtol=1e-12)


def test_touching_the_limits_is_not_being_clipped() -> None:
    model = GPI.example()
    for u in ([0.0, 5.0, 0.0, 5.0], [0.0, 5.0, 5.0, 4.0], [5.0, 0.0, 0.0, 0.3, 0.0, 5.0]):
        references = model.simulate(u)
        recovered = model.inverse().simulate(references)
        np.testing.assert_allclose(model.simulate(recovered), references, atol=1e-12)


def test_held_reference_holds_the_input() -> None:
    """Rounding must not be taken for a reversal, on which the input jumps across the dead zone."""
    model = GPI.example()
    u = np.concatenate([np.linspace(0.5, 4.5, 40), np.linspace(4.5, 1.0, 40), np.full(500, 1.0)])
    recovered = model.inverse().simulate(model.simulate(u))
    assert np.ptp(recovered[-500:]) == 0.0


@pytest.mark.parametrize(
    ("rising", "falling"),
    [
        (Tanh(0.5, -1.0, 0.1), Tanh(0.5, -1.0, 0.0)),
        (Exponential(0.4, 0.1), Exponential(0.3, 0.1)),
        (
            PiecewiseLinear((0.0, 5.0), (0.0, 1.0)),
            PiecewiseLinear((0.0, 2.0, 5.0), (0.0, 0.3, 1.0)),
        ),
    ],
)
def test_crossed_envelopes_have_no_inverse(rising: Tanh, falling: Tanh) -> None:
    with pytest.raises(ModelError, match=r"no inverse: at .* bar its falling envelope.*Remedy:"):
        GPI((0.0, 0.1), (1.0, 1.0), rising, falling, (LOW, HIGH)).inverse()


def test_says_why_there_is_no_inverse() -> None:
    envelopes = Tanh.examples()
    with pytest.raises(ModelError, match=r"smallest threshold is 0.1.*Remedy:"):
        GPI((0.1, 0.2), (1.0, 1.0), *envelopes, (LOW, HIGH)).inverse()
    with pytest.raises(ModelError, match=r"weights 0 to 1 add up to -1.*Remedy:"):
        GPI((0.0, 0.2), (1.0, -2.0), *envelopes, (LOW, HIGH)).inverse()


@pytest.mark.parametrize("factor", [1e-9, 1e-3, 1e6])
def test_any_unit_of_the_output_will_do(factor: float) -> None:
    plain = GPI.example()
    weights = vector(factor * np.array(plain.weights))
    model = GPI(plain.thresholds, weights, plain.rising, plain.falling, plain.input_range)
    u = np.concatenate([np.linspace(0.2, 4, 50), np.linspace(4, 1, 40), np.linspace(1, 3, 30)])
    references = model.simulate(u)
    error = np.abs(model.simulate(model.inverse().simulate(references)) - references).max()
    assert error <= 1e-12 * np.ptp(references)
