"""Identification of the activation-pressure model, as its paper does it.

Source: "Inverse Modeling of Nonlinear Artificial Muscle Using Polynomial Parameterization and
Particle Swarm Optimization", Sections 4.2 to 4.4: `characteristic_points`, regressed on the force in
two enrichment steps; and gamma and phi by particle swarm.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

import numpy as np
from annotated_types import Ge

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.fields import vector
from mckibben.blocks.force.activation_pressure import ActivationPressure
from mckibben.estimators.core.data import Run, TrainingData
from mckibben.estimators.core.searching import SearchingEstimator
from mckibben.estimators.core.uncertainty import simulate_all
from mckibben.estimators.force.characteristic_points import characteristic_points
from mckibben.estimators.optimisers.swarm import particle_swarm
from mckibben.estimators.optimisers.tracker import Tracker

STATIC_SHARE = 0.1
"""A run below this share of the fastest run's frequency is static: it bounds low and high pressure,
and tells nothing of the rate."""


@dataclass(kw_only=True, repr=False, eq=False)
class ActivationPressureEstimator(SearchingEstimator):
    """Activation pressure by characteristic points, and gamma and phi by particle swarm.

    Parameters
    ----------
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
    can = (
        "Pressure for a contraction under a force, at one frequency of a sine; as its paper has it."
    )
    cannot = "Knows no minor loops and no other frequency: its hysteresis is a term in the rate."
    needs_time: ClassVar[bool] = True

    input: str = "contraction"
    output: str = "pressure"
    force: str = "force"
    rate_time_constant: Annotated[float, Ge(0)] | None = None
    frequency: Annotated[float, Ge(0)] | None = None
    pso_particles: Annotated[int, Ge(2)] = 50
    pso_iterations: Annotated[int, Ge(1)] = 100
    pso_inertia_start: float = 0.4
    pso_inertia_end: float = 0.4
    pso_c1: Annotated[float, Ge(0)] = 1.5
    pso_c2: Annotated[float, Ge(0)] = 1.5

    made_for: ClassVar[tuple[str, str] | None] = ("contraction", "pressure")
    told: ClassVar[tuple[str, ...]] = ("force",)
    rises: ClassVar[bool] = False

    def identify(self, data: TrainingData, tracker: Tracker) -> tuple[Block, TrainingData]:
        """Return the model found, set to the first moving run's frequency, and the data."""
        step = data.timed()
        frequencies = np.array(
            [
                dominant_frequency(run) if self.frequency is None else self.frequency
                for run in data.runs
            ]
        )
        moving = frequencies >= STATIC_SHARE * frequencies.max()
        loops = replace(data, runs=tuple(data.runs[i] for i in np.flatnonzero(moving)))
        at = frequencies[moving]
        contractions, pressures = characteristic_points(data.runs, moving)
        tau = self.rate_time_constant
        model = ActivationPressure(
            vector(contractions.ravel()),
            vector(pressures.ravel()),
            (0.0, 0.0, 0.0, 1.0),
            (0.0, 1.0),
            1.0,
            3 * step if tau is None else tau,
            self.starting_rule,
            **self.channels(data),
        )
        phi, gamma = self._rates(model, loops.thinned(20_000), at, tracker)
        return replace(model, phi=vector(phi), gamma=gamma, frequency=float(at[0])), data

    def _rates(
        self, model: ActivationPressure, data: TrainingData, at: Array, tracker: Tracker
    ) -> tuple[Array, tuple[float, float]]:
        """Return phi (a cubic of the force) and gamma, by swarm or by least squares.

        gamma phi is fixed up to a factor, which is chosen such that gamma is 1 at the mean
        frequency.
        """
        parts = [replace(data, runs=(run,)) for run in data.runs]
        alone = replace(model, gamma=(0.0, 0.0))
        left = [part.target - simulate_all([alone], part)[0] for part in parts]
        rates = [simulate_all([model], part)[0] - simulate_all([alone], part)[0] for part in parts]
        forces = [run.scheduled[run.counts, 0] for run in data.runs]
        largest = max(float(np.abs(np.concatenate(forces)).max()), 1.0)
        middle = float(at.mean()) if at.size else 1.0
        rise = np.concatenate(
            [
                np.full(r.size, (f - middle) / max(middle, 1e-9))
                for r, f in zip(rates, at, strict=True)
            ]
        )
        rate, rest = np.concatenate(rates), np.concatenate(left)
        x = np.concatenate(forces) / largest
        powers = np.column_stack([x**3, x**2, x, np.ones_like(x)])
        start = np.linalg.lstsq(powers * rate[:, np.newaxis], rest, rcond=1e-9)[0]
        width = np.maximum(np.abs(start), np.abs(start).max(initial=1e-6))
        lower, upper = np.append(start - 2 * width, -1.0), np.append(start + 2 * width, 1.0)

        def errors(point: Array) -> Array:
            return (powers @ point[:4]) * (1 + point[4] * rise) * rate - rest

        if self.method == "ls":
            from scipy.optimize import least_squares

            found = least_squares(errors, np.append(start, 0.0), bounds=(lower, upper)).x
            tracker.saw(found, float(np.sqrt(np.mean(errors(found) ** 2))))
        else:

            def costs(points: Array) -> Array:
                return np.array([float(np.sqrt(np.mean(errors(point) ** 2))) for point in points])

            found = particle_swarm(costs, lower, upper, self.swarm, tracker, self.seed)
        phi = found[:4] / largest ** np.array([3, 2, 1, 0])
        slope = float(found[4]) / max(middle, 1e-9)
        return phi, (slope, 1.0 - slope * middle)


def dominant_frequency(run: Run) -> float:
    """Return the strongest frequency of a run's input [Hz]."""
    assert run.sample_time is not None
    moved = run.u - run.u.mean()
    spectrum = np.abs(np.fft.rfft(moved * np.hanning(moved.size), 4 * moved.size))
    return float(np.argmax(spectrum) / (4 * moved.size * run.sample_time))
