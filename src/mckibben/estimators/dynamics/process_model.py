"""Identification of continuous-time process models P1 to P3, by free-running errors."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.dynamics.process_model import ProcessModel
from mckibben.blocks.runs import Run
from mckibben.estimators.core.data import TrainingData
from mckibben.estimators.core.separable import SeparableEstimator

LEAST_DAMPING, MOST_DAMPING = 0.02, 100.0
"""Bounds of the damping, within those of the decay; see `damping_range`."""

LARGEST_GAIN = 3.0
"""Largest steady-state output over the range of the input, relative to the range of the output."""

Structure = Literal["P1", "P1Z", "P2", "P2Z", "P2U", "P2UZ", "P3"]


class ProcessModelEstimator(SeparableEstimator):
    """Process model by variable projection: gain and zero solved for, poles searched.

    P2UZ is Eq. (11) of "Analysis and modeling of a pneumatic artificial muscle system".

    Parameters
    ----------
    structure : {"P1", "P1Z", "P2", "P2Z", "P2U", "P2UZ", "P3"}
        MATLAB's name: how many poles, whether two of them may oscillate (U), and a zero (Z).
    initial : {"first_sample", "virgin"}
        State before the first sample of every recording: at rest where the first output is explained; at
        rest at the operating point.
    """

    purpose = "rate"
    cannot = "No hysteresis; no inverse."
    needs_time = True
    begins_measured = True
    effort = 0.3
    rises = False
    searches_condensed = False
    fits_offset = False  # it is one of the responses
    fixed_fields = ("process-model.input_offset",)  # redundant with the output's

    structure: Structure = "P1"
    nonnegative = False
    n_starts = 16

    @property
    def n_times(self) -> int:
        """Number of time constants searched."""
        return 1 if "U" in self.structure else int(self.structure[1])

    def bounds(self, data: TrainingData) -> tuple[Array, Array]:
        """Return bounds of [log time constants], and of the share of the damping in its range."""
        oscillates, step = "U" in self.structure, data.timed()
        lower, upper = (np.full(self.n_times, np.log(k * step)) for k in (1.0, data.slowest))
        return np.append(lower, [0.0] * oscillates), np.append(upper, [1.0] * oscillates)

    def guesses(self, data: TrainingData) -> list[Array]:
        """Return initial lags; for several, distinct ones."""
        lower, upper = self.bounds(data)
        spacing = np.where(np.arange(lower.size) < self.n_times, 0.05 * np.arange(lower.size), 0.0)
        return [lower + (share - spacing) * (upper - lower) for share in (0.2, 0.4, 0.6, 0.8)]

    def unit(self, theta: Array, data: TrainingData, gain: float = 1.0) -> ProcessModel:
        """Return the model without zero and offsets."""
        n = self.n_times
        times, damping = np.sort(np.exp(theta[:n]))[::-1], None
        if "U" in self.structure:
            least, most = damping_range(times[0], data)
            damping = least * (most / least) ** float(theta[n])
        return ProcessModel(
            gain,
            tuple(times.tolist()),
            damping,
            None,
            0.0,
            data.input_range[0],
            0.0,
            "first",
            initial=self.initial,
            **self.channels(data),
        )

    def basis(self, theta: Array, run: Run, data: TrainingData) -> Array:
        """Return responses to the input, with a zero to its derivative, 1, and to the first output.

        The model was at rest where that output is explained, of which the share that is left decays as
        the lags do.
        """
        unit = data.latest("unit", theta, lambda: self.unit(theta, data))
        columns = [unit.simulate(run.u, sample_time=run.sample_time)]
        if "Z" in self.structure:
            zero = data.latest("zero", theta, lambda: replace(unit, zero_time=1.0))
            response = zero.simulate(run.u, sample_time=run.sample_time)
            columns.append(response - columns[0])
        columns.append(np.ones(run.u.size))
        responses, start_left = np.column_stack(columns), np.zeros(run.u.size)
        if self.initial == "first_sample" and run.counts[0]:
            ones = np.ones(run.u.size)
            plain = replace(unit, input_offset=0.0)
            at_zero = plain.initial_state(np.array([0.0]), sample_time=run.sample_time).tolist()
            start_left = 1.0 - plain.simulate(ones, initial=at_zero, sample_time=run.sample_time)
            start_left /= start_left[0]
        relative = responses - np.outer(start_left, responses[0])
        return np.column_stack([relative, start_left * float(run.y[0])])

    def solve(self, matrix: Array, data: TrainingData) -> tuple[Array, float]:
        """Return gain, zero and offset, and 1 for the share of the first output."""
        target, start_columns = data.target - matrix[:, -1], matrix[:, 1:-1]
        solution = np.linalg.lstsq(matrix[:, :-1], target, rcond=1e-12)[0]
        gain = np.clip(solution[0], *self.gain_range(data))
        if gain != solution[0]:  # with a single bound the optimum is on it
            starts = np.linalg.lstsq(start_columns, target - gain * matrix[:, 0], rcond=1e-12)[0]
            solution = np.append(gain, starts)
        return np.append(solution, 1.0), 0.0

    def gain_range(self, data: TrainingData) -> tuple[float, float]:
        """Return the bounds of the gain; a larger one is not seen in the recordings."""
        most = LARGEST_GAIN * data.output_span / data.input_span
        return -most, most

    def free_regressors(self, matrix: Array, linear: Array, data: TrainingData) -> Array:
        """Return the responses whose gains are solved for, and not at a bound."""
        return matrix[:, int(linear[0] in self.gain_range(data)) : -1]

    def at_bounds(self, block: Block, data: TrainingData) -> tuple[int, ...]:
        """Return the indices of parameters that are zero, or at a bound of the search."""
        assert isinstance(block, ProcessModel)
        times = zip(*np.exp(self.bounds(data))[:, : self.n_times], strict=True)
        ends = [self.gain_range(data), *times]
        if block.damping is not None:
            ends.append(damping_range(block.time_constants[0], data))
        numbers = zip(block.pack(), ends, strict=False)
        reached = [
            k for k, (value, of) in enumerate(numbers) if np.isclose(value, of, 1e-3, 0).any()
        ]
        return tuple(sorted({*super().at_bounds(block, data), *reached}))

    def build(self, theta: Array, linear: Array, offset: float, data: TrainingData) -> ProcessModel:
        gain, offset, zero = float(linear[0]), float(linear[-2]), None
        if "Z" in self.structure:
            zero = float(linear[1] / gain) if gain != 0 else 0.0
        return replace(self.unit(theta, data, gain), zero_time=zero, output_offset=offset)


def damping_range(time: float, data: TrainingData) -> tuple[float, float]:
    """Return the least and largest damping of poles of a time constant [s].

    Their slower decay, `TrainingData.slowest` at most, takes time / damping, or time (damping +
    sqrt(damping^2 - 1)).
    """
    slowest = data.slowest * data.timed() / time
    most = 0.5 * (slowest + 1.0 / slowest)
    return max(LEAST_DAMPING, 1.0 / slowest), min(MOST_DAMPING, most)


class P1Estimator(ProcessModelEstimator):
    """One lag."""

    title = "Process model: one lag (P1)"


class P1ZEstimator(ProcessModelEstimator):
    """One lag and a zero."""

    title = "Process model: one lag and a zero (P1Z)"
    structure = "P1Z"


class P2Estimator(ProcessModelEstimator):
    """Two lags."""

    title = "Process model: two lags (P2)"
    structure = "P2"


class P2ZEstimator(ProcessModelEstimator):
    """Two lags and a zero."""

    title = "Process model: two lags and a zero (P2Z)"
    structure = "P2Z"


class P2UEstimator(ProcessModelEstimator):
    """Oscillating poles."""

    title = "Process model: oscillating poles (P2U)"
    structure = "P2U"


class P2UZEstimator(ProcessModelEstimator):
    """Oscillating poles and a zero."""

    title = "Process model: oscillating poles and a zero (P2UZ)"
    can = "Two poles that may oscillate, and a zero: best of the linear ones on coiled muscles."
    quick = True
    structure = "P2UZ"


class P3Estimator(ProcessModelEstimator):
    """Three lags."""

    title = "Process model: three lags (P3)"
    structure = "P3"
