"""Identification of a grey-box muscle: friction memory, balance of braid forces, and creep.

Every part is physics in its own units: friction in proportion to pressure makes play operators on the
logarithm of pressure, whose weights add up to 1, so that they give the pressure that is left for the
braid; the braid's geometry, its load and elasticity give the contraction; and Kelvin-Voigt elements let
it creep.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from annotated_types import Ge, Gt

from mckibben.arrays import Array
from mckibben.blocks.compose import Series
from mckibben.blocks.core.block import Block
from mckibben.blocks.core.fields import vector
from mckibben.blocks.force.braid_equilibrium import BraidEquilibrium
from mckibben.blocks.memoryless.logarithm import FLOOR, Exponential, Logarithm
from mckibben.blocks.play_type.pi import PI
from mckibben.estimators.core.data import Run, TrainingData
from mckibben.estimators.core.estimator import Operators
from mckibben.estimators.core.separable import LEAST_REVERSIBLE, counting
from mckibben.estimators.play_type.creeping import CreepingEstimator, creep_moves, with_creep
from mckibben.estimators.play_type.pi import play_operators
from mckibben.estimators.play_type.thresholds import spread


@dataclass(kw_only=True, repr=False, eq=False)
class GreyBoxEstimator(CreepingEstimator):
    """Grey-box muscle under a constant load, pressure to displacement.

    Parameters
    ----------
    diameter : float
        Of the muscle at rest [mm]; scales load and stiffness, and nothing else.
    """

    effort: ClassVar[float] = 1.2

    n_operators: Operators = 6
    diameter: Annotated[float, Gt(0)] = 20.0
    n_starts: Annotated[int, Ge(1)] = 32
    n_refined: Annotated[int, Ge(1)] = 4

    reach: ClassVar[tuple[float, float]] = (0.9, 0.0)
    made_for: ClassVar[tuple[str, str] | None] = ("pressure", "displacement")

    # theta is [relative weights, log offset, log load, log stiffness, log hardening, braid angle,
    #           log time constants, compliances]

    def bounds(self, data: TrainingData) -> tuple[Array, Array]:
        """Return bounds of the searched parameters; forces relative to 1 bar on the cross-section."""
        area = 0.1 * np.pi / 4 * self.diameter**2
        forces = np.log(area * np.array([[1e-2, 1e-2, 1e-2], [30.0, 300.0, 3000.0]]))
        return self.bounds_about(data, 1.0, ([*forces[0], 0.2], [*forces[1], 0.9]))

    def guesses(self, data: TrainingData) -> list[Array]:
        """Return muscles of usual braid angles and a few loads, with some creep."""
        lower, upper = self.bounds(data)
        n, k = self.n_operators, self.n_creep
        area = 0.1 * np.pi / 4 * self.diameter**2
        middle = np.linspace(lower[-2 * k :][:k], upper[-2 * k :][:k], 5)
        taus = np.array([middle[min(1 + j, 3), j] for j in range(k)])
        weights = np.maximum(np.exp(-1.0 * np.arange(n)), LEAST_REVERSIBLE)
        return [
            np.concatenate(
                [
                    weights,
                    [lower[n] + 0.2],
                    np.log(area * np.array([load, 4.0 * load, 20.0 * load])),
                    [angle],
                    taus,
                    np.full(k, 0.07),
                ]
            )
            for angle in (0.4, 0.6)
            for load in (1.0, 4.0, 10.0)
        ]

    def braid(self, theta: Array, data: TrainingData) -> BraidEquilibrium:
        """Return the balance for a rest length of 1 mm."""
        n = self.n_operators
        load, stiffness, hardening = np.exp(theta[n + 1 : n + 4]).tolist()
        angle = float(theta[n + 4])
        return BraidEquilibrium(
            load,
            stiffness,
            hardening,
            angle,
            1.0,
            0.0,
            self.diameter,
            data.inputs[0],
            data.outputs[0],
        )

    def memory(self, theta: Array, data: TrainingData) -> tuple[Logarithm, Array, Array]:
        """Return the logarithm, the thresholds on it, and weights that add up to 1."""
        n = self.n_operators
        channel = data.inputs[0]
        logarithm = Logarithm(float(np.exp(theta[n])), channel, channel)
        low, high = logarithm.simulate(np.array(data.input_range))
        radii = 0.6 * spread(n, high - low, "even")
        return logarithm, radii, theta[:n] / theta[:n].sum()

    def basis(self, theta: Array, run: Run, data: TrainingData) -> Array:
        """Return the contraction over the run's history, with its creep."""
        pressure, _ = self.pressure(theta, run, data)
        contraction = self.braid(theta, data).simulate(pressure)
        return with_creep(contraction[:, np.newaxis], *self.creep(theta), run.sample_time)

    def pressure(self, theta: Array, run: Run, data: TrainingData) -> tuple[Array, Array]:
        """Return the pressure left for the braid, and its derivatives by the relative weights."""
        logarithm, radii, weights = self.memory(theta, data)
        along = logarithm.simulate(run.history)
        operators = play_operators(along, radii, self.starting_rule)
        left = operators @ weights
        pressure = logarithm.inverse().simulate(left)
        steepness = np.maximum(pressure + logarithm.offset, FLOOR) / theta[: self.n_operators].sum()
        return pressure, steepness[:, np.newaxis] * (operators - left[:, np.newaxis])

    def moves(self, theta: Array, linear: Array, data: TrainingData) -> Array:
        n = self.n_operators
        braid = self.braid(theta, data)
        raised, step = self.raised(theta, data)
        # loads and stiffnesses are searched by their logarithms, the angle as it is
        factors = np.append(np.exp(theta[n + 1 : n + 4]), 1.0)
        taus, compliances = self.tail(theta)

        def of(run: Run) -> Array:
            pressure, by_weights = self.pressure(theta, run, data)
            by_offset = (self.pressure(raised, run, data)[0] - pressure) / step
            given = braid.simulate(pressure)
            by_pressure, by_physics = braid.slopes(given)
            driven = by_pressure[:, np.newaxis] * np.column_stack([by_weights, by_offset])
            at_once = linear[0] * np.column_stack([driven, by_physics * factors])
            crept = with_creep(at_once, taus, compliances, run.sample_time)
            late = creep_moves(linear[0] * given, taus, compliances, run.sample_time)
            return np.column_stack([crept, late])

        return counting(data, of)

    def build(self, theta: Array, linear: Array, offset: float, data: TrainingData) -> Series:
        """Return the series: logarithm, friction, its exponential, the braid, and creep."""
        from dataclasses import replace

        logarithm, radii, weights = self.memory(theta, data)
        compliances = self.creep(theta)[1]
        given, result = logarithm.input, data.outputs[0]
        low, high = logarithm.simulate(np.array(data.input_range)).tolist()
        rest = offset / (1.0 + compliances.sum())
        parts = (
            logarithm,
            PI(
                vector(radii),
                vector(weights),
                0.0,
                (low, high),
                self.starting_rule,
                given,
                given,
            ),
            Exponential(logarithm.offset, given, given),
            replace(self.braid(theta, data), rest_length=float(linear[0]), offset=rest),
            *self.creep_parts(theta, result),
        )
        return Series(parts)

    def parameter_bounds(self, data: TrainingData) -> tuple[Block, Array, Array]:
        """Return the series solved for, and bounds that keep the angle valid."""
        template, lower, upper = super().parameter_bounds(data)
        angle = 1 + self.n_operators + 1 + 1 + 3
        lower[angle], upper[angle] = 0.2, 0.9
        return template, lower, upper
