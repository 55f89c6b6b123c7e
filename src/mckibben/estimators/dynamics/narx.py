"""Identification of NARX models: on one-step errors, then on free-running errors.

Terms of a polynomial are chosen by forward orthogonal least squares, one by one by how much of the
output they explain; the hidden layer of a network is searched by variable projection. Both are then
refined over ever longer free runs, and a model that leaves all bounds is refused.

A free run feeds on its own outputs, so a parameter acts twice: y_t = f(y_{t-1}, ..., x_t; theta) gives
dy_t/dtheta = df/dtheta + sum_k df/dy_{t-k} dy_{t-k}/dtheta. What else f looks at, past inputs and play
operators, depends on no parameter, and is prepared once.

Source: Chen, Billings and Luo, "Orthogonal least squares methods and their application to non-linear
system identification", 1989 (error reduction ratio).
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, partial
from itertools import combinations_with_replacement, islice, pairwise
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from annotated_types import Interval

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.derivatives import relative_sizes
from mckibben.blocks.dynamics.narx import Narx, NarxNetwork, NarxPolynomial, products
from mckibben.blocks.fields import vector
from mckibben.blocks.kernels import kernel
from mckibben.blocks.runs import Run
from mckibben.errors import DataError, ModelError, ModelWarning
from mckibben.estimators.core.data import TrainingData
from mckibben.estimators.core.estimator import Grid, SearchEstimator
from mckibben.estimators.hysteresis.pi import play_operators
from mckibben.numerics.descent import trust_region
from mckibben.numerics.statistics import rms
from mckibben.numerics.tracker import Tracker

BOUND = 1.0
"""Largest distance of a stable model's output from the data's range, relative to the range."""

HORIZONS = (20, 200)
"""Prediction horizons whose errors are minimised before free runs [samples]."""

MOST_REFINED = 2
"""Number of models refined on free runs."""

LEAST_GAIN = 1e-6
"""Smallest relative reduction of the squared error for another step."""

HORIZON_SAMPLES, SELECTION_SAMPLES, LAYER_SAMPLES = 4000, 5000, 3000
"""Largest number of samples used over short horizons, to select terms, and to fit a hidden layer.
"""

LAYER_EVALUATIONS, DAMPING = 15, 1e-4
"""Maximum number of evaluations for a hidden layer, and ridge of its output weights."""

MOST_ERROR, MOST_SLOPE = 10.0, 1e6
"""Bounds to which errors and their derivatives are clipped, relative to half the output's range."""

HOLD = 1000
"""Number of samples with constant inputs in the stability check."""

MOST_CANDIDATES = 2000
"""Maximum number of candidate products of regressors."""

DEPENDENT = 1e-10
"""Share of a term that must remain after projection on the chosen ones."""


