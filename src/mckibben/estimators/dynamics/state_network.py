"""Identification of state-space networks: Gauss-Newton on free runs, from a linear oscillator.

The first two states begin as displacement and velocity of the linear oscillator nearest to the data;
others as lags of the velocity; units begin at random, and next to unread. What the states become is
left to the descent, whose derivatives are exact.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np
from annotated_types import Interval

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.dynamics.process_model import ProcessModel
from mckibben.blocks.dynamics.state_network import BETWEEN, SETTLING, SETTLING_STEP, StateNetwork
from mckibben.blocks.fields import rows
from mckibben.blocks.kernels import summing_kernel
from mckibben.blocks.runs import Run
from mckibben.errors import DataError
from mckibben.estimators.core.data import TrainingData
from mckibben.estimators.core.estimator import SearchEstimator
from mckibben.estimators.dynamics.process_model import ProcessModelEstimator
from mckibben.numerics.descent import trust_region
from mckibben.numerics.tracker import Tracker
from mckibben.signals.periodic import band_limited

ANGLE = 1 / 3
"""Largest angle of the linear oscillator per substep [rad]."""

SPRING, DAMPING, LAG = 0.5, 0.1, 0.3
"""Initial values in units of the linear oscillator: stiffness with lags of the velocity, damping,
and decay rate of the first lag.
"""

UNIT, FORCED, READ = 0.7, 0.05, 0.01
"""Scales of random initial weights: of units by states, by the input, and of the output layer."""

LEAST_GAIN = 1e-7
"""Smallest relative reduction of the squared error for another step."""

RUNGE_KUTTA = ((0.0, 1.0, 0.5), (0.5, 2.0, 0.5), (0.5, 2.0, 1.0), (1.0, 1.0, 0.0))
"""Runge-Kutta stages: position in the step, weight, and length of the following stage."""

LARGEST = 1e6
"""State, in units of the output's scale, that counts as diverged."""

FORGOTTEN = 3 * np.log(1e8)
"""Number of decay times after which a start is forgotten: three times those of a decay to 1e-8, as
small motions decay more slowly with hysteresis.
"""

MOST_SUBSTEPS = 1000
"""Largest number of Runge-Kutta steps per sample."""

MOST_PERIODS = 20
"""Limit of that number, in periods of the longest run."""


def linear_oscillator(data: TrainingData, channels: dict[str, Any]) -> ProcessModel:
    """Return the linear oscillator of least free-running error, with a start state per run.

    Raises
    ------
    DataError
        If the displacement falls while the force rises slowly.
    """
    estimator = ProcessModelEstimator(
        structure="P2U", input=channels["input"].name, output=channels["output"].name, n_refined=1
    )
    model = estimator.find(data, Tracker())
    assert isinstance(model, ProcessModel)
    if not model.gain > 0:
        raise DataError(
            "the displacement falls while the force rises slowly",
            channel=channels["output"].name,
            remedy="turn the sign of one of them",
        )
    return model


def settling_samples(model: ProcessModel, data: TrainingData) -> int:
    """Return the number of samples after which the start state of an oscillator has no effect."""
    frequency, damping = 1.0 / model.time_constants[0], model.damping or 0.0
    decay = frequency * (damping - float(np.sqrt(max(damping**2 - 1.0, 0.0))))
    longest = MOST_PERIODS * max(run.u.size for run in data.runs)
    return int(min(np.ceil(FORGOTTEN / max(decay * data.timed(), 1e-9)), longest))


@dataclass(frozen=True)
class Path:
    """The input of a run in substeps; substeps per sample; samples before the first scored one."""

    run: Run
    inputs: Array
    every: int
    skipped: int


def paths(data: TrainingData, substeps: int, warm: int | None, at_rest: bool) -> list[Path]:
    """Return the inputs of all runs in substeps.

    Parameters
    ----------
    data : TrainingData
    substeps : int
        From sample to sample; `BETWEEN` times as many in periodic runs.
    warm : int or None
        Samples to be run before those of a period; None where runs are not periodic: then the input goes
        in straight lines from sample to sample.
    at_rest : bool
        Whether a run that is not periodic begins with its first input, instead of with none.
    """
    found = []
    for run in data.runs:
        n = run.u.size
        if warm is None:
            steps = np.arange(1 + substeps * n) / substeps
            before = run.u[0] if at_rest else 0.0
            u = np.interp(steps, np.arange(n + 1), np.append(before, run.u))
            found.append(Path(run, u, substeps, 0))
            continue
        ratio = BETWEEN * substeps
        places = np.arange(-(warm + 1) * ratio, (n - 1) * ratio + 1) % (n * ratio)
        found.append(Path(run, band_limited(run.u, ratio)[places], ratio, warm))
    return found


