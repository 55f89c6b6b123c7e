"""Identification of the stiffness-dependent hysteresis coupling model, SDCHM.

A hysteresis block for every muscle, a coupling between them, and a fuzzy network that takes in the
extensor's pressure, identified in three stages.

Source: "Modeling and Compensation of Stiffness-Dependent Hysteresis Coupling Behavior for Parallel
Pneumatic Artificial Muscle-Driven Soft Manipulator", Algorithm 1.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from annotated_types import Ge, Interval

from mckibben import registry
from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.compose import PerChannel, Series
from mckibben.blocks.coupled.coupling import Coupling
from mckibben.blocks.coupled.fuzzy_network import FuzzyNetwork
from mckibben.blocks.fields import Channel, rows, vector
from mckibben.blocks.hysteresis.pi import PI
from mckibben.errors import DataError, ModelError, ModelWarning
from mckibben.estimators.core.data import Run, TrainingData
from mckibben.estimators.coupled.base import CoupledEstimator, alone
from mckibben.estimators.coupled.fuzzy import (
    Consequents,
    Fitted,
    Method,
    Search,
    fit_network,
    printed_swarm,
)
from mckibben.estimators.hysteresis.pi import play_operators
from mckibben.estimators.optimisers.linear import solve_linear
from mckibben.estimators.optimisers.tracker import Tracker, whole_searches
from mckibben.presets import preset
from mckibben.recording import Recording

BEYOND = 0.1
"""How far beyond the data the inverse may go, relative to their range."""

FRICTION = (0.002, 0.1)
"""Smallest and largest threshold of a muscle's own friction, relative to its travel."""

LEAST_SLOPE = 0.05
"""Smallest slope of a displacement by itself, right after a reversal."""


@dataclass(kw_only=True, repr=False, eq=False)
class NetworkEstimator(CoupledEstimator):
    """What models with a fuzzy network share.

    Parameters
    ----------
    n_sets : int
        Gaussian sets of every input.
    constants : bool
        Whether rules have a constant term; the paper's have none.
    method : {"ls", "pso"}
        Antecedents by variable projection, or by the paper's particle swarm.
    ridge : float
        Damping of what is a rule's own, relative to the size of what it multiplies. With next to none
        (1e-7) the network follows what was recorded most closely; but it is then undetermined where no
        run has been: it neither predicts there nor can be inverted.
    particles, iterations : int
        Of the swarm.
    search_samples : int
        Samples on which antecedents are searched; consequents are solved for on all.
    """

    fewest_inputs: ClassVar[int] = 2

    n_sets: Annotated[int, Interval(ge=1, le=6)] = 3
    constants: bool = False
    method: Method = "ls"
    ridge: Annotated[float, Ge(0)] = 1e-3
    particles: Annotated[int, Ge(1)] = 20
    iterations: Annotated[int, Ge(1)] = 50
    search_samples: Annotated[int, Ge(100)] = 6000

    @property
    def stops_early(self) -> bool:
        """Where there is a network."""
        return self.n_sets > 0

    @property
    def search(self) -> Search:
        """How antecedents are searched."""
        swarm = printed_swarm(self.particles, self.iterations)
        return Search(self.method, self.search_samples, swarm, self.seed)

    def network(
        self,
        x: Array,
        y: Array,
        driven: tuple[Channel, ...],
        data: TrainingData,
        early: tuple[Array, Array] | None,
        tracker: Tracker,
    ) -> FuzzyNetwork:
        """Return a network from driven and scheduling inputs to displacements."""
        found = fit_network(
            x,
            y,
            self.n_sets,
            Consequents(self.constants, self.ridge),
            self.search,
            tracker=tracker,
            validation=early,
        )
        n = len(driven)
        low, high = x[:, :n].min(axis=0), x[:, :n].max(axis=0)
        margin = BEYOND * (high - low)
        limits = np.column_stack([low - margin, high + margin])
        return as_block(found, driven, data.outputs, data.scheduled, limits, self.constants)


def as_block(
    fitted: Fitted,
    driven: tuple[Channel, ...],
    given: tuple[Channel, ...],
    scheduled: tuple[Channel, ...],
    limits: Array,
    constants: bool,
) -> FuzzyNetwork:
    """Return a fitted network as a block."""
    n_terms = len(driven) + len(scheduled) + constants
    consequents = fitted.consequents.reshape(-1, n_terms, len(given))
    return FuzzyNetwork(
        rows(fitted.sets.centres),
        rows(fitted.sets.widths),
        vector(np.moveaxis(consequents, 2, 1).ravel()),
        driven,
        given,
        scheduled,
        constants,
        rows(limits),
    )


