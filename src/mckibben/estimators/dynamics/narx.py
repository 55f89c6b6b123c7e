"""What NARX estimators share: free-run refinement, and the check that the model stays within bounds."""

from __future__ import annotations

import warnings
from abc import abstractmethod
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import Annotated, Any, ClassVar

import numpy as np
from annotated_types import Interval

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.dynamics.narx import Narx
from mckibben.errors import DataError, ModelError, ModelWarning
from mckibben.estimators.core.data import TrainingData
from mckibben.estimators.core.single import SingleEstimator
from mckibben.estimators.core.uncertainty import relative_sizes
from mckibben.estimators.dynamics.narx_free_run import FreeRuns, Segment, free_run_errors, segments
from mckibben.estimators.dynamics.narx_regressors import Lags
from mckibben.estimators.optimisers.descent import Radius, descend
from mckibben.estimators.optimisers.tracker import Tracker

BOUND = 1.0
"""How far beyond the data's range a stable model's output may go, relative to the range."""

HORIZONS = (20, 200)
"""Samples over which errors are minimised before whole runs are."""

MOST_REFINED = 2
"""Models refined over whole runs."""

LEAST_GAIN = 1e-6
"""Share of the squared error that a step of the refinement has to gain."""

HORIZON_SAMPLES = 4000
"""Samples looked at over such horizons, at most."""

FAR = 10.0
"""Errors are not counted as larger than this, relative to half the output's range."""

HOLD = 1000
"""Samples for which inputs are held in the check of stability."""


@dataclass(kw_only=True, repr=False, eq=False)
class NarxEstimator(SingleEstimator):
    """An estimator of a NARX model.

    Parameters
    ----------
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
        Whether a model that leaves all bounds is returned, with a warning, instead of refused.
    """

    needs_time: ClassVar[bool] = True

    output_lags: Annotated[int, Interval(ge=1, le=20)] = 2
    input_lags: Annotated[int, Interval(ge=1, le=20)] = 2
    delay: Annotated[int, Interval(ge=0, le=50)] = 0
    n_play: Annotated[int, Interval(ge=0, le=20)] = 0
    refine: bool = True
    max_evaluations: Annotated[int, Interval(ge=1, le=10_000)] = 20
    allow_unstable: bool = False

    rises: ClassVar[bool] = False

    def fields(self, lags: Lags, data: TrainingData) -> dict[str, Any]:
        """Return the fields that all NARX blocks have."""
        return lags.fields(data) | {"initial": self.starting_rule} | self.channels(data)

    @abstractmethod
    def candidates(self, lags: Lags, data: TrainingData, tracker: Tracker) -> list[Narx]:
        """Return models fitted to one-step errors, the most promising first."""

    def identify(self, data: TrainingData, tracker: Tracker) -> tuple[Block, TrainingData]:
        """Return the best model that stays within bounds, and the data."""
        data.timed(instead=", or use gpi")
        if self.initial == "fitted":
            raise ModelError(
                "a NARX model starts from the first measured output. Remedy: leave initial out."
            )
        lags = Lags.of(data, self.output_lags, self.input_lags, self.delay, self.n_play)
        started: list[list[Narx]] = []
        tried: list[tuple[float, Narx]] = []

        def settle(found: list[Narx]) -> None:
            # what is refined last is best, if it stays within bounds
            options = (m for m in reversed(found) if self.allow_unstable or stable(m, data))
            best = next(options, None)
            if best is not None:
                tried.append((rms(free_run_errors(best, data)), best))

        with tracker.searching():
            for model in self.candidates(lags, data, tracker):
                if data.target.size <= model.n_parameters:
                    raise DataError(
                        f"{data.target.size} samples are too few for {model.n_parameters} parameters",
                        remedy="give longer recordings, or use fewer lags, terms or units",
                    )
                started.append(found := [model])
                for horizon in HORIZONS if self.refine else ():
                    found += self._refined(found[-1], horizon, data, tracker)[-1:]
            started.sort(key=lambda found: rms(free_run_errors(found[-1], data)))
            for found in started:
                if self.refine and len(tried) < MOST_REFINED:
                    found += self._refined(found[-1], None, data, tracker)[1:]
                settle(found)
        if tracker.interrupted and not tried:
            for found in started:
                settle(found)
        if not tried:
            raise ModelError(
                "every NARX model found leaves all bounds when it runs free. Remedy: use fewer terms "
                "or units, n_play=3, or allow_unstable=true to get it nevertheless."
            )
        cost, chosen = min(tried, key=lambda item: item[0])
        tracker.best_cost = cost
        if not stable(chosen, data):
            warnings.warn(
                "the NARX model leaves all bounds when its input is held or goes on: do not run it free",
                ModelWarning,
                stacklevel=4,
            )
        return chosen, data

    def _refined(
        self, model: Narx, horizon: int | None, data: TrainingData, tracker: Tracker
    ) -> list[Narx]:
        """Return models of ever smaller errors over a horizon, or over whole runs.

        A model that is unstable when it runs free has no slope to follow there; over short horizons,
        each started from what was measured, it has.
        """
        pieces = some(segments(model, data, horizon), horizon)
        start = model.pack()
        # the samples before a stretch may be measured nowhere, or seldom
        if sum(int(piece.counts.sum()) for piece in pieces) < start.size:
            return []
        runs = FreeRuns(model, data.sample_time, pieces)
        path = descend(
            partial(_errors, model, runs, tracker),
            partial(_slopes, model, runs),
            start,
            Radius(start, relative_sizes(start)),
            most_evaluations=self.max_evaluations,
            least_gain=LEAST_GAIN,
        )
        return [model.unpack(parameters) for parameters, _ in path]


