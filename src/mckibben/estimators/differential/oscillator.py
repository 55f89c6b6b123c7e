"""Identification of oscillators with hysteresis in their loop: Gauss-Newton on free runs.

A linear oscillator is found first; its stiffness is shared between spring and element in a few ways,
from each of which a descent on one run in coarse steps begins, and the best go on with all runs in
fine ones. Derivatives are exact (`oscillator_slopes`), so that every step costs about two runs.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from typing import Annotated, Any, ClassVar

import numpy as np
from annotated_types import Interval

from mckibben.arrays import Array
from mckibben.blocks.core.block import Block
from mckibben.blocks.differential.oscillator import BETWEEN, Oscillator
from mckibben.blocks.dynamic.process_model import ProcessModel
from mckibben.errors import DataError, ModelError
from mckibben.estimators.core.data import Run, TrainingData
from mckibben.estimators.core.single import SingleEstimator
from mckibben.estimators.core.uncertainty import inverted, relative_sizes
from mckibben.estimators.differential.oscillator_slopes import OWN
from mckibben.estimators.linear.process import ProcessModelEstimator
from mckibben.estimators.optimisers.descent import Damping, damped, descend
from mckibben.estimators.optimisers.multi_start import follow_best
from mckibben.estimators.optimisers.tracker import Tracker
from mckibben.signals.periodic import band_limited

ANGLE, COARSE_ANGLE = 1 / 30, 1 / 3
"""Of the linear oscillator in a substep, and in one of the search's coarse ones, at most [rad]."""

MOST_SUBSTEPS, FEWEST_COARSE = 1000, 2

FORGOTTEN = 3 * np.log(1e8)
"""Times the linear oscillator's decay after which a start counts as forgotten.

Thrice what a hundred-millionth takes, for smaller motion meets less hysteresis and decays slower.
"""

MOST_PERIODS = 20
"""Periods run before the one that counts, at most."""

FIRST_STEPS, STEPS, FOLLOWED, SAME = 12, 60, 1, 1e-3
"""Steps from every start; of what is followed; how many are; and how much starts differ that are."""

ROUNDS = 8
"""Times that a start is searched, in ever finer structures."""

FIRST_GAIN, LEAST_GAIN = 1e-3, 1e-9
"""Share of the squared error that a step gains, or the descent has arrived."""

FIRST_DAMPING, HEAVIEST = 1e-3, 1e9

FLOOR = 1e-10
"""What is added to the square of every slope, relative to the sum of all."""

LARGEST = 1e100
"""Error that still is one: the sum of its squares is a number."""

DIFFERENCE = 1e-6
"""Of a parameter, relative, by which starts at rest are moved."""


@dataclass(frozen=True)
class Path:
    """The input of a run in steps, and where samples lie on it; see `oscillator_slopes.follow`."""

    run: Run
    inputs: Array
    every: int
    skipped: int


