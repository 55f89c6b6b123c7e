"""Krasnosel'skii-Pokrovskii model on a grid of thresholds, and its inverse.

y = offset + sum_ij w_ij s_ij, where operator ij is a play operator with bounded ridges: while the input
rises, s is at least the ramp from 0 at level i to 1 at level i + 1; while it falls, s is at most the
ramp from level j to level j + 1, j <= i. On the diagonal both ramps are one, and the operator is
reversible.

Source: Krasnosel'skii and Pokrovskii, "Systems with Hysteresis", 1989; as an approximation of the
Preisach model by Banks, Kurdila and Webb, 1997.
"""

from __future__ import annotations

from typing import ClassVar, Self

import numpy as np
from pydantic import FiniteFloat
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks.base import Kernel, Start
from mckibben.blocks.fields import (
    DISPLACEMENT,
    PRESSURE,
    STRICT,
    ChannelField,
    StoredInitial,
    Vector,
)
from mckibben.blocks.hysteresis.triangular_grid import TriangularGrid
from mckibben.blocks.inverse import Invertible
from mckibben.blocks.kernels import kernel, step
from mckibben.blocks.notation import Notation
from mckibben.blocks.solving import solve_sample, solved_start


@kernel
def _ramp(u: float, levels: Array, i: int) -> float:
    return min(max((u - levels[i]) / (levels[i + 1] - levels[i]), 0.0), 1.0)


@kernel
def _advance(u: float, c: Array, state: Array) -> None:
    n = int(c[0])
    levels = c[2 : 3 + n]
    place = 0
    for i in range(n):
        least = _ramp(u, levels, i)
        for j in range(i + 1):
            state[place] = max(least, min(_ramp(u, levels, j), state[place]))
            place += 1
    state[place] = u


@kernel
def _trial(u: float, memory: tuple[Array, Array]) -> float:
    c, state = memory
    n = int(c[0])
    levels = c[2 : 3 + n]
    y = c[1]
    place = 0
    for i in range(n):
        least = _ramp(u, levels, i)
        for j in range(i + 1):
            y += c[3 + n + place] * max(least, min(_ramp(u, levels, j), state[place]))
            place += 1
    return y


@step
def krasnoselskii_pokrovskii_step(
    coefficients: Array, state: Array, inputs: Array, outputs: Array
) -> None:
    """Run the model; coefficients are [number of intervals, offset, levels, weights].

    The state is [operators, previous input].
    """
    n = int(coefficients[0])
    weights = coefficients[3 + n :]
    _advance(inputs[0], coefficients, state)
    y = coefficients[1]
    for k in range(weights.size):
        y += weights[k] * state[k]
    outputs[0] = y


@step
def krasnoselskii_pokrovskii_inverse_step(
    coefficients: Array, state: Array, inputs: Array, outputs: Array
) -> None:
    """Solve for the input; see `mckibben.blocks.solving`."""
    solve_sample(_trial, _advance, coefficients, state, inputs, outputs)


@kernel
def krasnoselskii_pokrovskii_start(
    coefficients: Array, state: Array, inputs: Array, virgin: bool
) -> None:
    """Start on the rising ridges, or half-way between the ridges."""
    n = int(coefficients[0])
    levels = coefficients[2 : 3 + n]
    place = 0
    for i in range(n):
        least = _ramp(inputs[0], levels, i)
        for j in range(i + 1):
            most = _ramp(inputs[0], levels, j) if virgin else least
            state[place] = 0.5 * (least + most)
            place += 1
    state[place] = inputs[0]


krasnoselskii_pokrovskii_inverse_start = solved_start(_trial, krasnoselskii_pokrovskii_start)


@dataclass(frozen=True, config=STRICT)
class KrasnoselskiiPokrovskii(TriangularGrid, Invertible):
    """Krasnosel'skii-Pokrovskii model on a triangular grid.

    Parameters
    ----------
    levels : sequence of float, length L + 1
        Increasing inputs between which the ridges rise; the output is constant beyond them.
    weights : sequence of float, length L (L + 1) / 2
        Output of the operators, for rising ridges interval by interval, each from the lowest
        falling ridge to the diagonal: w_00, w_10, w_11, w_20, ...
    offset : float
        Output with all operators at 0.
    initial : {"first_sample", "virgin"} or sequence of float
        Default memory before the first sample: the input has risen from the lowest level, or every
        operator is half-way between its ridges.
    input, output : Channel
        Channel driven and channel given.
    """

    kind: ClassVar[str] = "krasnoselskii-pokrovskii"
    solved: ClassVar[bool] = True
    inverse_remembers = "input"
    kernel: ClassVar[Kernel] = krasnoselskii_pokrovskii_step
    start_kernel: ClassVar[Start] = krasnoselskii_pokrovskii_start
    inverse_kernel: ClassVar[Kernel] = krasnoselskii_pokrovskii_inverse_step
    inverse_start_kernel: ClassVar[Start] = krasnoselskii_pokrovskii_inverse_start
    parameters: ClassVar[tuple[str, ...]] = ("weights", "offset")
    notation: ClassVar[Notation] = Notation(
        r"y = y_0 + \sum_{j \le i} w_{ij} s_{ij}",
        r"s_{ij,t} = \begin{cases} \max(s_{ij,t-1},\, \rho_i(u_t)) & u \text{ rises} \\ "
        r"\min(s_{ij,t-1},\, \rho_j(u_t)) & u \text{ falls} \end{cases}",
        r"\rho_i(u) = \min\left(\max\left(\frac{u - a_i}{a_{i+1} - a_i},\, 0\right),\, "
        r"1\right)",
        levels="a_i [{u}]",
        weights="w_k [{y}]",
        offset="y_0 [{y}]",
    )

    levels: Vector
    weights: Vector
    offset: FiniteFloat = 0.0
    initial: StoredInitial = "first_sample"
    input: ChannelField = PRESSURE
    output: ChannelField = DISPLACEMENT

    @property
    def n_states(self) -> int:
        """Operators and the previous input."""
        return len(self.weights) + 1

    def coefficients(self, sample_time: float | None) -> Array:
        """Return [number of intervals, offset, levels, weights]."""
        del sample_time
        return np.array([len(self.levels) - 1, self.offset, *self.levels, *self.weights])

    def least_slope(self) -> float:
        """Return the least slope by the input: that of the reversible operators, or less."""
        least = min(self.weights)
        if least < 0:
            return float(least / np.diff(self.levels).min())
        return float(np.min(self.diagonal / np.diff(self.levels)))

    def remembered(self, state: Array) -> tuple[float, ...]:
        """Return the input last seen, within the levels."""
        return (float(np.clip(state[-1], *self.input_range)),)

    @classmethod
    def example(cls) -> Self:
        """Return a loop over 0 to 5 bar with more weight near the diagonal."""
        n = 5
        weights = [4.0 / (1 + i - j) ** 2 for i in range(n) for j in range(i + 1)]
        return cls(tuple(np.linspace(0.0, 5.0, n + 1).tolist()), tuple(weights), 1.0)
