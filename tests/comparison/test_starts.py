"""Where on a test an error lies."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mckibben.comparison.splits import Split, given_split
from mckibben.comparison.starts import start_of
from mckibben.recording import Recording


def runs(*sizes: int) -> tuple[Recording, ...]:
    return tuple(Recording({"pressure": np.zeros(n)}, 0.5) for n in sizes)


def errors(*sizes: int, early: float) -> NDArray[np.float64]:
    """Return errors of one, and of ``early`` in the first ten samples that are scored."""
    return np.concatenate([np.where(np.arange(n - 1) < 10, early, 1.0) for n in sizes])[:, None]


def test_half_of_the_squares_in_a_short_start_is_said_with_samples_and_seconds() -> None:
    found = start_of(errors(1001, early=20.0), given_split(runs(50), runs(1001)))
    assert found is not None
    total = 10 * 20.0**2 + 990
    assert found.samples == np.ceil(total / 2 / 20.0**2)
    assert (found.of, found.seconds) == (1000, 0.5 * found.samples)
    assert "first 7 of 1000 samples (3.5 s)" in str(found)


def test_errors_that_lie_anywhere_else_are_not_said_of_the_start() -> None:
    split = given_split(runs(50), runs(1001))
    assert start_of(errors(1001, early=1.0), split) is None
    assert start_of(errors(1001, early=20.0)[::-1], split) is None


def test_starts_of_all_recordings_count_and_a_part_that_goes_on_has_none() -> None:
    sizes = (1001, 501)
    found = start_of(errors(*sizes, early=20.0), given_split(runs(50), runs(*sizes)))
    assert found is not None
    assert found.samples < 10
    (whole,) = runs(2000)
    tail = np.arange(2000) >= 1000
    held = Split((whole.slice(0, 1000),), (whole,), (tail,), "")
    assert start_of(errors(1001, early=20.0), held) is None
