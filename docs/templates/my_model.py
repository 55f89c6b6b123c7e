"""The elastic-plastic model: y = g u + w (u - F_r[u]), a spring in parallel with one that slips.

F_r is the play operator of threshold r. Source: title of the paper, equations, and any deviations.
"""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import FiniteFloat
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks import fields
from mckibben.blocks.base import Block
from mckibben.blocks.inverse import Invertible
from mckibben.blocks.kernels import kernel
from mckibben.blocks.runs import Run
from mckibben.blocks.solving import solved_kernels
from mckibben.estimators.core.data import TrainingData
from mckibben.estimators.core.separable import LEAST_REVERSIBLE, SeparableEstimator


@kernel
def advance(u: float, c: Array, state: Array) -> None:
    """Advance the play operator, which is the state; c is [g, w, r]."""
    state[0] = min(max(state[0], u - c[2]), u + c[2])


@kernel
def trial(u: float, memory: tuple[Array, Array]) -> float:
    """Return the output for an input, without changing the state; the inverse is solved with it."""
    c, state = memory
    return c[0] * u + c[1] * (u - min(max(state[0], u - c[2]), u + c[2]))


@kernel
def elastic_plastic_start(coefficients: Array, state: Array, inputs: Array, virgin: bool) -> None:
    """Initialize for an input that has only risen to the first sample, or for a virgin state."""
    u, r = inputs[0], coefficients[2]
    state[0] = min(max(0.0, u - r), u + r) if virgin else u - r


@dataclass(frozen=True, config=fields.STRICT)
class ElasticPlastic(fields.WithMemory, Invertible):
    """Elastic-plastic model.

    Parameters
    ----------
    gain, weight : float
        g, slope while slipping, and w, additional slope while sticking; the inverse requires g + w > 0.
    threshold : float
        Change of the input from the middle until slipping; at least 0.
    input_range : (float, float), optional
        Lowest and highest input; required by the inverse, which clips there.
    """

    kind = "elastic-plastic"
    start_kernel = elastic_plastic_start
    kernel, inverse_kernel, inverse_start_kernel = solved_kernels(trial, advance, start_kernel)
    solved, inverse_memory = True, "input"
    parameters = ("gain", "weight", "threshold")  # the kernel's coefficients, in this order
    typical = (4.0, -1.5, 0.4, (0.0, 5.0))  # arguments of `example`, which the tests use
    formulas = (r"y = g u + w (u - F_r[u])",)

    gain: Annotated[fields.Positive, "g [{y}/{u}]"]
    weight: Annotated[FiniteFloat, "w [{y}/{u}]"]
    threshold: Annotated[fields.NotNegative, "r [{u}]"]
    input_range: fields.InputRange | None = None
    n_states = 1

    def peaks(self) -> Array:  # input from which the operator just returns to its lowest state
        return np.array([self.input_limits[0] + 2 * self.threshold])

    def least_slope(self) -> float:  # must be positive for the inverse
        return min(self.gain, self.gain + self.weight)


class ElasticPlasticEstimator(SeparableEstimator):
    """Elastic-plastic model: the threshold is searched, the slopes are solved for by least squares."""

    title = "Elastic-plastic model"
    purpose = "memory"
    can = "One loop of straight branches, with nonlocal memory."
    cannot = "No curved branches, no rate, no creep."
    inverse_kind = "solved"
    makes = ("elastic-plastic",)
    fits_offset = False

    def bounds(self, data: TrainingData) -> tuple[Array, Array]:  # of theta, [threshold / range]
        return np.array([0.005]), np.array([0.45])

    def guesses(self, data: TrainingData) -> list[Array]:
        return [np.array([share]) for share in (0.02, 0.08, 0.2)]

    def basis(self, theta: Array, run: Run, data: TrainingData) -> Array:  # regressors
        play = self.build(theta, np.array([0.0, 1.0]), 0.0, data).simulate(run.u)
        return np.column_stack([run.u - play, play])

    def lower_bounds(self, matrix: Array, data: TrainingData) -> Array:  # bounds for the inverse
        return LEAST_REVERSIBLE * np.ptp(data.output_range) / np.ptp(matrix, axis=0)

    def build(self, theta: Array, linear: Array, offset: float, data: TrainingData) -> Block:
        sticking, slipping = linear.tolist()
        return ElasticPlastic(
            slipping,
            sticking - slipping,
            float(theta[0] * np.ptp(data.input_range)),
            **self.common_fields(data),
        )
