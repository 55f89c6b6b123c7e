"""Viscoelastic creep, and its exact inverse.

y = u + sum_k c_k x_k,  tau_k x_k' = u - x_k: a spring in series with Kelvin-Voigt elements. Behind a
hysteresis model it adds the lag (short time constants) and creep (long ones) of a muscle's braid and
rubber. The input is held from sample to sample, x_k <- a_k x_k + (1 - a_k) u with
a_k = exp(-T / tau_k), so the output answers at once and the inverse is in closed form.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar

import numpy as np
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks.fields import (
    DISPLACEMENT,
    STRICT,
    ChannelField,
    NotNegativeVector,
    PositiveVector,
    StartRule,
)
from mckibben.blocks.inverse import Invertible
from mckibben.blocks.kernels import kernel, step
from mckibben.blocks.parameters import one_per
from mckibben.blocks.sample_times import needs_sample_time


@step
def creep_step(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
    """Advance the model; coefficients are [a, c], the state is x."""
    n = state.size
    u = inputs[0]
    y = u
    for k in range(n):
        state[k] = coefficients[k] * state[k] + (1.0 - coefficients[k]) * u
        y += coefficients[n + k] * state[k]
    outputs[0] = y


@kernel
def creep_start(coefficients: Array, state: Array, inputs: Array, virgin: bool) -> None:
    """Start with the elements at rest: at the first input, or at 0."""
    state[:] = 0.0 if virgin else inputs[0]


@kernel
def creep_matrix(coefficients: Array, columns: Array, state: Array, found: Array) -> None:
    """Fill ``found`` (n, k) with the creeping response of each column, from rest at its first value.

    ``state`` is room for elements by columns.
    """
    n, k = state.shape
    for i in range(n):
        for j in range(k):
            state[i, j] = columns[0, j]
    for t in range(columns.shape[0]):
        for j in range(k):
            found[t, j] = columns[t, j]
        for i in range(n):
            decay, compliance = coefficients[i], coefficients[n + i]
            for j in range(k):
                state[i, j] = decay * state[i, j] + (1.0 - decay) * columns[t, j]
                found[t, j] += compliance * state[i, j]


@step
def creep_inverse_step(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
    """Advance the inverse; coefficients and state as forward."""
    n = state.size
    gain = 1.0
    for k in range(n):
        gain += coefficients[n + k] * (1.0 - coefficients[k])
    rest = inputs[0]
    for k in range(n):
        rest -= coefficients[n + k] * coefficients[k] * state[k]
    u = rest / gain
    for k in range(n):
        state[k] = coefficients[k] * state[k] + (1.0 - coefficients[k]) * u
    outputs[0] = u


@kernel
def creep_inverse_start(coefficients: Array, state: Array, inputs: Array, virgin: bool) -> None:
    """Start with the elements at rest: for a constant first output, or at 0."""
    crept = 0.0
    for k in range(state.size):
        crept += coefficients[state.size + k]
    state[:] = 0.0 if virgin else inputs[0] / (1.0 + crept)


@dataclass(frozen=True, config=STRICT)
class Creep(Invertible):
    """Viscoelastic creep after a model of the immediate response.

    Parameters
    ----------
    compliances : sequence of float, length K
        c_k: creep once it has ended, relative to the immediate response; not negative.
    time_constants : sequence of float, length K
        tau_k, how long each creep takes [s]; positive.
    initial : {"first_sample", "virgin"}
        Where the elements are before the first sample: at rest at the first input, or at 0.
    input, output : Channel
        Channel driven and channel given.
    """

    kind = "creep"
    added: ClassVar[Mapping[str, int]] = {"initial": 2}
    kernel = creep_step
    start_kernel = creep_start
    inverse_kernel = creep_inverse_step
    inverse_start_kernel = creep_inverse_start
    rate_dependent = True
    is_linear = True
    counts_clipped = False
    parameters = same_length = ("compliances", "time_constants")
    n_states = one_per("compliances")  # one to every Kelvin-Voigt element
    typical = ((0.08, 0.05), (1.5, 40.0))
    formulas = (r"y = u + \sum_k c_k x_k,\quad \tau_k \dot{x}_k = u - x_k",)

    compliances: Annotated[NotNegativeVector, "c_k"]
    time_constants: Annotated[PositiveVector, r"\tau_k [s]"]
    initial: StartRule = "first_sample"
    input: ChannelField = DISPLACEMENT
    output: ChannelField = DISPLACEMENT

    def coefficients(self, sample_time: float | None) -> Array:
        """Return [decays per sample, compliances]."""
        step = needs_sample_time(self.kind, sample_time)
        return np.array([*np.exp(-step / np.array(self.time_constants)), *self.compliances])

    def passes(self, low: Array, high: Array) -> tuple[Array, Array]:
        """Return the range of immediate outputs, for any creep state."""
        crept = float(np.sum(self.compliances))
        return low + crept * high, high + crept * low
