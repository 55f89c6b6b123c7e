"""Where training has been, and how models of local rules do elsewhere."""

from __future__ import annotations

import numpy as np

from mckibben import Recording, compare
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
TOGETHER = moved(wave(0.4), wave(3.1))


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
