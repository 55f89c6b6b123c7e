"""Recordings of another muscle, sign or zero are told from repeats, other loads and other motions."""

from __future__ import annotations

from typing import Any

import numpy as np

from mckibben import PI, Recording
from mckibben.comparison.belonging import unlike, zeros
from mckibben.signals import triangle

STEP = 0.05
PRESSURE = triangle(np.arange(0, 40, STEP), 8.0, [3.0, 4.0, 2.5, 3.5, 4.0])


def run(name: str, gain: float = 1.0, zero: float = 0.0, **held: float) -> Recording:
    noise = np.random.default_rng(len(name)).standard_normal(PRESSURE.size)
    moved = gain * (PI.example().simulate(PRESSURE) + 0.01 * noise) + zero
    beside = {key: np.full(PRESSURE.size, value) for key, value in held.items()}
    channels = {"pressure": PRESSURE, "displacement": moved, **beside}
    return Recording(channels, STEP, meta={"name": name})


def said(*runs: Recording, names: tuple[str, ...] = ("pressure",), loads: Any = ()) -> list[str]:
    return [*unlike(runs, names, "displacement", loads), *zeros(runs, names, "displacement", loads)]


def test_repeats_and_loads_that_are_known_belong_together() -> None:
    assert said(run("a"), run("bb"), run("ccc", 1.05)) == []
    names, loads = ("pressure", "force"), ("force",)
    runs = [run("a", 1.0, force=10.0), run("bb", 0.5, 30.0, force=90.0)]
    assert said(*runs, names=names, loads=loads) == []
    assert len(said(*runs)) == 2  # where nobody says that a load differs


def test_another_muscle_moves_otherwise_under_the_same_load() -> None:
    (found,) = said(run("a"), run("bb", 1.8))
    assert "in a and by" in found
    assert "in bb" in found
    assert len(said(run("a"), run("bb", -1.0, 3.0))) == 1
    assert said(run("a"), run("bb", 1.3)) == []
    runs = [run(name, gain) for name, gain in (("a", 1), ("bb", 1.01), ("c", 1.25), ("dd", 1.26))]
    assert said(*runs)  # repeats show that it is no chance
