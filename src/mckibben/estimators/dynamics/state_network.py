"""Identification of state-space networks: Gauss-Newton on free runs, from a linear model.

States begin as lags of the inputs, with the time constants whose best combination is nearest to the
outputs, or, of one input and one output, as the linear oscillator nearest to them; units begin at
random, and next to unread. A few steps from every start show which is followed, and the free run over
what is held back shows when to stop. What the states become is left to the descent, whose derivatives
are exact; but the linear part alone decays, so that states are bounded under any inputs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Annotated, Any, ClassVar

import numpy as np
from annotated_types import Interval

from mckibben.arrays import Array, Mask
from mckibben.blocks.base import Block
from mckibben.blocks.dynamics.process_model import ProcessModel
from mckibben.blocks.dynamics.state_network import BETWEEN, StateNetwork
from mckibben.blocks.fields import rows, vector
from mckibben.blocks.kernels import summing_kernel
from mckibben.blocks.runs import Run
from mckibben.errors import DataError, MckibbenError
from mckibben.estimators.core.data import TrainingData
from mckibben.estimators.core.estimator import Purpose, Start
from mckibben.estimators.coupled.base import CoupledEstimator
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
"""Scales of random initial weights: of units by states, by the inputs of an oscillator, and of the
output layer.
"""

FASTEST_LAG, SLOWEST_LAG, N_LAGS = 0.7, 1 / 3, 9
"""Lags tried: from so many samples to such a share of the longest run, and how many."""

SHARPEST = 0.8
"""Largest substep in units of the fastest lag."""

MOST_WORK = 6e11
"""Products of numbers in a descent, which take about a minute."""

FEW = 12
"""Steps from every start before one is followed."""

PATIENCE = 25
"""Steps after the least error on what is held back before the descent ends."""

HELD_BACK = 4
"""One of so many recordings is held back; of fewer, each one's last such part."""

LEAST_GAIN = 1e-7
"""Smallest relative reduction of the squared error for another step."""

MOST_ROWS = 8192
"""Errors of the descent, evenly spread."""

RIDGE = 1e-8
"""Penalty of moving weights away from their start: the share of the variance of the outputs that
moving each by 1 costs.
"""

RUNGE_KUTTA = ((0.0, 1.0, 0.5), (0.5, 2.0, 0.5), (0.5, 2.0, 1.0), (1.0, 1.0, 0.0))
"""Runge-Kutta stages: position in the step, weight, and length of the following stage."""

LARGEST = 1e6
"""Scaled state that counts as diverged."""

FORGOTTEN = 3 * np.log(1e8)
"""Number of decay times after which a start is forgotten: three times those of a decay to 1e-8, as
small motions decay more slowly with hysteresis.
"""

MOST_SUBSTEPS = 1000
"""Largest number of Runge-Kutta steps per sample."""

MOST_PERIODS = 3
"""Limit of the samples before a period, in periods of the longest run."""


@dataclass(frozen=True)
class Path:
    """The inputs of a run in substeps.

    Parameters
    ----------
    run : Run
    inputs : array, shape (1 + every * (skipped + samples), m)
    every, skipped : int
        Substeps per sample, and samples before the first of the run.
    """

    run: Run
    inputs: Array
    every: int
    skipped: int


def path_of(run: Run, template: StateNetwork, warm: int) -> Path:
    """Return the inputs of a run in substeps.

    A periodic run is band-limited between samples, and comes after ``warm`` samples of its own; the
    inputs of others go in straight lines, from the first on, or from 0 of a virgin start.
    """
    given, n, substeps = run.inputs, len(run), template.substeps
    if not run.source.periodic:
        before = given[:1] if template.initial == "first_sample" else np.zeros_like(given[:1])
        whole, steps = np.vstack([before, given]), np.arange(1 + substeps * n) / substeps
        columns = [np.interp(steps, np.arange(n + 1), column) for column in whole.T]
        return Path(run, np.column_stack(columns), substeps, 0)
    ratio = BETWEEN * substeps
    places = np.arange(-(warm + 1) * ratio, (n - 1) * ratio + 1) % (n * ratio)
    columns = [band_limited(column, ratio)[places] for column in given.T]
    return Path(run, np.column_stack(columns), ratio, warm)


