"""Base class of estimators: settings that identify a block from recordings.

A subclass declares its settings as fields and defines `Estimator.find`, which returns the block for
`TrainingData`. `Estimator.fit` prepares the data, calls it, and adds `Diagnostics`; comparisons, studies
and scikit-learn call `fit`, `predict` and `score`.
"""

from __future__ import annotations

import sys
import time
import warnings
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, fields, is_dataclass, replace
from functools import cached_property, partial
from inspect import get_annotations
from typing import Annotated, Any, ClassVar, Literal, Self, dataclass_transform, get_type_hints

import numpy as np
from annotated_types import Interval
from numpy.typing import ArrayLike
from pydantic import ConfigDict, TypeAdapter, ValidationError

from mckibben.arrays import Array, Mask
from mckibben.blocks.base import Block
from mckibben.blocks.fields import Channel
from mckibben.blocks.free_runs import FreeRuns, as_it_is
from mckibben.channels import Channels, Names, channels_of, quantity
from mckibben.errors import MckibbenError, ModelError, ModelWarning
from mckibben.estimators.core.arguments import (
    Outputs,
    is_array,
    recorded,
    require_outputs,
    squeezed,
    timed,
)
from mckibben.estimators.core.data import TrainingData, training_data
from mckibben.estimators.core.leaving_out import outputs_without_parts
from mckibben.estimators.core.uncertainty import covariance_of, unknown, vanishing
from mckibben.numerics.tracker import Progress, Tracker
from mckibben.recording import REST_LENGTH, Recording, base_name, conversion, is_frame, listed
from mckibben.signals.checking import LARGEST_SEED
from mckibben.system.progress import telling
from mckibben.system.threads import one_blas_thread

Operators = Annotated[int, Interval(ge=1, le=1000)]
"""Number of operators."""

Purpose = Literal["memory", "rate", "several", "force"]
"""Purpose of a model: hysteresis of one muscle, dynamics, several muscles or loads, force."""

InverseKind = Literal["exact", "exact where stable", "solved", "none"]
"""Kind of inverse: closed form, closed form whose stability depends on the fit, solved in every
sample, or none.
"""

Grid = Mapping[str, tuple[Any, ...]]
"""Setting -> candidate values."""


Start = Literal["first_sample", "virgin"]
"""State before the first sample of every recording: what its first output determines, and at rest at
the first input for the rest (see `mckibben.blocks.starts`); or as if nothing had ever happened.
"""

STRICT_SETTINGS = ConfigDict(strict=True, allow_inf_nan=False)

MOST_PASTS, LEAST_EFFECT = 3, 0.1
"""Maximum number of fits after pasts that the last fit shows; and the effect of these on outputs, or the
reduction of the error, relative to the error, for another.
"""


@dataclass(frozen=True)
class Diagnostics:
    """Diagnostics of a fit.

    Errors are those of free runs on the samples fitted, in the unit of the output, which begin as those
    of `simulate` on these recordings; of several outputs the mean of theirs.
    """

    rmse: float
    rmse_by_output: tuple[float, ...]
    rmse_from_rest: float
    """RMSE with every run started from rest, without known outputs, as in a stream or generated
    code.
    """

    n_samples: int
    n_free: int
    """Number of free parameters of the fit; tables count them as parameters."""

    n_evaluations: int
    """Number of evaluations of the model in the search."""

    seconds: float
    at_bounds: tuple[int, ...]
    """Indices, in ``model_.pack()``, of the parameters at a bound."""

    notes: tuple[str, ...]
    """Notes for the user."""

    uncertainty: Callable[[], tuple[float, Array]] = field(repr=False)
    """Has `condition` and `covariance`, computed on first access."""

    @cached_property
    def _uncertainty(self) -> tuple[float, Array]:
        with one_blas_thread():
            return self.uncertainty()

    def __getstate__(self) -> dict[str, Any]:
        """Return what is pickled: the uncertainty itself, not the recordings that it is found from."""
        return vars(self) | {"uncertainty": partial(tuple, self._uncertainty)}

    @property
    def condition(self) -> float:
        """Condition number of the sensitivity of the output to the free parameters.

        Each parameter is scaled by its own size.
        """
        return self._uncertainty[0]

    @property
    def covariance(self) -> Array:
        """Covariance of the parameters for autocorrelated residuals, shape (n_parameters, n_parameters).

        NaN for parameters at bounds or that the data do not determine, unless the estimator expects them
        to be of some scale.
        """
        return self._uncertainty[1]

    @property
    def standard_errors(self) -> tuple[float, ...]:
        """Standard error of every parameter, NaN as in `covariance`."""
        return tuple(np.sqrt(np.diag(self.covariance)).tolist())


