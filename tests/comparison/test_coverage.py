"""Where training has been, and how models of local rules do elsewhere."""

from __future__ import annotations

import numpy as np
import pytest

from mckibben import Recording, compare
from mckibben.comparison.coverage import FARTHEST, NEAREST, coverage_of
from mckibben.comparison.results import Leaderboard

INPUTS = ("pressure_1", "pressure_2")
TIME = np.arange(0, 30, 0.1)


def moved(*pressures: np.ndarray) -> Recording:
    """Return a recording of displacements with a product, which is learned where both move alone."""
    one, two = pressures
    given = dict(zip(INPUTS, pressures, strict=True))
    made = {"displacement_1": 5 * one + one * two, "displacement_2": 4 * two - one * two}
    return Recording(given | made, 0.1)


def wave(seed: float, peak: float = 3.0) -> np.ndarray:
    return peak * 0.5 * (1 - np.cos(2 * np.pi * (0.07 + 0.02 * seed) * TIME + seed))


STILL = np.zeros(TIME.size)
PATTERNS = [
    moved(wave(0), STILL),
    moved(wave(1), STILL),
    moved(STILL, wave(0)),
    moved(STILL, wave(1)),
]
JOINT = [moved(wave(k), wave(2.3 * k + 0.7)) for k in range(1, 9)]
TOGETHER = moved(wave(0.4), wave(3.1))


def test_muscles_moved_one_at_a_time_cover_edges_alone() -> None:
    apart = coverage_of(PATTERNS, [TOGETHER], INPUTS)
    joint = coverage_of(JOINT, [TOGETHER], INPUTS)
    assert apart is not None
    assert joint is not None
    assert (apart.n_patterns, joint.n_patterns) == (2, None)
    assert apart.covered < 0.3 < 0.9 < joint.covered
    assert apart.outside[0].mean() > 0.5
    assert joint.outside[0].mean() < 0.05


def test_distances_are_those_to_the_nearest_sample_and_the_radius_that_between_runs() -> None:
    """Against all pairs of samples, one by one."""
    few = JOINT[:3]
    found = coverage_of(few, [TOGETHER], INPUTS)
    assert found is not None
    low = np.min([r.matrix(INPUTS).min(axis=0) for r in few], axis=0)
    span = np.max([r.matrix(INPUTS).max(axis=0) for r in few], axis=0) - low
    runs = [(r.matrix(INPUTS) - low) / span for r in few]

    def nearest(x: np.ndarray, others: list[np.ndarray]) -> float:
        return min(float(np.sqrt(((x - run) ** 2).sum(axis=1)).min()) for run in others)

    apart = [nearest(x, runs[:k] + runs[k + 1 :]) for k, run in enumerate(runs) for x in run]
    assert NEAREST < found.radius < FARTHEST
    assert found.radius == pytest.approx(np.quantile(apart, 0.99), rel=1e-9)
    asked = (TOGETHER.matrix(INPUTS) - low) / span
    expected = [nearest(x, runs) > found.radius for x in asked]
    np.testing.assert_array_equal(found.outside[0], expected)


def board(train: list[Recording], test: Recording) -> Leaderboard:
    settings = {"tsfnn": {"n_sets": 2, "search_samples": 300}}
    models = ["tsfnn", "coupled-memory"]
    return compare(train, test, models=models, settings=settings, n_folds=0, jobs=1)


def test_a_network_is_not_to_be_trusted_where_no_run_moved_both_muscles() -> None:
    found = board(PATTERNS, TOGETHER)
    rows = {row.model: row for row in found.rows}
    told = rows["tsfnn"].off_training
    assert told is not None
    assert told.trusted is False
    assert told.ratio is not None
    assert told.ratio > 2
    assert rows["coupled-memory"].off_training is None
    (row,) = [row for row in found.to_dict()["rows"] if row["model"] == "tsfnn"]
    assert row["off_training"]["trusted"] is False
