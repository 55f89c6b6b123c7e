"""Identification of lags and play operators of several inputs with a polynomial readout.

Linear in the readout: damped least squares on what a block with a unit readout gives.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations_with_replacement
from typing import Annotated, ClassVar

import numpy as np
from annotated_types import Gt, Interval

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.coupled.coupled_memory import CoupledMemory, readout_width
from mckibben.blocks.fields import rows, vector
from mckibben.estimators.core.data import Run, TrainingData
from mckibben.estimators.coupled.base import CoupledEstimator
from mckibben.estimators.optimisers.tracker import Tracker


@dataclass(kw_only=True, repr=False, eq=False)
class CoupledMemoryEstimator(CoupledEstimator):
    """Lags and play operators of all inputs, any number of outputs, no inverse.

    Parameters
    ----------
    lags : sequence of float
        Time constants [s].
    thresholds : sequence of float
        Of the play operators, relative to the range of their input.
    degree : int
        Highest degree of products of inputs.
    ridge : float
        Damping, relative to the size of what is read out.
    """

    title = "Coupled lags and play operators"
    can = (
        "Any number of outputs from lags, play operators and products of all inputs; in "
        "closed form."
    )
    cannot = "No inverse; products know nothing of inputs larger than those recorded."
    quick = True
    makes = ("coupled-memory",)
    needs_time: ClassVar[bool] = True

    lags: tuple[Annotated[float, Gt(0)], ...] = (0.3, 1.0, 8.0)
    thresholds: tuple[Annotated[float, Gt(0)], ...] = (0.04, 0.11, 0.23)
    degree: Annotated[int, Interval(ge=1, le=3)] = 3
    ridge: Annotated[float, Gt(0)] = 1e-4

    paired: ClassVar[bool] = False

    def identify(self, data: TrainingData, tracker: Tracker) -> Block:
        data.timed()
        inputs = (*data.inputs, *data.scheduled)
        every = np.concatenate([run.inputs for run in data.runs])
        spans = np.maximum(np.ptp(every, axis=0), 1e-9)
        width = readout_width(len(inputs), len(self.lags), len(self.thresholds), self.degree)
        template = CoupledMemory(
            vector(self.lags),
            rows(spans[:, np.newaxis] * np.array(self.thresholds)),
            rows(np.zeros((len(data.outputs), width))),
            self.degree,
            data.inputs,
            data.scheduled,
            data.outputs,
        )
        gram, right = np.zeros((width, width)), np.zeros((width, len(data.outputs)))
        total = 0
        for place, run in enumerate(data.runs):
            tracker.reached(place / len(data.runs))
            columns = features(template, run)
            gram += columns.T @ columns
            right += columns.T @ run.outputs
            total += len(columns)
        size = np.sqrt(np.maximum(np.diag(gram), 1e-12 * np.diag(gram).max()))
        scaled = gram / size / size[:, np.newaxis]
        damping = np.full(width, self.ridge)
        damping[0] = 0.0
        found = np.linalg.solve(scaled + np.diag(damping + 1e-12), right / size[:, np.newaxis])
        return template.unpack((found / size[:, np.newaxis]).T.ravel())


def features(block: CoupledMemory, run: Run) -> Array:
    """Return what the readout multiplies over a run, shape (n, width)."""
    inputs = run.inputs
    n, width = inputs.shape[1], len(block.readout[0])
    many = CoupledMemory(
        block.lags,
        block.thresholds,
        rows(np.eye(width)[: block.n_states + 1]),
        block.degree,
        block.driven,
        block.scheduled,
        tuple(
            type(c)(f"feature_{k}", "") for k in range(block.n_states + 1) for c in [block.given[0]]
        ),
    )
    linear = many.simulate(inputs, sample_time=run.sample_time)
    first = linear[:, 1 : 1 + n]
    products = [
        np.prod(first[:, list(chosen)], axis=1)
        for power in range(2, block.degree + 1)
        for chosen in combinations_with_replacement(range(n), power)
    ]
    return np.column_stack([linear, *products])
