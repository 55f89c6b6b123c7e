from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from mckibben.recording import Recording
from mckibben.report.drawing import (
    along,
    axis_label,
    left_out,
    over_time,
    series_colour,
    time_label,
)

signals = st.integers(2, 500).flatmap(
    lambda n: arrays(np.float64, (2, n), elements=st.floats(-1e6, 1e6))
)


@given(signals, st.integers(8, 60))
def test_thinning_over_time_keeps_the_extremes_and_the_limit(pair: np.ndarray, points: int) -> None:
    y = pair[0]
    t, kept = over_time(np.arange(y.size, dtype=float), y, points)
    assert t.size <= max(points, 2)
    assert (kept.min(), kept.max()) == (y.min(), y.max())
    np.testing.assert_array_equal(kept, y[t.astype(int)])


@given(signals, st.integers(8, 60))
def test_thinning_a_path_keeps_the_extremes_of_both_and_the_order(
    pair: np.ndarray, points: int
) -> None:
    places, x, y = along(pair[0], pair[1], points)
    assert places.size <= points
    assert np.all(np.diff(places) > 0)
    assert (x.min(), x.max(), y.min(), y.max()) == (
        pair[0].min(),
        pair[0].max(),
        pair[1].min(),
        pair[1].max(),
    )
    np.testing.assert_array_equal(np.stack([x, y]), pair[:, places.astype(int)])


def test_every_spike_in_a_million_samples_survives() -> None:
    y = np.zeros(1_000_000)
    spikes = np.arange(777, y.size, 9973)
    y[spikes] = 1 + spikes
    _, kept = over_time(np.arange(y.size, dtype=float), y)
    assert set(kept[kept > 0]) == set(y[spikes])


@pytest.mark.parametrize(
    ("channel", "unit", "label"),
    [("pressure", "bar", "pressure [bar]"), ("contraction", "", "contraction")],
)
def test_labels_carry_units(channel: str, unit: str, label: str) -> None:
    assert axis_label(channel, unit) == label


def test_time_without_time_is_samples() -> None:
    samples = {"pressure": np.array([0.0, 1.0])}
    assert time_label(Recording(samples)) == "sample"
    assert time_label(Recording(samples, 0.1)) == "time [s]"


def test_colours_go_round() -> None:
    assert [series_colour(place) for place in (0, 5, 6)] == ["series-1", "series-6", "series-1"]


def test_what_is_left_out_is_named_up_to_six_and_counted() -> None:
    assert left_out([]) == ""
    names = [f"run {k}" for k in range(400)]
    assert left_out(names).endswith("run 4, run 5 and 394 more.")
