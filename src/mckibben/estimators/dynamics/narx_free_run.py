"""Free runs of NARX models over stretches of data, and how they depend on the parameters.

A free run feeds on its own outputs, so a parameter acts twice: y_t = f(y_{t-1}, ..., x_t; theta) gives
dy_t/dtheta = df/dtheta + sum_k df/dy_{t-k} dy_{t-k}/dtheta. What else f looks at, past inputs and play
operators, depends on no parameter, and is prepared once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Array
from mckibben.blocks.dynamics.narx import Narx
from mckibben.blocks.hysteresis.play_operators import play_matrix
from mckibben.blocks.kernels import kernel
from mckibben.estimators.core.data import Mask, TrainingData
from mckibben.estimators.hysteresis.pi import play_operators

Places = NDArray[np.intp]

STEEPEST = 1e6
"""Derivatives larger than this say nothing: the run has left all bounds."""


@kernel
def feed_back(slopes: Array, by_past: Array) -> None:
    """Turn derivatives of f by its parameters into those of its free run, in place.

    Shapes: slopes (n, p); by_past (n, lags), the derivatives by past outputs, newest first, 0 where
    these are given.
    """
    for t in range(slopes.shape[0]):
        for k in range(min(t, by_past.shape[1])):
            share = by_past[t, k]
            if share != 0.0:
                for j in range(slopes.shape[1]):
                    slopes[t, j] += share * slopes[t - 1 - k, j]


@dataclass(frozen=True)
class Segment:
    """A stretch of a run: its inputs, the state before it, its outputs, and which of them count."""

    inputs: Array
    state: Array
    outputs: Array
    counts: Mask


def segments(model: Narx, data: TrainingData, horizon: int | None) -> list[Segment]:
    """Return stretches of so many samples, each started from measured outputs; or whole runs."""
    found = []
    n, m = model.output_lags, model.past_inputs
    for run in data.runs:
        given = np.ascontiguousarray(run.u[:, np.newaxis])
        if horizon is None:
            state = model.state_at(given[0], run.y[:1]) if run.counts[0] else None
            if state is None:
                state = model.initial_state(given[0])
            found.append(Segment(given, state, run.y, run.counts))
            continue
        x = (run.u - model.input_scale[0]) / model.input_scale[1]
        y = (run.y - model.output_scale[0]) / model.output_scale[1]
        operators = play_operators(x, np.array(model.thresholds), "first_sample")
        first = max(n, m, 1)
        for start in range(first, run.u.size, horizon):
            before = np.arange(start - 1, start - 1 - n, -1)
            if not run.counts[before].all():
                continue
            past = x[start - 1 - np.arange(m)]
            state = np.concatenate([y[before], past, operators[start - 1]])
            stop = start + horizon
            found.append(
                Segment(given[start:stop], state, run.y[start:stop], run.counts[start:stop])
            )
    return found


class FreeRuns:
    """Free runs over stretches of data, for models that differ in their parameters alone.

    Parameters
    ----------
    model : Narx
        One of them.
    sample_time : float or None
        Of the data [s].
    pieces : sequence of Segment
        The stretches; their errors follow one another.
    """

    def __init__(self, model: Narx, sample_time: float | None, pieces: Sequence[Segment]) -> None:
        self.sample_time = sample_time
        self.pieces = pieces
        self.counts = np.concatenate([piece.counts for piece in pieces])
        self._targets = np.concatenate([piece.outputs for piece in pieces])
        self._driven = np.concatenate([_driven(model, piece) for piece in pieces])
        self._given = np.concatenate([piece.state[: model.output_lags] for piece in pieces])
        self._past = _past_places([len(piece.inputs) for piece in pieces], model.output_lags)

    def outputs(self, model: Narx) -> Array:
        """Return the outputs over all stretches, whether they count or not, shape (n,)."""
        run, coefficients = model.kernel.batch, model.coefficients(self.sample_time)
        outputs = np.empty((self.counts.size, 1))
        stop = 0
        for piece in self.pieces:
            start, stop = stop, stop + len(piece.inputs)
            run(coefficients, piece.state.copy(), piece.inputs, outputs[start:stop])
        return outputs[:, 0]

    def errors(self, model: Narx) -> Array:
        """Return the errors at the samples that count."""
        return np.asarray((self.outputs(model) - self._targets)[self.counts])

    def slopes(self, model: Narx) -> Array:
        """Return the derivatives of the errors by the parameters, shape (errors, n_parameters)."""
        centre, half = model.output_scale
        own = (self.outputs(model) - centre) / half
        past = np.concatenate([own, self._given])[self._past]
        with np.errstate(over="ignore", invalid="ignore"):
            by_parameters, by_past = model.slopes(np.column_stack([past, self._driven]))
            by_past[self._past >= own.size] = 0.0
            feed_back(by_parameters, by_past)
            slopes = half * by_parameters[self.counts]
        slopes[~(np.abs(slopes).max(axis=1) < STEEPEST * half)] = 0.0
        return slopes


def _driven(model: Narx, piece: Segment) -> Array:
    """Return the regressors that depend on inputs alone: past ones, and operators."""
    n, m = model.output_lags, model.past_inputs
    x = (piece.inputs[:, 0] - model.input_scale[0]) / model.input_scale[1]
    history = np.concatenate([piece.state[n : n + m][::-1], x])
    samples = m + np.arange(x.size)
    columns = [history[samples - back] for back in range(min(model.delay, m), m)]
    operators = np.empty((x.size, len(model.thresholds)))
    play_matrix(x, np.array(model.thresholds), piece.state[n + m :].copy(), operators)
    return np.column_stack([*columns, operators])


def _past_places(lengths: Sequence[int], lags: int) -> Places:
    """Return where past outputs are among the outputs of all stretches, then all given ones."""
    total = sum(lengths)
    places = []
    start = 0
    for number, length in enumerate(lengths):
        own = np.arange(length)[:, np.newaxis] - 1 - np.arange(lags)
        given = total + number * lags - 1 - own
        places.append(np.where(own >= 0, start + own, given))
        start += length
    return np.concatenate(places)


def free_run_errors(model: Narx, data: TrainingData) -> Array:
    """Return free-running errors at the samples that count, each run started where it was measured.

    A run whose first sample does not count starts at rest, since its output may not be looked at.
    """
    return FreeRuns(model, data.sample_time, segments(model, data, None)).errors(model)