@dataclass(kw_only=True, repr=False, eq=False)
class TSFNNEstimator(NetworkEstimator):
    """Fuzzy network on the raw pressures: the paper's baseline, without memory."""

    title = "Takagi–Sugeno fuzzy network of raw pressures (TSFNN)"
    can = "A network without memory, as a baseline."
    cannot = "Hysteresis; combinations of pressures unlike those recorded."
    caution = (
        "its network is arbitrary where muscles move in other combinations (mckibben "
        "reproduce sdchm)"
    )
    inverse_kind = "solved"
    effort: ClassVar[float] = 5.0

    paired: ClassVar[bool] = False

    def identify(self, data: TrainingData, tracker: Tracker) -> Block:
        held = None if data.early is None else _table(data.early)
        return self.network(*_table(data), data.inputs, data, held, tracker)


@dataclass(kw_only=True, repr=False, eq=False)
class SDCHMEstimator(NetworkEstimator):
    """Hysteresis of every muscle, coupling, a network scheduled by stiffness, and friction.

    Where every part but the network has an exact inverse, and the network one solved for, so has the
    whole. The last part is beyond the paper: a muscle that is moved by the others rubs in its own braid,
    and a Prandtl-Ishlinskii memory of its own motion says so.

    ``sdchm-published`` follows Algorithm 1, with thresholds by Eq. (7), operators started by Eq. (1) and
    the loss of Eq. (26). What differs: the GPI models' search does not start from weights and envelopes
    of 0 (see `GPIEstimator`); gains and consequents are solved for, so that their printed starts are of
    no effect; and rules are normalised input by input in the log domain, since printed centres near 0
    are so far from most displacements that every rule's product underflows.

    Parameters
    ----------
    n_sets : int
        Gaussian sets of every input of the network; 0 for neither network nor friction.
    memory : str
        Model of every muscle's hysteresis: any with an exact inverse. ``cpi`` knows creep.
    memory_settings : mapping
        Its settings.
    n_friction : int
        Play operators with a dead zone behind the network, on every displacement; 0 for no such part.
    n_rounds : int
        Times that network and friction are fitted in turn.
    """

    title = "Stiffness-dependent coupled hysteresis model (SDCHM)"
    can = (
        "Hysteresis, coupling and stiffness of muscles round a backbone; its damped network "
        "holds where pressures move in other combinations."
    )
    cannot = (
        "Strong rate dependence; with next to no damping (ridge) its network is arbitrary off"
        " the runs recorded."
    )
    inverse_kind = "solved"
    effort: ClassVar[float] = 20.0
    each_alone: ClassVar[bool] = True

    n_sets: Annotated[int, Interval(ge=0, le=6)] = 3
    constants: bool = True
    memory: Literal["gpi", "pi", "mpi", "eupi", "cpi"] = "cpi"
    memory_settings: dict[str, Any] | None = None
    n_friction: Annotated[int, Interval(ge=0, le=20)] = 6
    n_rounds: Annotated[int, Interval(ge=1, le=5)] = 2

    def identify(self, data: TrainingData, tracker: Tracker) -> Block:
        chosen = [softest(data, muscle) for muscle in range(len(data.inputs))]
        tracker.reached(0.0)
        memories = [self.hysteresis(run, k, data) for k, run in enumerate(chosen)]
        hysteresis = PerChannel(tuple(memories))
        tracker.reached(0.2)
        coupling = coupled(memories, chosen, data)
        front = Series((hysteresis, coupling))
        if not self.n_sets:
            if data.scheduled:
                tracker.notes.append(f"{data.scheduled[0].name} is not used by this model")
            return front
        used = {id(run) for run in chosen}
        rest = [run for run in data.runs if id(run) not in used] or list(data.runs)
        x = stacked_inputs(front, rest)
        held = None
        if data.early is not None:
            held = (stacked_inputs(front, list(data.early.runs)), data.early.stacked("outputs"))
        target = [run.outputs for run in rest]
        rounds = self.n_rounds if self.n_friction else 1
        for number in range(rounds):
            first, last = (0.25 + 0.75 * (number + end) / rounds for end in (0, 1))
            own = tracker.part(first, last)
            network = self.network(
                x,
                np.concatenate(target),
                data.outputs,
                data,
                held if number == 0 else None,
                own,
            )
            tracker.saw_all(own)
            if not self.n_friction:
                return Series((hysteresis, coupling, network))
            straight = np.split(
                network.simulate(x), np.cumsum([len(run.outputs) for run in rest])[:-1]
            )
            rubbing = PerChannel(
                tuple(
                    self.friction(
                        [part[:, k] for part in straight],
                        [run.outputs[:, k] for run in rest],
                        channel,
                    )
                    for k, channel in enumerate(data.outputs)
                )
            )
            if tracker.interrupted:
                break
            unrubbed = rubbing.inverse()
            with warnings.catch_warnings():  # noise at the ends is clipped
                warnings.simplefilter("ignore", ModelWarning)
                target = [unrubbed.simulate(run.outputs) for run in rest]
        return Series((hysteresis, coupling, network, rubbing))

    def friction(self, given: list[Array], wanted: list[Array], channel: Channel) -> PI:
        """Return the memory of a muscle's own motion: play operators, all partial sums positive."""
        low = min(float(part.min()) for part in given)
        high = max(float(part.max()) for part in given)
        span = high - low
        smallest = FRICTION[0] * span
        radii = np.append(0.0, np.geomspace(smallest, FRICTION[1] * span, self.n_friction))
        plays = np.concatenate([play_operators(part, radii, "first_sample") for part in given])
        # weights are differences of partial sums, which must stay positive for an inverse
        steps = np.column_stack([-np.diff(plays, axis=1), plays[:, -1]])
        least = np.full(radii.size, LEAST_SLOPE)
        sums, offset = solve_linear(steps, np.concatenate(wanted), nonnegative=True, least=least)
        weights = np.diff(sums, prepend=0.0)
        margin = BEYOND * span
        return PI(
            vector(radii),
            vector(weights),
            offset,
            (low - margin, high + margin),
            "first_sample",
            channel,
            channel,
        )

    def hysteresis(self, run: Run, muscle: int, data: TrainingData) -> Block:
        """Return the hysteresis of one muscle, from a run in which it moves alone."""
        given, wanted = data.inputs[muscle], data.outputs[muscle]
        recording = Recording(
            {given.name: run.driven[:, muscle], wanted.name: run.outputs[:, muscle]},
            run.sample_time,
        )
        settings = {"input": given.name, "output": wanted.name, "seed": self.seed}
        estimator = registry.load("estimators", self.memory)()
        try:
            estimator.set_params(**settings | (self.memory_settings or {}))
        except ValueError as error:
            raise ModelError(f"memory_settings: {error}") from None
        with whole_searches():
            block: Block = estimator.fit(recording).model_
        return block


