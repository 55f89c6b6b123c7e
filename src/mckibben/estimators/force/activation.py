"""Identification of activation pressure: with memory, in closed form; and as in its paper.

Source of the latter: "Inverse Modeling of Nonlinear Artificial Muscle Using Polynomial Parameterization
and Particle Swarm Optimization", Sections 4.2 to 4.4; gamma and phi are found by least squares, or by
the particle swarm that the paper prints.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Interval

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.fields import vector
from mckibben.blocks.force.activation import ActivationMemory, ActivationPressure
from mckibben.blocks.runs import Run
from mckibben.errors import DataError
from mckibben.estimators.core.data import TrainingData
from mckibben.estimators.core.estimator import Operators, SearchEstimator
from mckibben.estimators.core.separable import DIFFERENCE, SeparableEstimator
from mckibben.numerics.descent import Errors, by_differences, trust_region
from mckibben.numerics.least_squares import solve_bounded
from mckibben.numerics.statistics import rms
from mckibben.numerics.swarm import Swarm, particle_swarm
from mckibben.numerics.tracker import Tracker
from mckibben.signals.reversals import reversals

SMOOTHED = 3.0
"""Default length of the rate filter [samples]."""

LEAST_GAIN, MOST_EVALUATIONS = 1e-8, 100
"""Smallest relative reduction of the squared error for another step; most evaluations of a search."""

# -- with memory -----------------------------------------------------------------------------


class ActivationMemoryEstimator(SeparableEstimator):
    """Activation pressure for any frequency.

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
        "beyond the recorded forces and contractions."
    )
    quick = True
    effort = 1.0
    needs_time = True
    made_for = ("contraction", "pressure")
    input_settings = ("force",)
    rises = False

    force: str = "force"
    degree: Annotated[int, Interval(ge=1, le=9)] = 4
    force_degree: Annotated[int, Interval(ge=0, le=5)] = 3
    n_operators: Operators = 6
    largest: Annotated[float, Interval(gt=0, le=0.5)] = 0.2
    time_constants: tuple[float, ...] = (0.1, 0.6, 4.0)
    rate_time_constant: Annotated[float, Ge(0)] | None = None
    nonnegative = False

    def unit(self, data: TrainingData) -> ActivationMemory:
        """Return the model with zero parameters."""
        forces = data.stacked("scheduled")
        weakest, strongest = float(forces.min()), float(forces.max())
        varies = strongest - weakest > 1e-6 * max(abs(strongest), 1.0)
        half = 0.5 * (strongest - weakest) if varies else 1.0
        n, taus, smoothed = self.n_operators, self.time_constants, self.rate_time_constant
        return ActivationMemory(
            surface=(0.0,) * ((self.degree + 1) * (self.force_degree + 1)),
            thresholds=vector(self.largest * data.input_span * (np.arange(1, n + 1) / n) ** 1.5),
            friction=(0.0,) * (2 * n),
            viscosity=(0.0, 0.0),
            relaxation=(0.0,) * (2 * len(taus)),
            time_constants=taus,
            degree=self.degree,
            force_degree=self.force_degree,
            input_scale=(0.5 * sum(data.input_range), 0.5 * data.input_span),
            force_scale=(0.5 * (weakest + strongest), half),
            rate_time_constant=SMOOTHED * data.timed() if smoothed is None else smoothed,
            initial=self.starting_rule,
            **self.channels(data),
        )

    def basis(self, theta: Array, run: Run, data: TrainingData) -> Array:
        """Return the response to each coefficient but the constant, over the run."""
        unit = self.unit(data)
        alone = np.eye(unit.n_parameters)[1:]
        return unit.simulate_many(alone, run.inputs, sample_time=run.sample_time).T

    def solve(self, matrix: Array, data: TrainingData) -> tuple[Array, float]:
        """Solve with every run's errors relative to its own range, so that light loads count equally."""
        parts = [run.y[run.counts] for run in data.runs]
        weights = np.concatenate(
            [np.full(y.size, 1.0 / max(float(np.ptp(y)), 1e-9)) for y in parts]
        )
        columns = np.column_stack([np.ones(len(matrix)), matrix]) * weights[:, np.newaxis]
        solution, _ = solve_bounded(columns, data.target * weights, with_offset=False)
        return solution[1:], float(solution[0])

    def build(self, theta: Array, linear: Array, offset: float, data: TrainingData) -> Block:
        return self.unit(data).unpack([offset, *linear])


