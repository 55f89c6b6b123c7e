"""What models answer to sines, held against closed forms."""

from __future__ import annotations

import numpy as np

from mckibben import Recording
from mckibben.arrays import Array
from mckibben.blocks.dynamics.process_model import ProcessModel
from mckibben.blocks.hysteresis.play_operators import Play
from mckibben.diagnosis.description import uncertainty
from mckibben.diagnosis.responses import describing_functions, frequency_responses

STEP = 0.02


def play_function(ratio: float) -> complex:
    """Return the describing function of a play whose threshold is a share of the amplitude.

    Source: Gelb and Vander Velde, "Multiple-Input Describing Functions", 1968, of backlash.
    """
    x = 1 - 2 * ratio
    real = 0.5 + (np.arcsin(x) + x * np.sqrt(1 - x * x)) / np.pi
    return complex(real, -4 * ratio * (1 - ratio) / np.pi)


def swung(amplitudes: tuple[float, ...], period: int = 400) -> Array:
    """Return cosine cycles from 0 up and back, one of each size."""
    one = 1 - np.cos(2 * np.pi * np.arange(period) / period)
    return np.append(np.concatenate([a * one for a in amplitudes]), 0.0)


def test_play_answers_as_the_closed_form_says() -> None:
    u = swung((0.5, 0.5, 1.0, 1.0, 2.0, 2.0))
    block = Play(0.4)
    y = np.asarray(block.simulate(u))
    recording = Recording({"pressure": u, "displacement": y}, STEP)
    (found,) = describing_functions(block, [recording])
    for amplitude, gain, angle in zip(found.amplitude, found.gain[0], found.angle[0], strict=True):
        expected = play_function(0.4 / amplitude)
        assert abs(gain - abs(expected)) < 2e-3
        assert abs(angle - np.degrees(np.angle(expected))) < 0.3
    # cycles that the model follows exactly are the same, measured and modelled
    assert found.measured_gain.size >= 5
    np.testing.assert_allclose(found.measured_gain, found.modelled_gain, rtol=1e-12)
    np.testing.assert_allclose(found.measured_angle, found.modelled_angle, atol=1e-9)


def test_a_process_model_answers_as_its_formula_says() -> None:
    block = ProcessModel(2.0, (0.5,), None, None, 0.04)
    rng = np.random.default_rng(0)
    u = np.repeat(rng.uniform(0, 5, 400), 10)
    y = np.asarray(block.simulate(u, sample_time=STEP)) + rng.normal(0, 0.05, u.size)
    recording = Recording({"pressure": u, "displacement": y}, STEP)
    covariance = uncertainty(block, [recording])[1]
    (found,) = frequency_responses(block, [recording], covariance, 1.96)
    slow = found.frequency < 3.0  # far from where straight lines between samples matter
    s = 2j * np.pi * found.frequency[slow]
    expected = 2.0 * np.exp(-0.04 * s) / (0.5 * s + 1)
    np.testing.assert_allclose(found.gain[slow], np.abs(expected), rtol=0.02)
    np.testing.assert_allclose(found.angle[slow], np.degrees(np.unwrap(np.angle(expected))), atol=1)
    # as measured
    near = np.interp(found.measured_frequency, found.frequency, found.gain)
    good = (found.coherence > 0.95) & (found.measured_frequency < 1.0)
    assert good.sum() > 5
    np.testing.assert_allclose(found.measured_gain[good], near[good], rtol=0.1)
