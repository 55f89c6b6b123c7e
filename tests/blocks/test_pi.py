"""The laws of Prandtl-Ishlinskii models, and their inverse against the textbook's closed form."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from numpy.typing import NDArray

from mckibben import PI, ModelError, ModelWarning
from mckibben.blocks.core.fields import vector
from tests.blocks.strategies import HIGH, LOW, numbers, paths, pi_models

Array = NDArray[np.float64]


def closed_form(model: PI) -> tuple[PI, tuple[float, ...]]:
    """Return the textbook inverse, itself a PI model, and the state of its operators after a rise.

    r^_i = sum_{j<=i} w_j (r_i - r_j), w^_0 = 1 / w_0, w^_i = -w_i / (S_i S_{i-1}) with S_i the
    partial sums; operator i of a model that only rose to y is at y - r^_i.
    """
    r, w = np.array(model.thresholds), np.array(model.weights)
    partial = np.cumsum(w)
    thresholds = [float(w[: i + 1] @ (r[i] - r[: i + 1])) for i in range(r.size)]
    weights = [1 / w[0], *(-w[1:] / (partial[1:] * partial[:-1]))]
    return PI(tuple(thresholds), vector(weights)), tuple(thresholds)


def worst(outputs: Array, references: Array) -> float:
    return float(np.abs(outputs - references).max())


@given(pi_models(), paths(0.1, 4.9))
def test_inverse_undoes_the_model(model: PI, u: Array) -> None:
    references = model.simulate(u)
    recovered = model.inverse().simulate(references)
    scale = sum(map(abs, model.weights)) * (HIGH - LOW)
    assert worst(model.simulate(recovered), references) <= 1e-9 * scale
    assert worst(recovered, u) <= 1e-9 * scale


@given(pi_models(), paths(0.1, 4.9))
def test_inverse_is_the_textbook_closed_form(model: PI, u: Array) -> None:
    references = model.simulate(u)
    inverse, r_hat = closed_form(model)
    risen = [float(references[0]) - model.offset - r for r in r_hat]
    expected = inverse.simulate(references - model.offset, initial=risen)
    assert worst(model.inverse().simulate(references), expected) <= 1e-9 * HIGH


@given(pi_models(), paths(0.1, 4.9))
def test_inverse_is_exact_from_rest_too(model: PI, u: Array) -> None:
    references = model.simulate(u, initial="virgin")
    recovered = model.inverse().simulate(references, initial="virgin")
    scale = sum(map(abs, model.weights)) * (HIGH - LOW)
    assert worst(model.simulate(recovered, initial="virgin"), references) <= 1e-9 * scale


@given(pi_models(), paths(0.1, 4.9), paths(0.1, 4.9))
def test_inverse_goes_on_from_where_the_model_is(model: PI, before: Array, after: Array) -> None:
    stream = model.stream()
    for u in before:
        stream.step(u)
    state = stream.state.tolist()
    references = model.simulate(after, initial=state)
    recovered = model.inverse().simulate(references, initial=state)
    scale = sum(map(abs, model.weights)) * (HIGH - LOW)
    assert worst(model.simulate(recovered, initial=state), references) <= 1e-9 * scale


@given(pi_models(), paths(1.0, 4.0))
def test_wiping_out(model: PI, inner: Array) -> None:
    """An excursion between a peak and a valley leaves no memory once both are passed again."""
    after = [5.0, 0.0, 2.0, 0.5]
    framed = model.simulate(np.concatenate([[0.0, 5.0], inner, after]))
    plain = model.simulate(np.array([0.0, 5.0, *after]))
    np.testing.assert_array_equal(framed[-4:], plain[-4:])


@given(pi_models(), paths(), paths(), numbers(0.5, 2.0), numbers(2.5, 4.5))
def test_congruency(model: PI, one: Array, other: Array, low: float, high: float) -> None:
    """Minor loops between the same turning points have the same shape, whatever came before."""
    loop = np.concatenate([np.linspace(low, high, 20), np.linspace(high, low, 20)])
    shapes = []
    for history in (one, other):
        outputs = model.simulate(np.concatenate([history, loop, loop]))[-loop.size :]
        shapes.append(outputs - outputs[0])
    np.testing.assert_allclose(shapes[0], shapes[1], atol=1e-9)


@given(pi_models(), paths(), numbers(0.5, 2.0), numbers(2.5, 4.5))
def test_return_point_memory(model: PI, history: Array, low: float, high: float) -> None:
    """A minor loop closes: the model comes back to the turning point it left."""
    loop = np.array([low, high, low, high])
    outputs = model.simulate(np.concatenate([history, loop]))
    assert abs(outputs[-1] - outputs[-3]) <= 1e-12 * (1 + abs(outputs[-1]))


def test_two_ranges_of_memory_by_hand() -> None:
    model = PI((0.0, 0.5), (3.0, 1.0))
    assert model.simulate([0.0, 2.0, 1.0, 1.5]).tolist() == [-0.5, 7.5, 4.5, 6.0]
    assert model.inverse().simulate([-0.5, 7.5, 4.5, 6.0]).tolist() == [0.0, 2.0, 1.0, 1.5]


def test_references_out_of_reach_are_clipped_counted_and_forgotten() -> None:
    model = PI.example()
    low, high = (float(end[0]) for end in model.reachable())
    references = np.array([low + 1, high + 5, high + 9, high + 9, high + 2, high - 1, low + 2])
    with pytest.warns(ModelWarning, match=r"4 sample\(s\) of the reference 'displacement'"):
        recovered = model.inverse().simulate(references)
    assert recovered[1:5].tolist() == [5.0] * 4
    np.testing.assert_allclose(model.simulate(recovered)[5:], references[5:], rtol=1e-12)


def test_touching_the_limits_is_not_being_clipped() -> None:
    """Rounding at the ends of the range is no reason to warn: warnings are errors here."""
    model = PI.example()
    for u in ([0.0, 5.0, 0.0, 5.0], [0.0, 5.0, 5.0, 4.0], [5.0, 0.0, 0.0, 0.3, 0.0, 5.0]):
        np.testing.assert_allclose(model.inverse().simulate(model.simulate(u)), u, atol=1e-12)


@pytest.mark.parametrize(
    ("thresholds", "weights", "reason"),
    [
        ((0.1, 0.5), (1.0, 1.0), "smallest threshold is 0.1"),
        ((0.0, 0.5), (1.0, -1.0), "weights 0 to 1 add up to 0"),
        ((0.0, 0.5), (-1.0, 3.0), "weights 0 to 0 add up to -1"),
    ],
)
def test_says_why_there_is_no_inverse(
    thresholds: tuple[float, ...], weights: tuple[float, ...], reason: str
) -> None:
    with pytest.raises(ModelError, match=rf"{reason}.*Remedy:"):
        PI(thresholds, weights).inverse()


@pytest.mark.parametrize(
    ("thresholds", "weights"),
    [((), ()), ((0.0,), (1.0, 2.0)), ((0.0, 0.0), (1.0, 1.0)), ((1.0, 0.5), (1.0, 1.0))],
)
def test_refuses_what_makes_no_sense(
    thresholds: tuple[float, ...], weights: tuple[float, ...]
) -> None:
    with pytest.raises(ModelError, match="Remedy:"):
        PI(thresholds, weights)


def test_refuses_an_empty_input_range() -> None:
    with pytest.raises(ModelError, match=r"input range .* is empty.*Remedy:"):
        PI((0.0,), (1.0,), input_range=(5.0, 5.0))


@pytest.mark.parametrize("scale", [1e-12, 1e-3, 1e6, 1e12])
def test_any_unit_of_input_and_output_will_do(scale: float) -> None:
    """The exactness of the inverse is relative: it survives extreme scales of either side."""
    plain = PI.example()
    u = np.concatenate([np.linspace(0.2, 4, 50), np.linspace(4, 1, 40), np.linspace(1, 3, 30)])
    models = [
        PI(plain.thresholds, vector(scale * np.array(plain.weights)), 0.0, (0.0, 5.0)),
        PI(vector(scale * np.array(plain.thresholds)), plain.weights, 0.0, (0.0, 5.0 * scale)),
    ]
    for model, inputs in zip(models, (u, scale * u), strict=True):
        references = model.simulate(inputs)
        recovered = model.inverse().simulate(references)
        error = np.abs(model.simulate(recovered) - references).max()
        assert error <= 1e-12 * np.ptp(references)


@given(pi_models(), paths())
def test_reachable_is_reached_whatever_happened_before(model: PI, history: Array) -> None:
    low, high = (float(end[0]) for end in model.reachable())
    scale = 1e-9 * (1 + abs(low) + abs(high))
    lowest_last = model.simulate(np.concatenate([history, [LOW]]))[-1]
    highest_last = model.simulate(np.concatenate([history, [HIGH]]))[-1]
    assert lowest_last <= low + scale
    assert highest_last >= high - scale
