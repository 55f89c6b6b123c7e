"""What an estimator is: settings that find a block from recordings."""

from __future__ import annotations

import time
import warnings
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from annotated_types import Interval

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.errors import ModelWarning
from mckibben.estimators.core.data import Mask, TrainingData
from mckibben.estimators.core.parameters import Parametrised
from mckibben.estimators.core.settings import check_settings
from mckibben.estimators.core.uncertainty import (
    covariance_of,
    simulate_all,
    simulate_started,
    unknown,
)
from mckibben.estimators.optimisers.tracker import Progress, Tracker
from mckibben.recording import Recording, listed
from mckibben.signals.checking import LARGEST_SEED
from mckibben.system.progress import telling
from mckibben.system.threads import one_blas_thread

Operators = Annotated[int, Interval(ge=1, le=1000)]
"""Number of operators."""

Purpose = Literal["memory", "rate", "several", "force"]
"""What models are for: loops of one muscle, lags and dynamics, several muscles or loads, forces."""

InverseKind = Literal["exact", "exact where stable", "solved", "none"]
"""How models are inverted: by a formula, by one whose stability depends on the fit, by solving in
every sample, or not at all."""

Grid = Mapping[str, tuple[Any, ...]]
"""Setting -> values to try."""

DefaultFor = Literal["load", "plan of displacement", "plan of force"]
"""Where one model is used without being named: fitted to each load, beside models that are given the
load; or fitted before a plan of recordings."""


@dataclass(frozen=True)
class Diagnostics:
    """What a fit has to say of itself.

    Parameters
    ----------
    rmse : float
        Free-running RMSE on the samples fitted, in the unit of the output, each run started as fitted;
        of several outputs the mean of theirs.
    rmse_by_output : tuple of float
        The same, of every output.
    rmse_from_rest : float
        The same, each run started as a stream or generated code starts: without knowing an output.
    n_samples : int
        Samples fitted.
    n_evaluations : int
        Times the model was evaluated in the search.
    seconds : float
        Wall time.
    interrupted : bool
        Whether the user stopped the search; the model is then the best found until there.
    condition : float
        Condition number of the sensitivity of the output to the free parameters, each scaled by its
        own size.
    at_bounds : tuple of int
        Parameters, by their place in ``model_.pack()``, that ended at a bound.
    standard_errors : tuple of float
        One a parameter, for residuals that remember; NaN for those at bounds or that the data do
        not determine.
    covariance : array, shape (n_parameters, n_parameters)
        The same, NaN likewise.
    peaks : tuple of float or None
        For every recording, the input from which it was taken to have come before its first sample.
    notes : tuple of str
        What the user should know.
    """

    rmse: float
    rmse_by_output: tuple[float, ...]
    rmse_from_rest: float
    n_samples: int
    n_evaluations: int
    seconds: float
    interrupted: bool
    condition: float
    at_bounds: tuple[int, ...]
    standard_errors: tuple[float, ...]
    covariance: Array = field(repr=False)
    peaks: tuple[float | None, ...]
    notes: tuple[str, ...] = ()