def averaged(data: TrainingData) -> TrainingData:
    """Return periodic runs of one input as one, with the mean output; other runs unchanged.

    What runs free is the same in all, so their squared errors are that of the mean, but for a constant.
    """
    first = data.runs[0]
    if not all(np.array_equal(run.driven, first.driven) and run.counts.all() for run in data.runs):
        return data
    mean = np.mean([run.outputs for run in data.runs], axis=0)
    return replace(data, runs=(replace(first, outputs=mean),))


class StateNetworkEstimator(SearchEstimator):
    """State-space network by Gauss-Newton on free runs, with a given number of states.

    Parameters
    ----------
    n_states, n_units : int
        Of the model.
    n_steps : int
        Most steps of the descent, each of which costs about as much as n_states runs of all weights.
    periodic : bool
        Whether every recording is a whole number of periods in steady state. Starts then have no effect,
        and the input is band-limited between samples. Otherwise recordings begin at rest, and the input
        is linear between samples.
    substeps : int, optional
        Runge-Kutta steps from sample to sample. Default: enough that the linear oscillator turns by
        no more than 1/3 rad in each.
    """

    title = "State-space network"
    purpose = "rate"
    can = (
        "Nonlinear dynamics with memory of any kind, from force to displacement; only the number"
        " of states is set."
    )
    cannot = "Slow to fit; no inverse; arbitrary beyond the data."
    caution = "a network without physics is arbitrary beyond them"
    needs_time = True
    made_for = ("force", "displacement")
    effort = 100.0

    n_states: Annotated[int, Interval(ge=2, le=10)] = 3
    n_units: Annotated[int, Interval(ge=1, le=100)] = 10
    n_steps: Annotated[int, Interval(ge=1, le=10_000)] = 200
    periodic: bool = False
    substeps: Annotated[int, Interval(ge=1, le=MOST_SUBSTEPS)] | None = None

    def find(self, data: TrainingData, tracker: Tracker) -> Block:
        step = data.timed()
        linear = linear_oscillator(data, self.channels(data))
        warm = settling_samples(linear, data) if self.periodic else None
        merged = averaged(data) if self.periodic else data
        turned = step / linear.time_constants[0]
        fewest = int(np.clip(np.ceil(turned / ANGLE), 1, MOST_SUBSTEPS))
        template = self.start(linear, merged, self.substeps or fewest)
        search = NetworkErrors(template, merged, warm)
        tracker.budget = self.n_steps
        (_, squares), *_ = trust_region(
            tracker.watched(search.errors),
            template.pack(),
            scale=np.ones(template.n_parameters),
            least_gain=LEAST_GAIN,
            max_evaluations=self.n_steps,
        )
        if not np.isfinite(squares):
            raise DataError(
                "no start runs stably under this force",
                channel=data.inputs[0].name,
                remedy="choose another seed, or record at a higher rate",
            )
        return template.unpack(tracker.found)

    def start(self, linear: ProcessModel, data: TrainingData, substeps: int) -> StateNetwork:
        """Return the initial network of the descent."""
        rng, n, units = np.random.default_rng(self.seed), self.n_states, self.n_units
        force, moved = data.stacked("driven")[:, 0], data.target
        sizes = float(np.std(force)), float(np.std(moved))
        channels: dict[str, Any] = self.channels(data)
        own = np.zeros((n, n + 2))
        own[0, 1] = 1.0
        own[1, : n + 1] = -SPRING if n > 2 else -1.0
        own[1, 1], own[1, n] = -DAMPING, sizes[0] * linear.gain / sizes[1]
        for place in range(2, n):
            own[1, place] /= n - 2
            own[place, [1, place]] = 1.0, -LAG * (place - 1)
        hidden = UNIT * rng.normal(size=(units, n + 2))
        hidden[:, n] *= FORCED / UNIT
        return StateNetwork(
            linear=rows(own),
            hidden=rows(hidden),
            readout=rows(READ * rng.normal(size=(n, units))),
            rate=1.0 / linear.time_constants[0],
            input_offset=float(np.mean(force)) if self.periodic else 0.0,
            input_scale=sizes[0],
            output_offset=float(np.mean(moved)) if self.periodic else 0.0,
            output_scale=sizes[1],
            substeps=substeps,
            initial=self.starting_rule,
            **channels,
        )


