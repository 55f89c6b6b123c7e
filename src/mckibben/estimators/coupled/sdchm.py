"""Identification of the stiffness-dependent hysteresis coupling model, SDCHM.

A hysteresis block for every muscle, a coupling between them, and a fuzzy network that takes in the
extensor's pressure, identified in three stages.

Source: "Modeling and Compensation of Stiffness-Dependent Hysteresis Coupling Behavior for Parallel
Pneumatic Artificial Muscle-Driven Soft Manipulator", Algorithm 1.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import field, replace
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
from mckibben.blocks.runs import Run
from mckibben.errors import DataError, ModelError, ModelWarning
from mckibben.estimators.catalogue import settings_of
from mckibben.estimators.core.data import TrainingData
from mckibben.estimators.core.estimator import InverseKind
from mckibben.estimators.coupled.base import CoupledEstimator, alone, memory_of
from mckibben.estimators.coupled.fuzzy import (
    Consequents,
    Method,
    Search,
    fit_network,
    printed_swarm,
)
from mckibben.estimators.hysteresis.pi import play_operators
from mckibben.metrics import rmse
from mckibben.numerics.least_squares import solve_bounded
from mckibben.numerics.tracker import Tracker
from mckibben.recording import Recording

BEYOND = 0.1
"""Range of the inverse beyond the data, relative to their range."""

FRICTION = (0.002, 0.1)
"""Smallest and largest threshold of a muscle's friction, relative to its travel."""

LEAST_SLOPE = 0.05
"""Smallest slope of a displacement alone, just after a reversal."""


class SDCHMEstimator(CoupledEstimator):
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
    memory : str, optional
        Model of every muscle's hysteresis: any with an exact inverse. ``cpi`` includes creep. None for a
        network of the raw pressures.
    memory_settings : mapping
        Its settings.
    n_friction : int
        Play operators with a dead zone behind the network, on every displacement; 0 for no such part.
    n_rounds : int
        Times that network and friction are fitted in turn.
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

    title = "Stiffness-dependent coupled hysteresis model (SDCHM)"
    can = (
        "Hysteresis, coupling and stiffness of muscles round a backbone; its damped network "
        "extrapolates to other combinations of pressures."
    )
    cannot = (
        "Strong rate dependence; with little damping (ridge) its network is arbitrary away from"
        " the recorded runs."
    )
    inverse_kind: ClassVar[InverseKind] = "solved"
    effort = 20.0
    each_alone = True
    fewest_inputs = 2

    n_sets: Annotated[int, Interval(ge=0, le=6)] = 3
    memory: Literal["gpi", "pi", "mpi", "eupi", "cpi"] | None = "cpi"
    memory_settings: dict[str, Any] | None = None
    n_friction: Annotated[int, Interval(ge=0, le=20)] = 6
    n_rounds: Annotated[int, Interval(ge=1, le=5)] = 2
    constants: bool = True
    method: Method = "ls"
    ridge: Annotated[float, Ge(0)] = 1e-3
    particles: Annotated[int, Ge(1)] = 20
    iterations: Annotated[int, Ge(1)] = 50
    search_samples: Annotated[int, Ge(100)] = 6000

    @property
    def pairs(self) -> bool:
        """Whether every muscle has a hysteresis, for which each needs an output."""
        return self.memory is not None

    def fixed(self, block: Block) -> tuple[int, ...]:
        """Return the indices of the unit gains, and of parameters fixed by the hysteresis fits."""
        places = [
            k
            for k, (part, _, index) in enumerate(block.numbers())
            if isinstance(part, Coupling) and index[0] == index[1]
        ]
        if self.memory is not None:
            memory, first = registry.load("estimators", self.memory)(), 0
            for muscle in block.parts[0].parts:  # type: ignore[attr-defined]
                places += [first + k for k in memory.fixed(muscle)]
                first += muscle.n_parameters
        return tuple(places)

    def find(self, data: TrainingData, tracker: Tracker) -> Block:
        tracker.reached(0.0)
        front: tuple[Block, ...] = ()
        runs, driven = list(data.runs), data.inputs
        if self.memory is not None:
            softest_runs = [softest(data, muscle) for muscle in range(len(data.inputs))]
            settings = settings_of(self.memory, {"seed": self.seed} | (self.memory_settings or {}))
            memories = [
                memory_of(self.memory, settings, [run], k, data, data.outputs[k])
                for k, run in enumerate(softest_runs)
            ]
            tracker.reached(0.2)
            front = (PerChannel(tuple(memories)), coupled(memories, softest_runs, data))
            used_ids = {id(run) for run in softest_runs}
            runs = [run for run in data.runs if id(run) not in used_ids] or runs
            driven = data.outputs
        if not self.n_sets:
            if data.scheduled:
                tracker.notes.append(f"{data.scheduled[0].name} is not used by this model")
            return Series(front)
        x, target = network_inputs(front, runs), [run.outputs for run in runs]
        swarm = printed_swarm(self.particles, self.iterations)
        rounds = self.n_rounds if self.n_friction else 1
        parts: tuple[Block, ...] = ()
        for number in range(rounds):
            network = fit_network(
                x,
                np.concatenate(target),
                self.n_sets,
                Consequents(self.constants, self.ridge),
                Search(self.method, self.search_samples, swarm, self.seed),
                (driven, data.scheduled, data.outputs),
                beyond=BEYOND,
                tracker=tracker.part(*(0.25 + 0.75 * (number + k) / rounds for k in (0, 1))),
            )
            parts = (*front, network)
            if not self.n_friction:
                break
            straight = np.split(network.simulate(x), np.cumsum([len(run) for run in runs])[:-1])
            rubbing = PerChannel(
                tuple(
                    self.friction([part[:, k] for part in straight], runs, k, channel)
                    for k, channel in enumerate(data.outputs)
                )
            )
            parts = (*parts, rubbing)
            unrubbed = rubbing.inverse()
            with warnings.catch_warnings():  # noise at the ends is clipped
                warnings.simplefilter("ignore", ModelWarning)
                target = [unrubbed.simulate(run.outputs) for run in runs]
        return parts[0] if len(parts) == 1 else Series(parts)

    def friction(self, inputs: list[Array], runs: list[Run], muscle: int, channel: Channel) -> PI:
        """Return the friction memory of a muscle: play operators with positive partial sums."""
        low = min(float(part.min()) for part in inputs)
        high = max(float(part.max()) for part in inputs)
        span = high - low
        radii = np.append(0.0, span * np.geomspace(*FRICTION, self.n_friction))
        plays = np.concatenate([play_operators(part, radii, "first_sample") for part in inputs])
        # weights are differences of partial sums, which must stay positive for an inverse
        steps = np.column_stack([-np.diff(plays, axis=1), plays[:, -1]])
        least = np.full(radii.size, LEAST_SLOPE)
        outputs = np.concatenate([run.outputs[:, muscle] for run in runs])
        sums, offset = solve_bounded(steps, outputs, least)
        weights = np.diff(sums, prepend=0.0)
        ends = low - BEYOND * span, high + BEYOND * span
        return PI(vector(radii), vector(weights), offset, ends, input=channel, output=channel)


