"""The choice among models: by cross-validated error, never by the test; and what choosing costs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Literal, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Array
from mckibben.comparison.offered import caution
from mckibben.signals.checking import generator
from mckibben.statistics import RESAMPLES

CONSTANT = "constant"
"""Name of the row that predicts the mean of the training output, whatever the input: never chosen."""

CAUTION = 2.0
"""Factor on the error of a model that is good only near its training data, where models are sorted."""

USEFUL = 0.9
"""Share of the constant's error on the test from which on a model is of no use."""

FEWEST = 4
"""Pieces of a cross-validation that can be resampled."""

Against = Literal["validation", "test"]
"""Where the constant is not beaten, so that no model is recommended."""


class Ranked(Protocol):
    """A row of a ranking."""

    @property
    def reason(self) -> str | None:
        """Why it failed, or None."""

    @property
    def skill_least(self) -> float | None:
        """Lower bound of the skill over the constant in the cross-validation."""

    @property
    def test_error(self) -> float:
        """RMSE on the test data, infinite where there is none."""


R = TypeVar("R", bound=Ranked)


def order(
    model: str,
    validated: float | None,
    fitted: float | None,
    skill_least: float | None = None,
) -> tuple[bool, bool, float, str]:
    """Return what models are sorted by: the validated ones first, by that; nothing of the test is in it.

    Those that are known to be no better than the constant come last. Blocks of the same motion cannot
    show how a model extrapolates, so the error of one with a caution counts `CAUTION` times.

    Parameters
    ----------
    model : str
        Short name.
    validated, fitted : float or None
        Error of the cross-validation, and on the data fitted, by which the others are sorted.
    skill_least : float or None
        Lower bound of the skill over the constant.
    """
    error = fitted if validated is None else validated
    counted = float("inf") if error is None else error * (CAUTION if caution(model) else 1.0)
    idle = skill_least is not None and not skill_least > 0
    return validated is None, idle, counted, model


def recommended(rows: Sequence[R], constant: Ranked | None) -> tuple[R | None, Against | None]:
    """Return the model to recommend, or None and where the constant is not beaten.

    It is the first in the order of the choice that beats the constant in the cross-validation beyond
    chance. The test does not choose, but it may take the recommendation away: no other is chosen in
    its place, since that would be a choice by the test.

    Parameters
    ----------
    rows : sequence of rows
        In the order of the choice.
    constant : row or None
        The constant's; without one the first that did not fail is recommended.
    """
    working = [row for row in rows if row.reason is None]
    if not working:
        return None, None
    judged = [row.skill_least for row in working if row.skill_least is not None]
    if judged and max(judged) <= 0:
        return None, "validation"
    first = next((row for row in working if (row.skill_least or 0.0) > 0), working[0])
    return (None, "test") if constant and not _beats(first, constant) else (first, None)


def acceptable(row: Ranked, constant: Ranked | None) -> bool:
    """Return whether nothing is known against a row beside one that is recommended."""
    if row.reason is not None or constant is None:
        return row.reason is None
    return (row.skill_least is None or row.skill_least > 0) and _beats(row, constant)


def _beats(row: Ranked, constant: Ranked) -> bool:
    return row.test_error < USEFUL * constant.test_error


def skill_of(squares: Array, constant: Array, seed: int) -> tuple[float, float]:
    """Return the share of a constant's squared error that a model removes, and its lower bound.

    The bound is exceeded by 99 % of resamples of blocks, the same for both.

    Parameters
    ----------
    squares, constant : array, shape (pieces,)
        Sums of squared errors of the model and of the constant on the same blocks.
    seed : int
        Of the resampling.
    """
    both = np.array([squares, constant])
    if not np.isfinite(both).all() or both[1].sum() == 0:
        return float("-inf"), float("-inf")
    drawn = np.random.default_rng(seed).integers(0, both.shape[1], (RESAMPLES, both.shape[1]))
    model, mean = both[:, drawn].sum(axis=2)
    left = model / np.maximum(mean, np.finfo(float).tiny)
    return float(1 - both[0].sum() / both[1].sum()), float(1 - np.quantile(left, 0.99))


@dataclass(frozen=True)
class Choice:
    """The choice of the least of several cross-validated errors, and its cost.

    Parameters
    ----------
    among : int
        Models that could have been chosen.
    picked : mapping of str to float
        Share of the resamples of the cross-validation in which each would have been, most first.
    error : float
        Cross-validated RMSE of the model chosen.
    expected : float
        The same of data that did not choose: the mean error of each resample's choice on the pieces
        that are not in the resample. At least `error`.
    """

    among: int
    picked: Mapping[str, float]
    error: float
    expected: float

    def to_dict(self) -> dict[str, Any]:
        """Return the fields, ready for JSON."""
        return asdict(self) | {"picked": dict(self.picked)}


def choice_of(
    squares: Mapping[str, Sequence[Sequence[float]]], counts: Sequence[int], seed: int
) -> Choice | None:
    """Return the choice among models by cross-validated RMSE, and what it costs.

    By the bootstrap of Tsamardinos, Greasidou and Borboudakis (Machine Learning 107, 2018). No model
    is fitted again.

    Parameters
    ----------
    squares : mapping of str to sequence of sequence of float
        Sums of squared errors by model, piece and output, of the same pieces.
    counts : sequence of int
        Samples of every piece.
    seed : int
        Of the resampling.

    Returns
    -------
    Choice or None
        None of fewer than two models, or of too few pieces.
    """
    sizes = np.array(counts, dtype=float)
    if len(squares) < 2 or np.count_nonzero(sizes) < FEWEST:
        return None
    models = list(squares)
    table = np.array([squares[model] for model in models])  # (models, pieces, outputs)
    rng = generator(seed)
    drawn = rng.multinomial(sizes.size, np.full(sizes.size, 1 / sizes.size), RESAMPLES)
    left = drawn == 0
    usable = ((drawn @ sizes) > 0) & ((left @ sizes) > 0)
    drawn, left = drawn[usable], left[usable]
    inside = np.sqrt(_mean_squares(table, sizes, drawn)).mean(axis=2)
    choices: NDArray[np.intp] = inside.argmin(axis=0)
    outside = _mean_squares(table, sizes, left)[choices, np.arange(len(choices))]
    own = np.sqrt(table.sum(axis=1) / sizes.sum()).mean(axis=1)
    shares = np.bincount(choices, minlength=len(models)) / len(choices)
    places = sorted(range(len(models)), key=lambda k: (-shares[k], own[k]))
    error = float(own.min())
    return Choice(
        among=len(models),
        picked={models[k]: float(shares[k]) for k in places if shares[k] > 0},
        error=error,
        expected=max(error, float(np.sqrt(outside.mean(axis=0)).mean())),
    )


def _mean_squares(table: Array, sizes: Array, weights: NDArray[Any]) -> Array:
    """Return mean squared errors under weights of pieces, shape (models, resamples, outputs)."""
    summed = np.einsum("mpo,rp->mro", table, weights.astype(float))
    return np.asarray(summed / (weights @ sizes)[:, np.newaxis])