# -- as published ----------------------------------------------------------------------------

CONSTANT_SHARE = 0.05
"""Range of an input, relative to the largest of any run, below which it is noise and the input
constant.
"""

STATIC_SHARE = 0.1
"""Share of the fastest run's frequency below which a run is static: it determines low and high
pressure, and no rate terms.
"""


PRINTED_SWARM = Swarm(50, 100, inertia=(0.4, 0.4), c1=1.5, c2=1.5)
"""Section 4.4. The paper prints no bounds: those of the least squares."""


class ActivationPressureEstimator(SearchEstimator):
    """Activation pressure by characteristic points, and gamma and phi by least squares or a swarm.

    Parameters
    ----------
    method : {"ls", "pso"}
        How gamma and phi are found: by least squares, or by the particle swarm of the paper.
    force : str
        Channel of the force.
    rate_time_constant : float, optional
        Of the filter of the rate [s]; default three samples.
    frequency : float, optional
        Of the excitation in every run [Hz]; default the strongest in each run's spectrum. The model
        found is set to that of the first run that is not static.
    """

    title = "Activation pressure by characteristic points"
    purpose = "force"
    can = "Pressure for a contraction under a force, at one frequency of a sine; as in its paper."
    cannot = "No minor loops, one frequency: its hysteresis is a term in the rate."
    needs_time = True
    made_for = ("contraction", "pressure")
    input_settings = ("force",)

    force: str = "force"
    method: Literal["ls", "pso"] = "ls"
    rate_time_constant: Annotated[float, Ge(0)] | None = None
    frequency: Annotated[float, Ge(0)] | None = None

    def fixed(self, block: Block) -> tuple[int, ...]:
        """Return the indices of undetermined powers of force or frequency, and of gamma's factor.

        Those powers are exactly 0; gamma is 1 at the mean frequency, as phi has the size of both.
        """
        absent = np.flatnonzero(block.pack() == 0).tolist()
        return tuple(sorted({*absent, block.n_parameters - 1}))

    def find(self, data: TrainingData, tracker: Tracker) -> Block:
        """Return the model, set to the first moving run's frequency."""
        step, smoothed, frequency = data.timed(), self.rate_time_constant, self.frequency
        at = frequencies(data) if frequency is None else np.full(len(data.runs), frequency)
        moving = at >= STATIC_SHARE * at.max()
        loops = replace(data, runs=tuple(data.runs[i] for i in np.flatnonzero(moving)))
        contractions, pressures = characteristic_points(data.runs, moving)
        model = ActivationPressure(
            vector(contractions.ravel()),
            vector(pressures.ravel()),
            phi=(0.0, 0.0, 0.0, 1.0),
            gamma=(0.0, 1.0),
            frequency=1.0,
            rate_time_constant=SMOOTHED * step if smoothed is None else smoothed,
            initial=self.starting_rule,
            frequency_range=(float(at[moving].min()), float(at[moving].max())),
            **self.channels(data),
        )
        at = at[moving]
        phi, gamma = self._rates(model, loops.thinned(20_000), at, tracker)
        return replace(model, phi=vector(phi), gamma=gamma, frequency=float(at[0]))

    def _rates(
        self, model: ActivationPressure, data: TrainingData, at: Array, tracker: Tracker
    ) -> tuple[Array, tuple[float, float]]:
        """Return phi (a cubic of the force) and gamma.

        gamma phi is fixed up to a factor, which is chosen such that gamma is 1 at the mean
        frequency.
        """
        full, static = data.simulated([model, replace(model, gamma=(0.0, 0.0))])
        rate, residual, middle = full - static, data.target - static, float(at.mean())
        rises = (at - middle) / max(middle, 1e-9)
        rise = np.repeat(rises, [int(run.counts.sum()) for run in data.runs])
        force = data.scored(lambda run: run.scheduled[:, 0])
        largest = max(float(np.abs(force).max()), 1.0)
        # a cubic of fewer forces than four, and a slope by one frequency, are not determined
        is_determined = np.append(np.arange(4, 0, -1) <= len(by_force(data.runs)), np.ptp(at) > 0)
        powers = np.vander(force / largest, 4) * is_determined[:4]
        start = np.linalg.lstsq(powers * rate[:, np.newaxis], residual, rcond=1e-9)[0]
        width = np.maximum(np.abs(start), np.abs(start).max(initial=1e-6))
        bounds = np.append(start - 2 * width, -1.0), np.append(start + 2 * width, 1.0)

        def errors(point: Array) -> tuple[Array, Callable[[], Array]]:
            shape, grown = powers @ point[:4], (1 + point[4] * rise) * rate
            slopes = [powers * grown[:, np.newaxis], shape * rise * rate]
            return shape * grown - residual, lambda: np.column_stack(slopes)

        if self.method == "pso":
            solution = _swarmed(errors, bounds, tracker, self.seed)
        else:
            solution = _searched(tracker.watched(errors), np.append(start, 0.0), bounds)
        solution = solution * is_determined
        phi = solution[:4] / largest ** np.array([3, 2, 1, 0])
        slope = float(solution[4]) / max(middle, 1e-9)
        return phi, (slope, 1.0 - slope * middle)