class CoupledPIEstimator(SDCHMEstimator):
    """Hysteresis of every muscle and a coupling, whatever the stiffness: a baseline."""

    title = "Coupled Prandtl–Ishlinskii model"
    can = "Hysteresis of every muscle, and a constant coupling."
    cannot = "The coupling does not change with stiffness."
    inverse_kind = "exact"
    quick = True
    memory = "gpi"
    n_sets = 0
    n_friction = 0


class PublishedSDCHMEstimator(SDCHMEstimator):
    """SDCHM identified as in its paper: GPI, coupling, and a network trained by particle swarm."""

    title = "SDCHM identified as in its paper"
    can = "As sdchm, identified as in its paper."
    cannot = "Combinations of pressures unlike those recorded: its network is arbitrary there."
    caution = "its network is arbitrary where muscles move in other combinations"
    effort = 25.0
    constants = False
    method = "pso"
    ridge = 1e-9
    memory = "gpi"
    memory_settings: dict[str, Any] | None = field(
        default_factory=lambda: {"threshold_rule": "paper", "initial": "virgin"}
    )
    n_friction = 0


class TSFNNEstimator(SDCHMEstimator):
    """Fuzzy network on the raw pressures: the paper's baseline, without memory."""

    title = "Takagi–Sugeno fuzzy network of raw pressures (TSFNN)"
    can = "A network without memory, as a baseline."
    cannot = "Hysteresis; combinations of pressures unlike those recorded."
    caution = PublishedSDCHMEstimator.caution
    effort = 5.0
    paired = False
    each_alone = False
    memory = None
    constants = False
    n_friction = 0