@dataclass(kw_only=True, repr=False, eq=False)
class Estimator(Parametrised, ABC):
    """What all estimators share; see scikit-learn for ``get_params``, ``clone`` and the like.

    Parameters
    ----------
    seed : int
        Of everything random.
    """

    seed: Annotated[int, Interval(ge=0, le=LARGEST_SEED)] = 0

    title: ClassVar[str] = ""
    """Full name of the model; its short name if empty."""

    purpose: ClassVar[Purpose | None] = None
    """What it is for, by which models are listed; None lists it under others."""

    can: ClassVar[str] = ""
    """What it represents, in a sentence; the first line of the docstring if empty."""

    cannot: ClassVar[str] = ""
    """What it does not represent, in a sentence."""

    caution: ClassVar[str | None] = None
    """Why it is good only near the motions that it was trained on; None where it is not."""

    inverse_kind: ClassVar[InverseKind] = "none"
    """How its models are inverted as a rule; a fitted one may lack its inverse."""

    quick: ClassVar[bool] = False
    """Whether it is tried first: well known, or good, and fitted in seconds."""

    param_grid: ClassVar[Grid] = {}
    """Setting -> values tried where orders are chosen by cross-validation."""

    makes: ClassVar[tuple[str, ...]] = ()
    """Models that it can fit again with as many operators, each by the kinds of its parts in order."""

    default_for: ClassVar[DefaultFor | None] = None
    """Where it is used without being named."""

    effort: ClassVar[float] = 0.5
    """About how long a fit to 10 000 samples takes [s]: models are compared cheapest first."""

    needs_time: ClassVar[bool] = False
    """Whether it cannot learn from recordings without time."""

    @classmethod
    @abstractmethod
    def objection(
        cls,
        recordings: Sequence[Recording],
        inputs: Sequence[str],
        outputs: Sequence[str],
        scheduling: Sequence[str] | None = None,
    ) -> str | None:
        """Return why the model has no place in a comparison on recordings, or None."""

    @classmethod
    @abstractmethod
    def channel_settings(
        cls,
        inputs: Sequence[str],
        outputs: Sequence[str],
        scheduling: Sequence[str] | None = None,
    ) -> dict[str, Any]:
        """Return the settings that make it learn from some channels; None for its own choice."""

    @property
    def stops_early(self) -> bool:
        """Whether runs that nothing is fitted to can stop the search."""
        return False

    @abstractmethod
    def data(
        self, recordings: Recording | Sequence[Recording], rows: Sequence[Mask] | None = None
    ) -> TrainingData:
        """Return what is learned from recordings, checked."""

    @abstractmethod
    def find(self, data: TrainingData, tracker: Tracker) -> tuple[Block, TrainingData]:
        """Return the block found, and the data with the memories at the start that belong to it."""

    def fit(
        self,
        recordings: Recording | Sequence[Recording],
        y: None = None,
        *,
        rows: Sequence[Mask] | None = None,
        validation: Sequence[Recording] = (),
        progress: bool | Progress | None = None,
    ) -> Self:
        """Find the block that runs free closest to the recordings.

        Parameters
        ----------
        recordings : Recording or sequence of Recording
            What to learn from; every one starts with a memory of its own.
        y : None
            Ignored; scikit-learn passes it.
        rows : sequence of bool arrays, optional
            For every recording, the samples whose outputs count.
        validation : sequence of Recording
            For searches that stop early; nothing is fitted to them, and most estimators have no use for
            them.
        progress : bool or callable, optional
            Whether to show a bar; or who is told the share of the work done and the best RMSE so far.

        Returns
        -------
        self
            With ``model_``, the block, and ``diagnostics_``.

        Raises
        ------
        DataError
            On recordings that cannot be learned from.
        ModelError
            On settings out of range.
        """
        before = dict(vars(self))
        try:
            with one_blas_thread(), telling(progress, "fitting") as tell:
                return self._fit(recordings, rows, validation, tell)
        except BaseException:  # a fit that fails, or is interrupted too early, leaves no traces
            vars(self).clear()
            vars(self).update(before)
            raise

    def _fit(
        self,
        recordings: Recording | Sequence[Recording],
        rows: Sequence[Mask] | None,
        validation: Sequence[Recording],
        progress: Progress | None,
    ) -> Self:
        started = time.perf_counter()
        self.check_settings()
        data = self.data(listed(recordings), rows)
        if early := listed(validation):
            data = replace(data, early=self.data(early))
        tracker = Tracker(progress=progress)
        block, data = self.find(data, tracker)
        tracker.end()
        diagnostics = self._diagnose(block, data, tracker, started)
        tracker.end()
        if progress is not None and not tracker.interrupted:
            progress(1.0, diagnostics.rmse)
        self.model_, self.diagnostics_ = block, diagnostics
        return self

    def check_settings(self) -> None:
        """Refuse settings that are not as they are declared.

        Raises
        ------
        ModelError
            Naming the setting, what it is, and what it may be.
        """
        check_settings(self)

    def predict(self, recordings: Recording | Sequence[Recording]) -> list[Array]:
        """Return the model's free-running output on every recording, from its inputs alone.

        Every run starts as a stream would: no measured output is looked at. Shape (n,), or (n, m) of
        a model of m outputs.
        """
        block = self.fitted
        names = [channel.name for channel in block.inputs]
        given = [channel.name for channel in block.outputs]
        every = listed(recordings)
        found = [block.simulate(r.select(names)).matrix(given) for r in every]
        return [outputs[:, 0] for outputs in found] if len(given) == 1 else found

    def score(self, recordings: Recording | Sequence[Recording], y: None = None) -> float:
        """Return R² over all recordings of what `predict` gives; of several outputs the mean."""
        every = listed(recordings)
        predicted = np.concatenate(self.predict(every))
        given = [channel.name for channel in self.fitted.outputs]
        measured = np.concatenate([recording.matrix(given) for recording in every])
        residual = measured - predicted.reshape(measured.shape)
        unexplained = (residual**2).sum(axis=0) / ((measured - measured.mean(axis=0)) ** 2).sum(
            axis=0
        )
        return float(1 - unexplained.mean())

    @property
    def fitted(self) -> Block:
        """The block found.

        Raises
        ------
        sklearn.exceptions.NotFittedError
            Before `fit`.
        """
        if not hasattr(self, "model_"):
            from sklearn.exceptions import NotFittedError

            raise NotFittedError(f"{type(self).__name__} is not fitted yet: call fit first")
        block: Block = self.model_
        return block

    def _diagnose(
        self, block: Block, data: TrainingData, tracker: Tracker, started: float
    ) -> Diagnostics:
        at_bounds = self.at_bounds(block)
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", ModelWarning)
            residual = data.target - self.free_runs([block], data)[0]
            from_rest = data.target - simulate_all([block], data.unstarted())[0]
        notes = dict.fromkeys([*tracker.notes, *sorted({str(one.message) for one in caught})])
        try:
            condition, covariance = self.uncertainty(block, data, residual, at_bounds)
        except KeyboardInterrupt:  # the model is found; only what is known about it is cut short
            tracker.interrupted = True
            condition, covariance = np.nan, unknown(block)
        by_output = _rms(residual.reshape(-1, len(data.outputs)))
        return Diagnostics(
            rmse=float(by_output.mean()),
            rmse_by_output=tuple(by_output.tolist()),
            rmse_from_rest=float(_rms(from_rest.reshape(-1, len(data.outputs))).mean()),
            n_samples=residual.size // len(data.outputs),
            n_evaluations=tracker.evaluations,
            seconds=time.perf_counter() - started,
            interrupted=tracker.interrupted,
            condition=condition,
            at_bounds=at_bounds,
            standard_errors=tuple(np.sqrt(np.diag(covariance)).tolist()),
            covariance=covariance,
            peaks=tuple(run.peak for run in data.runs),
            notes=tuple(notes),
        )

    def undetermined(self) -> tuple[int, ...]:
        """Return the places in ``model_.pack()`` of what the recordings do not determine.

        By default, the parameters at no bound whose standard errors are not known.
        """
        found = self.diagnostics_
        unknown = np.flatnonzero(np.isnan(found.standard_errors)).tolist()
        return tuple(place for place in unknown if place not in found.at_bounds)

    def free_runs(self, blocks: Sequence[Block], data: TrainingData) -> Array:
        """Return the free-running outputs of blocks where samples count, each run started as fitted.

        Shape (blocks, samples).
        """
        return simulate_started(blocks, data)

    def uncertainty(
        self, block: Block, data: TrainingData, residual: Array, at_bounds: Sequence[int]
    ) -> tuple[float, Array]:
        """Return the condition of the free parameters, and the covariance of all; see `Diagnostics`."""
        return covariance_of(block, data, residual, at_bounds)

    def at_bounds(self, block: Block) -> tuple[int, ...]:
        """Return the places of parameters that ended at a bound: by default those that are zero."""
        return tuple(np.flatnonzero(block.pack() == 0).tolist())


class ErrorsUnknown:
    """What an estimator inherits first whose fits do not tell how sure parameters are."""

    def uncertainty(
        self, block: Block, data: TrainingData, residual: Array, at_bounds: Sequence[int]
    ) -> tuple[float, Array]:
        """Return that neither condition nor covariance is known."""
        return np.nan, unknown(block)

    def undetermined(self) -> tuple[int, ...]:
        """Return none, since it is not known."""
        return ()


def _rms(residual: Array) -> Array:
    """Return the root mean square of every column."""
    with np.errstate(over="ignore", invalid="ignore"):  # a model that overflows has no finite error
        found: Array = np.sqrt(np.mean(residual**2, axis=0))
    return found


def resting(recordings: Sequence[Recording], inputs: Sequence[str]) -> str | None:
    """Return why nothing can be learned of what inputs do, if all rest in every recording; else None."""
    known = [r[name] for r in recordings for name in inputs if name in r]
    if not known or any(np.ptp(values) > 0 for values in known):
        return None
    return f"{' and '.join(inputs)} rests in every recording"
