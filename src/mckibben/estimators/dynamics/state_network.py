"""Identification of state-space networks: Gauss-Newton on free runs, from a linear model.

States begin as lags of the inputs, with the time constants whose best combination is nearest to the
outputs, or, of one input and one output, as the linear oscillator nearest to them
(`mckibben.estimators.dynamics.network_starts`); units begin at random, with small output weights. After
a few steps from every start, the best is continued, until the free-run error on held-back data has not
fallen for long. What the states become is left to the descent, whose derivatives are exact
(`mckibben.estimators.dynamics.network_kernel`); but the linear part alone decays, so that states are
bounded under any inputs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar

import numpy as np
from annotated_types import Interval

from mckibben.arrays import Array, Mask
from mckibben.blocks.base import Block
from mckibben.blocks.dynamics.state_network import BETWEEN, StateNetwork
from mckibben.blocks.fields import rows, vector
from mckibben.blocks.runs import Run
from mckibben.errors import DataError
from mckibben.estimators.core.data import TrainingData
from mckibben.estimators.core.estimator import Purpose, Start
from mckibben.estimators.coupled.base import CoupledEstimator
from mckibben.estimators.dynamics.network_kernel import layer, simulate_network
from mckibben.estimators.dynamics.network_starts import of_lags, of_oscillator
from mckibben.numerics.descent import trust_region
from mckibben.numerics.tracker import Tracker
from mckibben.signals.periodic import band_limited

HIDDEN_SCALE, READOUT_SCALE = 0.7, 0.01
"""Scales of random initial weights: of units by states, and of the output layer."""

MOST_WORK = 6e11
"""Largest number of multiplications in a descent: about a minute."""

FIRST_STEPS = 12
"""Steps from every start before the best is continued."""

PATIENCE = 25
"""Steps after the least error on held-back data before the descent ends."""

HELD_BACK = 4
"""One of so many recordings is held back; of fewer recordings, this part of each, its last."""

LEAST_GAIN = 1e-7
"""Smallest relative reduction of the squared error for another step."""

MOST_ERRORS = 8192
"""Largest number of errors in the descent, at evenly spread samples."""

RIDGE = 1e-8
"""Penalty of moving weights away from their start: the share of the variance of the outputs that
moving each by 1 costs.
"""

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
    inputs : array, shape (1 + substeps * (skipped + samples), m)
    substeps, skipped : int
        Substeps per sample, and samples before the first of the run.
    """

    run: Run
    inputs: Array
    substeps: int
    skipped: int


