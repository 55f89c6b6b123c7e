"""Identification of continuous-time process models P1 to P3, by free-run errors."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, Literal

import numpy as np
from annotated_types import Ge
from numpy.typing import NDArray

from mckibben.blocks.base import Block
from mckibben.blocks.dynamic.process_model import LONGEST_DELAY, ProcessModel
from mckibben.errors import DataError
from mckibben.estimators.data import Run, TrainingData
from mckibben.estimators.linear.starts import LinearEstimator
from mckibben.estimators.search import Tracker
from mckibben.estimators.separable import SeparableEstimator

Array = NDArray[np.float64]

Structure = Literal["P1", "P1Z", "P2", "P2Z", "P2U", "P2UZ", "P3"]


@dataclass(kw_only=True, repr=False, eq=False)
class ProcessModelEstimator(LinearEstimator, SeparableEstimator):
    """Process model by variable projection: gain and zero are solved for, the poles searched.

    Parameters
    ----------
    fit_delay : bool
        Whether a delay of up to a quarter of the longest run is searched too.
    hold : {"first", "zero"}
        What the input does between samples.
    """

    effort: ClassVar[float] = 0.3

    fit_delay: bool = False
    hold: Literal["first", "zero"] = "first"
    nonnegative: bool = False
    n_starts: Annotated[int, Ge(1)] = 16
    n_refined: Annotated[int, Ge(1)] = 4

    rises: ClassVar[bool] = False
    searches_condensed: ClassVar[bool] = False
    fits_peaks: ClassVar[bool] = False

    @property
    @abstractmethod
    def structure(self) -> Structure:
        """MATLAB's name."""

    def identify(self, data: TrainingData, tracker: Tracker) -> tuple[Block, TrainingData]:
        """Return the block found, and the data with the memories at the start that belong to it."""
        if data.sample_time is None:
            raise DataError(
                "the recordings have no time, and this model depends on rate",
                remedy="read them with a time column or --rate, or use gpi",
            )
        return super().identify(data, tracker)

    def uncertainty(
        self, block: Block, data: TrainingData, residual: Array, at_bounds: Sequence[int]
    ) -> tuple[float, Array]:
        """Return the condition and covariance from free-run errors; the input's offset is set."""
        del residual
        return self.free_run_covariance(block, data, [*at_bounds, block.n_parameters - 2])

    def undetermined(self) -> tuple[int, ...]:
        """Return also a gain, a time constant or a zero within two standard errors of 0.

        A zero that all but cancels a pole leaves them so, and what depends on them uncertain too.
        """
        values, errors = self.fitted.pack(), self.diagnostics_.standard_errors
        names = self.fitted.parameter_names
        vague = {
            place
            for place, (value, error) in enumerate(zip(values, errors, strict=True))
            if abs(value) < 2 * error and "offset" not in names[place]
        }
        return tuple(sorted({*super().undetermined(), *vague}))

    @property
    def n_times(self) -> int:
        """Time constants searched."""
        return 1 if "U" in self.structure else int(self.structure[1])

    def bounds(self, data: TrainingData) -> tuple[Array, Array]:
        """Return bounds of [log time constants, log damping, delay]."""
        step = data.sample_time or 1.0
        longest = max(run.u.size for run in data.runs) * step
        lower, upper = [np.log(step)] * self.n_times, [np.log(10 * longest)] * self.n_times
        if "U" in self.structure:
            lower.append(np.log(0.02))
            upper.append(np.log(100.0))
        if self.fit_delay:
            lower.append(0.0)
            upper.append(min(0.25 * longest, (LONGEST_DELAY - 1) * step))
        return np.array(lower), np.array(upper)

    def guesses(self, data: TrainingData) -> list[Array]:
        """Return lags of a few speeds."""
        lower, upper = self.bounds(data)
        return [lower + share * (upper - lower) for share in (0.2, 0.4, 0.6, 0.8)]

    def unit(self, theta: Array, data: TrainingData, gain: float = 1.0) -> ProcessModel:
        """Return the model without zero and offsets."""
        n = self.n_times
        damping = float(np.exp(theta[n])) if "U" in self.structure else None
        times = np.sort(np.exp(theta[:n]))[::-1]
        return ProcessModel(
            gain,
            tuple(times.tolist()),
            damping,
            None,
            float(theta[-1]) if self.fit_delay else 0.0,
            data.input_range[0],
            0.0,
            self.hold,
            self.initial,
            **self.channels(data),
        )

    def _units(self, theta: Array, data: TrainingData) -> tuple[ProcessModel, ProcessModel]:
        """Return the model without zero, and with one."""
        unit = self.unit(theta, data)
        return unit, replace(unit, zero_time=1.0)

    def basis(self, theta: Array, run: Run, data: TrainingData) -> Array:
        """Return the response to the input, and, with a zero, to its derivative."""
        unit, with_zero = data.latest("units", theta, lambda: self._units(theta, data))
        step = run.sample_time
        columns = [unit.simulate(run.history, sample_time=step)]
        if "Z" in self.structure:
            whole = with_zero.simulate(run.history, sample_time=step)
            columns.append(whole - columns[0])
        return np.column_stack(columns)

    def matrix(self, theta: Array, data: TrainingData) -> Array:
        """Return the basis and, where starts are fitted, what the lags of every run start with."""
        from scipy.linalg import block_diag

        columns = super().matrix(theta, data)
        if self.initial != "fitted":
            return columns
        unit = self._units(theta, data)[0]
        starts = [unit.free_responses(run.u.size, run.sample_time)[run.counts] for run in data.runs]
        return np.column_stack([columns, block_diag(*starts)])

    def build(self, theta: Array, linear: Array, offset: float, data: TrainingData) -> ProcessModel:
        """Return the model."""
        gain = float(linear[0])
        zero = float(linear[1] / gain) if "Z" in self.structure and gain != 0 else None
        if "Z" in self.structure and zero is None:
            zero = 0.0
        return replace(self.unit(theta, data, gain), zero_time=zero, output_offset=offset)

    def parameter_bounds(self, data: TrainingData) -> tuple[Block, Array, Array]:
        """Return the model solved for at a guess, and bounds by factors of ten about it."""
        theta = self.guesses(data)[1]
        template = self.build(theta, *self._solve(theta, data), data)
        values = template.pack()
        span = 2 * np.maximum(np.abs(values), 1.0)
        lower, upper = values - span, values + span
        n = self.n_times + ("U" in self.structure)
        lower[1 : 1 + n], upper[1 : 1 + n] = 0.05 * values[1 : 1 + n], 20 * values[1 : 1 + n]
        if template.delay > 0:
            place = 1 + n + ("Z" in self.structure)
            lower[place], upper[place] = 1e-6, self.bounds(data)[1][-1]
        return template, lower, upper