class NarxEstimator(SearchEstimator):
    """NARX model: one-step least squares, then free-run refinement.

    Parameters
    ----------
    mapping : {"polynomial", "network"}
        From regressors to the next output.
    output_lags, input_lags : int
        Past outputs, and inputs from `delay` samples ago on.
    delay : int
        Samples.
    n_play : int
        Play operators among the regressors; without, the model forgets its branch in a hold.
    refine : bool
        Whether parameters found on one-step errors are refined on free-running ones.
    max_evaluations : int
        Of the refinement.
    allow_unstable : bool
        Whether a model that leaves all bounds is returned, with a warning, where no other is found.
    degree : int
        Of a polynomial's products of regressors.
    n_terms : int
        Most terms of a polynomial; half and a quarter of them are tried too, and the best free run kept.
    n_units : int
        Units of a network's hidden layer.
    n_starts : int
        Random hidden layers tried.
    """

    title = "Polynomial NARX model"
    purpose = "rate"
    can = (
        "Nonlinear dynamics by a polynomial of past inputs and outputs; terms chosen by "
        "orthogonal least squares."
    )
    cannot = "Memory limited to its lags; no inverse."
    caution = "a polynomial of past values is unbounded beyond them"
    param_grid: ClassVar[Grid] = {"output_lags": (1, 2), "input_lags": (1, 2), "n_terms": (8, 16)}
    needs_time = True
    effort = 0.6

    mapping: Literal["polynomial", "network"] = "polynomial"
    output_lags: Annotated[int, Interval(ge=1, le=20)] = 2
    input_lags: Annotated[int, Interval(ge=1, le=20)] = 2
    delay: Annotated[int, Interval(ge=0, le=50)] = 0
    n_play: Annotated[int, Interval(ge=0, le=20)] = 0
    refine: bool = True
    max_evaluations: Annotated[int, Interval(ge=1, le=10_000)] = 20
    allow_unstable: bool = False
    degree: Annotated[int, Interval(ge=1, le=6)] = 3
    n_terms: Annotated[int, Interval(ge=1, le=200)] = 16
    n_units: Annotated[int, Interval(ge=1, le=100)] = 5
    n_starts: Annotated[int, Interval(ge=1, le=100)] = 3

    def find(self, data: TrainingData, tracker: Tracker) -> Block:
        """Return the best bounded model."""
        identify = self._polynomials if self.mapping == "polynomial" else self._networks
        error = cache(partial(free_run_rmse, data=data))
        paths: list[list[Narx]] = []
        for model in identify(self._fields(data), data):
            if data.target.size <= model.n_parameters:
                raise DataError(
                    f"{data.target.size} samples are too few for {model.n_parameters} parameters",
                    remedy="give longer recordings, or use fewer lags, terms or units",
                )
            paths.append(path := [model])
            for horizon in HORIZONS if self.refine else ():
                path += self._refined(path[-1], horizon, data, tracker)[-1:]
        paths.sort(key=lambda path: error(path[-1]))
        candidates: list[Narx] = []
        for path in paths:
            if self.refine and len(candidates) < MOST_REFINED:
                path += self._refined(path[-1], None, data, tracker)[1:]
            candidates += islice((m for m in sorted(path, key=error) if stable(m, data)), 1)
        if not candidates and self.allow_unstable:
            candidates = [model for path in paths for model in path]
            warnings.warn(
                "the NARX model diverges for constant or continued input: do not simulate it",
                ModelWarning,
                stacklevel=4,
            )
        if not candidates:
            raise ModelError(
                "every NARX model found diverges in a free run",
                remedy="use fewer terms or units, `settings[n_play]=3`, or "
                "`settings[allow_unstable]=true` to return it anyway",
            )
        best = min(candidates, key=error)
        tracker.best_cost = error(best)
        return best

    def _fields(self, data: TrainingData) -> dict[str, Any]:
        """Return the common fields of all candidate models; the scales map the data to -1 to 1."""
        return {
            "output_lags": self.output_lags,
            "input_lags": self.input_lags,
            "delay": self.delay,
            "thresholds": vector(np.arange(1, self.n_play + 1) / (self.n_play + 1)),
            "input_scale": (0.5 * sum(data.input_range), 0.5 * data.input_span),
            "output_scale": (0.5 * sum(data.output_range), 0.5 * data.output_span),
            "sample_time": data.sample_time,
            "initial": self.starting_rule,
            **self.channels(data),
        }

    def _polynomials(self, fields: Mapping[str, Any], data: TrainingData) -> list[Narx]:
        """Return polynomials of the most significant terms: the maximum number, half, and a quarter."""
        x, y = one_step_pairs(fields, data, SELECTION_SAMPLES)
        terms = tuple(
            term
            for order in range(self.degree + 1)
            for term in combinations_with_replacement(range(x.shape[1]), order)
        )
        if len(terms) > MOST_CANDIDATES:
            raise ModelError(
                f"{len(terms)} products of {x.shape[1]} regressors are too many to choose from",
                remedy="use a lower degree, or fewer lags",
            )
        columns = products(x, terms)
        order = select(columns, y, self.n_terms)
        models: list[Narx] = []
        for size in sorted({max(len(order) // part, 1) for part in (1, 2, 4)}, reverse=True):
            weights = np.linalg.lstsq(columns[:, order[:size]], y, rcond=1e-12)[0]
            selection = tuple(terms[index] for index in order[:size])
            models.append(NarxPolynomial(terms=selection, weights=vector(weights), **fields))
        return models

    def _networks(self, fields: Mapping[str, Any], data: TrainingData) -> list[Narx]:
        """Return networks fitted to one-step errors by variable projection, one per start."""
        x, y = one_step_pairs(fields, data, LAYER_SAMPLES)
        layers = HiddenLayers(x, y, fields, self.n_units)
        rng = np.random.default_rng(self.seed)
        models: list[Narx] = []
        for _ in range(self.n_starts):
            first = rng.normal(0.0, 1.0, self.n_units * (x.shape[1] + 1))
            *_, (layer, _) = trust_region(
                layers.errors,
                first,
                scale=np.ones(first.size),
                least_gain=LEAST_GAIN,
                max_evaluations=LAYER_EVALUATIONS,
            )
            models.append(layers.solved(layer, layers.columns(layer))[0])
        return models

    def _refined(
        self, model: Narx, horizon: int | None, data: TrainingData, tracker: Tracker
    ) -> list[Narx]:
        """Return models refined over a horizon, or over whole runs.

        A model that is unstable when it runs free has no slope to follow there; over short horizons,
        each started from what was measured, it has.
        """
        pieces, start = stretches(model, data, horizon), model.pack()
        # the samples before a stretch may be measured nowhere, or seldom
        if sum(int(piece.run.counts.sum()) for piece in pieces) < start.size:
            return []
        stretch_errors = StretchErrors(model, pieces)
        path = trust_region(
            tracker.watched(stretch_errors.errors, model.output_scale[1]),
            start,
            scale=relative_sizes(start),
            least_gain=LEAST_GAIN,
            max_evaluations=self.max_evaluations,
        )
        return [model.unpack(parameters) for parameters, _ in path]


class NarxNetworkEstimator(NarxEstimator):
    """NARX model with one hidden layer: linear part first, units on top, then free-run refinement."""

    title = "NARX network"
    can = "Nonlinear dynamics by one hidden layer."
    cannot = "Slow to fit; no inverse; arbitrary beyond the data."
    caution = "a network without physics is arbitrary beyond them"
    param_grid: ClassVar[Grid] = {"output_lags": (1, 2), "n_units": (3, 5)}
    effort = 2.0
    mapping = "network"


class NarxPlayEstimator(NarxEstimator):
    """Polynomial NARX model with play operators among its regressors."""

    title = "Polynomial NARX model with play operators"
    can = (
        "Polynomial dynamics with play operators among the regressors: hysteresis and rate in one."
    )
    cannot = "No inverse."
    param_grid: ClassVar[Grid] = {"n_play": (3, 6), "n_terms": (8, 16)}
    effort = 0.2
    output_lags = 1
    input_lags = 1
    n_play = 6


def scaled(values: Array, scale: tuple[float, float]) -> Array:
    """Return values relative to a centre, in half ranges."""
    return np.asarray((values - scale[0]) / scale[1])


def driven(model: Narx, run: Run) -> Array:
    """Return the regressors over a run that depend on inputs alone: past inputs, and operators."""
    x = scaled(run.u, model.input_scale)
    ago = np.arange(model.delay, model.delay + model.input_lags)
    past = x[np.maximum(np.arange(x.size)[:, np.newaxis] - ago, 0)]
    return np.column_stack([past, operators(model, x)])


def operators(model: Narx, x: Array) -> Array:
    """Return the play operators over a scaled input, shape (n, number of operators)."""
    rule = "virgin" if model.initial == "virgin" else "first_sample"
    return play_operators(x, np.array(model.thresholds), rule)


def one_step_pairs(fields: Mapping[str, Any], data: TrainingData, most: int) -> tuple[Array, Array]:
    """Return regressors and next outputs at evenly spaced samples where all values are scored."""
    model = NarxPolynomial(terms=(), weights=(), **fields)
    lags = 1 + np.arange(model.output_lags)
    tables, targets = [], []
    for run in data.runs:
        rows = np.arange(max(model.output_lags, model.past_inputs - 1), run.u.size)
        past = rows[:, np.newaxis] - lags
        rows, past = (
            part[run.counts[rows] & run.counts[past].all(axis=1)] for part in (rows, past)
        )
        y = scaled(run.y, model.output_scale)
        tables.append(np.column_stack([y[past], driven(model, run)[rows]]))
        targets.append(y[rows])
    target = np.concatenate(targets)
    keep = np.linspace(0, target.size - 1, min(target.size, most)).round().astype(int)
    return np.concatenate(tables)[keep], target[keep]


def select(columns: Array, target: Array, most: int) -> list[int]:
    """Return columns, (n, k), ordered by their contribution to the target, (n,)."""
    left, residual = columns.copy(), target.copy()
    power = np.maximum((columns**2).sum(axis=0), 1e-300)
    indices: list[int] = []
    for _ in range(min(most, columns.shape[1])):
        size = (left**2).sum(axis=0)
        usable = size > DEPENDENT * power
        usable[indices] = False
        if not usable.any():
            break
        explained = np.where(usable, (left.T @ residual) ** 2 / np.where(usable, size, 1.0), -1.0)
        best = int(np.argmax(explained))
        direction = left[:, best] / np.sqrt(size[best])
        residual = residual - direction * (direction @ residual)
        left = left - np.outer(direction, direction @ left)
        indices.append(best)
    return indices


@dataclass(frozen=True)
class HiddenLayers:
    """One-step errors of networks by hidden weights, with optimal output weights."""

    x: Array
    y: Array
    """Regressors, shape (n, k), and target outputs, shape (n,)."""

    fields: Mapping[str, Any]
    units: int

    def columns(self, layer: Array) -> Array:
        """Return the regressors of the output weights: constant, regressors, units; then their damping.

        Neighbouring samples make the regressors nearly dependent.
        """
        rows = layer.reshape(self.units, -1)
        a = np.tanh(self.x @ rows[:, :-1].T + rows[:, -1])
        columns = np.column_stack([np.ones(len(a)), self.x, a])
        return np.vstack([columns, DAMPING * np.eye(columns.shape[1])])

    def solved(self, layer: Array, columns: Array) -> tuple[NarxNetwork, Array]:
        """Return the best network for hidden weights, shape (units * (k + 1),), and its errors."""
        target = np.append(self.y, np.zeros(len(columns) - self.y.size))
        weights = np.linalg.lstsq(columns, target, rcond=None)[0]
        bias, linear, read = np.split(weights, [1, 1 + self.x.shape[1]])
        hidden = vector(np.column_stack([layer.reshape(self.units, -1), read]).ravel())
        network = NarxNetwork(
            bias=float(bias[0]), linear=vector(linear), hidden=hidden, **self.fields
        )
        return network, columns @ weights - target

    def errors(self, layer: Array) -> tuple[Array, Callable[[], Array]]:
        """Return the errors, and a function to their projected derivatives (Kaufman)."""
        columns, (n, k) = self.columns(layer), self.x.shape
        network, residual = self.solved(layer, columns)

        def slopes() -> Array:
            by_all, _ = network.slopes(self.x)
            moves = np.zeros((len(columns), layer.size))
            moves[:n] = by_all[:, 1 + k :].reshape(n, self.units, -1)[:, :, :-1].reshape(n, -1)
            span = np.linalg.qr(columns)[0]
            return np.asarray(moves - span @ (span.T @ moves))

        return residual, slopes


@dataclass(frozen=True, eq=False)
class Stretch:
    """A segment of a run, the state before it, and the regressors that depend on inputs alone."""

    run: Run
    state: Array
    regressors: Array


def stretches(model: Narx, data: TrainingData, horizon: int | None) -> list[Stretch]:
    """Return segments of so many samples, each started from measured outputs; or whole runs.

    Of short ones no more than `HORIZON_SAMPLES` take, spread evenly.
    """
    if horizon is None:
        return [
            Stretch(run, model.state_after(model.past(run), run), driven(model, run))
            for run in data.runs
        ]
    result: list[Stretch] = []
    n, m = model.output_lags, model.past_inputs
    for run in data.runs:
        regressors = driven(model, run)
        x, y = scaled(run.u, model.input_scale), scaled(run.y, model.output_scale)
        played = operators(model, x)
        for start in range(max(n, m, 1), len(run), horizon):
            before, stop = start - 1 - np.arange(max(n, m)), start + horizon
            if run.counts[before[:n]].all():
                state = np.concatenate([y[before[:n]], x[before[:m]], played[start - 1]])
                result.append(Stretch(run.cut(start, stop), state, regressors[start:stop]))
    few = min(len(result), -(-HORIZON_SAMPLES // horizon))
    return [result[k] for k in np.linspace(0, len(result) - 1, few).round().astype(int)]


@kernel
def feed_back(slopes: Array, by_past: Array) -> None:
    """Convert derivatives of f by its parameters to those of its free run, in place.

    Shapes: slopes (n, p); by_past (n, lags), the derivatives by past outputs, newest first, 0 where
    these are given.
    """
    for t in range(slopes.shape[0]):
        for k in range(min(t, by_past.shape[1])):
            share = by_past[t, k]
            if share != 0.0:
                for j in range(slopes.shape[1]):
                    slopes[t, j] += share * slopes[t - 1 - k, j]


class StretchErrors:
    """Errors over segments of data, running free in each, for models of one structure."""

    def __init__(self, model: Narx, stretches: Sequence[Stretch]) -> None:
        self.model, self.stretches = model, stretches
        self.counts = np.concatenate([each.run.counts for each in stretches])
        self.target = np.concatenate([each.run.y for each in stretches])[self.counts]
        self._driven = np.concatenate([each.regressors for each in stretches])
        # outputs of all stretches, each behind the measured ones before it, the oldest first
        lags, lengths = model.output_lags, [len(each.run) for each in stretches]
        numbers = np.repeat(np.arange(len(lengths)), lengths)
        self._own = np.arange(numbers.size) + lags * (1 + numbers)
        self._past = self._own[:, np.newaxis] - 1 - np.arange(lags)
        self._behind = np.full(numbers.size + lags * len(lengths), np.nan)
        self._behind[np.delete(np.arange(self._behind.size), self._own)] = np.concatenate(
            [each.state[:lags][::-1] for each in stretches]
        )

    def outputs(self, model: Narx) -> Array:
        """Return the outputs over all segments, shape (n,)."""
        coefficients = model.coefficients(model.sample_time)
        outputs = np.empty((self.counts.size, 1))
        stop = 0
        for each in self.stretches:
            start, stop = stop, stop + len(each.run)
            model.kernel.batch(
                coefficients, each.state.copy(), each.run.driven, outputs[start:stop]
            )
        return outputs[:, 0]

    def errors(self, theta: Array) -> tuple[Array, Callable[[], Array]]:
        """Return the errors at scored samples, relative to half the output's range.

        And a function to their derivatives.
        """
        model = self.model.unpack(theta)
        outputs = self.outputs(model)
        errors = (outputs[self.counts] - self.target) / model.output_scale[1]
        errors = np.clip(
            np.nan_to_num(errors, nan=MOST_ERROR, posinf=MOST_ERROR, neginf=-MOST_ERROR),
            -MOST_ERROR,
            MOST_ERROR,
        )
        return errors, lambda: self.slopes(model, outputs)

    def slopes(self, model: Narx, outputs: Array) -> Array:
        """Return the derivatives of the errors, shape (errors, parameters)."""
        y = scaled(outputs, model.output_scale)
        behind = self._behind.copy()
        behind[self._own] = y
        with np.errstate(over="ignore", invalid="ignore"):
            regressors = np.column_stack([behind[self._past], self._driven])
            by_parameters, by_past = model.slopes(regressors)
            # measured, whatever the parameters
            by_past[np.isfinite(self._behind)[self._past]] = 0.0
            feed_back(by_parameters, by_past)
        slopes = by_parameters[self.counts]
        errors = y[self.counts] - scaled(self.target, model.output_scale)
        slopes[~((np.abs(slopes).max(axis=1) < MOST_SLOPE) & (np.abs(errors) < MOST_ERROR))] = 0.0
        return slopes


def free_run_rmse(model: Narx, data: TrainingData) -> float:
    """Return the RMSE of free runs from measured starts; infinite on overflow."""
    problem = StretchErrors(model, stretches(model, data, None))
    with np.errstate(over="ignore", invalid="ignore"):
        return rms(problem.outputs(model)[problem.counts] - problem.target)


def stable(model: Narx, data: TrainingData) -> bool:
    """Return whether the output is bounded on the data, and for long constant inputs."""
    low, high = data.input_range
    centre, half = model.output_scale
    most = (1.0 + 2.0 * BOUND) * half
    levels = [low, high, *np.linspace(low, high, 7), high, low]
    # as fast as the data go on 99 % of their way, for nothing is known of faster inputs
    moves = np.sort(np.concatenate([np.abs(np.diff(run.u)) for run in data.runs]))
    fastest = moves[np.searchsorted(np.cumsum(moves), 0.99 * moves.sum())] or high - low
    ramps = [
        np.linspace(start, stop, 2 + int(abs(stop - start) / fastest))
        for start, stop in pairwise(levels)
    ]
    inputs_held = np.concatenate([np.append(ramp, np.full(HOLD, ramp[-1])) for ramp in ramps])
    swept = np.concatenate(ramps * 3)
    for inputs in (*(run.u for run in data.runs), inputs_held, swept):
        outputs = model.simulate(inputs, sample_time=data.sample_time)
        if not np.isfinite(outputs).all() or np.abs(outputs - centre).max() > most:
            return False
    return True
