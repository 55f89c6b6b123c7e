"""Corrections of a motion that repeats, learned from its repetitions, as a table.

y(t) = u(t) + c(t),

with t in samples since the start. In front of a compensator it plays what
`mckibben.control.iterative_learning` has learned, in step with the motion: the start is that of the
motion, so on a robot the controller is started with it.
"""

from __future__ import annotations

from typing import Annotated, Self

import numpy as np
from annotated_types import Gt
from pydantic import FiniteFloat
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.fields import DISPLACEMENT, STRICT, Channels, Rows, vector
from mckibben.blocks.kernels import kernel, step
from mckibben.blocks.sample_times import own_sample_time
from mckibben.errors import ModelError


@step
def repetition_step(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
    """Add the corrections of a sample; coefficients are [whether it repeats, a table a channel]."""
    n = (coefficients.size - 1) // outputs.size
    place = int(state[0])
    for k in range(outputs.size):
        outputs[k] = inputs[k] + coefficients[1 + k * n + place]
    if place + 1 < n:
        state[0] += 1.0
    elif coefficients[0] > 0.0:
        state[0] = 0.0


@kernel
def repetition_start(coefficients: Array, state: Array, inputs: Array, virgin: bool) -> None:
    """Start with the motion."""
    state[0] = 0.0


@dataclass(frozen=True, config=STRICT)
class Repetition(Block):
    """Corrections of a motion that repeats, by sample since the start.

    Parameters
    ----------
    corrections : sequence of rows, shape (n_channels, n)
        What is added to each channel, in its unit; at least one sample.
    sample_time : float
        Time between samples [s]; positive.
    driven, given : sequence of Channel
        References, and the corrected ones.
    repeats : bool
        Whether the motion begins again after n samples without a new start. If not, the last
        correction is held.
    """

    kind = "repetition"
    ports = ("driven",), (), ("given",)
    kernel = repetition_step
    start_kernel = repetition_start
    rate_dependent = True
    n_states = 1  # sample since the start
    parameters = ("corrections",)
    same_length = ("corrections", "driven", "given")
    formulas = (r"y_{i,t} = u_{i,t} + c_{i,t},\quad t \text{ counts samples of } T_s",)

    corrections: Annotated[Rows, "c_{i,t} [{out0}]"]
    sample_time: Annotated[FiniteFloat, Gt(0), "T_s [s]"]
    driven: Annotated[Channels, "u_i"] = (DISPLACEMENT,)
    given: Annotated[Channels, "y_i"] = (DISPLACEMENT,)
    repeats: bool = False

    def __post_init__(self) -> None:
        self.check_channels()
        sizes = {len(row) for row in self.corrections}
        if len(sizes) > 1 or 0 in sizes:
            raise ModelError(
                f"{self.kind!r} has rows of {sorted(sizes)} corrections",
                remedy="give a row a channel, all of the same length",
            )

    def coefficients(self, sample_time: float | None) -> Array:
        own_sample_time(self.kind, self.sample_time, sample_time)
        return np.concatenate([[float(self.repeats)], *map(np.asarray, self.corrections)])

    def inverse(self) -> Repetition:
        rows = tuple(vector(-np.asarray(row)) for row in self.corrections)
        return Repetition(rows, self.sample_time, self.given, self.driven, self.repeats)

    @classmethod
    def example(cls) -> Self:
        time = np.arange(200) / 200
        return cls((vector(0.5 * np.sin(2 * np.pi * time)),), 0.01, repeats=True)