@dataclass_transform(kw_only_default=True, eq_default=False)
@dataclass(kw_only=True, repr=False, eq=False)
class Estimator(ABC):
    """Base class of all estimators; one input and one output unless a class overrides that.

    Settings are the fields of the class, to be read, changed, cloned and searched over by scikit-learn.
    Every subclass is a dataclass without a decorator. One that only assigns other defaults and
    declarations is a preset: the same model under a name and title of its own.

    Parameters
    ----------
    input, output : str or sequence of str
        Channels to learn from.
    seed : int
        Of everything random.
    """

    seed: Annotated[int, Interval(ge=0, le=LARGEST_SEED)] = 0
    input: str | tuple[str, ...] | None = "pressure"
    output: str | tuple[str, ...] | None = "displacement"

    title: ClassVar[str] = ""
    """Full name of the model; by default its short name."""

    purpose: ClassVar[Purpose | None] = None
    """Purpose by which models are grouped; None groups it under others."""

    can: ClassVar[str] = ""
    """What it represents, in one sentence; by default the first line of the docstring."""

    cannot: ClassVar[str] = ""
    """What it does not represent, in one sentence."""

    caution: ClassVar[str | None] = None
    """Why it is reliable only near its training motions; None if it extrapolates."""

    inverse_kind: ClassVar[InverseKind] = "none"
    """Usual kind of inverse of its models; a fitted model may have none."""

    quick: ClassVar[bool] = False
    """Whether it is in the quick selection: established or accurate, and fitted in seconds."""

    long: ClassVar[bool] = False
    """Whether it takes long, so that a comparison of all models leaves it out where it is not named."""

    targets: ClassVar[Mapping[str, Mapping[str, Any]]] = {}
    """Export format -> settings with which a model can be exported to it."""

    param_grid: ClassVar[Grid] = {}
    """Setting -> values for choosing orders by cross-validation."""

    makes: ClassVar[tuple[str, ...]] = ()
    """Models that it can refit with as many operators, each by the kinds of its parts in order."""

    effort: ClassVar[float] = 0.5
    """Approximate time of a fit to 10 000 samples [s], by which comparisons order their work."""

    needs_time: ClassVar[bool] = False
    """Whether recordings must have time."""

    made_for: ClassVar[tuple[str, str] | None] = None
    """Kinds of its input and output channels, whose defaults they are; None for any."""

    input_settings: ClassVar[tuple[str, ...]] = ()
    """Settings that name further input channels, of the block as well."""

    begins_measured: ClassVar[bool] = False
    """Whether the fit itself begins every run from its first output, as the model does; others are
    fitted from rest, and again after the pasts that this fit shows.
    """

    errors_known: ClassVar[bool] = True
    """Whether standard errors of the parameters are computed."""

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        if made_for := vars(cls).get("made_for"):
            cls.input, cls.output = made_for
        annotations, base = get_annotations(cls), next(filter(is_dataclass, cls.__mro__[1:]))
        inherited = {setting.name for setting in fields(base)}
        if (
            changed := inherited & vars(cls).keys() - annotations.keys()
        ):  # defaults, of the types of the base
            hints = get_type_hints(base, include_extras=True)
            cls.__annotations__ = annotations | {name: hints[name] for name in changed}
        dataclass(kw_only=True, repr=False, eq=False)(cls)

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """Return the settings by name; ``deep`` has no effect."""
        return {name: getattr(self, name) for name in self._names()}

    def set_params(self, **settings: Any) -> Self:
        """Change settings.

        Raises
        ------
        ValueError
            On a name that is none of them.
        """
        if unknown := settings.keys() - set(self._names()):
            raise ValueError(
                f"{sorted(unknown)[0]!r} is no setting of {type(self).__name__}: "
                f"choose among {', '.join(self._names())}."
            )
        for name, value in settings.items():
            setattr(self, name, value)
        return self

    def __repr__(self) -> str:
        defaults, texts = (
            {k: repr(v) for k, v in e.get_params().items()} for e in (type(self)(), self)
        )
        changed = [f"{name}={text}" for name, text in texts.items() if text != defaults[name]]
        return f"{type(self).__name__}({', '.join(changed)})"

    def __sklearn_tags__(self) -> Any:
        # scikit-learn alone asks, so it is there already
        from sklearn.base import BaseEstimator, RegressorMixin

        tags = type("Regressor", (RegressorMixin, BaseEstimator), {})().__sklearn_tags__()
        tags.input_tags.one_d_array = isinstance(self.input, str) and not self._further_inputs()
        # it is of data of ten columns, of which one matters
        tags.regressor_tags.poor_score = self.input is not None
        single = isinstance(self.output, str) or (self.output is not None and len(self.output) == 1)
        tags.target_tags.multi_output = not single
        tags.target_tags.single_output = single or self.output is None
        return tags

    @property
    def n_features_in_(self) -> int:
        """Number of columns of an array of its inputs."""
        return len(self.fitted.inputs)

    @classmethod
    def _names(cls) -> list[str]:
        return sorted(setting.name for setting in fields(cls))

    @classmethod
    def resolved(
        cls,
        recordings: Sequence[Recording],
        inputs: Names = None,
        outputs: Names = None,
        scheduling: Names = None,
    ) -> Channels:
        """Return the channels to fit: as named, as the model is made for, or found by `channels_of`."""
        driving = cls.input if inputs is None and cls.input != Estimator.input else inputs
        modelled = cls.output if outputs is None and cls.output != Estimator.output else outputs
        return channels_of(recordings, driving, modelled, scheduling)

    @classmethod
    def objection(cls, recordings: Sequence[Recording], channels: Channels) -> str | None:
        """Return why the model does not apply to recordings, or None."""
        if len(channels.inputs) != 1 or len(channels.outputs) != 1:
            return "it is of one input and one output"
        roles = cls.own_roles(channels)
        if roles.scheduling:
            return "the load is not one of its inputs"
        (input_,), (output,) = roles.inputs, roles.outputs
        kinds = (base_name(input_), base_name(output))
        if cls.made_for is not None and kinds != cls.made_for:
            convertible = kinds[1] == cls.made_for[1] and conversion(cls.made_for[0], kinds[0], 1.0)
            remedy = (
                f": name that as the input, and state {REST_LENGTH}, which makes it of {kinds[0]}"
            )
            return f"it maps {cls.made_for[0]} to {cls.made_for[1]}{remedy if convertible else ''}"
        further = cls(**cls.channel_settings(channels))._further_inputs()
        absent = [name for name in further if any(name not in r for r in recordings)]
        if absent:
            return f"it needs the channel {absent[0]!r} too"
        return None if cls.input_settings else resting(recordings, roles.inputs)

    @classmethod
    def channel_settings(cls, channels: Channels) -> dict[str, Any]:
        """Return the settings that select channels."""
        roles = cls.own_roles(channels)
        input_, output = roles.pair
        kinds = {quantity(name): name for name in reversed(roles.offered)}
        further = {name: kinds[name] for name in cls.input_settings if name in kinds}
        return {"input": input_, "output": output, **further}

    @classmethod
    def own_roles(cls, channels: Channels) -> Channels:
        """Return the channels with what schedules among those offered, if the model takes it.

        A model that takes one further input does not mind which of the two drives: force by length and
        pressure is one law, whichever is held.
        """
        inputs, scheduling = channels.inputs, channels.scheduling
        if len(cls.input_settings) == len(inputs) == len(scheduling) == 1:
            if cls.input_settings[0] == quantity(inputs[0]):
                return replace(channels, inputs=scheduling, scheduling=(), offered=inputs)
            if cls.input_settings[0] == quantity(scheduling[0]):
                return replace(channels, scheduling=(), offered=scheduling)
        return channels

    def channels(self, data: TrainingData) -> dict[str, Channel]:
        """Return the channels of the block to build, as keyword arguments."""
        scheduled = zip(self.input_settings, data.scheduled, strict=True)
        return {"input": data.inputs[0], "output": data.outputs[0], **dict(scheduled)}

    @property
    def starting_rule(self) -> Start:
        """Start rule of the block: `initial`, where that is a setting."""
        return "virgin" if self.get_params().get("initial") == "virgin" else "first_sample"

    def common_fields(self, data: TrainingData) -> dict[str, Any]:
        """Return the common fields of blocks with memory: input range, start, channels."""
        memory_fields = {"input_range": data.input_range, "initial": self.starting_rule}
        return memory_fields | self.channels(data)

    def _further_inputs(self) -> tuple[str, ...]:
        return tuple(getattr(self, name) for name in self.input_settings)

    @property
    def fixed_fields(self) -> tuple[str, ...]:
        """Fields of the model that are not fitted, each as kind and field, joined by a dot."""
        return ()

    def fixed(self, block: Block) -> tuple[int, ...]:
        """Return the indices in ``block.pack()`` that are not fitted.

        They are no parameters of the model fitted. By default those of `fixed_fields`.
        """
        fields = self.fixed_fields
        return tuple(
            index
            for index, (part, field, _) in enumerate(block.numbers() if fields else ())
            if f"{part.kind}.{field}" in fields
        )

    @property
    def n_further(self) -> int:
        """Number of fitted values that are not in ``model_.pack()``."""
        return 0

    def data(
        self, recordings: Recording | Sequence[Recording], rows: Sequence[Mask] | None = None
    ) -> TrainingData:
        """Return the training data from recordings, checked."""
        # models of several muscles begin anew after rows left out, and so are fitted to bridges too
        measured = [~one.bridged for one in listed(recordings)]
        scored = measured if rows is None else map(np.logical_and, rows, measured)
        assert self.input is not None
        assert self.output is not None
        return training_data(
            recordings, self.input, self.output, list(scored), self._further_inputs()
        )

    @abstractmethod
    def find(self, data: TrainingData, tracker: Tracker) -> Block:
        """Return the identified block."""

    def find_again(self, data: TrainingData, tracker: Tracker) -> Block:
        """Return the block identified once more, from data that begin after the pasts it shows."""
        return self.find(data, tracker)

    def fit(
        self,
        recordings: Recording | Sequence[Recording] | ArrayLike,
        y: ArrayLike | None = None,
        *,
        sample_time: float | None = None,
        rows: Sequence[Mask] | None = None,
        progress: bool | Progress | None = None,
    ) -> Self:
        """Fit the block to recordings by its free-running error.

        Parameters
        ----------
        recordings : Recording, data frame, or sequence of these; or array, shape (n,) or (n, inputs)
            Training data; every recording starts with its own memory. With ``y``, an array of the
            inputs, in the package's units: of `input`, then what settings name besides.
        y : array, shape (n,) or (n, outputs), or list of these, optional
            The outputs: of the array, or in place of those of the recordings.
        sample_time : float, optional
            Between samples of arrays [s].
        rows : sequence of bool arrays, optional
            For every recording, the samples whose outputs are scored.
        progress : bool or callable, optional
            Whether to show a bar; or a callback for the share done and the best RMSE so far.

        Returns
        -------
        self
            With ``model_``, the block, and ``diagnostics_``.

        Raises
        ------
        DataError
            On recordings that cannot be learned from.
        ModelError
            On settings out of range, or if the model found is no better than the mean of the output:
            then ``model_`` and ``diagnostics_`` are there to look at.
        """
        owner = type(self).__name__
        require_outputs(recordings, y, owner)
        inputs, outputs = ((a,) if isinstance(a, str) else a for a in (self.input, self.output))
        if inputs is not None:
            scheduling = self.get_params().get("scheduling") or ()
            inputs = (*inputs, *self._further_inputs(), *scheduling)
        if y is not None and outputs is None and not is_array(recordings):
            outputs = self._outputs(listed(recordings))
        runs = recorded(recordings, inputs, y, outputs, sample_time, owner)
        fitted = copy(self)  # a fit that fails or is interrupted leaves no traces
        with one_blas_thread(), telling(progress, "fitting") as tell:
            data = fitted._fit(runs, rows, tell)
        vars(self).update(vars(fitted))
        self.sample_time_ = sample_time
        refuse_useless(self.diagnostics_, data)
        return self

    def _fit(
        self,
        recordings: Sequence[Recording],
        rows: Sequence[Mask] | None,
        progress: Progress | None,
    ) -> TrainingData:
        begin = time.perf_counter()
        self.check_settings()
        tracker = Tracker(progress=progress)
        data = self.data(recordings, rows)
        if self.needs_time:
            data.timed()
        self.model_ = self.find(data, tracker)
        runs = self.free_runs(self.model_, recordings, rows)
        may_begin_moved = not self.begins_measured and any(map(len, runs.pasts))
        if may_begin_moved and runs.apart(runs.from_rest) > LEAST_EFFECT * runs.rmse:
            runs = self._after_pasts(runs, recordings, rows, tracker)
        self.diagnostics_ = self._diagnose(runs, data, tracker, begin)
        if progress is not None:
            progress(1.0, self.diagnostics_.rmse)
        return data

    def _after_pasts(
        self,
        runs: FreeRuns,
        recordings: Sequence[Recording],
        rows: Sequence[Mask] | None,
        tracker: Tracker,
    ) -> FreeRuns:
        """Fit again to recordings that begin after the pasts which the fit from rest shows."""
        for _ in range(MOST_PASTS):
            again = copy(self)
            try:
                data = again.data(*preceded(recordings, runs))
                again.model_ = again.find_again(data, tracker)
                runs_after = again.free_runs(again.model_, recordings, rows)
            except MckibbenError:  # the fit from rest remains
                break
            before, after = runs.rmse, runs_after.rmse
            if after < before:
                vars(self).update(vars(again))
                runs = runs_after
            if not after < (1.0 - LEAST_EFFECT) * before:
                break
        return runs

    def check_settings(self) -> None:
        """Raise an error for settings that violate their declarations.

        Raises
        ------
        ModelError
            Naming the setting, what it is, and what it may be.
        """
        hints = get_type_hints(type(self), include_extras=True)
        for name, raw in self.get_params().items():
            value = raw.tolist() if isinstance(raw, np.generic | np.ndarray) else raw
            try:
                TypeAdapter(hints[name], config=STRICT_SETTINGS).validate_python(value)
            except ValidationError as error:
                message = error.errors()[0]["msg"]
                raise ModelError(
                    f"it is {value!r}: {message[0].lower()}{message[1:]}",
                    parameter=name,
                    remedy="give another, or leave it out",
                ) from None

    def predict(
        self,
        recordings: Recording | Sequence[Recording] | ArrayLike,
        *,
        sample_time: float | None = None,
    ) -> Any:
        """Return the model's free-running output, as `simulate` of the model does.

        A recording that has the output begins from its first sample, an array of inputs at rest.

        Parameters
        ----------
        recordings : Recording, data frame, or array of inputs; or sequence of recordings
        sample_time : float, optional
            Between samples of arrays and of frames without time [s]; default as given to `fit`.

        Returns
        -------
        array, shape (n,), or (n, m) of a model of m outputs
            Of one recording; `Outputs`, a sequence of these, of several.
        """
        runs, outputs = self._of_model(recordings, None, sample_time)
        outputs_of_runs = (self.fitted.simulate(run).matrix(outputs) for run in runs)
        predictions = Outputs(tuple(map(squeezed, outputs_of_runs)))
        is_single = (
            isinstance(recordings, Recording) or is_frame(recordings) or is_array(recordings)
        )
        return predictions[0] if is_single else predictions

    def _of_model(
        self, recordings: Any, y: Any, sample_time: float | None
    ) -> tuple[list[Recording], list[str]]:
        """Return recordings with the channels of the model, and its outputs."""
        block = self.fitted
        inputs, outputs = ([c.name for c in side] for side in (block.inputs, block.outputs))
        runs = recorded(recordings, inputs, y, outputs, sample_time, type(self).__name__)
        default_time = self.sample_time_
        runs = [timed(run, default_time) if run.sample_time is None else run for run in runs]
        return runs, outputs

    def measured(self, recordings: Recording | Sequence[Recording]) -> Outputs:
        """Return the measured outputs, as `predict` returns those of the model.

        They are the ``y`` for scorers of scikit-learn, as ``"neg_mean_absolute_error"``, on recordings.
        """
        runs = listed(recordings)
        outputs = self._outputs(runs)
        return Outputs(tuple(squeezed(run.matrix(outputs)) for run in runs))

    def _outputs(self, recordings: Sequence[Recording]) -> tuple[str, ...]:
        """Return the channels of the outputs: as named, or found."""
        if self.output is None:
            scheduling = self.get_params().get("scheduling")
            return self.resolved(recordings, self.input, None, scheduling).outputs
        return (self.output,) if isinstance(self.output, str) else self.output

    def score(
        self,
        recordings: Recording | Sequence[Recording] | ArrayLike,
        y: ArrayLike | None = None,
        *,
        sample_time: float | None = None,
    ) -> float:
        """Return R² of `predict` over all recordings, or arrays as of `fit`, averaged over outputs."""
        require_outputs(recordings, y, type(self).__name__)
        runs, outputs = self._of_model(recordings, y, sample_time)
        predicted = np.concatenate(self.predict(runs))
        measured = np.concatenate([recording.matrix(outputs) for recording in runs])
        residual = measured - predicted.reshape(measured.shape)
        around = measured - measured.mean(axis=0)
        unexplained = (residual**2).sum(axis=0) / (around**2).sum(axis=0)
        return float(1 - unexplained.mean())

    @property
    def fitted(self) -> Block:
        """The fitted block.

        Raises
        ------
        sklearn.exceptions.NotFittedError
            Before `fit`; an AttributeError without scikit-learn.
        """
        if not hasattr(self, "model_"):
            # whoever expects the class of scikit-learn has imported it
            sklearn_errors = sys.modules.get("sklearn.exceptions")
            kind = AttributeError if sklearn_errors is None else sklearn_errors.NotFittedError
            raise kind(f"{type(self).__name__} is not fitted yet: call fit first")
        block: Block = self.model_
        return block

    def _diagnose(
        self, runs: FreeRuns, data: TrainingData, tracker: Tracker, begin: float
    ) -> Diagnostics:
        block, at_bounds = runs.block, self.at_bounds(runs.block, data)
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", ModelWarning)
            by_output, from_rest = runs.errors, runs.from_rest.errors
        notes = dict.fromkeys([*tracker.notes, *sorted({str(w.message) for w in caught})])
        return Diagnostics(
            rmse=float(np.mean(by_output)),
            rmse_by_output=by_output,
            rmse_from_rest=float(np.mean(from_rest)),
            n_samples=runs.residual.size // len(runs.names),
            n_free=block.n_parameters - len(self.fixed(block)) + self.n_further,
            n_evaluations=tracker.evaluations,
            seconds=time.perf_counter() - begin,
            at_bounds=at_bounds,
            notes=tuple(notes),
            # of the estimator as it is now: it may be changed or fitted again
            uncertainty=partial(copy(self).uncertainty, runs, at_bounds),
        )

    def undetermined(self) -> tuple[int, ...]:
        """Return the indices in ``model_.pack()`` of undetermined parameters.

        By default, the parameters at no bound whose standard errors are not known.
        """
        if not self.errors_known:
            return ()
        diagnostics = self.diagnostics_
        unknown = np.flatnonzero(np.isnan(diagnostics.standard_errors)).tolist()
        excluded = {*diagnostics.at_bounds, *self.fixed(self.fitted)}
        return tuple(index for index in unknown if index not in excluded)

    def free_runs(
        self, block: Block, recordings: Sequence[Recording], rows: Sequence[Mask] | None = None
    ) -> FreeRuns:
        """Return the free runs of a block over recordings."""
        return FreeRuns.of(block, recordings, rows)

    def left_out(self, runs: FreeRuns, parts: Sequence[Mask]) -> list[list[Array]] | None:
        """Return the outputs of the model as it would be without each part of its data.

        By a step from the fit, or in closed form; see `mckibben.estimators.core.leaving_out`. A setting
        `ridge` is of each parameter's own effect on the output.
        """
        block, ridge = runs.block, self.get_params().get("ridge", 0.0)
        fixed = {*self.diagnostics_.at_bounds, *self.fixed(block)}
        free = [index for index in range(block.n_parameters) if index not in fixed]
        return outputs_without_parts(runs, free, ridge, parts)

    def held_out(
        self, recordings: Sequence[Recording], parts: Sequence[Sequence[Mask]]
    ) -> list[Array] | None:
        """Return the outputs over recordings that were fitted, each part by the model without it.

        Parameters
        ----------
        recordings : sequence of Recording
            Those that the estimator was fitted to.
        parts : sequence of sequence of array of bool, shape (n,)
            For every part, its samples of every recording.

        Returns
        -------
        list of array, shape (n, m), or None
            None of a model with more parameters than a step is computed for.
        """
        # as the model is delivered, without loads of the recordings' own
        runs = replace(self.free_runs(self.fitted, recordings), changed=as_it_is)
        m = len(runs.names)
        without = self.left_out(runs, [runs.scored(part).repeat(m) for part in parts])
        if without is None:
            return None
        result = [table.copy() for table in runs.modelled]
        for part, tables in zip(parts, without, strict=True):
            for outputs, table, rows in zip(result, tables, part, strict=True):
                outputs[rows] = table[rows]
        return result

    def uncertainty(self, runs: FreeRuns, at_bounds: Sequence[int]) -> tuple[float, Array]:
        """Return the condition of the free parameters, and the covariance of all; see `Diagnostics`."""
        if not self.errors_known:
            return np.nan, unknown(runs.block)
        return covariance_of(runs, sorted({*at_bounds, *self.fixed(runs.block)}))

    def at_bounds(self, block: Block, data: TrainingData) -> tuple[int, ...]:
        """Return the indices of parameters at a bound: by default those equal to zero."""
        return tuple(np.flatnonzero(vanishing(block.pack())).tolist())


