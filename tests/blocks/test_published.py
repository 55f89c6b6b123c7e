"""Printed models against their printed formulas and numbers, written out once more."""

from __future__ import annotations

import numpy as np
import pytest

from mckibben.papers.field_models.published import process_model
from mckibben.papers.multistate_friction.published import static_force
from mckibben.registry import load

R_MPI = [0, 0.0101, 0.0296, 0.2596, 0.4318, 0.8309, 1.6003, 1.9544, 3.9537, 4.95]
K_MPI = [3.5838, -3.8779, 0.3084, 0.1117, -0.0887, -0.0033, -0.0116, -0.0208, -0.0429, 0.0315]
D_MPI = [-0.3435, 0.643, -0.1711, 0.1878, -0.0425, 0.0359, 0.046, 0.0461, -0.0298, 0.0698]
A_MPI = [-8.97e-4, 0, 0.0411, 0, -0.6712, 0, 4.4945, 0, 2.3917, 0]


def test_modified_prandtl_ishlinskii() -> None:
    """b = sum_i (k_i v + d_i) h_i and f = sum_i a_i b^(10 - i), under the paper's excitation."""
    step, frequency = 0.001, 0.2
    t = np.arange(0, 2 / frequency, step)
    u = (10 - 0.1) / 2 * np.sin(2 * np.pi * frequency * t - np.pi / 2) + (10 + 0.1) / 2
    previous = u[0]
    states = [max(u[0] - r, min(u[0] + r, 0.0)) for r in R_MPI]
    expected = []
    for x in u:
        rate, previous = (x - previous) / step, x
        states = [max(x - r, min(x + r, s)) for r, s in zip(R_MPI, states, strict=True)]
        b = sum((k * rate + d) * s for k, d, s in zip(K_MPI, D_MPI, states, strict=True))
        expected.append(sum(a * b ** (9 - i) for i, a in enumerate(A_MPI)))
    outputs = load("published", "mpi-narmax-mpi")().simulate(u, sample_time=step)
    np.testing.assert_allclose(outputs, expected, rtol=1e-9, atol=1e-9)
    last_cycle = outputs[outputs.size // 2 :]
    assert 1.2 < last_cycle.min() < 1.8
    assert 47.5 < last_cycle.max() < 49.0


def test_printed_numbers() -> None:
    poles = np.sort(np.roots(process_model().denominator()))
    np.testing.assert_allclose(poles, [-3.185, -0.00966], rtol=2e-3)
    assert load("published", "sdchm-coupling")().radius == pytest.approx(0.456, abs=5e-4)
    per_bar, rest = static_force().terms(np.array([190.0]))
    assert float(rest[0] + 4.0 * per_bar[0]) == pytest.approx(
        7596 - 136.6 * 4 - 93.14 * 190 + 1.176 * 190 * 4 + 0.2758 * 190**2
    )
