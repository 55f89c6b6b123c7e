"""Rate-dependent Prandtl-Ishlinskii models and their inverse, solved sample by sample."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from numpy.typing import NDArray

from mckibben import PI, ModelError, ModelWarning, RateDependentPI, Recording
from tests.blocks.strategies import HIGH, LOW, paths, pi_models, rate_dependent_models

Array = NDArray[np.float64]
SAMPLE_TIME = 0.05


@given(rate_dependent_models(), paths(0.2, 4.8, pace=60))
def test_model_undoes_its_inverse(model: RateDependentPI, u: Array) -> None:
    references = model.simulate(u, sample_time=SAMPLE_TIME)
    recovered = model.inverse().simulate(references, sample_time=SAMPLE_TIME)
    error = np.abs(model.simulate(recovered, sample_time=SAMPLE_TIME) - references).max()
    assert error <= 1e-9 * sum(model.weights) * (HIGH - LOW)
    assert np.abs(recovered - u).max() <= 1e-6


@given(pi_models(), paths())
def test_without_rate_weights_it_is_the_classical_model(model: PI, u: Array) -> None:
    still = tuple(0.0 for _ in model.weights)
    rated = RateDependentPI(model.thresholds, still, model.weights, model.offset)
    outputs = rated.simulate(u, sample_time=0.01)
    np.testing.assert_allclose(outputs, model.simulate(u), atol=1e-12)


def test_filter_follows_a_ramp_exactly() -> None:
    """After a time t on a ramp of rate v the filtered rate is v (1 - exp(-t / tau))."""
    model = RateDependentPI((0.0,), (1.0,), (0.0,), rate_time_constant=0.3)
    t = np.arange(200) * 0.01
    outputs = model.simulate(2.0 * t, sample_time=0.01)
    expected = 2.0 * (1 - np.exp(-t / 0.3)) * 2.0 * t
    np.testing.assert_allclose(outputs, expected, atol=1e-12)


def test_faster_is_wider_with_positive_rate_weights() -> None:
    model = RateDependentPI.example()
    t = np.arange(2000) * 0.01
    widths = []
    for frequency in (0.05, 0.5):
        u = 2.5 - 2.5 * np.cos(2 * np.pi * frequency * t)
        widths.append(np.ptp(model.simulate(u, sample_time=0.01)))
    assert widths[1] > widths[0]


def test_needs_time() -> None:
    model = RateDependentPI.example()
    with pytest.raises(ModelError, match=r"needs a sample time.*Remedy:"):
        model.simulate([0.0, 1.0])
    with pytest.raises(ModelError, match=r"needs a sample time.*Remedy:"):
        model.simulate(Recording({"pressure": np.array([0.0, 1.0])}))
    with pytest.raises(ModelError, match=r"needs a sample time.*Remedy:"):
        model.stream()


def test_says_why_there_is_no_inverse() -> None:
    with pytest.raises(ModelError, match=r"without an input range.*Remedy:"):
        RateDependentPI((0.0,), (0.0,), (1.0,)).inverse()
    with pytest.raises(ModelError, match=r"add up to -1.*Remedy:"):
        RateDependentPI((0.0,), (0.0,), (-1.0,), input_range=(0.0, 1.0)).inverse()
    inverse = RateDependentPI.example().inverse()
    with pytest.raises(ModelError, match=r"cannot start virgin.*Remedy:"):
        inverse.simulate([5.0, 6.0], initial="virgin", sample_time=0.1)


def test_references_out_of_reach_are_clipped_and_forgotten() -> None:
    model = RateDependentPI.example()
    low, high = (float(end[0]) for end in model.reachable())
    corners = [low + 1, high - 1, high + 5, high - 1, low + 1, low - 5, low + 1, high - 2]
    references = np.interp(np.arange(701), 100 * np.arange(8), corners)
    with pytest.warns(ModelWarning, match="were clipped"):
        recovered = model.inverse().simulate(references, sample_time=SAMPLE_TIME)
    outputs = model.simulate(recovered, sample_time=SAMPLE_TIME)
    inside = (references > low + 0.5) & (references < high - 0.5)
    assert np.abs(outputs - references)[inside].max() <= 1e-9 * (high - low)
