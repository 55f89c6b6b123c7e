"""What is to be expected of a choice among models: of errors whose truth is known."""

from __future__ import annotations

import numpy as np

from mckibben.comparison.choosing import choice_of

SIZES = [100] * 32


def squares(rng: np.random.Generator, scale: float) -> list[tuple[float]]:
    """Return squared errors of 32 pieces whose sizes differ as those of real motions do."""
    return [(100 * scale**2 * float(rng.gamma(2.0, 0.5)),) for _ in SIZES]


def rmse(pieces: list[tuple[float]]) -> float:
    return float(np.sqrt(sum(piece for (piece,) in pieces) / sum(SIZES)))


def test_what_is_to_be_expected_is_what_comes_of_the_choice() -> None:
    """Twenty models that are equally good: the least error is too low, what is expected is not."""
    least, expected = [], []
    for seed in range(100):
        rng = np.random.default_rng(seed)
        models = {f"m{k}": squares(rng, 1.0) for k in range(20)}
        choice = choice_of(models, SIZES, seed)
        assert choice is not None
        least.append(choice.error)
        expected.append(choice.expected)
    assert np.mean(least) < 0.9
    assert abs(np.mean(expected) - 1.0) < 0.06


def test_a_clear_choice_costs_next_to_nothing() -> None:
    rng = np.random.default_rng(0)
    models = {"good": squares(rng, 0.2), "bad": squares(rng, 1.0), "worse": squares(rng, 2.0)}
    choice = choice_of(models, SIZES, 0)
    assert choice is not None
    assert choice.error == rmse(models["good"])
    assert choice.expected / choice.error < 1.03
    assert choice.picked == {"good": 1.0}


def test_the_mean_over_outputs_chooses() -> None:
    pieces = [(1.0, 100.0)] * 32
    choice = choice_of({"a": pieces, "b": [(4.0, 64.0)] * 32}, [1] * 32, 0)
    assert choice is not None
    assert choice.error == (2.0 + 8.0) / 2
    assert choice.picked == {"b": 1.0}
