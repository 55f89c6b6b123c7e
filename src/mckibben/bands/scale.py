"""How much a model misses by the state of motion: few weights, as many as runs left out bear out.

What is missed on average, and the logarithm of what is missed beside, are linear in the state of motion.
Weights are small (ridge), by how well they foresee what is missed on runs left out; with no state that
foresees anything the scale is constant.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Array
from mckibben.blocks.bands import FARTHEST

RIDGES = (1e-4, 1e-3, 1e-2, 1e-1, 1.0, 1e3)
"""Of weights, per sample."""

FLOOR = 0.1
"""Of the median miss, below which misses count as alike."""

PARTS = 4
"""That weights are tried on."""


class Shape(NamedTuple):
    """What a scale may be made of: a shift by state, a scale by state."""

    shift: bool
    scale: bool


SHAPES = (Shape(False, False), Shape(False, True), Shape(True, True))
"""From the simplest on."""


@dataclass(frozen=True)
class Terms:
    """What weights multiply: found once on all runs, for it asks nothing of what is missed.

    Parameters
    ----------
    mean, spread : array, shape (s,)
        Of the state of motion.
    """

    mean: Array
    spread: Array

    @classmethod
    def of(cls, seen: Array) -> Terms:
        """Return terms for states of motion, shape (n, s)."""
        spread = seen.std(axis=0)
        return cls(seen.mean(axis=0), np.where(spread > 1e-9, spread, 1.0))

    def __call__(self, seen: Array) -> Array:
        """Return 1, and the state of motion in deviations from its mean, shape (n, 1 + s)."""
        z = ((seen - self.mean) / self.spread).clip(-FARTHEST, FARTHEST)
        return np.column_stack([np.ones(len(z)), z])


@dataclass(frozen=True)
class Scale:
    """What is missed on average (``shift``), and how much beside (``log_scale``), by weights of terms.

    ``limits`` are the least and the largest of either.
    """

    shift: Array
    log_scale: Array
    limits: tuple[float, float, float, float]

    def scores(self, terms: Array, missed: Array) -> Array:
        """Return how wide, in scales, a band must be to hold what is missed, shape (n,); see `Band`."""
        shift, scale = self.at(terms)
        return np.asarray((np.sign(missed) * (missed - shift) / scale).clip(0.0))

    def width(self, terms: Array, half: float) -> float:
        """Return the mean width of the band at a quantile of the scores."""
        shift, scale = self.at(terms)
        ends = np.maximum(shift + half * scale, 0.0) - np.minimum(shift - half * scale, 0.0)
        return float(ends.mean())

    def at(self, terms: Array) -> tuple[Array, Array]:
        """Return shift and scale, each of shape (n,)."""
        a, b, c, d = self.limits
        return (terms @ self.shift).clip(a, b), np.exp((terms @ self.log_scale).clip(c, d))


def scale_of(
    terms: Array,
    missed: Array,
    units: NDArray[np.intp],
    shape: Shape,
    typical: Array,
) -> Scale:
    """Return the scale that misses (n,) ask for.

    It is 1 at ``typical`` terms: it tells where more is missed, and the scores how much. Else runs that
    miss more than those a scale was found on would have it widen the band twice: by their scores, and
    again in the scale that knows them.

    Parameters
    ----------
    terms : array, shape (n, t)
        Of which the first is 1, the others the state of motion.
    units : array of int, shape (n,)
        Which run, or block, a sample is of: weights are tried on some that they do not know.
    shape : Shape
        What it may be made of.
    typical : array, shape (t,)
        Mean of all terms there are, also of units left out.
    """
    part = _parts(units)
    shift, left = np.zeros(terms.shape[1]), missed
    if shape.shift:
        shift, foreseen = _ridge(terms, missed, part)
        left = missed - foreseen
    size = np.abs(left)
    floor = FLOOR * float(np.median(size)) or float(size.mean()) or 1.0
    log_scale = np.zeros(terms.shape[1])
    if shape.scale:
        log_scale, _ = _ridge(terms, np.log(size + floor), part)
        log_scale[0] -= typical @ log_scale
    m, s = terms @ shift, terms @ log_scale
    low, high = np.quantile(s, [0.01, 0.999])
    limits = (float(m.min()), float(m.max()), float(low), float(high))
    return Scale(shift, log_scale, limits)


def _parts(units: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return which part a sample is of; neighbours in time are of one."""
    _, place = np.unique(units, return_inverse=True)
    n = int(place.max()) + 1
    return np.asarray(place * min(PARTS, n) // n)


def _ridge(terms: Array, wanted: Array, part: NDArray[np.intp]) -> tuple[Array, Array]:
    """Return weights, and what weights that do not know a part foresee there, at the best ridge."""
    n, n_terms = terms.shape
    places = [part == k for k in range(int(part.max()) + 1)]
    squares = [terms[p].T @ terms[p] for p in places]
    products = [terms[p].T @ wanted[p] for p in places]
    square, product = sum(squares), sum(products)
    small = np.eye(n_terms)
    small[0, 0] = 1e-9  # the constant is free
    best, weight = np.inf, RIDGES[-1]
    foreseen = np.full(n, wanted.mean())
    for ridge in RIDGES if len(places) > 1 else RIDGES[-1:]:
        tried = np.empty(n)
        for p, a, b in zip(places, squares, products, strict=True):
            known = (n - int(p.sum())) or n
            others = (square - a, product - b) if known < n else (square, product)
            tried[p] = terms[p] @ np.linalg.solve(others[0] + ridge * known * small, others[1])
        error = float(np.mean((wanted - tried) ** 2))
        if error < best:
            best, weight, foreseen = error, ridge, tried
    return np.linalg.solve(square + weight * n * small, product), foreseen
