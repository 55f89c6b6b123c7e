"""Metrics against scikit-learn, closed forms and the laws that they must obey."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from sklearn.metrics import mean_absolute_error, mean_squared_error, r2_score

from mckibben import DataError, metrics
from mckibben.metrics import Scores, crosstalk, loop_area, loop_width, score

Array = NDArray[np.float64]

VALUES = st.floats(-1e6, 1e6).map(lambda value: round(value, 6))
PAIRS = st.integers(2, 40).flatmap(
    lambda n: st.tuples(*(st.lists(VALUES, min_size=n, max_size=n).map(np.array),) * 2)
)


@given(PAIRS)
def test_scores_agree_with_scikit_learn(pair: tuple[Array, Array]) -> None:
    y, model = pair
    found = score(y, model)
    assert found.rmse == pytest.approx(math.sqrt(mean_squared_error(y, model)), rel=1e-12)
    assert found.mae == pytest.approx(mean_absolute_error(y, model), rel=1e-12)
    assert found.mae <= found.rmse * (1 + 1e-12) <= found.max_error * (1 + 2e-12)
    if np.ptp(y) > 0:
        assert found.r2 == pytest.approx(r2_score(y, model), rel=1e-9, abs=1e-9)


@given(PAIRS, st.floats(0.01, 100.0), st.floats(-10.0, 10.0))
def test_relative_errors_do_not_depend_on_the_unit(
    pair: tuple[Array, Array], factor: float, offset: float
) -> None:
    y, model = pair
    if np.ptp(y) < 1.0:
        return
    one, other = score(y, model), score(factor * y + offset, factor * model + offset)
    for name in ("r2", "nrmse", "err"):
        assert getattr(other, name) == pytest.approx(getattr(one, name), rel=1e-6, abs=1e-6)


def test_err_is_that_of_the_paper() -> None:
    y, model = np.array([0.0, 1.0, 3.0, 4.0]), np.array([0.5, 1.0, 2.0, 4.0])
    assert metrics.err(y, model) == pytest.approx(100 * (0.5 + 1.0) / (2 + 1 + 1 + 2))
    assert metrics.nrmse(y, model) == pytest.approx(math.sqrt((0.25 + 1) / 4) / 4)


def test_nothing_to_explain_and_nothing_missed() -> None:
    assert score([1.0, 2.0], [1.0, 2.0]) == Scores(0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
    constant = score([0.1, 0.1, 0.1], [0.0, 0.1, 0.2])
    assert all(math.isnan(value) for value in (constant.r2, constant.nrmse, constant.err))
    assert constant.max_error == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("measured", "modelled", "row"),
    [
        ([1.0, 2.0], [1.0], None),
        ([], [], None),
        ([[1.0]], [[1.0]], None),
        ([1.0, math.nan], [1.0, 2.0], 2),
        ([1.0, 2.0], [math.inf, 2.0], 1),
    ],
)
def test_what_cannot_be_scored_is_refused(
    measured: list[float], modelled: list[float], row: int | None
) -> None:
    with pytest.raises(DataError) as refused:
        score(measured, modelled)
    assert refused.value.row == row


@given(st.floats(0.1, 10.0), st.floats(0.05, 0.95), st.integers(20, 200))
def test_width_of_a_parallelogram(gain: float, share: float, n: int) -> None:
    # A play operator of radius r under a full cycle of amplitude a has width 2 r of a - 2 r.
    amplitude, radius = 4.0, 2.0 * share
    up, down = np.linspace(0, amplitude, n), np.linspace(amplitude, 0, n)[1:]
    rising = gain * np.maximum(up - 2 * radius, 0.0)
    falling = gain * np.minimum(down, amplitude - 2 * radius)
    u, y = np.concatenate([up, down]), np.concatenate([rising, falling])
    middle = amplitude / 2
    expected = min(middle, amplitude - 2 * radius) - max(middle - 2 * radius, 0.0)
    step = 2 * amplitude / n / (amplitude - 2 * radius)
    wanted = 100 * expected / (amplitude - 2 * radius)
    assert loop_width(u, y) == pytest.approx(wanted, abs=100 * step)
    assert crosstalk(u, y, 4 * y) == pytest.approx(loop_width(u, y) / 4)
    assert loop_area(u, y) == pytest.approx(
        gain * 2 * radius * (amplitude - 2 * radius), rel=0.5 / n, abs=gain * 4 * (4.0 / n) ** 2
    )


def test_a_line_has_no_width_and_what_is_no_loop_is_refused() -> None:
    u = np.array([0.0, 1.0, 2.0, 1.0, 0.0])
    assert loop_width(u, 3 * u + 1) == loop_area(u, 3 * u + 1) == 0
    for x, y in ((u[:3], u[:3]), (0 * u[:3] + 1, u[:3]), ([0.0, 1.0, 0.0], [2.0, 2.0, 2.0])):
        with pytest.raises(DataError):
            loop_width(x, y)


@given(st.floats(0.1, 5.0), st.floats(0.1, 5.0), st.booleans())
def test_area_of_an_ellipse(a: float, b: float, clockwise: bool) -> None:
    phase = np.linspace(0, 2 * np.pi, 2001) * (-1 if clockwise else 1)
    area = loop_area(a * np.cos(phase) + 7, b * np.sin(phase) - 3)
    assert area == pytest.approx(np.pi * a * b, rel=1e-5)
