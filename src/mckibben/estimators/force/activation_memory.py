"""Identification of activation pressure with nonlocal memory: linear, so solved for at once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from annotated_types import Ge, Interval

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.fields import vector
from mckibben.blocks.force.activation_memory import ActivationMemory
from mckibben.estimators.core.data import Run, TrainingData
from mckibben.estimators.core.estimator import Operators
from mckibben.estimators.core.separable import SeparableEstimator
from mckibben.estimators.optimisers.tracker import Tracker


@dataclass(kw_only=True, repr=False, eq=False)
class ActivationMemoryEstimator(SeparableEstimator):
    """Activation pressure that needs no frequency.

    Parameters
    ----------
    force : str
        Channel of the force.
    degree, force_degree : int
        Of the static surface, in contraction and force.
    n_operators : int
        Stop operators.
    largest : float
        Largest threshold, relative to the range of the contraction.
    time_constants : sequence of float
        Of what relaxes [s], positive; may be empty.
    rate_time_constant : float, optional
        Of the filter of the rate [s]; default three samples.
    """

    title = "Activation pressure with memory"
    purpose = "force"
    can = (
        "Pressure for a contraction under a varying force, at any frequency: surface, "
        "friction with memory, viscosity, relaxation."
    )
    cannot = (
        "Is itself a compensator, so it has no inverse here; extrapolates as polynomials do "
        "beyond the forces and contractions seen."
    )
    quick = True
    needs_time: ClassVar[bool] = True

    effort: ClassVar[float] = 1.0

    input: str = "contraction"
    output: str = "pressure"
    force: str = "force"
    degree: Annotated[int, Interval(ge=1, le=9)] = 4
    force_degree: Annotated[int, Interval(ge=0, le=5)] = 3
    n_operators: Operators = 6
    largest: Annotated[float, Interval(gt=0, le=0.5)] = 0.2
    time_constants: tuple[float, ...] = (0.1, 0.6, 4.0)
    rate_time_constant: Annotated[float, Ge(0)] | None = None
    nonnegative: bool = False

    made_for: ClassVar[tuple[str, str] | None] = ("contraction", "pressure")
    told: ClassVar[tuple[str, ...]] = ("force",)
    rises: ClassVar[bool] = False
    searches_condensed: ClassVar[bool] = False
    reach: ClassVar[tuple[float, float]] = (2.0, 0.05)

    def identify(self, data: TrainingData, tracker: Tracker) -> tuple[Block, TrainingData]:
        data.timed()
        return super().identify(data, tracker)

    def unit(self, data: TrainingData) -> ActivationMemory:
        """Return the model with zero parameters."""
        forces = np.concatenate([run.scheduled[:, 0] for run in data.runs])
        low, high = data.input_range
        n = self.n_operators
        weakest, strongest = float(forces.min()), float(forces.max())
        varies = strongest - weakest > 1e-6 * max(abs(strongest), 1.0)
        thresholds = self.largest * (high - low) * (np.arange(1, n + 1) / n) ** 1.5
        tau = self.rate_time_constant
        return ActivationMemory(
            (0.0,) * ((self.degree + 1) * (self.force_degree + 1)),
            vector(thresholds),
            (0.0,) * (2 * n),
            (0.0, 0.0),
            (0.0,) * (2 * len(self.time_constants)),
            self.time_constants,
            self.degree,
            self.force_degree,
            (0.5 * (low + high), 0.5 * (high - low)),
            (0.5 * (weakest + strongest), 0.5 * (strongest - weakest) if varies else 1.0),
            3 * (data.sample_time or 1.0) if tau is None else tau,
            self.starting_rule,
            **self.channels(data),
        )

    def basis(self, theta: Array, run: Run, data: TrainingData) -> Array:
        """Return the output by each coefficient alone but the constant, over the run's history."""
        unit = self.unit(data)
        alone = np.eye(unit.n_parameters)[1:]
        return unit.simulate_many(alone, run.inputs, sample_time=run.sample_time).T

    def _solve_for(self, matrix: Array, data: TrainingData) -> tuple[Array, float]:
        """Solve with every run's errors relative to its own range, so that light loads count too."""
        weights = np.concatenate(
            [
                np.full(int(run.counts.sum()), 1.0 / max(float(np.ptp(run.y[run.counts])), 1e-9))
                for run in data.runs
            ]
        )
        columns = np.column_stack([np.ones(len(matrix)), matrix]) * weights[:, np.newaxis]
        size = np.linalg.norm(columns, axis=0)
        size[size == 0] = 1.0
        found = np.linalg.lstsq(columns / size, data.target * weights, rcond=1e-10)[0] / size
        return found[1:], float(found[0])

    def build(self, theta: Array, linear: Array, offset: float, data: TrainingData) -> Block:
        return self.unit(data).unpack([offset, *linear])
