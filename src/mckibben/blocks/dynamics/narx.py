"""What NARX models share: past outputs and inputs, and play operators, as regressors.

y_t = f(y_{t-1}, ..., y_{t-n}, u_{t-d}, ..., u_{t-d-m+1}, F_r1[u]_t, ...), run free: past outputs are the
model's own. Source: Eq. (4) of "Analysis and modeling of a pneumatic artificial muscle system"; Chen and
Billings 1989. Without play operators such a model forgets its branch while the input is held; with
them it keeps it.

Everything is centred and scaled: outputs by `output_scale`, inputs and operators by `input_scale`.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from typing import Annotated, Any, ClassVar

import numpy as np
from annotated_types import Gt, Interval
from pydantic import FiniteFloat
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks.base import Block, own_sample_time
from mckibben.blocks.fields import (
    DISPLACEMENT,
    PRESSURE,
    STRICT,
    ChannelField,
    StoredInitial,
    Vector,
)
from mckibben.blocks.hysteresis.play_operators import start_operators
from mckibben.blocks.kernels import inlined, kernel
from mckibben.errors import ModelError

HEAD = 7
"""Coefficients before the thresholds: lags of the output, of the input, operators, and the
scales."""

FARTHEST, SPACING, PLACES = 1.5, 0.0025, 1201
"""Where rest is looked for, in scaled output: from one end of the data's range, and half of it more, to
the other."""


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
        r = coefficients[HEAD + i]
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


@inlined
def output_at_rest(
    regression: Any, wanted: int, coefficients: Array, state: Array
) -> tuple[float, int]:
    """Return the output that the regression gives back, one of several by its number, and how many.

    Where there is none, the output that changes least.
    """
    n = int(coefficients[0])
    found, rests, least = 0.0, 0, math.inf
    before, last = 0.0, 0.0
    for place in range(PLACES):
        y = place * SPACING - FARTHEST
        state[:n] = y
        change = regression(coefficients, state) - y
        if rests == 0 and abs(change) < least:
            found, least = y, abs(change)
        if place > 0 and ((before > 0.0) != (change > 0.0) or (before < 0.0) != (change < 0.0)):
            if rests == wanted:
                found = last - SPACING * before / (change - before)
            rests += 1
        before, last = change, y
    return found, rests


@inlined
def start_resting(
    regression: Any, coefficients: Array, state: Array, inputs: Array, virgin: bool
) -> None:
    """Start at rest at the first input: where the regression gives back the output it is given.

    Of several such outputs within the data's range, the lowest for an input that has risen, the middle
    one for a virgin start.
    """
    n, m, k = int(coefficients[0]), int(coefficients[1]), int(coefficients[2])
    x = (inputs[0] - coefficients[3]) / coefficients[4]
    state[n : n + m] = x
    start_operators(coefficients[HEAD : HEAD + k], x, x, virgin, state[n + m :])
    y, rests = output_at_rest(regression, 0, coefficients, state)
    if virgin:
        y, _ = output_at_rest(regression, rests // 2, coefficients, state)
    state[:n] = y


@dataclass(frozen=True, kw_only=True, config=STRICT)
class Narx(Block):
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
    def slopes(self, regressors: Array) -> tuple[Array, Array]:
        """Return the derivatives of f by the parameters, and by past outputs.

        Shapes (k, n_parameters) and (k, output_lags), at scaled regressors and in scaled output.
        """

    def state_at(self, first: Array, output: Array) -> Array | None:
        """Return the state at rest at a first input where the output is known."""
        centre, half = self.output_scale
        state = self.initial_state(first, "first_sample")
        state[: self.output_lags] = (float(output[0]) - centre) / half
        return state

    def inverse(self) -> Block:
        """Refuse: nothing keeps the output of a NARX model rising with its input."""
        raise ModelError(
            f"{self.kind!r} has no exact inverse: nothing keeps its output rising with its input. "
            "Remedy: invert a hysteresis model (cpi, gpi, mpi)."
        )
