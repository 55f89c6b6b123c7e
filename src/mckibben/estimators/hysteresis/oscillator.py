"""Identification of oscillators with hysteresis in their loop: Gauss-Newton on free runs.

A linear oscillator is found first; its stiffness is shared between spring and element in a few ways,
from each of which a descent on one run in coarse steps begins, and the best goes on with all runs in
fine ones. Derivatives are exact (`oscillator_slopes`), so that every step costs about two runs.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Annotated, Any, ClassVar

import numpy as np
from annotated_types import Interval

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.hysteresis.oscillators import Oscillator
from mckibben.errors import DataError, ModelError
from mckibben.estimators.core.data import TrainingData
from mckibben.estimators.core.single import SingleEstimator
from mckibben.estimators.core.uncertainty import relative_sizes, told_by_runs
from mckibben.estimators.dynamics.linear_oscillator import MOST_SUBSTEPS, linear_oscillator
from mckibben.estimators.dynamics.paths import averaged, paths
from mckibben.estimators.hysteresis.oscillator_runs import FreeRuns, Way
from mckibben.estimators.optimisers.tracker import Tracker

ANGLE, COARSE_ANGLE = 1 / 30, 1 / 3
"""Of the linear oscillator in a substep, and in one of the search's coarse ones, at most [rad]."""

FEWEST_COARSE = 2

FIRST_STEPS, STEPS = 12, 60
"""Steps from every start, and of the best."""

SHARES, BENDS = (0.1, 0.3, 0.6), (0.5, 3.0, 10.0)
"""Of elements to start from: shares of the linear stiffness; and how far loops are bent, as what the
slope about no force loses over the largest displacement, relative."""

ROUNDS = 8
"""Times that a start is searched, in ever finer structures."""

FIRST_GAIN, LEAST_GAIN = 1e-3, 1e-9
"""Share of the squared error that a step gains, or the descent has arrived."""


@dataclass(kw_only=True, repr=False, eq=False)
class OscillatorEstimator(SingleEstimator):
    """An estimator of a mass, a damper, a spring and an element that remembers.

    Parameters
    ----------
    periodic : bool
        Whether every recording is a whole number of periods of a motion that repeats itself, as under
        a multisine after some periods. Then no start counts, and the input is taken to be band-limited
        between samples; run such models by `Repeating.steady_state`. Otherwise recordings begin at
        rest, and the input goes in straight lines from sample to sample.
    fit_offset : bool
        Whether the displacement has an offset to be found; else it is 0 without force.
    substeps : int, optional
        Runge-Kutta steps from sample to sample. Default: enough that the linear oscillator turns by
        no more than 1/30 rad in each.
    """

    needs_time: ClassVar[bool] = True

    input: str = "force"
    output: str = "displacement"
    periodic: bool = False
    fit_offset: bool = False
    substeps: Annotated[int, Interval(ge=1, le=MOST_SUBSTEPS)] | None = None

    made_for: ClassVar[tuple[str, str] | None] = ("force", "displacement")
    rises: ClassVar[bool] = False
    effort: ClassVar[float] = 3.0

    n_positive: ClassVar[int]
    """Parameters of the block, the first ones, that are searched by their logarithms."""

    order: ClassVar[int]
    """The others have the unit of this power of a force, over displacement."""

    follows: ClassVar[Callable[..., None]]
    """What runs the model with its derivatives."""

    @abstractmethod
    def starts(self, slope: float, bend: float, fields: dict[str, Any]) -> list[Oscillator]:
        """Return models to start from.

        Parameters
        ----------
        slope, bend : float
            Of the element: slope about no force, and the share of it that 1 mm takes away.
        fields : dict
            All other fields.
        """

    def refined(self, model: Oscillator, forces: Array) -> Oscillator | None:
        """Return the model in a finer structure, for forces that its element has, if there is one."""
        del model, forces
        return None

    def identify(self, data: TrainingData, tracker: Tracker) -> tuple[Block, TrainingData]:
        step = data.timed()
        if self.initial == "fitted":
            raise ModelError(
                "starts of oscillators are not fitted. Remedy: use recordings that begin at rest, or "
                "periodic=true and whole periods of a motion that repeats itself."
            )
        linear = linear_oscillator(data, self.channels(data))
        fine = self.substeps or linear.substeps(step, ANGLE)
        coarse = min(max(linear.substeps(step, COARSE_ANGLE), FEWEST_COARSE), fine)
        self._warm = linear.forgets(data)
        merged = averaged(data) if self.periodic else data
        fields = self.channels(data) | {
            "output_offset": 0.0 if self.fit_offset else None,
            "substeps": fine,
            "initial": self.starting_rule,
        }
        middle = float(np.mean(data.target)) if self.fit_offset else 0.0
        most = float(np.abs(data.target - middle).max())
        first = replace(merged, runs=merged.runs[:1])

        def begun(model: Oscillator) -> tuple[Oscillator, float]:
            return self.search(model, first, coarse, tracker).descended(FIRST_STEPS, FIRST_GAIN)

        tried = []
        for share, bend in product(SHARES, BENDS):
            # an element that is bent far adds the less to the stiffness of large motion
            spring = (1.0 - share / max(1.0, bend)) * linear.stiffness
            own = {"mass": linear.mass, "damping": 0.5 * linear.damping, "stiffness": spring}
            starts = self.starts(share * linear.stiffness, bend / most, fields | own)
            tried += [begun(start) for start in starts]
        model, cost = min(tried, key=lambda one: one[1])
        if not np.isfinite(cost):
            raise DataError(
                "no oscillator runs stably under this force",
                channel=data.input,
                remedy="check units, or record at a higher rate",
            )
        for _ in range(ROUNDS):
            finer = self.refined(model, self.search(model, first, coarse, tracker).forces(model))
            if finer is None:
                break
            model, _ = begun(finer)
        for substeps, gain, told in ((coarse, FIRST_GAIN, False), (fine, LEAST_GAIN, True)):
            search = self.search(model, merged, substeps, tracker, told)
            model, _ = search.descended(STEPS, gain)
        return model, data

    def search(
        self,
        model: Oscillator,
        data: TrainingData,
        substeps: int,
        tracker: Tracker,
        told: bool = False,
    ) -> FreeRuns:
        """Return the errors of models of one structure on all runs."""
        at_rest = not self.periodic and self.starting_rule == "first_sample"
        way = Way(self.n_positive, type(self).follows, at_rest, self.order)
        warm = self._warm if self.periodic else None
        return FreeRuns(model, data, paths(data, substeps, warm, at_rest), way, tracker, told)

    def free_runs(self, blocks: Sequence[Block], data: TrainingData) -> Array:
        """Return the outputs of blocks where samples count: in steady state, of periodic recordings."""
        if not self.periodic:
            return super().free_runs(blocks, data)
        rows = []
        for block in blocks:
            assert isinstance(block, Oscillator)
            rows.append(self.search(block, data, block.substeps, Tracker()).outputs(block))
        return np.array(rows)

    def uncertainty(
        self, block: Block, data: TrainingData, residual: Array, at_bounds: Sequence[int]
    ) -> tuple[float, Array]:
        """Return the condition of all parameters and their covariance, from exact derivatives."""
        assert isinstance(block, Oscillator)
        search = self.search(block, data, block.substeps, Tracker())
        theta = search.coordinates(block)
        search.errors(theta)
        size = relative_sizes(block.pack())
        slopes = search.slopes(theta) / search.scale(block) * size
        condition, own = told_by_runs(slopes, residual, data.runs)
        return condition, own * np.outer(size, size)
