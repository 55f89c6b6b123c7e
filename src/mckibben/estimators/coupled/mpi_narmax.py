"""Identification of MPI-NARMAX: rate-dependent hysteresis, then a recurrent network with load.

Two steps: the hysteresis on the runs without load; then the network, which takes in the hysteresis, the
measured force, and its own past output, running free. Its consequents are solved for by least squares,
with measured outputs for past ones and then, step by step, with its own; antecedents and feedbacks are
searched.

Source: "High-Precision Displacement and Force Hybrid Modeling of Pneumatic Artificial Muscle Using 3D
PI-NARMAX Model", Sections 3 and 4.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal

import numpy as np
from annotated_types import Gt, Interval
from numpy.typing import NDArray

from mckibben import registry
from mckibben.arrays import Array
from mckibben.blocks.base import Block, run_many
from mckibben.blocks.compose import Series
from mckibben.blocks.coupled.recurrent_fuzzy_network import RecurrentFuzzyNetwork
from mckibben.blocks.fields import rows, vector
from mckibben.blocks.kernels import kernel
from mckibben.blocks.runs import Run
from mckibben.errors import DataError, MckibbenError, ModelError
from mckibben.estimators.core.data import TrainingData
from mckibben.estimators.coupled.base import CoupledEstimator, memory_of
from mckibben.estimators.coupled.fuzzy import Consequents, Sets, firing, regressors
from mckibben.numerics.statistics import rms
from mckibben.numerics.swarm import Swarm, particle_swarm
from mckibben.numerics.tracker import Tracker
from mckibben.recording import check_sample_times

UNLOADED = 0.05
"""Largest force of a run without load, relative to the largest of all runs."""

SWARM = Swarm(20, 30, (0.9, 0.4), 2.0, 2.0, fastest=0.5)
"""Attractions and inertia of the paper, which does not print the size."""

ROUNDS = 8
"""Number of times that consequents are solved for on the network's free-running outputs."""