def _searched(errors: Errors, start: Array, bounds: tuple[Array, Array]) -> Array:
    path = trust_region(
        errors, start, bounds=bounds, least_gain=LEAST_GAIN, max_evaluations=MOST_EVALUATIONS
    )
    return path[-1][0]


def _swarmed(errors: Errors, bounds: tuple[Array, Array], tracker: Tracker, seed: int) -> Array:
    """Return the best point of the paper's swarm, which starts anywhere within the bounds."""
    start = np.random.default_rng(seed).uniform(*bounds, (PRINTED_SWARM.particles, bounds[0].size))

    def costs(points: Array) -> Array:
        return np.array([rms(errors(point)[0]) for point in points])

    return particle_swarm(costs, *bounds, PRINTED_SWARM, tracker, seed, start)


def frequencies(data: TrainingData) -> Array:
    """Return the dominant frequency of each run's input [Hz]; 0 if it is constant."""
    spans, result = np.array([np.ptp(run.u) for run in data.runs]), []
    for run in data.runs:
        centred, n = run.u - run.u.mean(), 4 * len(run)
        spectrum = np.abs(np.fft.rfft(centred * np.hanning(centred.size), n))
        result.append(np.argmax(spectrum) / (n * data.timed()))
    return np.where(spans < CONSTANT_SHARE * spans.max(), 0.0, result)


# -- characteristic points -------------------------------------------------------------------

SAME_FORCE = 0.02
"""Largest difference of runs of one force, relative to the largest mean force."""

LOW, HIGH = 0.07, 0.975
"""Boundaries of low and high pressure as shares of the range: Table 1 has y_3 at .028 and y_4 at
.391 MPa, of 0 to .4 MPa."""

MARGIN, FARTHEST = 0.05, 3.0
"""Smallest and largest distance of a boundary from the nearest extreme: in contraction, relative to
the distance of the extremes (by Table 1, 0.2 to 1.4). The least holds for the pressures, too, relative
to their range."""


def characteristic_points(runs: Sequence[Run], moving: Sequence[bool]) -> tuple[Array, Array]:
    """Return e_1 to e_4 and y_1 to y_4 as cubics of the force (Sections 4.2 and 4.3).

    First enrichment: the outermost turning points of the loops at a force, where the rate is nought and
    the pressure static, are regressed on the force. Second enrichment: inflection and tangent are moved
    to the boundaries of low and of high pressure, the same at every force and outside the extremes, so
    that e_3 < e_1 < e_2 < e_4 as in Table 1. The paper does not say how the boundaries and their
    contractions were chosen: here they are at its own shares of the range of pressure, and the cubic at
    a force, held to its extremes, reaches them where it is nearest to all runs there.

    Parameters
    ----------
    runs : sequence of Run
        All runs, contraction to pressure, which changes, the force being scheduled.
    moving : sequence of bool
        Which of them are loops, whose turning points are the extremes; the others are slow cycles,
        and count for the boundaries only. Where no run at a force is a loop, all there are taken.

    Returns
    -------
    array, shape (4, 4), array, shape (4, 4)
        Contractions, then pressures in the output's unit: a row a point, highest power first.

    Raises
    ------
    DataError
        Where the contraction does not move at some force.
    """
    groups = by_force(runs)
    forces, groups_of = np.array(list(groups)), list(groups.values())
    pressures = np.concatenate([run.y[run.counts] for run in runs])
    lowest, span = float(pressures.min()), float(np.ptp(pressures))
    loops = [[i for i in group if moving[i]] or group for group in groups_of]
    extremes = np.array([outermost([runs[i] for i in group]) for group in loops])
    still = extremes[:, 1, 0] <= extremes[:, 0, 0]
    if still.any():
        raise DataError(
            f"it does not move under {forces[still][0]:g} N",
            channel="contraction",
            remedy="leave that run out",
        )
    ends = np.array([[regress(forces, extremes[:, j, c]) for c in (0, 1)] for j in (0, 1)])
    fitted = np.array([[np.polyval(cubic, forces) for cubic in end] for end in ends])
    low = min(lowest + LOW * span, float(fitted[0, 1].min()) - MARGIN * span)
    high = max(lowest + HIGH * span, float(fitted[1, 1].max()) + MARGIN * span)
    bounds = [
        boundaries([runs[i] for i in group], fitted[:, :, k], (low, high))
        for k, group in enumerate(groups_of)
    ]
    contractions = [*ends[:, 0], *(regress(forces, bound) for bound in np.transpose(bounds))]
    constants = [[0.0, 0.0, 0.0, level] for level in (low, high)]
    return np.array(contractions), np.array([*ends[:, 1], *constants])