@dataclass(kw_only=True, repr=False, eq=False)
class P1Estimator(ProcessModelEstimator):
    """One lag."""

    @property
    def structure(self) -> Structure:
        """MATLAB's name."""
        return "P1"


@dataclass(kw_only=True, repr=False, eq=False)
class P1ZEstimator(ProcessModelEstimator):
    """One lag and a zero."""

    @property
    def structure(self) -> Structure:
        """MATLAB's name."""
        return "P1Z"


@dataclass(kw_only=True, repr=False, eq=False)
class P2Estimator(ProcessModelEstimator):
    """Two lags."""

    @property
    def structure(self) -> Structure:
        """MATLAB's name."""
        return "P2"


@dataclass(kw_only=True, repr=False, eq=False)
class P2ZEstimator(ProcessModelEstimator):
    """Two lags and a zero."""

    @property
    def structure(self) -> Structure:
        """MATLAB's name."""
        return "P2Z"


@dataclass(kw_only=True, repr=False, eq=False)
class P2UEstimator(ProcessModelEstimator):
    """Two poles that may oscillate."""

    @property
    def structure(self) -> Structure:
        """MATLAB's name."""
        return "P2U"


@dataclass(kw_only=True, repr=False, eq=False)
class P2UZEstimator(ProcessModelEstimator):
    """Two poles that may oscillate, and a zero.

    Source: "Analysis and modeling of a pneumatic artificial muscle system", Eq. (11).
    """

    @property
    def structure(self) -> Structure:
        """MATLAB's name."""
        return "P2UZ"


@dataclass(kw_only=True, repr=False, eq=False)
class P3Estimator(ProcessModelEstimator):
    """Three lags."""

    @property
    def structure(self) -> Structure:
        """MATLAB's name."""
        return "P3"