def averaged(data: TrainingData) -> TrainingData:
    """Return periodic runs of the same inputs as one, with the mean outputs; other runs unchanged.

    What runs free is the same in all, so their squared errors are that of the mean, but for a constant.
    """
    first = data.runs[0]
    alike = (
        run.source.periodic and run.counts.all() and np.array_equal(run.inputs, first.inputs)
        for run in data.runs
    )
    if not all(alike):
        return data
    mean = np.mean([run.outputs for run in data.runs], axis=0)
    return replace(data, runs=(replace(first, outputs=mean),))


def held_back(data: TrainingData) -> list[Mask]:
    """Return the samples of every run that are held back, of those that count.

    Every fourth run, or the last quarter of each of fewer; nothing of periodic ones, whose parts have
    the same inputs.
    """
    found = []
    whole = len(data.runs) >= HELD_BACK
    for place, run in enumerate(data.runs):
        held = np.zeros(len(run), dtype=bool)
        if run.source.periodic:
            pass
        elif whole:
            held |= run.counts & (place % HELD_BACK == HELD_BACK - 1)
        else:
            counting = np.flatnonzero(run.counts)
            held[counting[len(counting) - len(counting) // HELD_BACK :]] = True
        found.append(held)
    return found


class StateNetworkEstimator(CoupledEstimator):
    """State-space network by Gauss-Newton on free runs, with a given number of states.

    A recording that is one whole period of a motion (``meta["periodic"]``) is fitted in its steady
    state, with inputs that are band-limited between samples. Others begin at rest, and their inputs are
    linear between samples; of these a quarter is held back, and shows when to stop.

    Parameters
    ----------
    n_states : int, optional
        Of the model. Default: one, and two for every output or every driven input, whichever are more.
    n_units : int
        Of the model.
    n_starts : int
        Of the descent; the best after a few steps is followed.
    n_steps : int
        Most steps of the descent.
    substeps : int, optional
        Runge-Kutta steps from sample to sample. Default: enough for the linear model.
    initial : {"first_sample", "virgin"}
        Memory before the first sample of recordings that are not periodic.
    """

    title = "State-space network"
    purpose: ClassVar[Purpose | None] = "rate"
    can = (
        "Nonlinear dynamics with memory of any kind, of any inputs and outputs; only the number of"
        " states is set."
    )
    cannot = "Slow to fit; no inverse; arbitrary beyond the data."
    caution = "a network without physics is arbitrary beyond them"
    needs_time = True
    alone = True
    through = True
    paired = False
    held_too = True
    long = True
    effort = 20.0

    n_states: Annotated[int, Interval(ge=1, le=20)] | None = None
    n_units: Annotated[int, Interval(ge=1, le=100)] = 10
    n_starts: Annotated[int, Interval(ge=1, le=100)] = 4
    n_steps: Annotated[int, Interval(ge=1, le=10_000)] = 400
    substeps: Annotated[int, Interval(ge=1, le=MOST_SUBSTEPS)] | None = None
    initial: Start = "first_sample"

    def find(self, data: TrainingData, tracker: Tracker) -> Block:
        merged = averaged(data)
        held = held_back(merged)
        searches = [
            NetworkErrors(template, merged, held, warm) for template, warm in self.starts(merged)
        ]
        few = FEW if len(searches) > 1 else 0
        tracker.budget = len(searches) * few + self.n_steps
        first = [followed(search, search.origin, few, tracker) for search in searches]
        best = int(np.argmin([error for _, error in first]))
        return self._followed(searches[best], first[best][0], tracker)

    def find_again(self, data: TrainingData, tracker: Tracker) -> Block:
        """Return the network once more, from the weights found before."""
        model = self.fitted
        assert isinstance(model, StateNetwork)
        search = NetworkErrors(model, data, held_back(data), 0)
        return self._followed(search, search.origin, tracker)

    def _followed(self, search: NetworkErrors, start: Array, tracker: Tracker) -> Block:
        steps = min(self.n_steps, max(int(MOST_WORK / search.work), FEW))
        found, error = followed(search, start, steps, tracker)
        if not np.isfinite(error):
            raise DataError(
                "no start runs stably under these inputs",
                channel=search.template.driven[0].name,
                remedy="choose another seed, or record at a higher rate",
            )
        return search.template.unpack(found)

    def starts(self, data: TrainingData) -> Iterator[tuple[StateNetwork, int]]:
        """Yield the initial networks of the descent, each with samples to run before a period."""
        rng = np.random.default_rng(self.seed)
        n = self.n_states or 1 + 2 * max(len(data.inputs), len(data.outputs))
        linear = [of_lags(data, n)]
        oscillator = of_oscillator(data, n)
        if oscillator is not None:
            linear.append(oscillator)
        inputs, outputs = data.stacked("inputs"), data.target.reshape(-1, len(data.outputs))
        scale = inputs.std(axis=0)
        common: dict[str, Any] = {
            "input_offset": vector(inputs.mean(axis=0)),
            "input_scale": vector(np.where(scale > 0, scale, 1.0)),
            "output_offset": vector(outputs.mean(axis=0)),
            "output_scale": vector(data.spread),
            "driven": data.inputs,
            "scheduled": data.scheduled,
            "given": data.outputs,
            "initial": self.starting_rule,
        }
        longest = max(len(run) for run in data.runs)
        for place in range(self.n_starts):
            own = linear[-1 - place % len(linear)]
            hidden = UNIT * rng.normal(size=(self.n_units, own.weights.shape[1]))
            hidden[:, n:-1] *= own.forced
            turned = own.rate * max(run.sample_time or 0.0 for run in data.runs)
            fewest = int(np.clip(np.ceil(turned / own.sharpest), 1, MOST_SUBSTEPS))
            template = StateNetwork(
                linear=rows(own.weights),
                hidden=rows(hidden),
                readout=rows(READ * rng.normal(size=(len(own.weights), self.n_units))),
                rate=own.rate,
                substeps=self.substeps or fewest,
                **common,
            )
            slowest = FORGOTTEN / max(own.decay * (data.runs[0].sample_time or 1.0), 1e-9)
            yield template, int(min(np.ceil(slowest), MOST_PERIODS * longest))


@dataclass(frozen=True)
class LinearStart:
    """A linear model to begin from, in scaled inputs and outputs.

    Parameters
    ----------
    weights : array, shape (n + p, n + m + 1)
    rate, decay : float
        Of time, and of the slowest motion [1/s].
    sharpest : float
        Largest substep in units of 1 / rate.
    forced : float
        Scale of the initial weights of units by inputs, beside those by states.
    """

    weights: Array
    rate: float
    decay: float
    sharpest: float
    forced: float


def of_lags(data: TrainingData, n: int) -> LinearStart:
    """Return n lags of the inputs with the time constants that are nearest to the outputs."""
    from scipy.signal import lfilter

    step = data.timed()
    inputs, target = data.stacked("inputs"), data.target.reshape(-1, len(data.outputs))
    middle, spread = inputs.mean(axis=0), inputs.std(axis=0)
    spread[spread == 0] = 1.0
    target = (target - target.mean(axis=0)) / data.spread
    m, longest = inputs.shape[1], max(len(run) for run in data.runs)
    lags = step * np.geomspace(FASTEST_LAG, max(SLOWEST_LAG * longest, 2 * FASTEST_LAG), N_LAGS)

    def features(run: Run) -> Array:
        u = (run.inputs - middle) / spread
        ticks = run.sample_time or step
        lagged = []
        for lag in lags:
            a = np.exp(-ticks / lag)
            lagged.append(lfilter([1 - a], [1, -a], u, axis=0, zi=a * u[:1])[0])
        return np.hstack([*lagged, u, np.ones((len(u), 1))])

    columns = data.scored(features)
    k = -(-n // m)
    best: tuple[float, list[int], Array] | None = None
    for chosen in combinations(range(N_LAGS), min(k, N_LAGS)):
        places = [lag * m + j for lag in chosen for j in range(m)][:n]
        some = np.hstack([columns[:, places], columns[:, N_LAGS * m :]])
        gram = some.T @ some
        gram[np.diag_indices_from(gram)] *= 1 + 1e-6
        readout = np.linalg.lstsq(gram, some.T @ target, rcond=1e-12)[0]
        error = float(np.sum((target - some @ readout) ** 2))
        if best is None or error < best[0]:
            best = error, places, readout.T
    assert best is not None
    _, places, readout = best
    rates = 1.0 / lags[np.array(places) // m]
    rate = float(rates.max())
    own = np.zeros((n, n + m + 1))
    own[range(n), range(n)] = -rates / rate
    own[range(n), n + np.array(places) % m] = rates / rate
    return LinearStart(np.vstack([own, readout]), rate, float(rates.min()), SHARPEST, 1.0)


def of_oscillator(data: TrainingData, n: int) -> LinearStart | None:
    """Return the linear oscillator nearest to one output of one input, with lags of its velocity.

    None where there are more of either, or nothing oscillates.
    """
    if len(data.inputs) != 1 or len(data.outputs) != 1 or data.scheduled or n < 2:
        return None
    estimator = ProcessModelEstimator(
        structure="P2U", input=data.inputs[0].name, output=data.outputs[0].name, n_refined=1
    )
    try:
        model = estimator.find(data, Tracker())
    except MckibbenError:
        return None
    assert isinstance(model, ProcessModel)
    damping = model.damping or 0.0
    if damping >= 1.0:
        return None
    own = np.zeros((n + 1, n + 2))
    own[0, 1] = 1.0
    own[1, : n + 1] = -SPRING if n > 2 else -1.0
    own[1, 1] = -DAMPING
    own[1, n] = data.stacked("inputs").std() * model.gain / data.spread[0]
    for place in range(2, n):
        own[1, place] /= n - 2
        own[place, [1, place]] = 1.0, -LAG * (place - 1)
    own[n, 0] = 1.0
    frequency = 1.0 / model.time_constants[0]
    return LinearStart(own, frequency, frequency * damping, ANGLE, FORCED / UNIT)


class NoImprovementError(Exception):
    """Ends a descent whose error on what is held back has not fallen for long."""


def followed(
    search: NetworkErrors, start: Array, steps: int, tracker: Tracker
) -> tuple[Array, float]:
    """Return the weights of least error on what is held back along a descent, and that error.

    Without steps, the start and 0.
    """
    if not steps:
        return start, 0.0
    best, least, since = start, np.inf, 0
    watched = tracker.watched(search.errors)

    def errors(theta: Array) -> tuple[Array, Callable[[], Array]]:
        found, slopes = watched(theta)

        def stopping() -> Array:
            nonlocal best, least, since
            error = search.held_error(theta) if search.holds else float(np.sqrt(np.mean(found**2)))
            if error < least:
                best, least, since = theta, error, 0
            else:
                since += 1
                if since >= PATIENCE:
                    raise NoImprovementError
            return slopes()

        return found, stopping

    with suppress(NoImprovementError):
        trust_region(
            errors, start, scale=np.ones(start.size), least_gain=LEAST_GAIN, max_evaluations=steps
        )
    return best, least


class NetworkErrors:
    """Errors of networks of one structure, and their derivatives.

    Parameters
    ----------
    template : StateNetwork
    data : TrainingData
    held : sequence of array of bool, shape (n,)
        Samples of every run that are held back.
    warm : int
        Samples to be run before those of a period.
    """

    def __init__(
        self, template: StateNetwork, data: TrainingData, held: Sequence[Mask], warm: int
    ) -> None:
        self.template, self.origin = template, template.pack()
        self.paths = [path_of(run, template, warm) for run in data.runs]
        fitted = [run.counts & ~one for run, one in zip(data.runs, held, strict=True)]
        n = sum(int(one.sum()) for one in fitted) * len(data.outputs)
        every = -(-n // MOST_ROWS)
        self.fitted, self.held = [], list(held)
        self.holds = any(one.any() for one in held)
        before = 0
        for one in fitted:
            places = np.flatnonzero(one)
            own = np.zeros_like(one)
            own[places[(-before) % every :: every]] = True
            before += len(places)
            self.fitted.append(own)
        steps = [(path.run.sample_time or 0.0) / path.every for path in self.paths]
        self.longest = template.rate * max(steps)
        self.scales = np.array(template.output_scale)
        self.offsets = np.array(template.output_offset)
        self.size = sum(int(one.sum()) for one in self.fitted) * len(data.outputs)

    def errors(self, theta: Array) -> tuple[Array, Callable[[], Array]]:
        """Return the scaled errors at fitted samples, infinite for diverging runs, and their slopes.

        These are computed with them, as most steps of a descent are taken.
        """
        ridge = np.sqrt(RIDGE * self.size)
        if not self.bounded(theta):
            unbounded = np.full(self.size + theta.size, np.inf)
            return unbounded, lambda: np.zeros((unbounded.size, theta.size))
        found = self._missed(theta, self.fitted, sloped=True)
        missed = np.append(found[:, 0], ridge * (theta - self.origin))
        return missed, lambda: np.vstack([found[:, 1:], ridge * np.eye(theta.size)])

    @property
    def work(self) -> float:
        """About how many products of numbers a step takes: in runs, and to solve for it."""
        n, q = self.template.order, self.origin.size
        in_runs = 6 * n * (n + 1) * (1 + q) * sum(len(path.inputs) for path in self.paths)
        return float(in_runs + 6 * self.size * q**2)

    def bounded(self, theta: Array) -> bool:
        """Return whether states stay bounded under any inputs: where the linear part alone decays.

        Units add no more than their weights; it decays in Runge-Kutta steps as well.
        """
        n = self.template.order
        width = n + len(self.template.inputs) + 1
        roots = np.linalg.eigvals(theta[: n * width].reshape(n, width)[:, :n])
        if not (roots.real < 0).all():
            return False
        z = self.longest * roots
        return bool((np.abs(1 + z * (1 + z / 2 * (1 + z / 3 * (1 + z / 4)))) < 1.0).all())

    def held_error(self, theta: Array) -> float:
        """Return the root mean square error on what is held back, infinite for diverging runs."""
        missed = self._missed(theta, self.held)
        return float(np.sqrt(np.mean(missed**2))) if np.isfinite(missed).all() else np.inf

    def _missed(self, theta: Array, rows: Sequence[Mask], sloped: bool = False) -> Array:
        """Return scaled errors at samples, and perhaps their derivatives, shape (N, 1 or 1 + q)."""
        tables = []
        for path, wanted in zip(self.paths, rows, strict=True):
            if wanted.any():
                found = self._followed(theta, path, wanted, sloped)
                found[:, :, 0] -= (path.run.outputs[wanted] - self.offsets) / self.scales
                tables.append(found.reshape(-1, found.shape[2]))
        return np.concatenate(tables)

    def _followed(self, theta: Array, path: Path, wanted: Mask, sloped: bool) -> Array:
        """Return scaled outputs at the samples wanted, and their derivatives, (samples, p, 1 + q)."""
        model = self.template
        n, p, units, m = model.order, len(model.given), len(model.hidden), len(model.inputs)
        width, columns = n + m + 1, 1 + theta.size if sloped else 1
        linear, hidden, readout = np.split(theta, np.cumsum([(n + p) * width, units * width]))
        linear, hidden = linear.reshape(n + p, width), hidden.reshape(units, width)
        readout = readout.reshape(n + p, units)
        h = model.rate * (path.run.sample_time or 0.0) / path.every
        inputs = (path.inputs - np.array(model.input_offset)) / np.array(model.input_scale)
        state = np.zeros((n, columns))
        if not path.run.source.periodic and model.initial == "first_sample":
            first = path.run.inputs[0]
            state[:, 0] = model.unpack(theta).initial_state(first, sample_time=h / model.rate)[:n]
            if sloped:
                act, found = np.zeros(units), np.zeros((n, columns))
                known = np.concatenate([state[:, 0], inputs[0], [1.0]])
                layer(linear, hidden, readout, 0, state, known, act, found)
                by = linear[:n, :n] + (readout[:n] * (1 - act**2)) @ hidden[:, :n]
                state[:, 1:] = -np.linalg.lstsq(by, found[:, 1:], rcond=None)[0]
        last = int(np.flatnonzero(wanted)[-1])
        inputs = inputs[: 1 + path.every * (path.skipped + last + 1)]
        outputs = np.empty((int(wanted.sum()), p, columns))
        along = h, state, inputs, path.every, path.skipped, wanted, outputs
        if not follow_network(linear, hidden, readout, *along):
            outputs[:] = np.inf
        return outputs


@summing_kernel
def layer(
    linear: Array,
    hidden: Array,
    readout: Array,
    first: int,
    x: Array,
    known: Array,
    act: Array,
    found: Array,
) -> None:
    """Fill in rows of L v + R tanh(H v), from the first on, and their derivatives by the weights.

    Parameters
    ----------
    linear, hidden, readout : arrays, shapes (n + p, n + m + 1), (units, n + m + 1) and (n + p, units)
    first : int
    x : array, shape (n, 1 + q)
        States, and their derivatives by the weights, row by row; q may be 0.
    known : array, shape (n + m + 1,)
        v: states, inputs and 1; the states are filled in here.
    act : array, shape (units,)
        Filled with tanh(H v).
    found : array, shape (rows, 1 + q)
    """
    total, width = linear.shape
    n, units, q = x.shape[0], hidden.shape[0], x.shape[1] - 1
    for d in range(n):
        known[d] = x[d, 0]
    for j in range(units):
        s = 0.0
        for e in range(width):
            s += hidden[j, e] * known[e]
        act[j] = np.tanh(s)
    for place in range(found.shape[0]):
        own, d = found[place], first + place
        for i in range(1 + q):
            own[i] = 0.0
        for e in range(width):
            own[0] += linear[d, e] * known[e]
        for j in range(units):
            own[0] += readout[d, j] * act[j]
        if q == 0:
            continue
        for e in range(n):
            share = linear[d, e]
            for j in range(units):
                share += readout[d, j] * (1.0 - act[j] * act[j]) * hidden[j, e]
            for i in range(1, 1 + q):
                own[i] += share * x[e, i]
        for e in range(width):
            own[1 + d * width + e] += known[e]
        for j in range(units):
            share = readout[d, j] * (1.0 - act[j] * act[j])
            for e in range(width):
                own[1 + (total + j) * width + e] += share * known[e]
            own[1 + (total + units) * width + d * units + j] += act[j]


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
    wanted: Mask,
    found: Array,
) -> bool:
    """Simulate a network with linearly interpolated inputs, one Runge-Kutta step per sample of them.

    Parameters
    ----------
    linear, hidden, readout : arrays
        As of `layer`.
    h : float
        Step by rate.
    state : array, shape (n, 1 + q)
        At the first inputs, with its derivatives by the weights; changed.
    inputs : array, shape (1 + every * (skipped + samples), m)
        Less their offsets, by their scales.
    every, skipped : int
        Steps from sample to sample, and samples before the first.
    wanted : array of bool, shape (samples,)
    found : array, shape (samples that are wanted, p, 1 + q)
        Filled with the scaled outputs, and their derivatives.

    Returns
    -------
    bool
        Whether it came to the end: a state that leaves all bounds ends it.
    """
    n, columns = state.shape
    m = inputs.shape[1]
    at, rate, total = state.copy(), np.zeros((n, columns)), np.zeros((n, columns))
    known, act, row = np.ones(linear.shape[1]), np.zeros(hidden.shape[0]), 0
    for t in range(inputs.shape[0] - 1):
        for way, weight, ahead in RUNGE_KUTTA:
            for j in range(m):
                known[n + j] = inputs[t, j] + way * (inputs[t + 1, j] - inputs[t, j])
            layer(linear, hidden, readout, 0, at, known, act, rate)
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
        if (t + 1) % every == 0 and k >= 0 and wanted[k]:
            for j in range(m):
                known[n + j] = inputs[t + 1, j]
            layer(linear, hidden, readout, n, state, known, act, found[row])
            row += 1
    return True
