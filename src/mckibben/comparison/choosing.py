"""What choosing among many models costs: the least of many errors is too low, and may be another's."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Array
from mckibben.numerals import numeral
from mckibben.signals.checking import generator
from mckibben.statistics import RESAMPLES

FEWEST = 4
"""Pieces of a cross-validation that can be resampled."""

RARE = 0.01
"""Share of the resamples below which it is not told that another model is chosen."""


@dataclass(frozen=True)
class Choice:
    """The choice of the least of several cross-validated errors, and its price.

    Parameters
    ----------
    among : int
        Models that could have been chosen.
    picked : mapping of str to float
        Share of the resamples of the cross-validation in which each would have been, most first.
    error : float
        Cross-validated RMSE of the model chosen.
    expected : float
        What choosing so gives on data that had no say: the mean of what each resample's choice does on
        the pieces that are not in the resample. At least `error`.
    """

    among: int
    picked: Mapping[str, float]
    error: float
    expected: float

    def said(self, unit: str) -> str:
        """Return that in words."""
        if not self.error > 0:
            return ""
        price = self.expected / self.error - 1
        own, fair = (f"{numeral(e, 3)} {unit}".strip() for e in (self.error, self.expected))
        first, *others = [
            f"{model} in {numeral(100 * share, 2)} %"
            for model, share in self.picked.items()
            if share >= RARE
        ]
        cost = f"choosing among {self.among} models by cross-validation costs next to nothing"
        if price >= RARE:
            cost = (
                f"the price of choosing among {self.among} models: the least error of "
                f"cross-validation, {own}, is too low by about {numeral(100 * price, 2)} %; "
                f"without that {fair}"
            )
        return f"{cost}. Resampled data choose {', '.join([f'{first} of the cases', *others])}"

    def to_dict(self) -> dict[str, Any]:
        """Return the fields, ready for JSON."""
        return asdict(self) | {"picked": dict(self.picked)}


def choice_of(
    squares: Mapping[str, Sequence[Sequence[float]]], counts: Sequence[int], seed: int
) -> Choice | None:
    """Return the choice among models by cross-validated RMSE, and what it costs.

    By the bootstrap of Tsamardinos, Greasidou and Borboudakis (Machine Learning 107, 2018): pieces of
    the cross-validation are resampled, each resample chooses, and its choice is judged on the pieces
    that it lacks. No model is fitted again.

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
    order = sorted(range(len(models)), key=lambda k: (-shares[k], own[k]))
    error = float(own.min())
    return Choice(
        among=len(models),
        picked={models[k]: float(shares[k]) for k in order if shares[k] > 0},
        error=error,
        expected=max(error, float(np.sqrt(outside.mean(axis=0)).mean())),
    )


def _mean_squares(table: Array, sizes: Array, weights: NDArray[Any]) -> Array:
    """Return mean squared errors under weights of pieces, shape (models, resamples, outputs)."""
    summed = np.einsum("mpo,rp->mro", table, weights.astype(float))
    return np.asarray(summed / (weights @ sizes)[:, np.newaxis])
