"""The published parameter sets against a direct evaluation of the printed formulas."""

from __future__ import annotations

import numpy as np
import pytest

from mckibben.papers.mpi_narmax.published import POLYNOMIAL, TURNING_POINT
from mckibben.registry import load

R_FIELD = [0, 0.3392, 0.6654, 0.9917, 1.3179, 1.6442, 1.9704]
P_FIELD = [0.3067, 0.1146, 0.0895, 0.0673, 0.0673, 0.0455, 0.0261, 0.0034]

R_MPI = [0, 0.0101, 0.0296, 0.2596, 0.4318, 0.8309, 1.6003, 1.9544, 3.9537, 4.95]
K_MPI = [3.5838, -3.8779, 0.3084, 0.1117, -0.0887, -0.0033, -0.0116, -0.0208, -0.0429, 0.0315]
D_MPI = [-0.3435, 0.643, -0.1711, 0.1878, -0.0425, 0.0359, 0.046, 0.0461, -0.0298, 0.0698]
A_MPI = [-8.97e-4, 0, 0.0411, 0, -0.6712, 0, 4.4945, 0, 2.3917, 0]


def test_field_models_prandtl_ishlinskii() -> None:
    """x = p_0 v + sum_i p_i F_{r_i}[v], Eqs. (12) and (13), on falling triangles as in the paper."""
    peaks = [1.0, 5.5, 1.0, 4.6, 1.0, 3.7, 1.0, 2.8, 1.0, 1.9, 1.0]
    v = np.interp(np.arange(1001), 100 * np.arange(11), peaks)
    states = [v[0] - r for r in R_FIELD]
    expected = []
    for u in v:
        states = [max(u - r, min(u + r, s)) for r, s in zip(R_FIELD, states, strict=True)]
        played = sum(p * s for p, s in zip(P_FIELD[1:], states, strict=True))
        expected.append(P_FIELD[0] * u + played)
    model = load("published", "field-models-pi")()
    np.testing.assert_allclose(model.simulate(v), expected, rtol=1e-13)
    recovered = model.inverse().simulate(expected)
    np.testing.assert_allclose(recovered, v, rtol=1e-12)
    assert model.input_range == (1.0, 5.5)


@pytest.mark.parametrize("frequency", [0.05, 0.1, 0.2])
def test_modified_prandtl_ishlinskii(frequency: float) -> None:
    """b = sum_i (k_i v + d_i) h_i and f = sum_i a_i b^(10 - i), under the paper's excitation."""
    step = 0.001
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
    model = load("published", "mpi-narmax-mpi")()
    outputs = model.simulate(u, sample_time=step)
    np.testing.assert_allclose(outputs, expected, rtol=1e-9, atol=1e-9)
    last_cycle = outputs[outputs.size // 2 :]
    assert 1.2 < last_cycle.min() < 1.8
    assert 47.5 < last_cycle.max() < 49.0
    assert abs(outputs[0]) < 0.1


def test_the_printed_map_turns_where_it_is_said_to() -> None:
    slope = np.polyder(POLYNOMIAL)
    turns = [root.real for root in np.roots(slope) if abs(root.imag) < 1e-9 and root.real > 0]
    assert min(turns) == pytest.approx(TURNING_POINT, abs=1e-4)
    assert np.polyval(POLYNOMIAL, TURNING_POINT) == pytest.approx(48.77, abs=0.01)
