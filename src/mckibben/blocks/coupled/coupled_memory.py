"""Lags and play operators of several inputs with a polynomial readout.

Every input passes first-order lags, every lagged input play operators; outputs are linear in those, and
in products of the first lag's inputs up to a degree, and of these with all other lags and plays:
friction that grows with a pressure is such a product. A lag of 0 is the input itself. Nothing is fed
back from outputs to states, so the model is stable whatever its readout. Displacements need not be one
to a muscle, as the place of an arm's tip is not, and motion may be dynamic.

The form is this package's own; it is linear in its parameters but for lags and thresholds.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import combinations_with_replacement
from typing import Annotated, ClassVar, Self

import numpy as np
from annotated_types import Interval
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks.base import SEVERAL, Block
from mckibben.blocks.fields import STRICT, Channel, Channels, PositiveRows, Rows, Vector
from mckibben.blocks.hysteresis.play_operators import start_operators
from mckibben.blocks.kernels import kernel, step
from mckibben.blocks.sample_times import needs_sample_time
from mckibben.errors import ModelError


@step
def coupled_memory_step(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
    """Advance lags, then play operators, then the readout.

    Coefficients are [lags, thresholds, degree, crossed, decays, thresholds (inputs by thresholds),
    origin, readout].
    """
    n, n_out = inputs.size, outputs.size
    n_lags, m, degree = int(coefficients[0]), int(coefficients[1]), int(coefficients[2])
    decays = coefficients[4 : 4 + n_lags]
    radii = coefficients[4 + n_lags : 4 + n_lags + n * m]
    origin = coefficients[4 + n_lags + n * m : 4 + n_lags + n * m + n]
    readout = coefficients[4 + n_lags + n * m + n :]
    width = readout.size // n_out
    for lag in range(n_lags):
        for i in range(n):
            position = lag * n + i
            state[position] += (1.0 - decays[lag]) * (inputs[i] - origin[i] - state[position])
            x = state[position]
            plays = state[n_lags * n + position * m :]
            for k in range(m):
                r = radii[i * m + k]
                plays[k] = min(max(plays[k], x - r), x + r)
    for j in range(n_out):
        at = j * width
        total = readout[at]
        at += 1
        for k in range(state.size):
            total += readout[at] * state[k]
            at += 1
        if degree >= 2:
            for i in range(n):
                for k in range(i, n):
                    total += readout[at] * state[i] * state[k]
                    at += 1
        if degree >= 3:
            for i in range(n):
                for k in range(i, n):
                    for q in range(k, n):
                        total += readout[at] * state[i] * state[k] * state[q]
                        at += 1
        if coefficients[3] > 0.0:
            for i in range(n):
                for k in range(n, state.size):
                    total += readout[at] * state[i] * state[k]
                    at += 1
        outputs[j] = total


@kernel
def coupled_memory_start(coefficients: Array, state: Array, inputs: Array, virgin: bool) -> None:
    """Start at rest at the first inputs, reached from their origin, or with all states zero."""
    n, n_lags, m = inputs.size, int(coefficients[0]), int(coefficients[1])
    radii = coefficients[4 + n_lags : 4 + n_lags + n * m]
    origin = coefficients[4 + n_lags + n * m : 4 + n_lags + n * m + n]
    for lag in range(n_lags):
        for i in range(n):
            x = 0.0 if virgin else inputs[i] - origin[i]
            state[lag * n + i] = x
            plays = state[n_lags * n + (lag * n + i) * m :]
            start_operators(radii[i * m : (i + 1) * m], x, x, True, plays)


@dataclass(frozen=True, config=STRICT)
class CoupledMemory(Block):
    """Lags, play operators and a polynomial readout.

    Parameters
    ----------
    lags : sequence of float
        Time constants [s], at least one; 0 for the input itself. Products are of the first.
    thresholds : sequence of n sequences of float
        Of the play operators of every input, in its unit; as many for each, maybe none.
    readout : sequence of sequences of float
        For every output: the constant, every lag of every input, the plays of each of those in the same
        order, then products of two and of three inputs, in order, then those of an input with all other
        lags and plays.
    degree : int
        Highest degree of products of inputs, 1 for none.
    driven, scheduled, given : sequence of Channel
        Inputs driven, those that schedule (treated alike), and outputs.
    crossed : bool
        Whether there are products of inputs with other lags and plays.
    origin : sequence of n float
        Of every input, from which it counts; by default 0.
    """

    kind = "coupled-memory"
    added: ClassVar[Mapping[str, int]] = {"crossed": 2, "origin": 2}
    ports = SEVERAL
    kernel = coupled_memory_step
    start_kernel = coupled_memory_start
    parameters = ("readout",)
    no_inverse = "has no inverse: its lags cannot be inverted within a sample"
    instead = "invert balance or sdchm, or close a loop"
    formulas = (
        r"\tau_l \dot{x}_{li} = u_i - u_{0i} - x_{li},\quad z_{lik} = F_{r_{ik}}[x_{li}]",
        r"y_j = \sum_k R_{jk} \phi_k,\quad \phi = \left(1,\; x,\; z,\; x_{1i} x_{1k},\; "
        r"x_{1i} x_{1k} x_{1q},\; x_{1i} x_{lk},\; x_{1i} z_{lkm}\right)",
    )

    lags: Annotated[Vector, r"\tau_l [s]"]
    thresholds: Annotated[PositiveRows, "r_{ik} [{in0}]"]
    readout: Annotated[Rows, "R_{jk}"]
    degree: Annotated[int, Interval(ge=1, le=3)]
    driven: Annotated[Channels, "u_i"]
    scheduled: Annotated[Channels, "u_i"]
    given: Annotated[Channels, "y_j"]
    crossed: bool = False
    origin: Annotated[Vector, "u_{0i} [{in0}]"] = ()

    def __post_init__(self) -> None:
        self.check_channels()
        n = len(self.inputs)
        if not self.lags or min(self.lags) < 0:
            raise ModelError(
                f"lags of {self.kind!r} are {self.lags}",
                remedy="give time constants, none negative",
            )
        if len(self.thresholds) != n or len({len(row) for row in self.thresholds}) > 1:
            raise ModelError(
                f"{self.kind!r} of {n} inputs has thresholds of "
                f"{[len(row) for row in self.thresholds]}",
                remedy="give as many for each input",
            )
        if len(self.origin) not in (0, n):
            raise ModelError(
                f"{self.kind!r} of {n} inputs has {len(self.origin)} origins", remedy=f"give {n}"
            )
        width = readout_width(n, len(self.lags), len(self.thresholds[0]), self.degree, self.crossed)
        if len(self.readout) != len(self.given) or any(len(row) != width for row in self.readout):
            raise ModelError(
                f"readout of {self.kind!r} has rows of {[len(row) for row in self.readout]}",
                remedy=f"give {len(self.given)} rows of {width}",
            )

    @property
    def rate_dependent(self) -> bool:  # type: ignore[override]
        return any(self.lags)

    @property
    def n_states(self) -> int:
        """Every lag of every input, and the plays of each."""
        return len(self.lags) * len(self.inputs) * (1 + len(self.thresholds[0]))

    def coefficients(self, sample_time: float | None) -> Array:
        step = needs_sample_time(self.kind, sample_time) if self.rate_dependent else 1.0
        head = [len(self.lags), len(self.thresholds[0]), self.degree, self.crossed]
        decays = [math.exp(-step / tau) if tau else 0.0 for tau in self.lags]
        radii = np.array(self.thresholds).ravel()
        origin = self.origin or np.zeros(len(self.inputs))
        return np.concatenate([head, decays, radii, origin, self.pack()])

    def unit_of(self, field: str, index: tuple[int, ...]) -> str | None:
        if field != "readout":
            return super().unit_of(field, index)
        units = [channel.unit for channel in self.inputs]
        plays = [unit for unit in units for _ in self.thresholds[0]]
        per = ["", *units * len(self.lags), *plays * len(self.lags)]
        for degree in range(2, self.degree + 1):
            per += [" ".join(many) for many in combinations_with_replacement(units, degree)]
        if self.crossed:
            per += [
                f"{unit} {other}"
                for unit in units
                for other in per[1 + len(units) : 1 + self.n_states]
            ]
        return f"{self.outputs[index[0]].unit or '1'}/{per[index[1]].strip() or '1'}"

    @classmethod
    def example(cls) -> Self:
        width = readout_width(2, 2, 1, 2)
        readout = 0.5 / (1.0 + np.arange(width))
        return cls(
            (0.05, 0.5),
            ((0.3,), (0.4,)),
            (tuple(readout.tolist()),),
            2,
            tuple(Channel(f"pressure_{k}", "bar") for k in (1, 2)),
            (),
            (Channel("displacement_1", "mm"),),
        )


def readout_width(
    n: int, n_lags: int, n_thresholds: int, degree: int, crossed: bool = False
) -> int:
    """Return the number of readout weights of one output."""
    products = sum(
        len(list(combinations_with_replacement(range(n), power))) for power in range(2, degree + 1)
    )
    linear = n * n_lags * (1 + n_thresholds)
    return 1 + linear + products + crossed * n * (linear - n)