@dataclass(kw_only=True, repr=False, eq=False)
class OscillatorEstimator(SingleEstimator):
    """An estimator of a mass, a damper, a spring and an element that remembers.

    Parameters
    ----------
    periodic : bool
        Whether every recording is a whole number of periods of a motion that repeats itself, as under
        a multisine after some periods. Then no start counts, and the input is taken to be band-limited
        between samples; run such models by `Oscillator.steady_state`. Otherwise recordings begin at
        rest, and the input goes in straight lines from sample to sample.
    fit_offset : bool
        Whether the displacement has an offset to be found; else it is 0 without force.
    substeps : int, optional
        Runge-Kutta steps from sample to sample. Default: enough that the linear oscillator turns by
        no more than 1/30 rad in each.
    """

    input: str = "force"
    output: str = "displacement"
    periodic: bool = False
    fit_offset: bool = False
    substeps: Annotated[int, Interval(ge=1, le=MOST_SUBSTEPS)] | None = None

    made_for: ClassVar[tuple[str, str] | None] = ("force", "displacement")
    rises: ClassVar[bool] = False
    effort: ClassVar[float] = 3.0

    n_positive: ClassVar[int]
    """Parameters of the block, the first ones, that are searched by their logarithms."""

    follows: ClassVar[Callable[..., None]]
    """What runs the model with its derivatives."""

    @abstractmethod
    def starts(self, linear: Linear, most: float, fields: dict[str, Any]) -> list[Oscillator]:
        """Return models to start from.

        Parameters
        ----------
        linear : Linear
            The oscillator without hysteresis that is nearest to the data.
        most : float
            Largest displacement.
        fields : dict
            Fields of the model beside its numbers.
        """

    def refined(self, model: Oscillator, forces: Array) -> Oscillator | None:
        """Return the model in a finer structure, for forces that its element has, if there is one."""
        del model, forces
        return None

    def identify(self, data: TrainingData, tracker: Tracker) -> tuple[Block, TrainingData]:
        step = data.timed()
        if self.initial == "fitted":
            raise ModelError(
                "starts of oscillators are not fitted. Remedy: use recordings that begin at rest, or "
                "periodic=true and whole periods of a motion that repeats itself."
            )
        linear = linear_oscillator(data, self.channels(data))
        fine, coarse = (
            int(np.clip(np.ceil(linear.frequency * step / angle), fewest, MOST_SUBSTEPS))
            for angle, fewest in ((ANGLE, 1), (COARSE_ANGLE, FEWEST_COARSE))
        )
        fine = fine if self.substeps is None else self.substeps
        fields = self.channels(data) | {
            "output_offset": 0.0 if self.fit_offset else None,
            "substeps": fine,
            "initial": self.starting_rule,
        }
        longest = MOST_PERIODS * max(run.u.size for run in data.runs)
        self._warm = int(min(np.ceil(FORGOTTEN / max(linear.decay * step, 1e-9)), longest))
        middle = float(np.mean(data.target)) if self.fit_offset else 0.0
        most = float(np.abs(data.target - middle).max())
        begun = replace(data, runs=data.runs[:1])

        def begin(place: Array) -> tuple[Array, float]:
            model = models[int(place[0])]
            for _ in range(ROUNDS):
                search = FreeRuns(self, model, begun, self.paths(begun, min(coarse, fine)), tracker)
                model, cost = search.descended(FIRST_STEPS, FIRST_GAIN)
                better = self.refined(model, search.forces)
                if better is None:
                    break
                model = better
            models[int(place[0])] = model
            return place, cost

        def follow(place: Array) -> None:
            model = models[int(place[0])]
            for density, gain, told in ((coarse, FIRST_GAIN, False), (fine, LEAST_GAIN, True)):
                paths = self.paths(data, min(density, fine))
                model, cost = FreeRuns(self, model, data, paths, tracker, told).descended(
                    STEPS, gain
                )
            found.append((cost, model))

        models = self.starts(linear, most, fields)
        found: list[tuple[float, Oscillator]] = []
        follow_best(
            (np.array([float(k)]) for k in range(len(models))), begin, follow, FOLLOWED, SAME
        )
        _, model = min(found, key=lambda one: one[0])
        return model, data

    def paths(self, data: TrainingData, substeps: int) -> list[Path]:
        """Return the inputs of all runs in steps."""
        found = []
        for run in data.runs:
            n = run.u.size
            if not self.periodic:
                before = run.u[0] if self.starting_rule == "first_sample" else 0.0
                steps = np.arange(1 + substeps * n) / substeps
                u = np.interp(steps, np.arange(n + 1), np.append(before, run.u))
                found.append(Path(run, u, substeps, 0))
                continue
            ratio, skipped = BETWEEN * substeps, self._warm
            places = np.arange(-(skipped + 1) * ratio, (n - 1) * ratio + 1) % (n * ratio)
            fine = data.once(("fine", run.place, ratio), lambda: band_limited(run.u, ratio))  # noqa: B023
            found.append(Path(run, fine[places], ratio, skipped))
        return found

    def free_runs(self, blocks: Sequence[Block], data: TrainingData) -> Array:
        """Return the outputs of blocks where samples count: in steady state, of periodic recordings."""
        if not self.periodic:
            return super().free_runs(blocks, data)
        rows = []
        for block in blocks:
            assert isinstance(block, Oscillator)
            paths = self.paths(data, block.substeps)
            rows.append(FreeRuns(self, block, data, paths, Tracker()).outputs(block))
        return np.array(rows)

    def uncertainty(
        self, block: Block, data: TrainingData, residual: Array, at_bounds: Sequence[int]
    ) -> tuple[float, Array]:
        """Return the condition of all parameters and their covariance, from exact derivatives."""
        assert isinstance(block, Oscillator)
        search = FreeRuns(self, block, data, self.paths(data, block.substeps), Tracker())
        theta = search.coordinates(block)
        search.errors(theta)
        size = relative_sizes(block.pack())
        condition, inverse = inverted(search.slopes(theta) / search.scale(block) * size)
        variance = float(residual @ residual) / max(residual.size - size.size, 1)
        return condition, variance * inverse * np.outer(size, size)


@dataclass(frozen=True)
class Linear:
    """An oscillator without hysteresis: mass [kg], damping [N s/mm] and stiffness [N/mm]."""

    mass: float
    damping: float
    stiffness: float

    @property
    def frequency(self) -> float:
        """Angular frequency without damping [rad/s]."""
        return float(np.sqrt(1e3 * self.stiffness / self.mass))

    @property
    def decay(self) -> float:
        """How fast its free motion dies away [1/s]: the slower of two lags, where overdamped."""
        half = 500.0 * self.damping / self.mass
        return half - float(np.sqrt(max(half**2 - self.frequency**2, 0.0)))


