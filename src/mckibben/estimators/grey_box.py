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
from annotated_types import Ge, Gt, Interval
from numpy.typing import NDArray

from mckibben.blocks.base import Block
from mckibben.blocks.braid_equilibrium import BraidEquilibrium
from mckibben.blocks.compose import Series
from mckibben.blocks.creep import Creep
from mckibben.blocks.fields import Channel, vector
from mckibben.blocks.logarithm import FLOOR, Exponential, Logarithm
from mckibben.blocks.pi import PI
from mckibben.errors import DataError
from mckibben.estimators.base import Operators
from mckibben.estimators.creep_pi import (
    FASTEST,
    MOST_CREEP,
    SLOWEST,
    creep_moves,
    with_creep,
)
from mckibben.estimators.data import Run, TrainingData
from mckibben.estimators.pi import play_operators
from mckibben.estimators.search import Tracker
from mckibben.estimators.separable import (
    LEAST_REVERSIBLE,
    SeparableEstimator,
    counting,
    difference,
)
from mckibben.estimators.thresholds import spread

Array = NDArray[np.float64]

PHYSICS = 5
"""Parameters of the balance that are searched: offset, load, stiffness, hardening, braid angle."""


@dataclass(kw_only=True, repr=False, eq=False)
class GreyBoxEstimator(SeparableEstimator):
    """Grey-box muscle under a constant load, pressure to displacement.

    Parameters
    ----------
    n_operators : int
        Friction elements.
    n_creep : int
        Visco-elastic elements.
    diameter : float
        Of the muscle at rest [mm]; scales load and stiffness, and nothing else.
    """

    effort: ClassVar[float] = 1.2

    n_operators: Operators = 6
    n_creep: Annotated[int, Interval(ge=0, le=5)] = 2
    diameter: Annotated[float, Gt(0)] = 20.0
    n_starts: Annotated[int, Ge(1)] = 32
    n_refined: Annotated[int, Ge(1)] = 4

    searches_condensed: ClassVar[bool] = False
    made_for: ClassVar[tuple[str, str] | None] = ("pressure", "displacement")

    def identify(self, data: TrainingData, tracker: Tracker) -> tuple[Block, TrainingData]:
        """Return the block found, and the data with the memories at the start that belong to it."""
        if data.sample_time is None and self.n_creep > 0:
            raise DataError(
                "the recordings have no time, and creep depends on it",
                remedy="read them with a time column or --rate, or use n_creep=0",
            )
        return super().identify(data, tracker)

    # theta is [relative weights, log offset, log load, log stiffness, log hardening, braid angle,
    #           log time constants, compliances]

    def bounds(self, data: TrainingData) -> tuple[Array, Array]:
        """Return bounds of the searched parameters; forces relative to 1 bar on the cross-section."""
        n, k = self.n_operators, self.n_creep
        low, high = data.input_range
        step = data.sample_time or 1.0
        longest = max(run.u.size for run in data.runs) * step
        least = np.log(max(0.01 * (high - low), 0.1 - low))
        area = 0.1 * np.pi / 4 * self.diameter**2
        forces = np.log(area * np.array([[1e-2, 1e-2, 1e-2], [30.0, 300.0, 3000.0]]))
        slow = np.log(max(SLOWEST * longest, 30 * step))
        lower = [*[0.0] * n, least, *forces[0], 0.2]
        upper = [*[1.0] * n, max(np.log(high - low), least + 1), *forces[1], 0.9]
        lower[0] = LEAST_REVERSIBLE
        lower += [*[np.log(FASTEST * step)] * k, *[0.0] * k]
        upper += [*[slow] * k, *[MOST_CREEP] * k]
        return np.array(lower), np.array(upper)

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
            Channel(data.input, data.input_unit),
            Channel(data.output, data.output_unit),
        )

    def memory(self, theta: Array, data: TrainingData) -> tuple[Logarithm, Array, Array]:
        """Return the logarithm, the thresholds on it, and weights that add up to 1."""
        n = self.n_operators
        channel = Channel(data.input, data.input_unit)
        logarithm = Logarithm(float(np.exp(theta[n])), channel, channel)
        low, high = logarithm.simulate(np.array(data.input_range))
        radii = 0.6 * spread(n, high - low, "even")
        return logarithm, radii, theta[:n] / theta[:n].sum()

    def creep(self, theta: Array) -> tuple[Array, Array]:
        """Return time constants and compliances, the fastest first."""
        k = self.n_creep
        tail = theta[self.n_operators + PHYSICS :]
        taus, compliances = np.exp(tail[:k]), tail[k:]
        order = np.argsort(taus, kind="stable")
        return taus[order], compliances[order]

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
        """Return how the output moves with the non-linear parameters, the linear one held."""
        n, k = self.n_operators, self.n_creep
        braid = self.braid(theta, data)
        step = difference(theta[n], self.bounds(data)[1][n])
        raised = theta + step * (np.arange(theta.size) == n)
        # loads and stiffnesses are searched by their logarithms, the angle as it is
        factors = np.append(np.exp(theta[n + 1 : n + 4]), 1.0)
        taus, compliances = np.exp(theta[n + PHYSICS :][:k]), theta[n + PHYSICS + k :]

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
        taus, compliances = self.creep(theta)
        given, result = logarithm.input, Channel(data.output, data.output_unit)
        low, high = logarithm.simulate(np.array(data.input_range)).tolist()
        rest = offset / (1.0 + compliances.sum())
        parts: list[Block] = [
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
        ]
        if self.n_creep:
            parts.append(Creep(vector(compliances), vector(taus), result, result))
        return Series(tuple(parts))

    def parameter_bounds(self, data: TrainingData) -> tuple[Block, Array, Array]:
        """Return the series solved for at the first guess, and bounds about it that keep it valid."""
        theta = self.guesses(data)[0]
        template = self.build(theta, *self._solve(theta, data), data)
        values = template.pack()
        span = 0.9 * np.abs(values)
        lower, upper = values - span, values + span
        angle = 1 + self.n_operators + 1 + 1 + 3
        lower[angle], upper[angle] = 0.2, 0.9
        return template, lower, upper