def _table(data: TrainingData) -> tuple[Array, Array]:
    """Return the inputs and outputs of all runs, one under another."""
    return data.stacked("inputs"), data.stacked("outputs")


def stacked_inputs(front: Block, runs: list[Run]) -> Array:
    """Return what the network is given over all runs: coupled hysteresis, then what schedules."""
    return np.concatenate([np.column_stack([simulated(front, run), run.scheduled]) for run in runs])


def simulated(block: Block, run: Run) -> Array:
    """Return a block's outputs over a run's pressures."""
    return block.simulate(np.ascontiguousarray(run.driven), sample_time=run.sample_time)


def softest(data: TrainingData, muscle: int) -> Run:
    """Return the run to identify a muscle's hysteresis from.

    It moves alone; what schedules is lowest; and the run is the longest of those.

    Raises
    ------
    DataError
        If the muscle never moves alone.
    """
    runs = alone(data, muscle)
    if not runs:
        raise DataError(
            "no run moves this muscle alone, so its hysteresis cannot be told from the coupling",
            channel=data.inputs[muscle].name,
            remedy="add a run in which the other pressures rest, or fit balance",
        )
    if not data.scheduled:
        return max(runs, key=lambda run: len(run.driven))
    lowest = min(float(run.scheduled.mean()) for run in runs)
    span = float(np.ptp(data.stacked("scheduled"))) or 1.0
    near = [run for run in runs if run.scheduled.mean() <= lowest + 0.02 * span]
    return max(near, key=lambda run: len(run.driven))


def coupled(memories: list[Block], runs: list[Run], data: TrainingData) -> Coupling:
    """Return the coupling: what moves with muscle i alone, by least squares on its hysteresis."""
    n = len(memories)
    gains = np.eye(n)
    for i, (block, run) in enumerate(zip(memories, runs, strict=True)):
        v = block.simulate(run.driven[:, i], sample_time=run.sample_time)
        for j in range(n):
            if j != i:
                gains[i, j] = float(v @ run.outputs[:, j]) / float(v @ v)
    return Coupling(rows(gains), data.outputs, data.outputs)


COUPLED_PI = preset(
    SDCHMEstimator,
    "Hysteresis of every muscle and a coupling, whatever the stiffness: a baseline.",
    title="Coupled Prandtl–Ishlinskii model",
    can="Hysteresis of every muscle, and a constant coupling.",
    cannot="The coupling does not change with stiffness.",
    inverse_kind="exact",
    quick=True,
    memory="gpi",
    n_sets=0,
    n_friction=0,
)

SDCHM_PUBLISHED = preset(
    SDCHMEstimator,
    "SDCHM as its paper identifies it: GPI, coupling, and a network trained by particle swarm.",
    title="SDCHM as its paper identifies it",
    can="As sdchm, identified as its paper has it.",
    cannot="Combinations of pressures unlike those recorded: its network is arbitrary there.",
    caution=(
        "its network is arbitrary where muscles move in other combinations (mckibben "
        "reproduce sdchm)"
    ),
    effort=25.0,
    constants=False,
    method="pso",
    ridge=1e-9,
    memory="gpi",
    memory_settings={"threshold_rule": "paper", "initial": "virgin"},
    n_friction=0,
)