def linear_oscillator(data: TrainingData, channels: dict[str, Any]) -> Linear:
    """Return the linear oscillator with the least free-run error, each run from a start of its own.

    Raises
    ------
    DataError
        If the displacement falls while the force rises slowly.
    """
    estimator = ProcessModelEstimator(
        structure="P2U", input=channels["input"].name, output=channels["output"].name, n_refined=1
    )
    model, _ = estimator.find(data, Tracker())
    assert isinstance(model, ProcessModel)
    assert model.damping is not None
    if not model.gain > 0:
        raise DataError(
            "the displacement falls while the force rises slowly",
            channel=channels["output"].name,
            remedy="turn the sign of one of them",
        )
    (time,), stiffness = model.time_constants, 1.0 / model.gain
    return Linear(1e3 * stiffness * time**2, 2.0 * model.damping * time * stiffness, stiffness)


def steady(theta: Array, slopes: Array, errors: Array, damping: float) -> Iterable[Array]:
    """Return where a damped step leads that leaves alone what next to nothing depends on."""
    return (theta + damped(slopes, errors, damping, FLOOR),)


class FreeRuns:
    """Errors of a model on all runs, and their derivatives, which are computed with them.

    Parameters
    ----------
    estimator : OscillatorEstimator
    template : Oscillator
        Whose structure is searched.
    data : TrainingData
    paths : sequence of Path
    tracker : Tracker
        Counts evaluations.
    told : bool
        Whether it is told of the best, too.
    """

    def __init__(
        self,
        estimator: OscillatorEstimator,
        template: Oscillator,
        data: TrainingData,
        paths: Sequence[Path],
        tracker: Tracker,
        told: bool = False,
    ) -> None:
        self.template, self.target, self.paths = template, data.target, paths
        self.tracker, self.told = tracker, told
        self.n_positive, self.follows = estimator.n_positive, type(estimator).follows
        self.at_rest = not estimator.periodic and estimator.starting_rule == "first_sample"
        self.step = data.sample_time or 1.0
        self.forces = np.zeros(1)

    def coordinates(self, model: Oscillator) -> Array:
        """Return where a model is searched: logarithms of what is positive, then the others."""
        theta = model.pack()
        theta[: self.n_positive] = np.log(np.maximum(theta[: self.n_positive], 1e-300))
        return theta

    def model(self, theta: Array) -> Oscillator:
        """Return the model at coordinates."""
        values = theta.copy()
        values[: self.n_positive] = np.exp(np.minimum(values[: self.n_positive], 690.0))
        return self.template.unpack(values)

    def scale(self, model: Oscillator) -> Array:
        """Return the derivatives of the parameters by the coordinates."""
        found = np.ones(model.n_parameters)
        found[: self.n_positive] = model.pack()[: self.n_positive]
        return found

    def descended(self, steps: int, least_gain: float) -> tuple[Oscillator, float]:
        """Return the model at the end of a descent, and its RMSE."""
        trust = Damping(FIRST_DAMPING, HEAVIEST, steps=steady)
        start = self.coordinates(self.template)
        path = descend(self.errors, self.slopes, start, trust, least_gain=least_gain)
        with self.tracker.searching():
            for theta, _ in islice(path, steps + 1):  # noqa: B007
                pass
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
            if not max(np.abs(found).max(), np.abs(self._slopes).max()) < LARGEST:
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
        return self._slopes * self.scale(self.model(theta))

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
            type(self).run(self.follows, numbers, h, state, moved, path, given, table)
            found.append(given[path.run.counts, 0])
            forces.append(given[:, 1])
            if slopes:
                tables.append(table[path.run.counts])
        self.forces = np.concatenate(forces)
        if slopes:
            self._slopes = np.concatenate(tables)
            self._slopes[:, 0] *= 1e-3  # the mass is in kg
            if has_offset:
                self._slopes = np.column_stack([self._slopes, np.ones(len(self._slopes))])
        return np.concatenate(found) + (model.output_offset or 0.0)

    @staticmethod
    def run(
        follows: Callable[..., None],
        numbers: Array,
        step: float,
        state: Array,
        moved: Array,
        path: Path,
        given: Array,
        table: Array,
    ) -> None:
        """Run the compiled model over a path."""
        follows(numbers, step, state, moved, path.inputs, path.every, path.skipped, given, table)

    def _begun(self, model: Oscillator, path: Path, p: int) -> tuple[Array, Array]:
        """Return the state before the first input of a path, and its derivatives."""
        moved = np.zeros((3, p))
        if not self.at_rest:
            return np.zeros(3), moved
        first = path.run.driven[0]
        state = model.initial_state(first, "first_sample")[:3]
        values = model.pack()
        for place in range(OWN - 1, p):  # rest knows neither mass nor damping
            change = DIFFERENCE * (abs(values[place]) or 1.0)
            other = values.copy()
            other[place] += change
            moved[:, place] = (
                model.unpack(other).initial_state(first, "first_sample")[:3] - state
            ) / change
        return state, moved
