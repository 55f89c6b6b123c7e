"""What models of several muscles are chosen on, and that the test has no say."""

from __future__ import annotations

import numpy as np
import pytest

from mckibben import GPI, Recording
from mckibben.comparison.muscles import (
    ENOUGH,
    MuscleRow,
    compare_muscles,
    in_order,
    validation_of,
)
from mckibben.signals import triangle

TIME = np.arange(0, 20, 0.05)


def run(peak: float, seed: int = 0) -> Recording:
    rng = np.random.default_rng(seed)
    waves = {f"pressure_{k}": triangle(TIME + k, 4.0, peak) for k in (1, 2)}
    moved = [GPI.example().simulate(wave) for wave in waves.values()]
    mixed = {
        f"displacement_{k + 1}": moved[k]
        - 0.2 * moved[1 - k]
        + 0.02 * rng.standard_normal(TIME.size)
        for k in (0, 1)
    }
    return Recording(waves | mixed, 0.05)


def test_given_runs_are_scored_without_another_fit() -> None:
    given = [run(3.0), run(4.0)]
    ((fitted, scored),) = validation_of([run(5.0)], given).parts
    assert fitted is None
    assert scored == ((given[0], 0), (given[1], 0))


def test_many_runs_are_left_out_in_turn_but_for_those_beyond_the_rest() -> None:
    runs = [run(peak) for peak in (*np.linspace(2.0, 4.0, ENOUGH - 1), 9.0)]
    parts = validation_of(runs).parts
    scored = [one for _, left in parts for one, _ in left]
    assert len(scored) == ENOUGH - 1
    assert not any(one is runs[-1] for one in scored)
    for fitted, left in parts:
        assert fitted is not None
        assert not {id(one) for one in fitted} & {id(one) for one, _ in left}


def test_of_few_runs_the_end_of_each_is_left_out() -> None:
    runs = [run(3.0), run(4.0)]
    ((fitted, scored),) = validation_of(runs).parts
    assert fitted is not None
    for part, (whole, start) in zip(fitted, scored, strict=True):
        assert len(part) == start == 0.75 * len(whole)


def test_the_choice_is_the_same_whatever_the_test() -> None:
    train, test = [run(5.0, 1), run(4.0, 2)], run(4.5, 3)
    names = {
        name: samples[::-1].copy() for name, samples in test.channels.items() if name[0] == "d"
    }
    boards = [
        compare_muscles(train, [one], models=["coupled-memory", "coupled-pi"], jobs=1)
        for one in (test, test.with_channels(**names))
    ]
    first, second = ([(row.model, row.validation) for row in rows] for rows in boards)
    assert first == second
    assert boards[0][0].test != boards[1][0].test


@pytest.mark.parametrize("worked", [True, False])
def test_rows_without_validation_come_after_those_with(worked: bool) -> None:
    block = GPI.example()
    good = MuscleRow("a", test={"y": 9.0}, validation={"y": 2.0}, block=block)
    lucky = MuscleRow("b", test={"y": 1.0}, invalid="too little", block=block if worked else None)
    first, second = in_order((lucky, good))
    assert (first.model, second.model) == ("a", "b")
    assert second.test_rank == (1 if worked else None)
