"""What an estimator is: settings that find a block from recordings."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Annotated, ClassVar, Literal, Self

import numpy as np
from annotated_types import Interval
from numpy.typing import NDArray

from mckibben.blocks.base import Block
from mckibben.blocks.compose import Series
from mckibben.blocks.fields import Channel
from mckibben.blocks.negative import Negative
from mckibben.blocks.running import run_many
from mckibben.estimators.data import Mask, TrainingData, training_data
from mckibben.estimators.parameters import Parametrised
from mckibben.estimators.search import Progress, Tracker
from mckibben.estimators.settings import check_settings
from mckibben.recording import Recording
from mckibben.signals.checking import LARGEST_SEED
from mckibben.threads import one_blas_thread

Array = NDArray[np.float64]

LARGEST = 1e150
"""Sensitivity that still is one: its square is a number."""

DIFFERENCE = 1e-6
"""Step of finite differences, relative to the size of a parameter."""

Operators = Annotated[int, Interval(ge=1, le=1000)]
"""Number of operators."""


@dataclass(frozen=True)
class Diagnostics:
    """What a fit has to say of itself.

    Parameters
    ----------
    rmse : float
        Free-running RMSE on the samples fitted, in the unit of the output, each run started as fitted.
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
        One a parameter, as if residuals were independent; NaN for those at bounds or that the data
        do not determine.
    covariance : array, shape (n_parameters, n_parameters)
        The same, NaN likewise.
    peaks : tuple of float or None
        For every recording, the input from which it was taken to have come before its first sample.
    """

    rmse: float
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


@dataclass(kw_only=True, repr=False, eq=False)
class Estimator(Parametrised, ABC):
    """Settings common to all estimators; see scikit-learn for ``get_params``, ``clone`` and the like.

    Parameters
    ----------
    input, output : str
        Channels to learn from.
    initial : {"first_sample", "virgin", "fitted"}
        Memory before the first sample of every recording: as if the input had only risen; as if
        nothing had ever happened; or fitted with the rest, of which a model with hysteresis has one
        number a recording, the input from which it came down, and a linear one its whole state.
    seed : int
        Of everything random.
    """

    input: str = "pressure"
    output: str = "displacement"
    initial: Literal["first_sample", "virgin", "fitted"] = "first_sample"
    seed: Annotated[int, Interval(ge=0, le=LARGEST_SEED)] = 0

    made_for: ClassVar[tuple[str, str] | None] = None
    """Kinds of channel, input and output, that the model is about; None for any."""

    rises: ClassVar[bool] = True
    """Whether the block's output rises with its input, so that falling data are turned over."""

    effort: ClassVar[float] = 0.5
    """About how long a fit to 10 000 samples takes [s]: models are compared cheapest first."""

    @property
    def scheduling(self) -> tuple[str, ...]:
        """Channels that the model is given beside the input."""
        return ()

    @classmethod
    def objection(cls, recordings: Sequence[Recording], input: str, output: str) -> str | None:  # noqa: A002
        """Return why the model has no place in a comparison on recordings, or None."""
        kinds = (input.partition("_")[0], output.partition("_")[0])
        if cls.made_for is not None and kinds != cls.made_for:
            return f"it maps {cls.made_for[0]} to {cls.made_for[1]}"
        needed = cls(input=input, output=output).scheduling
        absent = [name for name in needed if any(name not in r for r in recordings)]
        return f"it needs the channel {absent[0]!r} too" if absent else None

    def fit(
        self,
        recordings: Recording | Sequence[Recording],
        y: None = None,
        *,
        rows: Sequence[Mask] | None = None,
        progress: Progress | None = None,
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
        progress : callable, optional
            Told the share of the work done and the best RMSE so far.

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
        del y
        with one_blas_thread():
            return self._fit(recordings, rows, progress)

    def _fit(
        self,
        recordings: Recording | Sequence[Recording],
        rows: Sequence[Mask] | None,
        progress: Progress | None,
    ) -> Self:
        started = time.perf_counter()
        self.check_settings()
        data = training_data(recordings, self.input, self.output, rows, self.scheduling)
        tracker = Tracker(progress=progress)
        if self.rises and data.falls:
            rising, used = self.identify(data.negated(), tracker)
            channel = self.channels(data)["output"]
            block: Block = Series((rising, Negative(channel, channel)))
            data = data.with_peaks([run.peak for run in used.runs])
        else:
            block, data = self.identify(data, tracker)
        tracker.end()
        self.model_ = block
        self.diagnostics_ = self._diagnose(block, data, tracker, started)
        tracker.end()
        if progress is not None:
            progress(1.0, self.diagnostics_.rmse)
        return self

    @abstractmethod
    def identify(self, data: TrainingData, tracker: Tracker) -> tuple[Block, TrainingData]:
        """Return the block found, and the data with the memories at the start that belong to it.

        The output of the data rises with the input; `fit` changes its sign where it does not.
        """

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

        Every run starts as a stream would: no measured output is looked at.
        """
        listed = [recordings] if isinstance(recordings, Recording) else list(recordings)
        block = self.fitted
        names = [channel.name for channel in block.inputs]
        return [block.simulate(r.select(names))[self.output] for r in listed]

    def score(self, recordings: Recording | Sequence[Recording], y: None = None) -> float:
        """Return R² over all recordings of what `predict` gives."""
        del y
        listed = [recordings] if isinstance(recordings, Recording) else list(recordings)
        measured = np.concatenate([recording[self.output] for recording in listed])
        residual = measured - np.concatenate(self.predict(listed))
        return float(1 - np.sum(residual**2) / np.sum((measured - measured.mean()) ** 2))

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

    def channels(self, data: TrainingData) -> dict[str, Channel]:
        """Return the channels of the block to build, as keyword arguments."""
        return {
            "input": Channel(data.input, data.input_unit),
            "output": Channel(data.output, data.output_unit),
        }

    @property
    def starting_rule(self) -> Literal["first_sample", "virgin"]:
        """The named rule behind `initial`."""
        return "virgin" if self.initial == "virgin" else "first_sample"

    def _diagnose(
        self, block: Block, data: TrainingData, tracker: Tracker, started: float
    ) -> Diagnostics:
        at_bounds = self.at_bounds(block)
        residual = data.target - self.free_runs([block], data)[0]
        try:
            condition, covariance = self.uncertainty(block, data, residual, at_bounds)
        except KeyboardInterrupt:  # the model is found; only what is known about it is cut short
            tracker.interrupted = True
            condition = np.nan
            covariance = np.full((block.n_parameters, block.n_parameters), np.nan)
        return Diagnostics(
            rmse=_rms(residual),
            rmse_from_rest=_rms(data.target - simulate_all([block], data.unstarted())[0]),
            n_samples=residual.size,
            n_evaluations=tracker.evaluations,
            seconds=time.perf_counter() - started,
            interrupted=tracker.interrupted,
            condition=condition,
            at_bounds=at_bounds,
            standard_errors=tuple(np.sqrt(np.diag(covariance)).tolist()),
            covariance=covariance,
            peaks=tuple(run.peak for run in data.runs),
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
        return simulate_all(blocks, data)

    def uncertainty(
        self, block: Block, data: TrainingData, residual: Array, at_bounds: Sequence[int]
    ) -> tuple[float, Array]:
        """Return the condition of the free parameters, and the covariance of all; see `Diagnostics`."""
        return _sensitivity(block, data, residual, at_bounds)

    def at_bounds(self, block: Block) -> tuple[int, ...]:
        """Return the places of parameters that ended at a bound: by default those that are zero."""
        return tuple(np.flatnonzero(block.pack() == 0).tolist())


def simulate_all(blocks: Sequence[Block], data: TrainingData) -> Array:
    """Return the free-running outputs of blocks at the samples that count, shape (k, samples)."""
    outputs = []
    for run in data.runs:
        many = run_many(blocks, run.inputs, sample_time=run.sample_time)
        trimmed = many[:, :, 0] if run.peak is None else many[:, 1:, 0]
        outputs.append(trimmed[:, run.counts])
    return np.concatenate(outputs, axis=1)


def _rms(residual: Array) -> float:
    with np.errstate(over="ignore", invalid="ignore"):  # a model that overflows has no finite error
        return float(np.sqrt(np.mean(residual**2)))


def _sensitivity(
    block: Block, data: TrainingData, residual: Array, fixed: Sequence[int]
) -> tuple[float, Array]:
    """Return the condition of the parameters that are free, and the covariance of all.

    From finite differences of the free-running output on a share of the samples. Parameters that
    are fixed, or that the data do not determine, have NaN; so have those at which the output
    overflows, and all of a model whose own output does.
    """
    parameters = block.pack()
    covariance = np.full((parameters.size, parameters.size), np.nan)
    free = [index for index in range(parameters.size) if index not in fixed]
    if not free:
        return np.inf, covariance
    thin = data.thinned(max(2000, 4 * parameters.size))
    sizes = relative_sizes(parameters)
    with np.errstate(over="ignore", invalid="ignore"):
        slopes = sensitivities(block, free, sizes[free], lambda blocks: simulate_all(blocks, thin))
        power = float(residual @ residual)
    finite = np.isfinite(slopes).all(axis=0) & (np.abs(slopes).max(axis=0, initial=0.0) < LARGEST)
    if not finite.any() or not np.isfinite(power):
        return np.inf, covariance
    condition, own = inverted(slopes[:, finite])
    places = np.array(free)[finite]
    variance = power / max(residual.size - len(free), 1) * len(slopes) / residual.size
    covariance[np.ix_(places, places)] = variance * own * np.outer(sizes[places], sizes[places])
    return condition if finite.all() else np.inf, covariance


def relative_sizes(parameters: Array) -> Array:
    """Return the sizes by which parameters are scaled; none is counted as very small."""
    return np.maximum(np.abs(parameters), 1e-3 * np.abs(parameters).max(initial=1e-3))


def sensitivities(
    block: Block, places: Sequence[int], sizes: Array, run: Callable[[list[Block]], Array]
) -> Array:
    """Return how outputs move with some parameters, each in units of its size, shape (n, k).

    Parameters
    ----------
    places : sequence of int, length k
        Of the parameters.
    sizes : array, shape (k,)
        Their sizes.
    run : callable
        Gives the outputs of blocks, shape (blocks, n).
    """
    parameters = block.pack()
    perturbed: list[Block] = [block]
    for place, size in zip(places, sizes, strict=True):
        moved = parameters.copy()
        moved[place] += DIFFERENCE * size
        perturbed.append(block.unpack(moved))
    base, *others = run(perturbed)
    return np.column_stack([other - base for other in others]) / DIFFERENCE


def inverted(slopes: Array) -> tuple[float, Array]:
    """Return the condition of scaled slopes, shape (n, k), and the inverse of their products, (k, k).

    Rows and columns of what the slopes do not determine are NaN.
    """
    singular, right = np.linalg.svd(slopes, full_matrices=False)[1:]
    condition = float(singular[0] / singular[-1]) if singular[-1] > 0 else np.inf
    kept = singular > 1e-6 * singular[0]
    inverse = (right[kept].T / singular[kept] ** 2) @ right[kept]
    determined = 1 - (right[~kept] ** 2).sum(axis=0) > 0.99
    inverse[~determined] = np.nan
    inverse[:, ~determined] = np.nan
    return condition, inverse
