"""What models answer to sines, held against closed forms."""

from __future__ import annotations

import numpy as np
from scipy.optimize import least_squares

from mckibben import Recording
from mckibben.arrays import Array
from mckibben.blocks.dynamic.process_model import ProcessModel
from mckibben.blocks.dynamic.transfer_function import TransferFunction
from mckibben.blocks.play_type.play import Play
from mckibben.validation.parameters import residuals, sureness
from mckibben.validation.responses import describing_functions, frequency_responses

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
    sure = sureness(block, [recording], residuals(block, [recording]))
    (found,) = frequency_responses(block, [recording], sure.covariance, sure.half_width)
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


def test_bounds_hold_the_true_response_as_often_as_they_say() -> None:
    rng = np.random.default_rng(1)
    u = np.repeat(rng.uniform(0, 5, 150), 10)
    truth = TransferFunction((0.5, 0.1), (-0.8,), STEP)
    clean = np.asarray(truth.simulate(u, sample_time=STEP))
    inside = []
    for _ in range(60):
        y = clean + rng.normal(0, 0.3, u.size)
        model = _least_squares(truth, u, y)
        recording = Recording({"pressure": u, "displacement": y}, STEP)
        sure = sureness(model, [recording], residuals(model, [recording]))
        (found,) = frequency_responses(model, [recording], sure.covariance, sure.half_width)
        h = truth.linear_system(STEP).response(found.frequency)[:, 0, 0]
        assert found.gain_interval is not None
        assert found.angle_interval is not None
        within = (found.gain_interval[0] <= np.abs(h)) & (np.abs(h) <= found.gain_interval[1])
        turned = np.degrees(np.unwrap(np.angle(h)))
        own = (found.angle_interval[0] <= turned) & (turned <= found.angle_interval[1])
        inside.append([within.mean(), own.mean()])
    assert np.all(np.abs(np.mean(inside, axis=0) - 0.95) < 0.06)


def _least_squares(block: TransferFunction, u: Array, y: Array) -> TransferFunction:
    def at(x: Array) -> TransferFunction:
        return block.unpack([*x, 0.0, 0.0])

    def left(x: Array) -> Array:
        return np.asarray(at(x).simulate(u, sample_time=STEP)) - y

    found = least_squares(left, block.pack()[:3])
    return at(found.x)
