"""What NARX estimators share: free-run refinement, and the check that the model stays within bounds."""

from __future__ import annotations

import warnings
from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import Annotated, Any, ClassVar

import numpy as np
from annotated_types import Interval
from numpy.typing import NDArray

from mckibben.blocks.base import Block
from mckibben.blocks.dynamic.narx import Narx
from mckibben.errors import DataError, ModelError, ModelWarning
from mckibben.estimators.base import Estimator
from mckibben.estimators.data import Mask, TrainingData
from mckibben.estimators.narx.regressors import Lags
from mckibben.estimators.pi import play_operators
from mckibben.estimators.search import Interrupted, Tracker

Array = NDArray[np.float64]

BOUND = 1.0
"""How far beyond the data's range a stable model's output may go, relative to the range."""

HORIZONS = (20, 200)
"""Samples over which errors are minimised before whole runs are."""

MOST_REFINED = 2
"""Models refined over whole runs."""

HORIZON_SAMPLES = 4000
"""Samples looked at over such horizons, at most."""

FAR = 10.0
"""Errors are not counted as larger than this, relative to half the output's range."""

HOLD = 1000
"""Samples for which inputs are held in the check of stability."""


@dataclass(kw_only=True, repr=False, eq=False)
class NarxEstimator(Estimator):
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
        if data.sample_time is None:
            raise DataError(
                "the recordings have no time, and this model depends on rate",
                remedy="read them with a time column or --rate, or use gpi",
            )
        if self.initial == "fitted":
            raise ModelError(
                "a NARX model starts from the first measured output. Remedy: leave initial out."
            )
        lags = Lags.of(data, self.output_lags, self.input_lags, self.delay, self.n_play)
        tried: list[tuple[float, Narx]] = []
        try:
            started = [
                (model, self._refined(model, HORIZONS, data, tracker) if self.refine else model)
                for model in self.candidates(lags, data, tracker)
            ]
            started.sort(key=lambda pair: rms(free_run_errors(pair[1], data)))
            for model, near in started:
                far = near
                if self.refine and len(tried) < MOST_REFINED:
                    far = self._refined(near, (None,), data, tracker)
                options = [m for m in (far, near, model) if self.allow_unstable or stable(m, data)]
                if options:
                    best = options[0]
                    tried.append((rms(free_run_errors(best, data)), best))
        except Interrupted:
            tracker.interrupted = True
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
        self,
        model: Narx,
        horizons: Sequence[int | None],
        data: TrainingData,
        tracker: Tracker,
    ) -> Narx:
        """Return the model refined on errors over ever longer horizons, the last one free-running.

        A model that is unstable when it runs free has no slope to follow there; over short horizons,
        each started from what was measured, it has.
        """
        from scipy.optimize import least_squares

        for horizon in horizons:
            pieces = some(segments(model, data, horizon), horizon)
            residuals = partial(_residuals, model, data, pieces, tracker)
            start = model.pack()
            found = least_squares(
                residuals,
                start,
                x_scale=np.maximum(np.abs(start), 1e-3 * np.abs(start).max(initial=1e-3)),
                max_nfev=self.max_evaluations,
                ftol=1e-6,
                xtol=1e-9,
            )
            model = model.unpack(found.x)
        return model


def _residuals(
    model: Narx, data: TrainingData, pieces: Sequence[Segment], tracker: Tracker, parameters: Array
) -> Array:
    half = model.output_scale[1]
    try:
        errors = segment_errors(model.unpack(parameters), data, pieces) / half
    except KeyboardInterrupt:
        raise Interrupted from None
    errors = np.clip(np.nan_to_num(errors, nan=FAR, posinf=FAR, neginf=-FAR), -FAR, FAR)
    tracker.saw(parameters, rms(errors) * half)
    return errors


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


def some(pieces: list[Segment], horizon: int | None) -> list[Segment]:
    """Return stretches spread evenly over all, as many as short horizons need; all of whole runs."""
    if horizon is None:
        return pieces
    n = min(len(pieces), -(-HORIZON_SAMPLES // horizon))
    return [pieces[k] for k in np.linspace(0, len(pieces) - 1, n).round().astype(int)]


def segment_errors(model: Narx, data: TrainingData, pieces: Sequence[Segment]) -> Array:
    """Return the errors over all stretches, at the samples that count."""
    errors = []
    for piece in pieces:
        outputs = np.empty_like(piece.inputs)
        model.bind(data.sample_time, piece.state.copy(), piece.inputs, outputs)()
        errors.append((outputs[:, 0] - piece.outputs)[piece.counts])
    return np.concatenate(errors)


def free_run_errors(model: Narx, data: TrainingData) -> Array:
    """Return free-running errors at the samples that count, each run started where it was measured.

    A run whose first sample does not count starts at rest, since its output may not be looked at.
    """
    return segment_errors(model, data, segments(model, data, None))


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
