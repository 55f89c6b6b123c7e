"""Identification of MPI-NARMAX: rate-dependent hysteresis, then a recurrent network with the load.

Two steps: the hysteresis on the runs without load; then the network, which takes in the hysteresis, the
measured force, and its own past output, running free.

Source: "High-Precision Displacement and Force Hybrid Modeling of Pneumatic Artificial Muscle Using 3D
PI-NARMAX Model", Sections 3 and 4.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, Literal

import numpy as np
from annotated_types import Gt, Interval
from numpy.typing import NDArray

from mckibben import registry
from mckibben.blocks.base import Block
from mckibben.blocks.compose import Series
from mckibben.blocks.fields import Channel, rows, vector
from mckibben.blocks.kernels import kernel
from mckibben.blocks.recurrent_fuzzy_network import RecurrentFuzzyNetwork
from mckibben.errors import DataError, MckibbenError, ModelError, ModelWarning
from mckibben.estimators.coupled.base import CoupledEstimator, Tell
from mckibben.estimators.coupled.data import CoupledData
from mckibben.estimators.coupled.fuzzy import Consequents, Sets, firing, regressors
from mckibben.recording import Recording

Array = NDArray[np.float64]

PARTICLES, ITERATIONS, ATTRACTION = 20, 30, 2.0
INERTIA = (0.9, 0.4)
"""Of the swarm: both attractions and the inertia are the paper's, which does not print its size."""

ROUNDS = 8
"""Times that consequents are solved for with the network's own free-running past."""

HORIZONS = (0.25, 0.5, 1.0)
"""Parts of the runs over which the trust region's steps are taken, one after another."""

TRUST_STEPS = 6
"""Of the trust region at each horizon."""

FAR = 100.0
"""Errors count for no more [mm]."""

SEARCH_SAMPLES = 6000
"""Samples of all runs on which the swarm compares free runs, from the start of each."""

UNLOADED = 0.05
"""A run is without load where its largest stays below this share of the largest of all runs."""

FREE = "displacement_free"
"""Name of what the hysteresis gives to the network."""


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


@dataclass(kw_only=True, repr=False, eq=False)
class MPINarmaxEstimator(CoupledEstimator):
    """Rate-dependent hysteresis and a recurrent fuzzy network scheduled by force.

    Parameters
    ----------
    n_sets : int
        Of every regressor.
    output_lags, input_lags, scheduling_lags : int
        n_a, n_b and n_c.
    memory : {"mpi", "rdpi"}
        Hysteresis in front: without rate, or with weights by rate as in the paper. It is identified on
        all runs without load, or on the one under the least: weights by rate need runs of several
        rates, since along one sine the rate follows from place and direction.
    learns_from : {"all", "loaded"}
        Runs that the network learns from: all, or as in the paper those under a load only.
    constants : bool
        Whether a consequent has a constant; the paper's fourth layer has none.
    method : {"pso", "ls", "trust-region"}
        Antecedents and feedbacks by the paper's particle swarm; even and none; or refined from those on
        the free-running error, over ever longer parts of the runs. Consequents by least squares always.
    ridge : float
        Damping of what is a rule's own.
    """

    effort: ClassVar[float] = 6.0

    n_sets: Annotated[int, Interval(ge=1, le=4)] = 3
    output_lags: Annotated[int, Interval(ge=1, le=3)] = 1
    input_lags: Annotated[int, Interval(ge=0, le=3)] = 0
    scheduling_lags: Annotated[int, Interval(ge=0, le=3)] = 0
    memory: Literal["mpi", "rdpi"] = "mpi"
    learns_from: Literal["all", "loaded"] = "all"
    constants: bool = True
    method: Literal["pso", "ls", "trust-region"] = "pso"
    ridge: Annotated[float, Gt(0)] = 1e-4

    def identify(self, data: CoupledData, validation: CoupledData | None, tell: Tell) -> Block:
        """Return the series of hysteresis and network."""
        del validation
        if len(data.pressures) != 1 or not data.scheduled:
            raise DataError(
                f"there are {len(data.pressures)} inputs and {len(data.scheduled)} loads",
                remedy="give recordings of one muscle, with a channel force",
            )
        if len({run.sample_time for run in data.runs}) > 1 or data.runs[0].sample_time is None:
            raise DataError("the runs differ in sample time", remedy="resample them to one")
        tell(0.0, "hysteresis")
        free, loaded = _parted(data)
        hysteresis = self.hysteresis(free)
        known = loaded if self.learns_from == "loaded" and loaded.runs else data
        problem = _Problem.of(self, known, hysteresis)
        low, high = problem.ranges
        even = Sets.even(low, high, self.n_sets)
        still = np.zeros_like(even.centres)
        chosen = (even, still)
        if self.method == "pso":
            chosen = problem.swarm(even, self.seed, tell)
        elif self.method == "trust-region":
            chosen = problem.refined(even, still, tell)
        tell(0.9, "network")
        network = problem.best(*chosen)
        return Series((hysteresis, network))

    def hysteresis(self, data: CoupledData) -> Block:
        """Return the hysteresis from runs without load."""
        u, y = data.pressures[0], data.displacements[0]
        recordings = [
            Recording(
                {u.name: run.pressures[:, 0], FREE: run.displacements[:, 0]},
                run.sample_time,
                {u.name: u.unit, FREE: y.unit},
            )
            for run in data.runs
        ]
        settings = {"input": u.name, "output": FREE, "seed": self.seed}
        if self.memory == "rdpi":
            settings["rate_time_constant"] = 5.0 * (data.runs[0].sample_time or 0.0)
        block: Block = registry.load("estimators", self.memory)(**settings).fit(recordings).model_
        return block


