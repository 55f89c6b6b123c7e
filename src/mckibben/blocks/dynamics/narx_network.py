"""NARX model with a network: f is linear plus one layer of sigmoids or wavelets.

f(x) = bias + linear . x + sum_h out_h a(hidden_h . x + shift_h), with a = tanh, or the wavelet
a(s) = (1 - s^2) exp(-s^2 / 2). MATLAB's sigmoid and wavelet networks are of this kind. See
`mckibben.blocks.dynamics.narx`.
"""

from __future__ import annotations

import math
from typing import ClassVar, Literal, Self

import numpy as np
from pydantic import FiniteFloat
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks.base import Kernel, Start
from mckibben.blocks.dynamics.narx import HEAD, Narx, give_output, start_resting, take_input
from mckibben.blocks.fields import STRICT, Vector
from mckibben.blocks.kernels import kernel, step
from mckibben.blocks.notation import Notation
from mckibben.errors import ModelError


@kernel
def network(coefficients: Array, state: Array) -> float:
    """Return the scaled output of the regressors in the state.

    After what all NARX kernels start with: number of regressors, of units, whether they are
    wavelets, places in the state, bias, linear, then for every unit its weights, shift and output.
    """
    start = HEAD + int(coefficients[2])
    n, units, wavelets = (
        int(coefficients[start]),
        int(coefficients[start + 1]),
        coefficients[start + 2] > 0.0,
    )
    places = coefficients[start + 3 : start + 3 + n]
    linear = coefficients[start + 3 + n : start + 4 + 2 * n]
    hidden = coefficients[start + 4 + 2 * n :]
    width = n + 2
    y = linear[0]
    for i in range(n):
        y += linear[1 + i] * state[int(places[i])]
    for h in range(units):
        s = hidden[h * width + n]
        for i in range(n):
            s += hidden[h * width + i] * state[int(places[i])]
        a = (1.0 - s * s) * math.exp(-0.5 * s * s) if wavelets else math.tanh(s)
        y += hidden[h * width + n + 1] * a
    return y


@step
def narx_network_step(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
    """Run the model."""
    take_input(inputs[0], coefficients, state)
    outputs[0] = give_output(network(coefficients, state), coefficients, state)


@kernel
def narx_network_start(coefficients: Array, state: Array, inputs: Array, virgin: bool) -> None:
    """Start the model at rest."""
    start_resting(network, coefficients, state, inputs, virgin)


@dataclass(frozen=True, kw_only=True, config=STRICT)
class NarxNetwork(Narx):
    """NARX model with one hidden layer.

    Parameters
    ----------
    bias : float
        Constant of f.
    linear : sequence of float
        One a regressor: past outputs, inputs, operators.
    hidden : sequence of float
        For every unit its weights, one a regressor, then its shift, then its output.
    activation : {"tanh", "wavelet"}
        Of the units.
    **others
        As for `mckibben.blocks.dynamics.narx.Narx`.
    """

    kind: ClassVar[str] = "narx-network"
    kernel: ClassVar[Kernel] = narx_network_step
    start_kernel: ClassVar[Start] = narx_network_start
    parameters: ClassVar[tuple[str, ...]] = ("bias", "linear", "hidden")
    notation: ClassVar[Notation] = Notation(
        r"\bar{y}_t = b + l^\top x_t + \sum_h o_h\, a(w_h^\top x_t + s_h)",
        r"x_t = (\bar{y}_{t-1}, \ldots, \bar{y}_{t-n},\, \bar{u}_{t-d}, \ldots, "
        r"\bar{u}_{t-d-m+1},\, F_{r_1}[\bar{u}]_t, \ldots)",
        r"\bar{u} = (u - u_1) / u_2,\quad \bar{y} = (y - y_1) / y_2",
        bias="b",
        linear="l_i",
        hidden="h_i",
        thresholds="r_i",
        input_scale="u_i [{u}]",
        output_scale="y_i [{y}]",
        sample_time="T [s]",
    )

    bias: FiniteFloat
    linear: Vector
    hidden: Vector
    activation: Literal["tanh", "wavelet"] = "tanh"

    def __post_init__(self) -> None:
        self.check_structure()
        n = len(self.places)
        if len(self.linear) != n or len(self.hidden) % (n + 2) != 0:
            raise ModelError(
                f"the weights of {self.kind!r} do not fit {n} regressors. Remedy: give {n} linear ones, "
                f"and {n + 2} numbers a unit."
            )

    def coefficients(self, sample_time: float | None) -> Array:
        """Return what the kernel reads."""
        n = len(self.places)
        shape = [n, len(self.hidden) // (n + 2), float(self.activation == "wavelet")]
        weights = [self.bias, *self.linear, *self.hidden]
        return np.array([*self.head(sample_time), *shape, *self.places, *weights])

    def slopes(self, regressors: Array) -> tuple[Array, Array]:
        """Return the derivatives by bias, linear and hidden weights, and by past outputs."""
        k, n = regressors.shape
        units = np.reshape(self.hidden, (-1, n + 2))
        weights, shifts, out = units[:, :n], units[:, n], units[:, n + 1]
        a, steepness = activated(self.activation, regressors @ weights.T + shifts)
        by_sum = steepness * out
        by_hidden = np.empty((k, len(units), n + 2))
        by_hidden[:, :, :n] = by_sum[:, :, np.newaxis] * regressors[:, np.newaxis, :]
        by_hidden[:, :, n] = by_sum
        by_hidden[:, :, n + 1] = a
        by_parameters = np.column_stack([np.ones(k), regressors, by_hidden.reshape(k, -1)])
        past = self.output_lags
        return by_parameters, np.array(self.linear)[:past] + by_sum @ weights[:, :past]

    @classmethod
    def example(cls) -> Self:
        """Return a first-order model with two units."""
        return cls(
            output_lags=1,
            input_lags=2,
            delay=1,
            input_scale=(2.5, 2.5),
            output_scale=(10.0, 10.0),
            sample_time=0.01,
            bias=0.01,
            linear=(0.9, 0.05, 0.03),
            hidden=(0.5, 1.0, -0.5, 0.1, 0.02, -0.3, 0.8, 0.2, -0.2, -0.015),
        )


def activated(activation: str, s: Array) -> tuple[Array, Array]:
    """Return the activation of the units at their weighted sums, and its derivative."""
    if activation == "tanh":
        a = np.tanh(s)
        return a, 1 - a**2
    bell = np.exp(-0.5 * s**2)
    return (1 - s**2) * bell, (s**3 - 3 * s) * bell
