"""Recordings that rest apart are why models fail, and no model that hardly helps is recommended."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from mckibben import PI, Recording, compare
from mckibben.comparison.recommending import USEFUL, recommended
from mckibben.comparison.results import Leaderboard
from mckibben.signals import triangle, zeroed

STEP = 0.05
PRESSURE = triangle(np.arange(0, 40, STEP), 8.0, [3.0, 4.0, 2.5, 3.5, 4.0])


def run(seed: int, zero: float = 0.0, force: float | None = None) -> Recording:
    noise = 0.01 * np.random.default_rng(seed).standard_normal(PRESSURE.size)
    moved = PI.example().simulate(PRESSURE) + zero + noise
    held = {} if force is None else {"force": np.full(PRESSURE.size, force)}
    channels = {"pressure": PRESSURE, "displacement": moved, **held}
    return Recording(channels, STEP, meta={"name": f"run {seed}"})


def board(*zeros: float, forces: tuple[float | None, ...] = (None,) * 3) -> Leaderboard:
    runs = [run(k, *each) for k, each in enumerate(zip(zeros, forces, strict=True))]
    return compare(runs[:-1], test=runs[-1:], models=["pi"])


def test_a_sensor_zeroed_anew_is_the_reason_and_no_drift() -> None:
    found = board(0.0, 0.0, 60.0)
    assert found.best is None
    assert "Displacement rests at" in found.not_recommended
    assert "--zero displacement" in found.not_recommended
    assert found.apart[1:] in {note[1:] for note in found.notes}
    assert not found.drift
    assert "DisturbanceObserver" not in str(found)


def test_without_it_the_model_is_recommended() -> None:
    assert board(0.0, 0.0, 0.0).apart == ""
    runs = [zeroed(run(k, 60.0 * (k == 2)), ["displacement"], "pressure") for k in range(3)]
    found = compare(runs[:2], test=runs[2:], models=["pi"])
    assert found.apart == ""
    assert found.best is not None


def test_loads_may_tell_why_but_not_between_runs_of_one_load() -> None:
    assert board(0.0, 60.0, 60.0, forces=(2.0, 4.0, 4.0)).apart == ""
    assert "another muscle hung there" in board(0.0, 60.0, 0.0, forces=(2.0, 4.0, 4.0)).apart


@dataclass(frozen=True)
class Ranked:
    """A row."""

    model: str
    test_error: float
    reason: str | None = None
    skill_least: float | None = 0.5


@pytest.mark.parametrize("share", [0.5, 0.99 * USEFUL, 1.01 * USEFUL, 1.0, 2.0])
def test_a_model_hardly_better_than_the_mean_is_not_recommended(share: float) -> None:
    best, why = recommended([Ranked("pi", share)], Ranked("constant", 1.0), "mm")
    assert (best is not None) == (share < USEFUL)
    assert ("The test differs" in why) == (share >= USEFUL)
    assert recommended([Ranked("pi", 0.6)], Ranked("constant", 1.0), "mm", "Apart")[0] is None
    unsure = [Ranked("pi", share, skill_least=-0.1)]
    why = recommended(unsure, Ranked("constant", 1.0), "mm")[1]
    assert ("does not depend" in why) == (share >= USEFUL)  # else the test says otherwise
    why = recommended([Ranked("pi", 2.0)], Ranked("constant", 1.0), "mm", "They rest apart")[1]
    assert why.endswith("They rest apart")