class SearchEstimator(Estimator):
    """An estimator of one input and one output with its own search.

    Parameters
    ----------
    initial : {"first_sample", "virgin"}
        Memory before the first sample of every recording: what its first output determines, else at rest
        at the first input; or as if nothing had ever happened.
    """

    input: str = "pressure"
    output: str = "displacement"
    initial: Start = "first_sample"


def refuse_useless(diagnostics: Diagnostics, data: TrainingData) -> None:
    """Raise a `ModelError` if free runs on training data explain no more than the mean of the outputs.

    Of several outputs the mean of their unexplained shares counts, as in `Estimator.score`.
    """
    errors, spread = np.array(diagnostics.rmse_by_output), data.spread
    if not np.mean((errors / spread) ** 2) < 1.0:  # also where an error is not a number
        outputs = zip(data.outputs, errors, spread, strict=True)
        figures = (
            f"{c.name} {error:.4g} {c.unit}, of its mean {spread_of:.4g}"
            for c, error, spread_of in outputs
        )
        raise ModelError(
            f"the model found explains no more than the mean: RMSE on its data {'; '.join(figures)}",
            remedy="change its settings, or fit another model: `compare()` ranks those that apply",
        )


def preceded(recordings: Sequence[Recording], runs: FreeRuns) -> tuple[list[Recording], list[Mask]]:
    """Return recordings with the pasts of their runs before them, and the samples that count."""
    names, result, scored = [channel.name for channel in runs.block.inputs], [], []
    for recording, past, rows in zip(recordings, runs.pasts, runs.rows, strict=True):
        columns = dict(zip(names, past.T, strict=True))
        channels = {
            name: np.concatenate([columns.get(name, np.full(len(past), samples[0])), samples])
            for name, samples in recording.with_derived(names).channels.items()
        }
        begin = recording.start_time - len(past) * recording.step
        result.append(replace(recording, channels=channels, start_time=begin))
        scored.append(np.concatenate([np.zeros(len(past), dtype=bool), rows]))
    return result, scored


def resting(recordings: Sequence[Recording], inputs: Sequence[str]) -> str | None:
    """Return why inputs cannot be identified, if all rest in every recording; else None."""
    samples = [r[name] for r in recordings for name in inputs if name in r]
    if not samples or any(np.ptp(values) > 0 for values in samples):
        return None
    return f"{' and '.join(inputs)} rests in every recording"