def network_inputs(front: Sequence[Block], runs: Sequence[Run]) -> Array:
    """Return the network's inputs over all runs: driven through blocks, and scheduling."""

    def of(run: Run) -> Array:
        driven = np.ascontiguousarray(run.driven)
        for block in front:
            driven = block.simulate(driven, sample_time=run.sample_time)
        return np.column_stack([driven, run.scheduled])

    return np.concatenate([of(run) for run in runs])


def softest(data: TrainingData, muscle: int) -> Run:
    """Return the run for a muscle's hysteresis.

    It moves alone; what schedules is lowest; and the run is the longest of those.

    Raises
    ------
    DataError
        If the muscle never moves alone.
    """
    runs = alone(data, muscle)
    if not runs:
        raise DataError(
            "no run moves this muscle alone, so its hysteresis and the coupling cannot be distinguished",
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
    """Return the coupling by least squares on the hysteresis of muscle i moving alone."""
    n = len(memories)
    gains = np.eye(n)
    for i, (block, run) in enumerate(zip(memories, runs, strict=True)):
        v = block.simulate(run.driven[:, i], sample_time=run.sample_time)
        for j in range(n):
            if j != i:
                gains[i, j] = float(v @ run.outputs[:, j]) / float(v @ v)
    return Coupling(rows(gains), data.outputs, data.outputs)


def trained_inverse(
    model: Block,
    recordings: Sequence[Recording],
    seed: int = 0,
    progress: Callable[[float, float], None] | None = None,
) -> tuple[Series, dict[str, float]]:
    """Return `learned_inverse` by the paper's swarm, and its RMSE on the recordings per output."""
    search = Search("pso", SDCHMEstimator.search_samples, printed_swarm(), seed)
    tracker = Tracker(progress=progress)
    inverse = learned_inverse(model, recordings, search=search, tracker=tracker)
    pairs = [(recording, inverse.simulate(recording)) for recording in recordings]
    return inverse, {
        channel.name: rmse(*(np.concatenate([p[k][channel.name] for p in pairs]) for k in (0, 1)))
        for channel in inverse.outputs
    }


def learned_inverse(
    model: Block,
    recordings: Recording | Sequence[Recording],
    *,
    search: Search | None = None,
    tracker: Tracker | None = None,
) -> Series:
    """Return the inverse with a trained network: SDIHC, as in its paper (Section 4).

    A network of the model's shape is trained on recordings with inputs and outputs swapped, from
    displacements to the coupled hysteresis; friction, coupling and hysteresis have their exact inverses.

    Parameters
    ----------
    model : Block
        As `SDCHMEstimator` finds it, with a network.
    recordings : Recording or sequence of Recording
        Of its inputs and outputs.
    search : Search, optional
        Of the network's sets; default the paper's swarm, on 6000 samples.
    tracker : Tracker, optional
        Is shown the progress.

    Raises
    ------
    ModelError
        If the model has not these parts.
    """
    parts = model.parts if isinstance(model, Series) else ()
    kinds = [type(part) for part in parts]
    if kinds[:3] != [PerChannel, Coupling, FuzzyNetwork]:
        raise ModelError(
            f"{model.title!r} is no hysteresis, coupling and fuzzy network, of which the "
            "last could be learned the other way round",
            remedy="give a model of sdchm or sdchm-published",
        )
    hysteresis, coupling, network, *friction = parts
    assert isinstance(network, FuzzyNetwork)
    pressures, motions, scheduling = (
        tuple(channel.name for channel in channels)
        for channels in (hysteresis.inputs, model.outputs, network.scheduled)
    )
    data = SDCHMEstimator(input=pressures, output=motions, scheduling=scheduling).data(recordings)
    before = tuple(part.inverse() for part in reversed(friction))
    h = network_inputs((hysteresis, coupling), data.runs)[:, : len(data.inputs)]
    with warnings.catch_warnings():  # noise at the ends is clipped
        warnings.simplefilter("ignore", ModelWarning)
        y = network_inputs(before, [replace(run, driven=run.outputs) for run in data.runs])
    swapped = fit_network(
        y,
        h,
        len(network.centres[0]),
        Consequents(network.constants, PublishedSDCHMEstimator.ridge),
        search or Search("pso", SDCHMEstimator.search_samples, printed_swarm(), 0),
        (data.outputs, data.scheduled, network.driven),
        beyond=0.0,
        tracker=tracker or Tracker(),
    )
    return Series((*before, swapped, coupling.inverse(), hysteresis.inverse()))
