"""Ridge regression on play operators, lags and products of all inputs.

Linear in the readout: least squares on what a block with a unit readout gives, with a penalty that is
chosen for every output by leaving out blocks of time, since generalized cross-validation, of one sample
left out at a time, takes for evidence that samples which follow one another are alike. Pressures count
from the least that is recorded, so that absolute and gauge ones are penalised alike.

Source: Hoerl and Kennard, "Ridge regression", Technometrics, 1970.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import combinations_with_replacement
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt, Interval, Len

from mckibben.arrays import Array, Mask
from mckibben.blocks.base import Block
from mckibben.blocks.coupled.coupled_memory import CoupledMemory, readout_width
from mckibben.blocks.fields import Channel, rows, vector
from mckibben.blocks.free_runs import FreeRuns
from mckibben.estimators.core.data import TrainingData
from mckibben.estimators.coupled.base import CoupledEstimator
from mckibben.numerics.blocks import squared_errors, sums_of_others
from mckibben.numerics.least_squares import solve_products
from mckibben.numerics.tracker import Tracker

PENALTIES = np.geomspace(1e-8, 10.0, 28)
"""Candidate penalties, relative to the size of the regressors."""

N_BLOCKS = 10
"""Smallest number of cross-validation blocks; the same in every run."""

SMALLEST_PENALTY = 1e-12
"""Smallest penalty, on the same scale, which makes the equations solvable."""


class PlayRidgeEstimator(CoupledEstimator):
    """Ridge regression on play operators, lags and products of all inputs; any number of outputs.

    After `fit`, ``penalties_`` holds the penalty of every output.

    Parameters
    ----------
    lags : sequence of float
        Time constants [s], 0 for the input itself; products are of the first. Of recordings without
        time, the inputs themselves are taken.
    thresholds : sequence of float
        Of the play operators of every lagged input, relative to the range of the input.
    degree : int
        Highest degree of products of inputs, 1 for none.
    crossed : bool
        Whether there are products of inputs with other lags and with plays.
    ridge : float, optional
        Penalty of the readout, its constant excepted, relative to the root mean square of what is read
        out. Default: for every output the largest whose error on blocks left out is within a standard
        error of the least.
    """

    title = "Ridge regression on play operators and lags"
    purpose = "several"
    can = (
        "One muscle or several, under loads too, any number of outputs: lags, play operators "
        "and products of all inputs, in closed form; always stable."
    )
    cannot = (
        "No inverse; beyond the recorded inputs its products extrapolate as polynomials; no dynamics "
        "that oscillate."
    )
    quick = True
    alone = True
    through = True
    paired = False

    lags: Annotated[tuple[Annotated[float, Ge(0)], ...], Len(1)] = (0.0, 0.1, 0.6, 4.0)
    thresholds: tuple[Annotated[float, Gt(0)], ...] = (0.04, 0.11, 0.23)
    degree: Annotated[int, Interval(ge=1, le=3)] = 3
    crossed: bool = True
    ridge: Annotated[float, Gt(0)] | None = None

    def find(self, data: TrainingData, tracker: Tracker) -> Block:
        lags = self.lags if data.sample_time is not None else (0.0,)
        inputs = data.stacked("inputs")
        spans = np.ptp(inputs, axis=0)
        every = (*data.inputs, *data.scheduled)
        relative = [channel.unit == "bar" for channel in every]  # a load of 0 is none
        width = readout_width(
            spans.size, len(lags), len(self.thresholds), self.degree, self.crossed
        )
        template = CoupledMemory(
            vector(lags),
            rows(np.where(spans > 0, spans, 1.0)[:, np.newaxis] * np.array(self.thresholds)),
            rows(np.zeros((len(data.outputs), width))),
            self.degree,
            data.inputs,
            data.scheduled,
            data.outputs,
            self.crossed,
            vector(np.where(relative, inputs.min(axis=0), 0.0)),
        )
        blocks = []
        for k, run in enumerate(data.runs):
            tracker.reached(k / len(data.runs))
            table = np.hstack([features(template, run.inputs, run.sample_time), run.outputs])
            n_blocks = -(-N_BLOCKS // len(data.runs))
            blocks += [block.T @ block for block in np.array_split(table[run.counts], n_blocks)]
        sums = np.array(blocks)
        penalties = None if self.ridge is None else (self.ridge,) * len(data.outputs)
        self.penalties_ = penalties or chosen(sums, width)
        return template.unpack(readout_of(sums.sum(axis=0), width, self.penalties_).ravel())

    def left_out(self, runs: FreeRuns, parts: Sequence[Mask]) -> list[list[Array]]:
        """Return the outputs of the readout without each part, in closed form."""
        block, m = runs.block, len(runs.names)
        assert isinstance(block, CoupledMemory)
        width, tables, scored = len(block.readout[0]), [], []
        for run, past in zip(runs.runs, runs.pasts, strict=True):
            inputs = np.vstack([past, run.inputs])
            tables.append(features(block, inputs, run.sample_time)[len(past) :])
            scored.append(np.hstack([tables[-1], run.outputs])[run.counts])
        rows = np.concatenate(scored)
        total, result = rows.T @ rows, []
        for part in parts:
            out = rows[part[::m]]
            readout = readout_of(total - out.T @ out, width, self.penalties_)
            result.append([table @ readout.T for table in tables])
        return result


class CoupledMemoryEstimator(PlayRidgeEstimator):
    """Lags and play operators of several muscles, with one fixed penalty."""

    title = "Coupled lags and play operators"
    can = (
        "Any number of outputs from lags, play operators and products of all inputs; in "
        "closed form."
    )
    cannot = "No inverse; products extrapolate badly beyond the recorded inputs."
    makes = ("coupled-memory",)
    alone = False
    needs_time = True
    crossed = False
    lags = (0.3, 1.0, 8.0)
    ridge = 1e-4


def readout_of(sums: Array, width: int, penalties: Sequence[float]) -> Array:
    """Return the readout of every output, shape (m, width).

    Parameters
    ----------
    sums : array, shape (width + m, width + m)
        Sums of products of what is read out, a constant first, and of the outputs.
    width : int
    penalties : sequence of m float
        Relative to the diagonal of ``sums``.
    """
    solutions = [
        solve_products(sums[np.newaxis], width, _damping(width, penalty))[0]
        for penalty in penalties
    ]
    return np.array([readout[:, k] for k, readout in enumerate(solutions)])


def _damping(width: int, penalty: float) -> Array:
    """Return the penalty of everything read out, its constant excepted."""
    damping = np.full(width, penalty + SMALLEST_PENALTY)
    damping[0] = SMALLEST_PENALTY
    return damping


def chosen(blocks: Array, width: int) -> tuple[float, ...]:
    """Return the penalty of every output: the largest within a standard error of the least error.

    Parameters
    ----------
    blocks : array, shape (n_blocks, width + m, width + m)
        Sums as of `readout_of`, of every block, which are left out in turn.
    width : int
    """
    other_sums, m = sums_of_others(blocks, np.arange(len(blocks))), blocks.shape[1] - width
    solve = partial(solve_products, other_sums, width, effects=np.diag(blocks.sum(axis=0))[:width])
    # squared errors of every output on blocks left out, by penalty
    errors = np.stack(
        [squared_errors(blocks, solve(ridge=_damping(width, ridge_))) for ridge_ in PENALTIES],
        axis=1,
    )
    least = errors.sum(axis=0).argmin(axis=0)
    more = errors - errors[:, least, range(m)][:, np.newaxis]
    spread = more.std(axis=0, ddof=1) * np.sqrt(len(blocks))
    within = more.sum(axis=0) <= spread
    return tuple(float(PENALTIES[within[:, j]].max()) for j in range(m))


def features(block: CoupledMemory, inputs: Array, sample_time: float | None) -> Array:
    """Return the features over inputs, shape (n, width)."""
    n, width = inputs.shape[1], len(block.readout[0])
    many = replace(
        block,
        readout=rows(np.eye(width)[: block.n_states + 1]),
        given=tuple(Channel(f"feature_{k}", "") for k in range(block.n_states + 1)),
    )
    linear = many.simulate(np.ascontiguousarray(inputs), sample_time=sample_time)
    first = linear[:, 1 : 1 + n]
    products = [
        np.prod(first[:, list(factors)], axis=1)
        for power in range(2, block.degree + 1)
        for factors in combinations_with_replacement(range(n), power)
    ]
    if block.crossed:
        products += [first[:, [k]] * linear[:, 1 + n :] for k in range(n)]
    return np.column_stack([linear, *products])
