"""Identification of a recurrent fuzzy network on its own free runs.

Consequents are solved for by least squares, with measured outputs for past ones and then, step by step,
with its own; antecedents and feedbacks are searched.

Source: "High-Precision Displacement and Force Hybrid Modeling of Pneumatic Artificial Muscle Using 3D
PI-NARMAX Model", Sections 3 and 4.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.coupled.recurrent_fuzzy_network import RecurrentFuzzyNetwork
from mckibben.blocks.fields import Channel, rows, vector
from mckibben.blocks.kernels import kernel
from mckibben.errors import MckibbenError, ModelError, ModelWarning
from mckibben.estimators.core.data import TrainingData
from mckibben.estimators.coupled.fuzzy import Consequents, Sets, firing, regressors
from mckibben.estimators.optimisers.swarm import Swarm, particle_swarm
from mckibben.estimators.optimisers.tracker import Tracker

SWARM = Swarm(20, 30, (0.9, 0.4), 2.0, 2.0, fastest=0.5, stops=False)
"""Both attractions and the inertia are the paper's, which does not print the size."""

ROUNDS = 8
"""Times that consequents are solved for with the network's own free-running past."""

SEARCH_SAMPLES = 6000
"""Samples of all runs on which the swarm compares free runs, from the start of each."""


@kernel
def remembered(
    x: Array, centres: Array, widths: Array, feedbacks: Array, memberships: Array
) -> None:
    """Fill memberships (n, inputs, sets) of given inputs; each set remembers its last one."""
    for t in range(x.shape[0]):
        for i in range(x.shape[1]):
            for s in range(centres.shape[1]):
                last = memberships[t - 1, i, s] if t > 0 else 0.0
                z = (x[t, i] - centres[i, s] + feedbacks[i, s] * last) / widths[i, s]
                memberships[t, i, s] = np.exp(-0.5 * z * z)


@dataclass(frozen=True)
class Shape:
    """What the network looks at, and how its consequents are solved for; see `MPINarmaxEstimator`."""

    n_sets: int
    output_lags: int
    input_lags: int
    scheduling_lags: int
    constants: bool
    ridge: float


