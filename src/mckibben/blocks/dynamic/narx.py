"""What NARX models share: past outputs and inputs, and play operators, as regressors.

y_t = f(y_{t-1}, ..., y_{t-n}, u_{t-d}, ..., u_{t-d-m+1}, F_r1[u]_t, ...), run free: past outputs are the
model's own. Source: Eq. (4) of "Analysis and modeling of a pneumatic artificial muscle system"; Chen and
Billings 1989. Without play operators such a model forgets its branch while the input is held; with
them it keeps it.

Everything is centred and scaled: outputs by `output_scale`, inputs and operators by `input_scale`.
"""

from __future__ import annotations

from abc import abstractmethod
from typing import Annotated, ClassVar

import numpy as np
from annotated_types import Gt, Interval
from pydantic import FiniteFloat
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks.core.block import Block, Primitive
from mckibben.blocks.core.fields import (
    DISPLACEMENT,
    PRESSURE,
    STRICT,
    ChannelField,
    Initial,
    StoredInitial,
    Vector,
)
from mckibben.blocks.core.kernels import kernel
from mckibben.blocks.core.refusals import explicit_state, own_sample_time
from mckibben.blocks.core.single_channel import SingleChannel
from mckibben.blocks.play_type.memory import named_state
from mckibben.errors import ModelError

HEAD = 7
"""Coefficients before the thresholds: lags of the output, of the input, operators, and the
scales."""


@kernel
def take_input(u: float, coefficients: Array, state: Array) -> None:
    """Put a new input among the past ones, and move the play operators."""
    n, m, k = int(coefficients[0]), int(coefficients[1]), int(coefficients[2])
    x = (u - coefficients[3]) / coefficients[4]
    for i in range(n + m - 1, n, -1):
        state[i] = state[i - 1]
    if m > 0:
        state[n] = x
    for i in range(k):
        r = coefficients[7 + i]
        place = n + m + i
        state[place] = min(max(state[place], x - r), x + r)


@kernel
def give_output(y: float, coefficients: Array, state: Array) -> float:
    """Put a new output among the past ones, and return it in its own unit."""
    n = int(coefficients[0])
    for i in range(n - 1, 0, -1):
        state[i] = state[i - 1]
    if n > 0:
        state[0] = y
    return coefficients[5] + coefficients[6] * y


