"""The memory test: gaps and holds of models whose memory is known."""

from __future__ import annotations

import numpy as np
import pytest

from mckibben import GPI, PI, Recording
from mckibben.diagnosis.branch_gaps import branch_gaps, memory_test
from mckibben.signals import triangle

U = triangle(np.arange(0, 24, 0.01), 6.0, [5.0, 4.0, 3.0, 2.0])

PAIRS = (("pressure", "displacement"),)


def column(samples: np.ndarray) -> np.ndarray:
    return samples[:, np.newaxis]


def recorded(y: np.ndarray) -> Recording:
    return Recording({"pressure": U, "displacement": y}, 0.01)


def test_gap_of_a_parallelogram_is_its_width() -> None:
    u = triangle(np.arange(0, 20, 0.01), 10.0, 5.0)
    rising = np.gradient(u) > 0
    y = 2 * u + np.where(rising, 0.0, 1.5)
    gaps = branch_gaps(u, np.column_stack([y, 2 * y]))
    inner = np.abs(gaps[:, 0] - 1.5) < 1e-6
    assert inner.mean() > 0.95
    np.testing.assert_allclose(gaps[:, 1], 2 * gaps[:, 0], atol=1e-9)


@pytest.mark.parametrize("block", [PI.example(), GPI.example()], ids=lambda b: b.kind)
def test_a_model_of_the_right_memory_scores_one(block: PI | GPI) -> None:
    y = block.simulate(U)
    found = memory_test(block, [recorded(y)], [column(y)], PAIRS)
    assert found.gap_ratio == pytest.approx(1.0)
    assert found.hold_ratio == pytest.approx(1.0)
    assert found.n_pairs > 100


def test_a_model_with_half_the_memory_scores_half() -> None:
    block = PI.example()
    y = block.simulate(U)
    reversible = PI((0.0,), (sum(block.weights),), 0.0)
    halved = 0.5 * (y + reversible.simulate(U))
    found = memory_test(block, [recorded(y)], [column(halved)], PAIRS)
    assert found.gap_ratio == pytest.approx(0.5, abs=1e-6)


def test_data_without_hysteresis_give_no_ratio() -> None:
    ramp = Recording({"pressure": np.linspace(0, 5, 50), "displacement": np.linspace(0, 9, 50)})
    block = PI.example()
    output = block.simulate(ramp)["displacement"]
    found = memory_test(block, [ramp], [column(output)], PAIRS)
    assert found.gap_ratio is None
    assert found.n_pairs == 0
