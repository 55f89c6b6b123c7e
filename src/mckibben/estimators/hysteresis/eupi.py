"""Identification of the extended unparallel Prandtl-Ishlinskii model."""

from __future__ import annotations

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.fields import vector
from mckibben.blocks.hysteresis.eupi import EUPI, eupi_matrix
from mckibben.blocks.hysteresis.play_operators import started
from mckibben.estimators.core.data import Run, TrainingData
from mckibben.estimators.core.estimator import Operators
from mckibben.estimators.core.separable import SeparableEstimator
from mckibben.estimators.hysteresis.output_maps import PolynomialMap
from mckibben.estimators.hysteresis.pi import spread

CUBIC = PolynomialMap(3)


class EUPIEstimator(SeparableEstimator):
    """Extended unparallel Prandtl-Ishlinskii model by variable projection.

    The slope and the threshold ratio of the falling edge are searched; the weights and an increasing
    cubic without memory are solved for.

    Parameters
    ----------
    n_operators : int
        Unparallel play operators.
    """

    title = "Extended unparallel Prandtl–Ishlinskii model (EUPI)"
    purpose = "memory"
    can = "Asymmetric loops by edges of different slope and threshold."
    cannot = "One asymmetry for all operators; the inverse needs non-negative weights."
    inverse_kind = "solved"
    makes = ("eupi",)
    effort = 0.3

    n_operators: Operators = 10
    n_starts = 16

    def bounds(self, data: TrainingData) -> tuple[Array, Array]:
        """Return bounds of the falling edge's slope and threshold ratio."""
        return np.array([0.3, 0.0]), np.array([3.0, 3.0])

    def guesses(self, data: TrainingData) -> list[Array]:
        """Return parallel edges, and slightly different ones."""
        return [np.array(edges) for edges in ([1.0, 1.0], [1.2, 0.8], [0.8, 1.2])]

    def basis(self, theta: Array, run: Run, data: TrainingData) -> Array:
        """Return the pieces of the cubic, then the operators, over the run."""
        low, high = data.input_range
        x = np.ascontiguousarray(run.u - low)
        radii = spread(self.n_operators, data.input_range)
        operators = np.empty((x.size, radii.size))
        state = started(radii, x[0], x[0], self.starting_rule)
        eupi_matrix(x, theta[0], theta[1], radii, state, operators)
        return np.column_stack([CUBIC.pieces(x / (high - low)), operators])

    def least(self, matrix: Array, data: TrainingData) -> Array:
        """Return a small lower bound of every piece of the cubic, so that it increases."""
        low, high = data.output_range
        return np.where(np.arange(matrix.shape[1]) < CUBIC.size, 1e-3 * (high - low), 0.0)

    def build(self, theta: Array, linear: Array, offset: float, data: TrainingData) -> EUPI:
        low, high = data.input_range
        slope, ratio = theta.tolist()
        a, b, c = (CUBIC.powers(linear[:3])[1:] / (high - low) ** np.arange(1, 4)).tolist()
        return EUPI(
            vector(spread(self.n_operators, data.input_range)),
            vector(linear[3:]),
            slope,
            ratio,
            (a, b, c),
            offset,
            **self.common_fields(data),
        )