def path_of(run: Run, template: StateNetwork, warm: int) -> Path:
    """Return the inputs of a run in substeps.

    A periodic run is band-limited between samples, and comes after ``warm`` samples of its own; the
    inputs of others go in straight lines, from the first on, or from 0 of a virgin start.
    """
    inputs, n, substeps = run.inputs, len(run), template.substeps
    if not run.source.periodic:
        before = inputs[:1] if template.initial == "first_sample" else np.zeros_like(inputs[:1])
        samples, steps = np.vstack([before, inputs]), np.arange(1 + substeps * n) / substeps
        columns = [np.interp(steps, np.arange(n + 1), column) for column in samples.T]
        return Path(run, np.column_stack(columns), substeps, 0)
    ratio = BETWEEN * substeps
    substep = np.arange(-(warm + 1) * ratio, (n - 1) * ratio + 1) % (n * ratio)
    columns = [band_limited(column, ratio)[substep] for column in inputs.T]
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
    masks = []
    by_run = len(data.runs) >= HELD_BACK
    for number, run in enumerate(data.runs):
        mask = np.zeros(len(run), dtype=bool)
        if run.source.periodic:
            pass
        elif by_run:
            mask |= run.counts & (number % HELD_BACK == HELD_BACK - 1)
        else:
            counting = np.flatnonzero(run.counts)
            mask[counting[len(counting) - len(counting) // HELD_BACK :]] = True
        masks.append(mask)
    return masks


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
        Of the descent; the best after a few steps is continued.
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
        masks = held_back(merged)
        searches = [
            NetworkErrors(template, merged, masks, warm) for template, warm in self.starts(merged)
        ]
        few = FIRST_STEPS if len(searches) > 1 else 0
        tracker.budget = len(searches) * few + self.n_steps
        descents = [descend(search, search.origin, few, tracker) for search in searches]
        best = int(np.argmin([error for _, error in descents]))
        return self._finish(searches[best], descents[best][0], tracker)

    def find_again(self, data: TrainingData, tracker: Tracker) -> Block:
        """Return the network once more, from the weights found before."""
        model = self.fitted
        assert isinstance(model, StateNetwork)
        search = NetworkErrors(model, data, held_back(data), 0)
        return self._finish(search, search.origin, tracker)

    def _finish(self, search: NetworkErrors, start: Array, tracker: Tracker) -> Block:
        """Return the network at the end of a descent."""
        steps = min(self.n_steps, max(int(MOST_WORK / search.work), FIRST_STEPS))
        weights, error = descend(search, start, steps, tracker)
        if not np.isfinite(error):
            raise DataError(
                "no start runs stably under these inputs",
                channel=search.template.driven[0].name,
                remedy="choose another seed, or record at a higher rate",
            )
        return search.template.unpack(weights)

    def starts(self, data: TrainingData) -> Iterator[tuple[StateNetwork, int]]:
        """Yield the initial networks of the descent, each with samples to run before a period."""
        rng = np.random.default_rng(self.seed)
        n = self.n_states or 1 + 2 * max(len(data.inputs), len(data.outputs))
        linear = [of_lags(data, n)]
        oscillator = of_oscillator(data, n)
        if oscillator is not None:
            linear.append(oscillator)
        common = self._common(data)
        slowest_sampling = max(run.sample_time or 0.0 for run in data.runs)
        longest = max(len(run) for run in data.runs)
        for number in range(self.n_starts):
            block = linear[-1 - number % len(linear)]  # alternate, oscillator first
            hidden = HIDDEN_SCALE * rng.normal(size=(self.n_units, block.weights.shape[1]))
            hidden[:, n:-1] *= block.forced
            fewest = np.ceil(block.rate * slowest_sampling / block.largest_substep)
            template = StateNetwork(
                linear=rows(block.weights),
                hidden=rows(hidden),
                readout=rows(READOUT_SCALE * rng.normal(size=(len(block.weights), self.n_units))),
                rate=block.rate,
                substeps=self.substeps or int(np.clip(fewest, 1, MOST_SUBSTEPS)),
                **common,
            )
            slowest = FORGOTTEN / max(block.decay * (data.runs[0].sample_time or 1.0), 1e-9)
            yield template, int(min(np.ceil(slowest), MOST_PERIODS * longest))

    def _common(self, data: TrainingData) -> dict[str, Any]:
        """Return what all initial networks have in common: scaling, channels and start."""
        inputs, outputs = data.stacked("inputs"), data.target.reshape(-1, len(data.outputs))
        scale = inputs.std(axis=0)
        return {
            "input_offset": vector(inputs.mean(axis=0)),
            "input_scale": vector(np.where(scale > 0, scale, 1.0)),
            "output_offset": vector(outputs.mean(axis=0)),
            "output_scale": vector(data.spread),
            "driven": data.inputs,
            "scheduled": data.scheduled,
            "given": data.outputs,
            "initial": self.starting_rule,
        }


class NoImprovementError(Exception):
    """Ends a descent whose error on held-back data has not fallen for long."""


class EarlyStopping:
    """The best weights of a descent so far, and when to end it."""

    def __init__(self, start: Array) -> None:
        self.weights, self.error, self.steps_since = start, np.inf, 0

    def update(self, weights: Array, error: float) -> None:
        """Note the weights after a step, and their error.

        Raises
        ------
        NoImprovementError
            If the last `PATIENCE` steps did not reduce the error.
        """
        if error < self.error:
            self.weights, self.error, self.steps_since = weights, error, 0
            return
        self.steps_since += 1
        if self.steps_since >= PATIENCE:
            raise NoImprovementError


def descend(
    search: NetworkErrors, start: Array, steps: int, tracker: Tracker
) -> tuple[Array, float]:
    """Return the weights of least error on held-back data along a descent, and that error.

    Without held-back data, the error on all data counts; without steps, the start and 0 are returned.
    """
    if not steps:
        return start, 0.0
    best = EarlyStopping(start)
    watched = tracker.watched(search.errors)

    def errors(theta: Array) -> tuple[Array, Callable[[], Array]]:
        residuals, slopes = watched(theta)

        def slopes_after_step() -> Array:  # `trust_region` needs slopes only after steps it takes
            fitted_error = float(np.sqrt(np.mean(residuals**2)))
            best.update(theta, search.held_error(theta) if search.holds else fitted_error)
            return slopes()

        return residuals, slopes_after_step

    with suppress(NoImprovementError):
        trust_region(
            errors, start, scale=np.ones(start.size), least_gain=LEAST_GAIN, max_evaluations=steps
        )
    return best.weights, best.error


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
        self.held, self.holds = list(held), any(mask.any() for mask in held)
        fitted = [run.counts & ~mask for run, mask in zip(data.runs, held, strict=True)]
        self.fitted = _thinned(fitted, len(data.outputs))
        steps = [(path.run.sample_time or 0.0) / path.substeps for path in self.paths]
        self.longest = template.rate * max(steps)
        self.scales = np.array(template.output_scale)
        self.offsets = np.array(template.output_offset)
        self.size = sum(int(mask.sum()) for mask in self.fitted) * len(data.outputs)

    def errors(self, theta: Array) -> tuple[Array, Callable[[], Array]]:
        """Return the scaled errors at fitted samples, infinite for diverging runs, and their slopes.

        These are computed with them, as most steps of a descent are taken.
        """
        ridge = np.sqrt(RIDGE * self.size)
        if not self.bounded(theta):
            unbounded = np.full(self.size + theta.size, np.inf)
            return unbounded, lambda: np.zeros((unbounded.size, theta.size))
        table = self._errors_at(theta, self.fitted, sloped=True)
        residuals = np.append(table[:, 0], ridge * (theta - self.origin))
        return residuals, lambda: np.vstack([table[:, 1:], ridge * np.eye(theta.size)])

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
        """Return the root mean square error on held-back data, infinite for diverging runs."""
        errors = self._errors_at(theta, self.held)
        return float(np.sqrt(np.mean(errors**2))) if np.isfinite(errors).all() else np.inf

    def _errors_at(self, theta: Array, samples: Sequence[Mask], sloped: bool = False) -> Array:
        """Return scaled errors at samples, and perhaps their derivatives, shape (N, 1 or 1 + q)."""
        tables = []
        for path, mask in zip(self.paths, samples, strict=True):
            if mask.any():
                table = self._simulate(theta, path, mask, sloped)
                table[:, :, 0] -= (path.run.outputs[mask] - self.offsets) / self.scales
                tables.append(table.reshape(-1, table.shape[2]))
        return np.concatenate(tables)

    def _simulate(self, theta: Array, path: Path, wanted: Mask, sloped: bool) -> Array:
        """Return scaled outputs at the samples wanted, and their derivatives, (samples, p, 1 + q)."""
        model = self.template
        linear, hidden, readout = self._layers(theta)
        h = model.rate * (path.run.sample_time or 0.0) / path.substeps
        inputs = (path.inputs - np.array(model.input_offset)) / np.array(model.input_scale)
        state = np.zeros((model.order, 1 + theta.size if sloped else 1))
        if not path.run.source.periodic and model.initial == "first_sample":
            first = path.run.inputs[0]
            start = model.unpack(theta).initial_state(first, sample_time=h / model.rate)
            state[:, 0] = start[: model.order]
            if sloped:
                _add_slopes_at_rest(linear, hidden, readout, inputs[0], state)
        last = int(np.flatnonzero(wanted)[-1])
        inputs = inputs[: 1 + path.substeps * (path.skipped + last + 1)]
        outputs = np.empty((int(wanted.sum()), len(model.given), state.shape[1]))
        along = h, state, inputs, path.substeps, path.skipped, wanted, outputs
        if not simulate_network(linear, hidden, readout, *along):
            outputs[:] = np.inf
        return outputs

    def _layers(self, theta: Array) -> tuple[Array, Array, Array]:
        """Return the matrices of a network from all its weights: see `layer`."""
        model = self.template
        n, p, units = model.order, len(model.given), len(model.hidden)
        width = n + len(model.inputs) + 1
        linear, hidden, readout = np.split(theta, np.cumsum([(n + p) * width, units * width]))
        return (
            linear.reshape(n + p, width),
            hidden.reshape(units, width),
            readout.reshape(n + p, units),
        )


def _thinned(masks: Sequence[Mask], n_outputs: int) -> list[Mask]:
    """Return every k-th sample of those in masks, counted on from run to run.

    So that there are at most `MOST_ERRORS` errors, of so many outputs.
    """
    n_errors = sum(int(mask.sum()) for mask in masks) * n_outputs
    stride = -(-n_errors // MOST_ERRORS)
    thinned, before = [], 0
    for mask in masks:
        samples = np.flatnonzero(mask)
        mask_kept = np.zeros_like(mask)
        mask_kept[samples[(-before) % stride :: stride]] = True
        before += len(samples)
        thinned.append(mask_kept)
    return thinned


def _add_slopes_at_rest(
    linear: Array, hidden: Array, readout: Array, inputs: Array, state: Array
) -> None:
    """Fill in the derivatives of a state of equilibrium by the weights.

    By the implicit function theorem: 0 = f(x, w) gives dx/dw = -(df/dx)^-1 df/dw.
    """
    n = len(state)
    act, rates = np.zeros(len(hidden)), np.zeros_like(state)
    features = np.concatenate([state[:, 0], inputs, [1.0]])
    layer(linear, hidden, readout, 0, state, features, act, rates)
    by_state = linear[:n, :n] + (readout[:n] * (1 - act**2)) @ hidden[:, :n]
    state[:, 1:] = -np.linalg.lstsq(by_state, rates[:, 1:], rcond=None)[0]