SEARCH_SAMPLES = 6000
"""Number of samples per run, from its start, on which the swarm compares free runs."""


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
    method : {"pso", "ls"}
        Antecedents and feedbacks by the paper's particle swarm; or even and none. Consequents by least
        squares always.
    ridge : float
        Damping of what is a rule's own.
    """

    title = "MPI in a recurrent fuzzy network (MPI–NARMAX)"
    can = "Hysteresis under a load that varies, by a recurrent fuzzy network behind a modified PI."
    cannot = "No inverse; the network is arbitrary under other loads."
    caution = "its network is arbitrary under loads and motions of another kind"
    effort = 6.0

    most_inputs = 1

    n_sets: Annotated[int, Interval(ge=1, le=4)] = 3
    output_lags: Annotated[int, Interval(ge=1, le=3)] = 1
    input_lags: Annotated[int, Interval(ge=0, le=3)] = 0
    scheduling_lags: Annotated[int, Interval(ge=0, le=3)] = 0
    memory: Literal["mpi", "rdpi"] = "mpi"
    learns_from: Literal["all", "loaded"] = "all"
    constants: bool = True
    method: Literal["pso", "ls"] = "pso"
    ridge: Annotated[float, Gt(0)] = 1e-4

    def fixed(self, block: Block) -> tuple[int, ...]:
        """Return the indices of parameters fixed by the hysteresis fit, and of even sets."""
        hysteresis, network = block.parts  # type: ignore[attr-defined]
        places = registry.load("estimators", self.memory)().fixed(hysteresis)
        if self.method == "pso":
            return places
        first, sets = hysteresis.n_parameters, 3 * network.n_regressors * network.n_sets
        return (*places, *range(first, first + sets))

    def find(self, data: TrainingData, tracker: Tracker) -> Block:
        """Return the series of hysteresis and network."""
        if len(data.inputs) != 1 or not data.scheduled:
            raise DataError(
                f"there are {len(data.inputs)} inputs and {len(data.scheduled)} loads",
                remedy="give recordings of one muscle, with a channel force",
            )
        check_sample_times([run.source for run in data.runs])
        tracker.reached(0.0)
        free, loaded = _parted(data)
        settings: dict[str, Any] = {"seed": self.seed}
        if self.memory == "rdpi":
            settings["rate_time_constant"] = 5.0 * data.timed()
        channel = replace(data.outputs[0], name=f"{data.outputs[0].name}_free")
        hysteresis = memory_of(self.memory, settings, free.runs, 0, free, channel)
        training = loaded if self.learns_from == "loaded" and loaded.runs else data
        problem = RecurrentProblem(self, after(hysteresis, training))
        even = Sets.even(*problem.ranges, self.n_sets)
        sets = (even, np.zeros_like(even.centres))
        if self.method == "pso":
            sets = problem.swarm(even, self.seed, tracker)
        tracker.reached(0.9)
        return Series((hysteresis, problem.best(*sets)))


def _parted(data: TrainingData) -> tuple[TrainingData, TrainingData]:
    """Return the runs without load, at least the one of smallest load, and all others."""
    largest = np.array([np.abs(run.scheduled).max(axis=0) for run in data.runs])
    shares = (largest / np.maximum(largest.max(axis=0), 1e-300)).max(axis=1)
    free = shares <= max(UNLOADED, float(shares.min()))

    def those(mask: NDArray[np.bool_]) -> TrainingData:
        runs = tuple(run for run, is_one in zip(data.runs, mask, strict=True) if is_one)
        return replace(data, runs=runs)

    return those(free), those(~free)


@kernel
def remembered(
    x: Array, centres: Array, widths: Array, feedbacks: Array, memberships: Array
) -> None:
    """Fill memberships (n, inputs, sets) of given inputs, with recurrent feedback of each set."""
    for t in range(x.shape[0]):
        for i in range(x.shape[1]):
            for s in range(centres.shape[1]):
                last = memberships[t - 1, i, s] if t > 0 else 0.0
                z = (x[t, i] - centres[i, s] + feedbacks[i, s] * last) / widths[i, s]
                memberships[t, i, s] = np.exp(-0.5 * z * z)


def after(hysteresis: Block, data: TrainingData) -> TrainingData:
    """Return the data with the outputs of a hysteresis instead of its inputs."""

    def driven(run: Run) -> Run:
        memory = hysteresis.simulate(run.driven, sample_time=run.sample_time)
        return replace(run, driven=np.asarray(memory))

    return replace(data.changed(driven), inputs=hysteresis.outputs)


@dataclass(frozen=True)
class RecurrentProblem:
    """Runs for the network, whose input is the hysteresis."""

    settings: MPINarmaxEstimator
    data: TrainingData

    def regress(self, inputs: Array, past: Array) -> Array:
        """Return all regressors over a run, with given past outputs."""
        e = self.settings

        def back(values: Array, lag: int) -> Array:
            return np.concatenate([np.full(lag, values[0]), values[: len(values) - lag]])

        columns = [back(past, lag) for lag in range(1, e.output_lags + 1)]
        columns += [back(inputs[:, 0], lag) for lag in range(e.input_lags + 1)]
        for s in range(1, inputs.shape[1]):
            columns += [back(inputs[:, s], lag) for lag in range(e.scheduling_lags + 1)]
        return np.ascontiguousarray(np.column_stack(columns))

    @property
    def ranges(self) -> tuple[Array, Array]:
        """Lowest and highest of every regressor."""
        x = np.concatenate([self.regress(run.inputs, run.y) for run in self.data.runs])
        low, high = x.min(axis=0), x.max(axis=0)
        return low, np.where(high > low, high, low + 1.0)

    def solved(self, sets: Sets, feedbacks: Array, pasts: Sequence[Array]) -> RecurrentFuzzyNetwork:
        """Return the network with least-squares consequents for given past outputs."""
        e, constants = self.settings, self.settings.constants
        solver = Consequents(constants, e.ridge)
        gram, right, n_terms = np.zeros(()), np.zeros(()), 0
        for run, past in zip(self.data.runs, pasts, strict=True):
            x = self.regress(run.inputs, past)
            phi = np.empty((len(x), *sets.centres.shape))
            remembered(x, sets.centres, sets.widths, feedbacks, phi)
            fired = firing(phi)
            fired = fired / np.maximum(fired.sum(axis=1, keepdims=True), 1e-290)
            columns = regressors(x, fired, constants=constants)
            gram = gram + columns.T @ columns
            right = right + columns.T @ run.outputs
            n_terms = x.shape[1] + constants
        consequents = solver.solve(gram, right, n_terms)
        return RecurrentFuzzyNetwork(
            rows(sets.centres),
            rows(sets.widths),
            rows(feedbacks),
            vector(consequents.ravel()),
            self.data.timed(),
            self.data.inputs,
            self.data.scheduled,
            self.data.outputs,
            e.output_lags,
            e.input_lags,
            e.scheduling_lags,
            constants,
        )

    def free_runs(self, network: RecurrentFuzzyNetwork) -> tuple[list[Array], float]:
        """Return the network's free-running outputs, and their RMSE; infinite for diverging runs."""
        pairs = ((run.inputs, run.sample_time) for run in self.data.runs)
        outputs = [run_many([network], u, sample_time=step)[0, :, 0] for u, step in pairs]
        with np.errstate(over="ignore", invalid="ignore"):
            return outputs, rms(np.concatenate(outputs) - self.data.stacked("y"))

    def best(self, sets: Sets, feedbacks: Array) -> RecurrentFuzzyNetwork:
        """Return the network of lowest free-running error, trained on its own past outputs.

        Raises
        ------
        ModelError
            If every one of them leaves all bounds.
        """
        pasts = [run.y for run in self.data.runs]
        best_network, least = None, np.inf
        for _ in range(ROUNDS):
            network = self.solved(sets, feedbacks, pasts)
            outputs, cost = self.free_runs(network)
            if cost < least:
                best_network, least = network, cost
            if not np.isfinite(cost):
                break
            # halfway from what was measured to what it makes of itself: whole steps may circle
            pasts = [0.5 * (a + b) for a, b in zip(pasts, outputs, strict=True)]
        if best_network is None:
            raise ModelError(
                "the network diverges in a free run",
                remedy="raise `settings[ridge]`, lower `settings[n_sets]`, or fit balance",
            )
        return best_network

    def swarm(self, even: Sets, seed: int, tracker: Tracker) -> tuple[Sets, Array]:
        """Return centres, widths and feedbacks by particle swarm on the free-running error."""
        rng = np.random.default_rng(seed)
        low, high = self.ranges
        span, base = (np.repeat(end, self.settings.n_sets) for end in (high - low, low))
        lower = np.concatenate([base, 0.15 * span, -0.3 * span])
        upper = np.concatenate([base + span, span, 0.3 * span])
        start = rng.uniform(lower, upper, (SWARM.particles, lower.size))
        start[0] = np.concatenate([even.vector, np.zeros(span.size)])
        most = max(SEARCH_SAMPLES // len(self.data.runs), 100)
        thin = replace(self, data=self.data.changed(lambda run: run.cut(0, most)))
        measured = [run.y for run in thin.data.runs]

        def split(position: Array) -> tuple[Sets, Array]:
            n = even.vector.size
            return even.replaced(position[:n]), position[n:].reshape(even.centres.shape)

        def cost(position: Array) -> float:
            try:
                return thin.free_runs(thin.solved(*split(position), measured))[1]
            except (MckibbenError, np.linalg.LinAlgError):
                return np.inf

        def costs(positions: Array) -> Array:
            return np.array([cost(position) for position in positions])

        part = tracker.part(0.1, 0.9)
        return split(particle_swarm(costs, lower, upper, SWARM, part, rng, start=start))
