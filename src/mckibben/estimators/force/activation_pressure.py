"""Identification of the activation-pressure model, as its paper does it.

Source: "Inverse Modeling of Nonlinear Artificial Muscle Using Polynomial Parameterization and
Particle Swarm Optimization", Sections 4.2 to 4.4: local extremes of every loop; a cubic at every
force through them; its four characteristic points; their regression on the force in two enrichment
steps, first the extremes, then inflection and tangent; and gamma and phi by particle swarm.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

import numpy as np
from annotated_types import Ge
from numpy.typing import NDArray

from mckibben.blocks.base import Block
from mckibben.blocks.fields import Channel, vector
from mckibben.blocks.force.activation_pressure import ActivationPressure
from mckibben.errors import DataError
from mckibben.estimators.base import simulate_all
from mckibben.estimators.data import Run, TrainingData
from mckibben.estimators.search import Tracker, particle_swarm
from mckibben.estimators.searching import SearchingEstimator

Array = NDArray[np.float64]

FORCE_STEP = 5.0
"""Runs whose mean forces differ by less belong to one force [N]."""

MARGIN = 1e-3
"""Least distance between neighbouring characteristic points, relative to the contraction's range."""


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
        found is set to that of the first run.
    """

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
    rises: ClassVar[bool] = False

    @property
    def scheduling(self) -> tuple[str, ...]:
        """Force."""
        return (self.force,)

    def identify(self, data: TrainingData, tracker: Tracker) -> tuple[Block, TrainingData]:
        """Return the model found, set to the first run's frequency, and the data."""
        if data.sample_time is None:
            raise DataError(
                "the recordings have no time, and this model depends on rate",
                remedy="read them with a time column or --rate",
            )
        groups = by_force(data.runs)
        forces = np.array(list(groups))
        points = np.array([characteristic_points(runs) for runs in groups.values()])
        # first enrichment: the extremes; second: inflection and tangent, kept apart from them
        contractions = [regress(forces, points[:, j, 0]) for j in range(4)]
        pressures = [regress(forces, points[:, j, 1]) for j in range(4)]
        tau = self.rate_time_constant
        model = ActivationPressure(
            vector(np.concatenate(contractions)),
            vector(np.concatenate(pressures)),
            (0.0, 0.0, 0.0, 1.0),
            (0.0, 1.0),
            1.0,
            3 * data.sample_time if tau is None else tau,
            self.starting_rule,
            **self.channels(data),
        )
        thin = data.thinned(20_000)
        at = [
            dominant_frequency(run) if self.frequency is None else self.frequency
            for run in thin.runs
        ]
        phi, gamma = self._rates(model, thin, np.array(at), tracker)
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

        tracker.budget = self.pso_particles * (self.pso_iterations + 1)
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

    def channels(self, data: TrainingData) -> dict[str, Channel]:
        """Return contraction, force and pressure."""
        force = Channel(data.scheduling[0], data.scheduling_units[0])
        return super().channels(data) | {"force": force}


def by_force(runs: tuple[Run, ...]) -> dict[float, list[Run]]:
    """Return the runs grouped by their mean force, weakest first."""
    groups: dict[float, list[Run]] = {}
    for run in sorted(runs, key=lambda run: float(run.scheduled.mean())):
        mean = float(run.scheduled.mean())
        near = next((force for force in groups if abs(force - mean) < FORCE_STEP), mean)
        groups.setdefault(near, []).append(run)
    return groups


def characteristic_points(runs: list[Run]) -> Array:
    """Return contraction and pressure at the lowest point, highest, inflection and tangent, (4, 2).

    The cubic is fitted to the middle of all loops at one force, with the local extremes counted as
    often as everything else together. The tangent is where the line through the first point touches
    the cubic again, or, where it does not within the range, its highest point moved off the second.
    """
    from mckibben.signals import reversals

    e = np.concatenate([run.u[run.counts] for run in runs])
    p = np.concatenate([run.y[run.counts] for run in runs])
    turns = np.concatenate([_turns(run, reversals(run.u)) for run in runs])
    span = float(np.ptp(e))
    columns = np.vander(np.concatenate([e, turns[:, 0]]), 4)
    target = np.concatenate([p, turns[:, 1]])
    weight = np.concatenate([np.ones(e.size), np.full(len(turns), e.size / max(len(turns), 1))])
    root = np.sqrt(weight)
    cubic = np.linalg.lstsq(columns * root[:, np.newaxis], target * root, rcond=1e-12)[0]
    low, high = float(e.min()), float(e.max())
    inflection = -cubic[1] / (3 * cubic[0]) if cubic[0] != 0 else 0.5 * (low + high)
    # a line from the lowest point touches the cubic half-way past its inflection
    tangent = -(cubic[1] / cubic[0] + low) / 2 if cubic[0] != 0 else low + 0.75 * span
    middles = [
        place if low + 0.05 * span < place < high - 0.05 * span else low + share * span
        for place, share in ((inflection, 1 / 3), (tangent, 2 / 3))
    ]
    if abs(middles[0] - middles[1]) < 0.05 * span:
        middles = [low + span / 3, low + 2 * span / 3]
    at = np.array([low, high, *middles])
    return np.column_stack([at, np.polyval(cubic, at)])


def _turns(run: Run, places: NDArray[np.int64]) -> Array:
    counting = [place for place in places if run.counts[place]]
    return np.column_stack([run.u[counting], run.y[counting]])


def regress(forces: Array, values: Array) -> Array:
    """Return a cubic of the force through values, of lower order where there are few forces."""
    order = min(3, forces.size - 1)
    scale = max(float(np.abs(forces).max()), 1.0)
    found = np.polyfit(forces / scale, values, order) / scale ** np.arange(order, -1, -1)
    return np.concatenate([np.zeros(3 - order), found])


def dominant_frequency(run: Run) -> float:
    """Return the strongest frequency of a run's input [Hz]."""
    assert run.sample_time is not None
    moved = run.u - run.u.mean()
    spectrum = np.abs(np.fft.rfft(moved * np.hanning(moved.size), 4 * moved.size))
    return float(np.argmax(spectrum) / (4 * moved.size * run.sample_time))