@dataclass(frozen=True)
class RecurrentProblem:
    """Runs as the network sees them: what drives and schedules it, (n, 1 + s), and the target."""

    shape: Shape
    inputs: tuple[Array, ...]
    targets: tuple[Array, ...]
    step: float
    free: Channel
    data: TrainingData

    @classmethod
    def of(cls, shape: Shape, data: TrainingData, hysteresis: Block) -> RecurrentProblem:
        """Return the problem on runs, behind a hysteresis that is known."""
        inputs = []
        for run in data.runs:
            f = hysteresis.simulate(run.driven[:, 0], sample_time=run.sample_time)
            inputs.append(np.ascontiguousarray(np.column_stack([f, run.scheduled])))
        targets = tuple(run.outputs[:, 0] for run in data.runs)
        step = float(data.runs[0].sample_time or 1.0)
        return cls(shape, tuple(inputs), targets, step, hysteresis.outputs[0], data)

    def regress(self, inputs: Array, past: Array) -> Array:
        """Return all x over a run, with given outputs for past ones."""
        e = self.shape

        def back(values: Array, lag: int) -> Array:
            return np.concatenate([np.full(lag, values[0]), values[: len(values) - lag]])

        columns = [back(past, lag) for lag in range(1, e.output_lags + 1)]
        columns += [back(inputs[:, 0], lag) for lag in range(e.input_lags + 1)]
        for s in range(1, inputs.shape[1]):
            columns += [back(inputs[:, s], lag) for lag in range(e.scheduling_lags + 1)]
        return np.ascontiguousarray(np.column_stack(columns))

    @property
    def ranges(self) -> tuple[Array, Array]:
        """Lowest and highest of every x."""
        pairs = zip(self.inputs, self.targets, strict=True)
        x = np.concatenate([self.regress(u, y) for u, y in pairs])
        low = x.min(axis=0)
        high = x.max(axis=0)
        return low, np.where(high > low, high, low + 1.0)

    def solved(
        self, sets: Sets, feedbacks: Array, pasts: tuple[Array, ...]
    ) -> RecurrentFuzzyNetwork:
        """Return the network whose consequents are solved for with given past outputs."""
        constants = self.shape.constants
        solver = Consequents(constants=constants, ridge=self.shape.ridge)
        gram: Array | float = 0.0
        right: Array | float = 0.0
        n_terms = 0
        for inputs, past, y in zip(self.inputs, pasts, self.targets, strict=True):
            x = self.regress(inputs, past)
            phi = np.empty((len(x), *sets.centres.shape))
            remembered(x, sets.centres, sets.widths, feedbacks, phi)
            fired = firing(phi)
            fired = fired / np.maximum(fired.sum(axis=1, keepdims=True), 1e-290)
            columns = regressors(x, fired, constants=constants)
            gram = gram + columns.T @ columns
            right = right + columns.T @ y[:, np.newaxis]
            n_terms = x.shape[1] + constants
        consequents = solver.solve(np.asarray(gram), np.asarray(right), n_terms)
        if not constants:
            consequents = np.pad(consequents.reshape(-1, n_terms), ((0, 0), (0, 1)))
        e = self.shape
        return RecurrentFuzzyNetwork(
            rows(sets.centres),
            rows(sets.widths),
            rows(feedbacks),
            vector(consequents.ravel()),
            self.step,
            (self.free,),
            self.data.scheduled,
            self.data.outputs,
            e.output_lags,
            e.input_lags,
            e.scheduling_lags,
        )

    def free_runs(self, network: RecurrentFuzzyNetwork, most: int | None = None) -> list[Array]:
        """Return the network's own outputs over all runs, or the start of each."""
        found = []
        for inputs in self.inputs:
            part = inputs if most is None else inputs[:most]
            output = np.empty((len(part), 1))
            network.bind(self.step, network.initial_state(part[0]), part, output)()
            found.append(output[:, 0])
        return found

    def cost(self, outputs: list[Array]) -> float:
        """Return the RMSE of free runs; infinite where they leave all bounds."""
        errors = np.concatenate(
            [z - y[: len(z)] for z, y in zip(outputs, self.targets, strict=True)]
        )
        with np.errstate(over="ignore", invalid="ignore"):
            value = float(np.sqrt(np.mean(errors**2)))
        return value if np.isfinite(value) else np.inf

    def best(self, sets: Sets, feedbacks: Array) -> RecurrentFuzzyNetwork:
        """Return the network that runs free best, of those that learn from their own past.

        Raises
        ------
        ModelError
            If every one of them leaves all bounds.
        """
        pasts = self.targets
        found, least = None, np.inf
        for _ in range(ROUNDS):
            network = self.solved(sets, feedbacks, pasts)
            outputs = self.free_runs(network)
            cost = self.cost(outputs)
            if cost < least:
                found, least = network, cost
            if not np.isfinite(cost):
                break
            # halfway from what was measured to what it makes of itself: whole steps may circle
            pasts = tuple(0.5 * (a + b) for a, b in zip(pasts, outputs, strict=True))
        if found is None:
            raise ModelError(
                "the network leaves all bounds when it runs free. Remedy: raise ridge, lower n_sets, or "
                "fit balance."
            )
        if not self.settles(found):
            warnings.warn(
                "the network does not settle while its inputs are held: do not run it free for long",
                ModelWarning,
                stacklevel=4,
            )
        return found

    def settles(self, network: RecurrentFuzzyNetwork) -> bool:
        """Tell whether outputs stay near the data's while inputs are held anywhere in their range."""
        every = np.concatenate(self.inputs)
        low, high = every.min(axis=0), every.max(axis=0)
        y = np.concatenate(self.targets)
        span = float(np.ptp(y))
        for share in (0.0, 0.5, 1.0):
            for load in (0.0, 1.0):
                first = np.concatenate(
                    [[low[0] + share * (high[0] - low[0])], low[1:] + load * (high - low)[1:]]
                )
                held = np.tile(first, (3000, 1))
                output = np.empty((3000, 1))
                network.bind(self.step, network.initial_state(first), held, output)()
                if not np.isfinite(output).all() or np.abs(output - y.mean()).max() > 2 * span:
                    return False
        return True

    @property
    def bounds(self) -> tuple[Array, Array, Array]:
        """Bounds of centres, widths and feedbacks, and the range that belongs to each set."""
        low, high = self.ranges
        span = np.repeat((high - low)[:, np.newaxis], self.shape.n_sets, axis=1).ravel()
        base = np.repeat(low[:, np.newaxis], self.shape.n_sets, axis=1).ravel()
        lower = np.concatenate([base, 0.15 * span, -0.3 * span])
        upper = np.concatenate([base + span, 1.0 * span, 0.3 * span])
        return lower, upper, span

    def shortened(self, most: int) -> RecurrentProblem:
        """Return the same problem on the start of every run."""
        return replace(
            self,
            inputs=tuple(np.ascontiguousarray(u[:most]) for u in self.inputs),
            targets=tuple(y[:most] for y in self.targets),
        )

    def swarm(self, even: Sets, seed: int, tracker: Tracker) -> tuple[Sets, Array]:
        """Return centres, widths and feedbacks by particle swarm on the free-running error."""
        rng = np.random.default_rng(seed)
        lower, upper, span = self.bounds
        start = rng.uniform(lower, upper, (SWARM.particles, lower.size))
        start[0] = np.concatenate([even.vector, np.zeros(span.size)])
        thin = self.shortened(max(SEARCH_SAMPLES // len(self.inputs), 100))

        def split(place: Array) -> tuple[Sets, Array]:
            n = even.vector.size
            return even.replaced(place[:n]), place[n:].reshape(even.centres.shape)

        def cost(place: Array) -> float:
            try:
                network = thin.solved(*split(place), thin.targets)
                return thin.cost(thin.free_runs(network))
            except (MckibbenError, np.linalg.LinAlgError):
                return np.inf

        def costs(places: Array) -> Array:
            return np.array([cost(place) for place in places])

        own = tracker.part(0.1, 0.9)
        found = particle_swarm(costs, lower, upper, SWARM, own, rng, start=start)
        tracker.saw_all(own)
        return split(found)
