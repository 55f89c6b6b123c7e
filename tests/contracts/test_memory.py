"""Laws of hysteresis over drawn models: exact inverses, memory of turning points, outputs in reach."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from mckibben import GPI, Affine, ModelError, ModelWarning, Play, Series
from mckibben.blocks.fields import vector
from mckibben.blocks.laws import examples
from mckibben.registry import load
from tests.blocks.strategies import (
    HIGH,
    LOW,
    eupi_models,
    gpi_models,
    modified_models,
    numbers,
    paths,
    pi_models,
    preisach_models,
    rate_dependent_models,
)

Array = NDArray[np.float64]

STEP = 0.05
"""Sample time [s]."""

EXAMPLES = examples()

INVERTIBLE: dict[str, st.SearchStrategy[Any]] = {
    "eupi": eupi_models(),
    "gpi": gpi_models(),
    "modified": modified_models(),
    "pi": pi_models(),
    "preisach": preisach_models(),
    "rate-dependent-pi": rate_dependent_models(),
}

FORGETFUL: dict[str, st.SearchStrategy[Any]] = {
    "gpi": gpi_models(),
    "modified": modified_models(),
    "pi": pi_models(),
    "play": st.builds(Play, numbers(0.0, 2.0)),
    "preisach": preisach_models(),
}
"""Families whose memory is of turning points that larger ones wipe out."""

RISING = {"eupi": eupi_models(), "gpi": gpi_models(), "preisach": preisach_models()}
RISING["pi"] = pi_models()
"""Families with an input range, whose output rises and falls with the input."""

few = settings(max_examples=60, deadline=None)


def simulate(model: Any, inputs: Any, initial: Any = None) -> Array:
    outputs: Array = model.simulate(np.asarray(inputs), initial=initial, sample_time=STEP)
    return outputs


def tolerance(outputs: Array, relative: float = 1e-12) -> float:
    return relative * (1.0 + float(np.abs(outputs).max()))


# -- inverses ----------------------------------------------------------------------------------


@pytest.mark.parametrize("family", INVERTIBLE)
@few
@given(data=st.data())
def test_a_model_undoes_its_inverse_from_any_state(family: str, data: st.DataObject) -> None:
    model = data.draw(INVERTIBLE[family])
    pace = 60 if model.rate_dependent else 6
    before, after = (data.draw(paths(0.2, 4.8, pace)) for _ in range(2))
    starts: list[Any] = [None]
    # inverses of one model remember what that does, and a jump may be too fast for some
    if hasattr(model, "input_range") and not model.rate_dependent:
        stream = model.stream(STEP)
        for u in before:
            stream.step(u)
        starts.append(stream.state.tolist())
    if family == "pi":
        starts.append("virgin")
    for start in starts:
        references = simulate(model, after, start)
        recovered = simulate(model.inverse(), references, start)
        error = np.abs(simulate(model, recovered, start) - references).max()
        assert error <= tolerance(references, 1e-9)
        if family != "gpi":  # between its envelopes an input may be anywhere
            np.testing.assert_allclose(recovered, after, atol=1e-6)


@pytest.mark.parametrize("family", RISING)
@few
@given(data=st.data())
def test_all_that_is_reachable_is_followed(family: str, data: st.DataObject) -> None:
    """References that no input was thought of for, and a history that does not matter."""
    model, share = data.draw(RISING[family]), data.draw(paths(0.0, 1.0))
    history = data.draw(paths())
    low, high = (float(end[0]) for end in model.reachable())
    margin = tolerance(np.array([low, high]), 1e-9)
    assert simulate(model, [*history, LOW])[-1] <= low + margin
    assert simulate(model, [*history, HIGH])[-1] >= high - margin
    if high > low:
        references = low + (0.02 + 0.96 * share) * (high - low)
        given_inputs = simulate(model.inverse(), references)
        assert LOW <= given_inputs.min() <= given_inputs.max() <= HIGH
        assert np.abs(simulate(model, given_inputs) - references).max() <= margin


CLIPPED = (
    "bouc-wen",
    "braid-equilibrium",
    "eupi",
    "gpi",
    "pi",
    "polynomial",
    "preisach",
    "rate-dependent-pi",
)


@pytest.mark.kernel
@pytest.mark.parametrize("kind", CLIPPED)
def test_references_out_of_reach_are_clipped_counted_and_forgotten(kind: str) -> None:
    block: Any = load("blocks", kind).example()
    if isinstance(block, GPI):  # whose usual envelopes have no value there: plain Python refuses
        rising, falling = load("envelopes", "piecewise-linear").examples()
        block = replace(block, rising=rising, falling=falling)
    (low,), (high,) = block.reachable()
    middle, span = 0.5 * (low + high), high - low
    turns = [middle, high + 0.3 * span, middle, low - 0.3 * span, middle, high - 0.1 * span]
    references = np.interp(np.arange(51), np.arange(0, 51, 10), turns)
    beyond = int(((references < low) | (references > high)).sum())
    with pytest.warns(ModelWarning, match=rf"^{beyond}\b") as caught:
        inputs = block.inverse().simulate(references, sample_time=10.0)
    assert f"'{block.output.name}'" in str(caught[0].message)
    outputs = block.simulate(inputs, sample_time=10.0)
    inside = (references > low + 0.02 * span) & (references < high - 0.02 * span)
    np.testing.assert_allclose(outputs[inside], references[inside], atol=1e-9 * span)
    assert block.input_limits[0] <= inputs.min() <= inputs.max() <= block.input_limits[1]


@pytest.mark.parametrize("kind", CLIPPED)
@pytest.mark.parametrize("shares", [(0, 1, 0, 1), (0, 1, 1, 0.8), (1, 0, 0, 0.06, 0, 1)])
def test_touching_the_limits_is_not_being_clipped(kind: str, shares: tuple[float, ...]) -> None:
    """Rounding at the ends of the range is no reason to warn: warnings are errors here."""
    block: Any = EXAMPLES[kind]
    low, high = block.input_limits
    references = simulate(block, low + (high - low) * np.array(shares))
    outputs = simulate(block, simulate(block.inverse(), references))
    np.testing.assert_allclose(outputs, references, atol=tolerance(references, 1e-11))


@pytest.mark.parametrize("kind", ["eupi", "gpi", "krasnoselskii-pokrovskii", "pi", "preisach"])
@pytest.mark.parametrize("factor", [1e-12, 1e-3, 1e6, 1e12])
def test_any_unit_of_the_output_will_do(kind: str, factor: float) -> None:
    """The exactness of the inverse is relative."""
    block: Any = EXAMPLES[kind]
    change: dict[str, Any] = {"weights": vector(factor * np.array(block.weights))}
    if kind == "eupi":
        change["polynomial"] = vector(factor * np.array(block.polynomial))
    if kind != "gpi":
        change["offset"] = factor * block.offset
    model = replace(block, **change)
    u = np.concatenate([np.linspace(0.2, 4, 50), np.linspace(4, 1, 40), np.linspace(1, 3, 30)])
    references = simulate(model, u)
    np.testing.assert_allclose(references, factor * simulate(block, u), rtol=1e-12)
    error = np.abs(simulate(model, simulate(model.inverse(), references)) - references).max()
    assert error <= 1e-11 * np.ptp(references)


# -- memory ------------------------------------------------------------------------------------


@pytest.mark.parametrize("family", FORGETFUL)
@few
@given(data=st.data(), inner=paths(1.0, 4.0))
def test_wiping_out(family: str, data: st.DataObject, inner: Array) -> None:
    """An excursion between a peak and a valley leaves no memory once both are passed again."""
    model, after = data.draw(FORGETFUL[family]), [5.0, 0.0, 2.0, 0.5]
    framed, plain = (simulate(model, [0.0, 5.0, *way, *after])[-4:] for way in (inner, ()))
    np.testing.assert_allclose(framed, plain, atol=tolerance(plain))


@pytest.mark.parametrize("family", FORGETFUL)
@few
@given(data=st.data(), low=numbers(0.5, 2.0), high=numbers(2.5, 4.5))
def test_minor_loops_close_and_are_congruent(
    family: str, data: st.DataObject, low: float, high: float
) -> None:
    """Between the same turning points they have one shape, whatever came before."""
    model = data.draw(FORGETFUL[family])
    loop = np.concatenate([np.linspace(low, high, 20), np.linspace(high, low, 20)])
    shapes = []
    for _ in range(2):
        outputs = simulate(model, [*data.draw(paths()), *loop, *loop])[-loop.size :]
        assert outputs[-1] == pytest.approx(outputs[0], abs=tolerance(outputs))
        shapes.append(outputs - outputs[0])
    if family != "modified":  # whose curve is steeper here than there
        np.testing.assert_allclose(shapes[0], shapes[1], atol=1e-9)


@pytest.mark.parametrize("kind", [kind for kind in EXAMPLES if len(EXAMPLES[kind].inputs) == 1])
def test_the_inverse_of_a_series_is_the_reversed_series_of_inverses(kind: str) -> None:
    block: Any = EXAMPLES[kind]
    try:
        inverse = block.inverse()
    except ModelError:
        return
    scaled = Series((block, Affine(2.0, 1.0, block.outputs[0])))
    assert scaled.inverse() == Series((scaled.parts[1].inverse(), inverse))