class NetworkErrors:
    """Errors of networks of one structure on all runs, and their derivatives, computed with them.

    ``warm`` is the number of samples before those of a period, None where runs are not periodic: these
    begin as after their first input has long been held, unless the template's start is virgin.
    """

    def __init__(self, template: StateNetwork, data: TrainingData, warm: int | None) -> None:
        self.template, self.target = template, data.target
        self.at_rest = warm is None and template.initial == "first_sample"
        self.rate = template.rate * data.timed()
        self.paths = paths(data, template.substeps, warm, self.at_rest)

    def errors(self, theta: Array) -> tuple[Array, Callable[[], Array]]:
        """Return the errors at scored samples, infinite for diverging runs, and a function to slopes."""
        found = self._followed(theta)
        return np.asarray(found[:, 0] - self.target), lambda: found[:, 1:]

    def _followed(self, theta: Array) -> Array:
        """Return the outputs at scored samples, and derivatives by the p weights, (n, 1 + p)."""
        model, columns = self.template, 1 + theta.size
        n, units = len(model.linear), len(model.hidden)
        parts: Any = np.split(theta, np.cumsum([n * (n + 2), units * (n + 2)]))
        sizes = zip(parts, (n, units, n), strict=True)
        linear, hidden, readout = (part.reshape(k, -1) for part, k in sizes)
        found = []
        for path in self.paths:
            given = np.empty((len(path.run), columns))
            h, u = self.rate / path.every, (path.inputs - model.input_offset) / model.input_scale
            state = np.zeros((n, columns))
            if self.at_rest:
                held, last = np.full(1 + SETTLING, u[0]), np.empty((1, columns))
                settle = SETTLING_STEP, state, held, SETTLING, 0, last
                follow_network(linear, hidden, readout, *settle)
            along = h, state, u, path.every, path.skipped, given
            ended = follow_network(linear, hidden, readout, *along)
            if not ended or not np.isfinite(given).all():
                return np.full((self.target.size, columns), np.inf)
            found.append(model.output_scale * given[path.run.counts])
        together = np.concatenate(found)
        together[:, 0] += model.output_offset
        return together


@summing_kernel
def rates(
    linear: Array, hidden: Array, readout: Array, x: Array, known: Array, act: Array, found: Array
) -> None:
    """Fill in x', in units of the rate, and its derivatives by the weights.

    Parameters
    ----------
    linear, hidden, readout : arrays, shapes (n, n + 2), (units, n + 2) and (n, units)
    x : array, shape (n, 1 + p)
        States, and their derivatives by the weights, row by row; p may be 0.
    known : array, shape (n + 2,)
        States, the input and 1; the states are filled in here.
    act : array, shape (units,)
        Scratch.
    found : array, shape (n, 1 + p)
    """
    n, width = linear.shape
    units, p = hidden.shape[0], x.shape[1] - 1
    for d in range(n):
        known[d] = x[d, 0]
    for j in range(units):
        s = 0.0
        for e in range(width):
            s += hidden[j, e] * known[e]
        act[j] = np.tanh(s)
    for d in range(n):
        own = found[d]
        for i in range(1 + p):
            own[i] = 0.0
        for e in range(width):
            own[0] += linear[d, e] * known[e]
        for j in range(units):
            own[0] += readout[d, j] * act[j]
        if p == 0:
            continue
        for e in range(n):
            share = linear[d, e]
            for j in range(units):
                share += readout[d, j] * (1.0 - act[j] * act[j]) * hidden[j, e]
            for i in range(1, 1 + p):
                own[i] += share * x[e, i]
        for e in range(width):
            own[1 + d * width + e] += known[e]
        for j in range(units):
            share = readout[d, j] * (1.0 - act[j] * act[j])
            for e in range(width):
                own[1 + (n + j) * width + e] += share * known[e]
            own[1 + (n + units) * width + d * units + j] += act[j]


@summing_kernel
def follow_network(
    linear: Array,
    hidden: Array,
    readout: Array,
    h: float,
    state: Array,
    inputs: Array,
    every: int,
    skipped: int,
    found: Array,
) -> bool:
    """Simulate a network with linearly interpolated inputs, one Runge-Kutta step per sample.

    Parameters
    ----------
    linear, hidden, readout : arrays
        As of `rates`.
    h : float
        Step by rate.
    state : array, shape (n, 1 + p)
        At the first input, with its derivatives by the weights; changed.
    inputs : array, shape (1 + every * (skipped + samples),)
        Less their offset, by their scale.
    every, skipped : int
        Steps from sample to sample, and samples before the first that is wanted.
    found : array, shape (samples, 1 + p)
        Filled with the first state at every sample, and its derivatives.

    Returns
    -------
    bool
        Whether it came to the end: a state that leaves all bounds ends it.
    """
    n, columns = state.shape
    at, rate, total = state.copy(), np.zeros((n, columns)), np.zeros((n, columns))
    known, act = np.ones(linear.shape[1]), np.zeros(hidden.shape[0])
    for t in range(inputs.size - 1):
        rise = inputs[t + 1] - inputs[t]
        for way, weight, ahead in RUNGE_KUTTA:
            known[n] = inputs[t] + way * rise
            rates(linear, hidden, readout, at, known, act, rate)
            for d in range(n):
                for i in range(columns):
                    total[d, i] += weight * rate[d, i]
                    at[d, i] = state[d, i] + ahead * h * rate[d, i]
        for d in range(n):
            for i in range(columns):
                state[d, i] += h / 6.0 * total[d, i]
                at[d, i], total[d, i] = state[d, i], 0.0
            if not abs(state[d, 0]) < LARGEST:
                return False
        k = (t + 1) // every - skipped - 1
        if (t + 1) % every == 0 and k >= 0:
            found[k] = state[0]
    return True
