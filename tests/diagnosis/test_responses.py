"""Frequency responses, held against a closed form."""

from __future__ import annotations

import numpy as np

from mckibben import Recording
from mckibben.blocks.dynamics.process_model import ProcessModel
from mckibben.diagnosis.description import uncertainty
from mckibben.diagnosis.responses import frequency_responses

STEP = 0.02


def test_a_process_model_answers_as_its_formula_says() -> None:
    block = ProcessModel(2.0, (0.5,), None, None, 0.04)
    rng = np.random.default_rng(0)
    u = np.repeat(rng.uniform(0, 5, 400), 10)
    y = np.asarray(block.simulate(u, sample_time=STEP)) + rng.normal(0, 0.05, u.size)
    recording = Recording({"pressure": u, "displacement": y}, STEP)
    covariance = uncertainty(block, [recording])[0]
    (found,) = frequency_responses(block, [recording], covariance, 1.96)
    slow = found.frequency < 3.0  # far from where straight lines between samples matter
    s = 2j * np.pi * found.frequency[slow]
    expected = 2.0 * np.exp(-0.04 * s) / (0.5 * s + 1)
    np.testing.assert_allclose(found.gain[slow], np.abs(expected), rtol=0.02)
    np.testing.assert_allclose(found.angle[slow], np.degrees(np.unwrap(np.angle(expected))), atol=1)
    # as measured
    near = np.interp(found.measured_frequency, found.frequency, found.gain)
    good = found.measured_frequency < 1.0
    assert good.sum() > 5
    np.testing.assert_allclose(found.measured_gain[good], near[good], rtol=0.1)
