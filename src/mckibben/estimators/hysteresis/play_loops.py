"""Models of a reversible, increasing polynomial and loops on top, linear in both.

y = offset + sum_k a_k B_k(x) + sum_j w_j (s_j x - z_j) + sum_j v_j z_j, all of a, w and v at least
0, where x runs from 0 to 1 over the input's range, the B_k are integrals of Bernstein polynomials,
the z_j are what the loops are made of, and s_j bounds the slope of z_j by x. Whatever the data,
such a sum rises with its input, so it has an inverse; and loops may lag (w) or lead (v).
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Interval

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.estimators.core.data import Run, TrainingData
from mckibben.estimators.core.output_maps import PolynomialMap
from mckibben.estimators.core.separable import SeparableEstimator

LEAST_SLOPE = 1e-4
"""Least share of the output's range that each piece of the polynomial gives."""


@dataclass(kw_only=True, repr=False, eq=False)
class LoopEstimator(SeparableEstimator):
    """An estimator of a reversible polynomial with loops on top.

    Parameters
    ----------
    degree : int
        Of the reversible polynomial.
    """

    degree: Annotated[int, Interval(ge=1, le=9)] = 5

    @abstractmethod
    def loops(self, theta: Array, run: Run, data: TrainingData) -> tuple[Array, Array]:
        """Return z over the run's history, shape (n, m), and the bounds of its slopes, shape (m,)."""

    @abstractmethod
    def assemble(
        self, theta: Array, polynomial: Array, weights: Array, data: TrainingData
    ) -> Block:
        """Return the block of an ascending polynomial in x, shape (degree + 1,), and weights of z."""

    def basis(self, theta: Array, run: Run, data: TrainingData) -> Array:
        """Return the pieces of the polynomial, then the loops that lag, then those that lead."""
        low, high = data.input_range
        x = (run.history - low) / (high - low)
        z, slopes = self.loops(theta, run, data)
        pieces = PolynomialMap(self.degree).pieces(x)
        if not self.nonnegative:
            return np.column_stack([pieces, z])
        return np.column_stack([pieces, slopes * x[:, np.newaxis] - z, z])

    def least(self, matrix: Array, data: TrainingData) -> Array:
        """Return a little of every piece of the polynomial, and nothing of the loops."""
        floor = np.zeros(matrix.shape[1])
        low, high = data.output_range
        floor[: self.degree] = LEAST_SLOPE * (high - low)
        return floor

    def build(self, theta: Array, linear: Array, offset: float, data: TrainingData) -> Block:
        polynomial = PolynomialMap(self.degree).powers(linear[: self.degree])
        polynomial[0] += offset
        if not self.nonnegative:
            return self.assemble(theta, polynomial, linear[self.degree :], data)
        lagging, leading = np.split(linear[self.degree :], 2)
        _, slopes = self.loops(theta, _short(data.runs[0]), data)
        polynomial[1] += float(slopes @ lagging)
        return self.assemble(theta, polynomial, leading - lagging, data)

    def parameter_bounds(self, data: TrainingData) -> tuple[Block, Array, Array]:
        """Return the block solved for, and bounds of which those of its shape are fixed."""
        template, lower, upper = super().parameter_bounds(data)
        low, high = self.shape_bounds(data)
        lower[lower.size - low.size :], upper[upper.size - high.size :] = low, high
        return template, lower, upper

    @abstractmethod
    def shape_bounds(self, data: TrainingData) -> tuple[Array, Array]:
        """Return bounds of the block's last parameters, those that are not linear."""


def _short(run: Run) -> Run:
    """Return the first samples of a run, enough to ask for bounds of slopes."""
    return run.cut(0, 2)
