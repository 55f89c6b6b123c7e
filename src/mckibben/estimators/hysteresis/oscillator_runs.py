"""Free runs of oscillators, their errors, and the descent of these."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import islice

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.hysteresis.oscillators import Oscillator
from mckibben.errors import ModelError
from mckibben.estimators.core.data import TrainingData
from mckibben.estimators.dynamics.paths import Path
from mckibben.estimators.hysteresis.oscillator_slopes import OWN
from mckibben.estimators.optimisers.descent import Damping, descend, marquardt
from mckibben.estimators.optimisers.tracker import Tracker

FIRST_DAMPING, HEAVIEST = 1e-3, 1e9

FLOOR = 1e-10
"""What is added to the square of every slope, relative to the sum of all."""

LARGEST = 1e50
"""Error, or derivative of one, that still is one: sums of its squares are numbers."""

DIFFERENCE = 1e-6
"""Of a parameter, relative, by which starts at rest are moved."""


@dataclass(frozen=True)
class Way:
    """How a model is searched and run.

    Parameters
    ----------
    n_positive : int
        Parameters, the first ones, that are searched by their logarithms.
    follows : callable
        The model with its derivatives; see `oscillator_slopes.follow`.
    at_rest : bool
        Whether runs begin at rest where their first input leads, instead of at none.
    order : int
        The other parameters of the element have the unit of this power of a force, over displacement.
    """

    n_positive: int
    follows: Callable[..., None]
    at_rest: bool
    order: int


class FreeRuns:
    """Errors of a model on all runs, and their derivatives, which are computed with them.

    Parameters
    ----------
    template : Oscillator
        Whose structure is searched.
    data : TrainingData
    paths : sequence of Path
        Of all runs.
    way : Way
        How the model is searched and run.
    tracker : Tracker
        Counts evaluations.
    told : bool
        Whether it is told of the best, too.
    """

    def __init__(
        self,
        template: Oscillator,
        data: TrainingData,
        paths: Sequence[Path],
        way: Way,
        tracker: Tracker,
        told: bool = False,
    ) -> None:
        self.template, self.target, self.paths = template, data.target, paths
        self.tracker, self.told = tracker, told
        self.n_positive, self.follows, self.at_rest = way.n_positive, way.follows, way.at_rest
        self.step = data.sample_time or 1.0
        force, travel = (float(np.ptp(span)) for span in (data.input_range, data.output_range))
        self.size = np.full(template.n_parameters, force**way.order / travel)
        self.size[: self.n_positive] = 1.0
        if template.output_offset is not None:
            self.size[-1] = travel

    def coordinates(self, model: Oscillator) -> Array:
        """Return where a model is searched: logarithms of what is positive, then the others' sizes."""
        theta = model.pack() / self.size
        theta[: self.n_positive] = np.log(np.maximum(theta[: self.n_positive], 1e-300))
        return theta

    def model(self, theta: Array) -> Oscillator:
        """Return the model at coordinates."""
        values = theta * self.size
        values[: self.n_positive] = np.exp(np.minimum(values[: self.n_positive], 690.0))
        return self.template.unpack(values)

    def scale(self, model: Oscillator) -> Array:
        """Return the derivatives of the parameters by the coordinates."""
        found = self.size.copy()
        found[: self.n_positive] = model.pack()[: self.n_positive]
        return found

    def descended(self, steps: int, least_gain: float) -> tuple[Oscillator, float]:
        """Return the model at the end of a descent, and its RMSE."""
        trust = Damping(FIRST_DAMPING, HEAVIEST, steps=partial(marquardt, floor=FLOOR))
        start = self.coordinates(self.template)
        path = descend(self.errors, self.slopes, start, trust, least_gain=least_gain)
        with self.tracker.searching():
            for found, squares in islice(path, steps + 1):
                theta = found
                if not np.isfinite(squares):
                    return self.template, np.inf
        if self.tracker.interrupted and self.tracker.best is not None:
            theta = self.tracker.best
        errors = self.errors(theta)
        return self.model(theta), float(np.sqrt(np.mean(errors**2)))

    def errors(self, theta: Array) -> Array:
        """Return the errors where samples count; infinite where there is no such model."""
        try:
            model = self.model(theta)
            found = self.outputs(model, slopes=True) - self.target
        except ModelError:
            found = np.full(self.target.size, np.inf)
        else:
            sizes = np.abs(found).max(), np.abs(self.slopes(theta)).max()
            if not all(size < LARGEST for size in sizes):
                found = np.full(self.target.size, np.inf)
        cost = float(np.sqrt(np.mean(found**2)))
        if self.told:
            self.tracker.saw(theta, cost)
        else:
            self.tracker.evaluations += 1
            self.tracker.reached(0.0)
        return found

    def slopes(self, theta: Array) -> Array:
        """Return the derivatives where errors were last asked for."""
        with np.errstate(invalid="ignore", over="ignore"):
            found: Array = self._slopes * self.scale(self.model(theta))
        return found

    def forces(self, model: Oscillator) -> Array:
        """Return the forces of the element in all runs."""
        self.outputs(model)
        return self._forces

    def outputs(self, model: Oscillator, slopes: bool = False) -> Array:
        """Return the outputs where samples count; note the derivatives by the parameters, if wanted."""
        values = model.pack()
        has_offset = model.output_offset is not None
        p = values.size - has_offset
        numbers = np.array([model.inertia, model.damping, model.stiffness, *model.element])
        found, tables, forces = [], [], []
        for path in self.paths:
            n = path.run.u.size
            given, table = np.empty((n, 2)), np.empty((n if slopes else 0, p))
            state, moved = self._begun(model, path, p)
            h = self.step / path.every
            along = (path.inputs, path.every, path.skipped)
            self.follows(numbers, h, state, moved, *along, given, table)
            found.append(given[path.run.counts, 0])
            forces.append(given[:, 1])
            if slopes:
                tables.append(table[path.run.counts])
        self._forces = np.concatenate(forces)
        if slopes:
            self._slopes = np.concatenate(tables)
            self._slopes[:, 0] *= 1e-3  # the mass is in kg
            if has_offset:
                self._slopes = np.column_stack([self._slopes, np.ones(len(self._slopes))])
        return np.concatenate(found) + (model.output_offset or 0.0)

    def _begun(self, model: Oscillator, path: Path, p: int) -> tuple[Array, Array]:
        """Return the state before the first input of a path, and its derivatives."""
        moved = np.zeros((3, p))
        if not self.at_rest:
            return np.zeros(3), moved
        first = path.run.driven[0]
        state = model.initial_state(first, "first_sample")[:3]
        values = model.pack()
        for place in range(OWN - 1, p):  # rest knows neither mass nor damping
            change = DIFFERENCE * (abs(values[place]) or self.size[place])
            other = values.copy()
            other[place] += change
            moved[:, place] = (
                model.unpack(other).initial_state(first, "first_sample")[:3] - state
            ) / change
        return state, moved