def by_force(runs: Sequence[Run]) -> dict[float, list[int]]:
    """Return the runs of equal mean force [N], weakest first."""
    means = [float(run.scheduled.mean()) for run in runs]
    groups: dict[float, list[int]] = {}
    tolerance = SAME_FORCE * max(map(abs, means))
    for i in np.argsort(means, kind="stable"):
        near = next((force for force in groups if abs(force - means[i]) <= tolerance), means[i])
        groups.setdefault(near, []).append(int(i))
    return groups


def outermost(runs: Sequence[Run]) -> Array:
    """Return contraction and pressure, (2, 2), at the outermost turning points."""
    extrema = []
    for run in runs:
        # where a run begins and ends, it does not turn
        places = [row for row in reversals(run.u)[1:-1] if run.counts[row]]
        if len(places) < 2:  # one that hardly turns counts as a whole
            places = list(np.flatnonzero(run.counts))
        extrema.append(np.column_stack([run.u[places], run.y[places]]))
    turns = np.concatenate(extrema)
    return turns[[turns[:, 0].argmin(), turns[:, 0].argmax()]]


def boundaries(runs: Sequence[Run], extremes: Array, levels: tuple[float, float]) -> Array:
    """Return the contractions e_3 and e_4 of a cubic through the extremes at one force.

    The errors of a run are relative to its own range of pressure, so that loops and slow cycles count
    alike.
    """
    (e_1, y_1), (e_2, y_2) = extremes
    samples = [(run.u[run.counts], run.y[run.counts]) for run in runs]
    e, p = (np.concatenate(parts) for parts in zip(*samples, strict=True))
    scales = [max(float(np.ptp(y)), 1e-9) * np.sqrt(max(y.size, 1)) for _, y in samples]
    weight = 1.0 / np.repeat(scales, [y.size for _, y in samples])
    powers = np.vander((e - e_1) / (e_2 - e_1), 4)
    pressures = np.array([y_1, y_2, *levels])

    def errors(away: Array) -> Array:
        through = np.vander([0.0, 1.0, -away[0], 1.0 + away[1]], 4)
        residual: Array = (powers @ np.linalg.solve(through, pressures) - p) * weight
        return residual

    rise = max(y_2 - y_1, 1e-9)
    straight = np.array([y_1 - levels[0], levels[1] - y_2]) / rise
    start = np.clip(straight, 2 * MARGIN, 0.5 * FARTHEST)
    bounds = np.full(2, MARGIN), np.full(2, FARTHEST)
    away = _searched(by_differences(errors, DIFFERENCE * (bounds[1] - bounds[0])), start, bounds)
    return e_1 + (e_2 - e_1) * np.array([-away[0], 1.0 + away[1]])


def regress(forces: Array, values: Array) -> Array:
    """Return a cubic of the force through values; of lower order for few forces."""
    order = min(3, forces.size - 1)
    scale = max(float(np.abs(forces).max()), 1.0)
    coefficients = np.polyfit(forces / scale, values, order) / scale ** np.arange(order, -1, -1)
    return np.concatenate([np.zeros(3 - order), coefficients])