def _parted(data: CoupledData) -> tuple[CoupledData, CoupledData]:
    """Return the runs without load, at least the one under the least, and all others."""
    largest = np.array([np.abs(run.scheduled).max(axis=0) for run in data.runs])
    shares = (largest / np.maximum(largest.max(axis=0), 1e-300)).max(axis=1)
    free = shares <= max(UNLOADED, float(shares.min()))

    def those(wanted: NDArray[np.bool_]) -> CoupledData:
        runs = tuple(run for run, is_one in zip(data.runs, wanted, strict=True) if is_one)
        return replace(data, runs=runs)

    return those(free), those(~free)


@dataclass(frozen=True)
class _Problem:
    """Runs as the network sees them: what drives and schedules it, (n, 1 + s), and the target."""

    estimator: MPINarmaxEstimator
    inputs: tuple[Array, ...]
    targets: tuple[Array, ...]
    step: float
    free: Channel
    data: CoupledData

    @classmethod
    def of(cls, estimator: MPINarmaxEstimator, data: CoupledData, hysteresis: Block) -> _Problem:
        inputs = []
        for run in data.runs:
            f = hysteresis.simulate(run.pressures[:, 0], sample_time=run.sample_time)
            inputs.append(np.ascontiguousarray(np.column_stack([f, run.scheduled])))
        targets = tuple(run.displacements[:, 0] for run in data.runs)
        step = float(data.runs[0].sample_time or 1.0)
        return cls(estimator, tuple(inputs), targets, step, hysteresis.outputs[0], data)

    def regress(self, inputs: Array, past: Array) -> Array:
        """Return all x over a run, with given outputs for past ones."""
        e = self.estimator

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
        return low, np.maximum(x.max(axis=0), low + 1e-6)

    def solved(
        self, sets: Sets, feedbacks: Array, pasts: tuple[Array, ...]
    ) -> RecurrentFuzzyNetwork:
        """Return the network whose consequents are solved for with given past outputs."""
        constants = self.estimator.constants
        solver = Consequents(constants=constants, ridge=self.estimator.ridge)
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
        e = self.estimator
        return RecurrentFuzzyNetwork(
            rows(sets.centres),
            rows(sets.widths),
            rows(feedbacks),
            vector(consequents.ravel()),
            self.step,
            (self.free,),
            self.data.scheduled,
            self.data.displacements,
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
                "fit force-balance."
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
        span = np.repeat((high - low)[:, np.newaxis], self.estimator.n_sets, axis=1).ravel()
        base = np.repeat(low[:, np.newaxis], self.estimator.n_sets, axis=1).ravel()
        lower = np.concatenate([base, 0.15 * span, -0.3 * span])
        upper = np.concatenate([base + span, 1.0 * span, 0.3 * span])
        return lower, upper, span

    def shortened(self, most: int) -> _Problem:
        """Return the same problem on the start of every run."""
        return replace(
            self,
            inputs=tuple(np.ascontiguousarray(u[:most]) for u in self.inputs),
            targets=tuple(y[:most] for y in self.targets),
        )

    def refined(self, even: Sets, still: Array, tell: Tell) -> tuple[Sets, Array]:
        """Return antecedents and feedbacks refined on free runs over ever longer horizons."""
        from scipy.optimize import least_squares

        lower, upper, span = self.bounds
        n = even.vector.size
        values = np.clip(np.concatenate([even.vector, still.ravel()]), lower, upper)
        longest = max(len(y) for y in self.targets)
        for place, share in enumerate(HORIZONS):
            part = self.shortened(round(share * longest))

            def missed(x: Array, part: _Problem = part) -> Array:
                network = part.solved(
                    even.replaced(x[:n]), x[n:].reshape(still.shape), part.targets
                )
                pairs = zip(part.free_runs(network), part.targets, strict=True)
                errors = np.concatenate([z - y for z, y in pairs])
                return np.clip(np.nan_to_num(errors, nan=FAR, posinf=FAR, neginf=-FAR), -FAR, FAR)

            tell(0.1 + 0.8 * place / len(HORIZONS), f"horizon {share:g}")
            found = least_squares(
                missed,
                values,
                bounds=(lower, upper),
                x_scale=np.tile(span, 3),
                max_nfev=TRUST_STEPS,
            )
            values = found.x
        return even.replaced(values[:n]), values[n:].reshape(still.shape)

    def swarm(self, even: Sets, seed: int, tell: Tell) -> tuple[Sets, Array]:
        """Return centres, widths and feedbacks by particle swarm on the free-running error."""
        rng = np.random.default_rng(seed)
        lower, upper, span = self.bounds
        places = rng.uniform(lower, upper, (PARTICLES, lower.size))
        places[0] = np.concatenate([even.vector, np.zeros(span.size)])
        speeds = np.zeros_like(places)
        thin = self.shortened(max(SEARCH_SAMPLES // len(self.inputs), 100))

        def split(place: Array) -> tuple[Sets, Array]:
            n = even.vector.size
            return even.replaced(place[:n]), place[n:].reshape(even.centres.shape)

        def cost(place: Array) -> float:
            network = thin.solved(*split(place), thin.targets)
            return thin.cost(thin.free_runs(network))

        own, costs = places.copy(), np.array([cost(place) for place in places])
        for iteration in range(ITERATIONS):
            share = iteration / ITERATIONS
            inertia = INERTIA[0] + share * (INERTIA[1] - INERTIA[0])
            pull = rng.uniform(size=(2, *places.shape))
            best = own[np.argmin(costs)]
            speeds = (
                inertia * speeds
                + ATTRACTION * pull[0] * (own - places)
                + ATTRACTION * pull[1] * (best - places)
            )
            speeds = np.clip(speeds, -0.5 * (upper - lower), 0.5 * (upper - lower))
            places = np.clip(places + speeds, lower, upper)
            for k, place in enumerate(places):
                try:
                    value = cost(place)
                except (MckibbenError, np.linalg.LinAlgError):
                    value = np.inf
                if value < costs[k]:
                    own[k], costs[k] = place, value
            tell(0.1 + 0.8 * (iteration + 1) / ITERATIONS, f"best {costs.min():.3g} mm")
        return split(own[np.argmin(costs)])