@dataclass(frozen=True, kw_only=True, config=STRICT)
class Narx(SingleChannel, Primitive):
    """Fields and states of NARX models.

    Parameters
    ----------
    output_lags, input_lags : int
        n and m; not negative, together at least one.
    delay : int
        d, samples; 0 where the input acts at once.
    thresholds : sequence of float
        Of play operators among the regressors, in scaled input: increasing, not negative; may be
        empty.
    input_scale, output_scale : (float, float)
        Centre, and half the range; the latter positive.
    sample_time : float
        Time between samples that it holds for [s]; positive.
    initial : {"first_sample", "virgin"} or sequence of float
        Default memory before the first sample: at rest at the first input, which may have risen
        there; or at rest with the operators at the centre.
    input, output : Channel
        Channel driven and channel given.
    """

    rate_dependent: ClassVar[bool] = True

    output_lags: Annotated[int, Interval(ge=0, le=50)]
    input_lags: Annotated[int, Interval(ge=0, le=50)]
    delay: Annotated[int, Interval(ge=0, le=50)] = 0
    thresholds: Vector = ()
    input_scale: tuple[FiniteFloat, FiniteFloat]
    output_scale: tuple[FiniteFloat, FiniteFloat]
    sample_time: Annotated[FiniteFloat, Gt(0)]
    initial: StoredInitial = "first_sample"
    input: ChannelField = PRESSURE
    output: ChannelField = DISPLACEMENT

    def check_structure(self) -> None:
        """Refuse scales that are not positive, thresholds out of order, and no lags at all."""
        if not (self.input_scale[1] > 0 and self.output_scale[1] > 0):
            raise ModelError(
                f"{self.kind!r} has a scale that is not positive. Remedy: give (centre, half range)."
            )
        r = np.array(self.thresholds)
        if r.size and (r[0] < 0 or np.any(np.diff(r) <= 0)):
            raise ModelError(
                f"the thresholds of {self.kind!r} are not 0 <= r_0 < r_1 < ... "
                "Remedy: sort them and drop repeated ones."
            )
        if self.output_lags + self.input_lags + r.size == 0:
            raise ModelError(f"{self.kind!r} has no regressors. Remedy: give a lag or an operator.")

    @property
    def n_states(self) -> int:
        """Past outputs, inputs from now to the last lag, and operators."""
        return self.output_lags + self.past_inputs + len(self.thresholds)

    @property
    def past_inputs(self) -> int:
        """Inputs kept: those between now and the last lag."""
        return self.delay + self.input_lags if self.input_lags else 0

    @property
    def places(self) -> tuple[int, ...]:
        """Where in the state the regressors are, in the order of f's arguments."""
        n, m = self.output_lags, self.past_inputs
        inputs = range(n + min(self.delay, m), n + m)
        return (*range(n), *inputs, *range(n + m, n + m + len(self.thresholds)))

    def head(self, sample_time: float | None) -> list[float]:
        """Return the coefficients that all NARX kernels start with."""
        own_sample_time(self.kind, self.sample_time, sample_time)
        counts = [self.output_lags, self.past_inputs, len(self.thresholds)]
        return [*counts, *self.input_scale, *self.output_scale, *self.thresholds]

    @abstractmethod
    def evaluate(self, regressors: Array) -> Array:
        """Return f at scaled regressors, shape (k, number of regressors), in scaled output (k,)."""

    @abstractmethod
    def slopes(self, regressors: Array) -> tuple[Array, Array]:
        """Return the derivatives of f by the parameters, and by past outputs.

        Shapes (k, n_parameters) and (k, output_lags), at scaled regressors and in scaled output.
        """

    def initial_state(self, first: Array, initial: Initial | None = None) -> Array:
        """Return the state at rest at the first input: where f gives back the output it is given.

        Of several such outputs within the data's range, the lowest for an input that has risen, the
        middle one for a virgin start; where there is none, the one that changes least.
        """
        start = self.initial if initial is None else initial
        if not isinstance(start, str):
            return explicit_state(self, start)
        grid = np.linspace(-1.5, 1.5, 1201)
        states = np.tile(self._resting(float(first[0]), 0.0, str(start)), (grid.size, 1))
        states[:, : self.output_lags] = grid[:, np.newaxis]
        change = self.evaluate(states[:, list(self.places)]) - grid
        crossings = np.flatnonzero(np.diff(np.sign(change)) != 0)
        if crossings.size == 0:
            y = float(grid[np.argmin(np.abs(change))])
        else:
            place = crossings[0 if start == "first_sample" else crossings.size // 2]
            rise = change[place + 1] - change[place]
            share = 0.0 if rise == 0 else -change[place] / rise
            y = float(grid[place] + share * (grid[1] - grid[0]))
        return self._resting(float(first[0]), y, str(start))

    def state_at(self, first: Array, output: Array) -> Array | None:
        """Return the state at rest at a first input where the output is known."""
        centre, half = self.output_scale
        return self._resting(float(first[0]), (float(output[0]) - centre) / half, "first_sample")

    def _resting(self, u: float, y: float, rule: str) -> Array:
        x = (u - self.input_scale[0]) / self.input_scale[1]
        operators = named_state(rule, np.array(self.thresholds), x, x)
        return np.array([*[y] * self.output_lags, *[x] * self.past_inputs, *operators])

    def inverse(self) -> Block:
        """Refuse: nothing keeps the output of a NARX model rising with its input."""
        raise ModelError(
            f"{self.kind!r} has no exact inverse: nothing keeps its output rising with its input. "
            "Remedy: invert a hysteresis model (cpi, gpi, mpi)."
        )