def _errors(model: Narx, runs: FreeRuns, tracker: Tracker, parameters: Array) -> Array:
    """Return errors relative to half the output's range, none counted as larger than `FAR`."""
    half = model.output_scale[1]
    errors = runs.errors(model.unpack(parameters)) / half
    errors = np.clip(np.nan_to_num(errors, nan=FAR, posinf=FAR, neginf=-FAR), -FAR, FAR)
    tracker.saw(parameters, rms(errors) * half)
    return errors


def _slopes(model: Narx, runs: FreeRuns, parameters: Array) -> Array:
    """Return the derivatives of `_errors`."""
    here, half = model.unpack(parameters), model.output_scale[1]
    slopes = runs.slopes(here) / half
    slopes[~(np.abs(runs.errors(here)) < FAR * half)] = 0.0
    return slopes


def some(pieces: list[Segment], horizon: int | None) -> list[Segment]:
    """Return stretches spread evenly over all, as many as short horizons need; all of whole runs."""
    if horizon is None:
        return pieces
    n = min(len(pieces), -(-HORIZON_SAMPLES // horizon))
    return [pieces[k] for k in np.linspace(0, len(pieces) - 1, n).round().astype(int)]


def stable(model: Narx, data: TrainingData) -> bool:
    """Tell whether the output stays within bounds on the data, and while inputs are held long."""
    low, high = data.input_range
    centre, half = model.output_scale
    most = (1.0 + 2.0 * BOUND) * half
    levels = [low, high, *np.linspace(low, high, 7), high, low]
    # as fast as the data ever go, for nothing is known of faster inputs
    fastest = max(np.quantile(np.abs(np.diff(run.u)), 0.99) for run in data.runs)
    ramps = [
        np.linspace(start, stop, 2 + int(abs(stop - start) / fastest))
        for start, stop in pairwise(levels)
    ]
    held = np.concatenate([np.append(ramp, np.full(HOLD, ramp[-1])) for ramp in ramps])
    swept = np.concatenate(ramps * 3)
    for inputs in (*(run.u for run in data.runs), held, swept):
        outputs = model.simulate(inputs, sample_time=data.sample_time)
        if not np.isfinite(outputs).all() or np.abs(outputs - centre).max() > most:
            return False
    return True


def rms(errors: Array) -> float:
    """Return the root mean square, infinite where it overflows."""
    with np.errstate(over="ignore", invalid="ignore"):
        value = float(np.sqrt(np.mean(errors**2)))
    return value if np.isfinite(value) else np.inf
