"""Drift of models' errors: said where it is, not where it is not, and taken out as is advised."""

from __future__ import annotations

import numpy as np
import pytest

from mckibben import PI, Recording, compare

STEP = 4.0
SEEDS = 30


def levels(n: int) -> np.ndarray:
    return np.random.default_rng(3).uniform(0.5, 5.5, n)


def run(drift: np.ndarray) -> Recording:
    """Return what a play model gives, with noise and what drifts."""
    pressure = levels(drift.size)
    y = PI.example().simulate(pressure) + drift
    y += 0.05 * np.random.default_rng(4).standard_normal(y.size)
    return Recording({"pressure": pressure, "displacement": y}, STEP)


def test_a_leaderboard_has_the_drift_that_there_is_and_none_else() -> None:
    none = np.zeros(320)
    board = compare(run(none).slice(0, 240), run(none).slice(240, 320), models=["pi", "gpi"])
    assert board.drift == ""
    assert all(row.drift is not None and not row.drift.certain for row in board.rows)
    off = run(np.where(np.arange(320) < 240, 0.0, 0.5))
    board = compare(off.slice(0, 240), off.slice(240, 320), models=["pi", "gpi"])
    assert board.drift
    (row,) = [row for row in board.rows if row.model == board.to_dict()["chosen"]]
    assert row.drift is not None
    assert row.drift.certain
    assert row.to_dict()["drift"]["offset"] == pytest.approx(0.5, abs=0.05)
    assert row.drift.adapted < 0.7 * row.drift.rmse
