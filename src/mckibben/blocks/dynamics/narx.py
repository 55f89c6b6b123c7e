"""NARX models: the next output from past outputs and inputs, and play operators of the input.

y_t = f(y_{t-1}, ..., y_{t-n}, u_{t-d}, ..., u_{t-d-m+1}, F_r1[u]_t, ...), run free: past outputs are the
model's own. Without play operators such a model forgets its branch while the input is held. Everything
is centred and scaled: outputs by `output_scale`, inputs and operators by `input_scale`.

The mapping f is a polynomial, or linear plus one layer of sigmoids, as MATLAB's networks; of saved
models also of wavelets.

Sources: Eq. (4) of "Analysis and modeling of a pneumatic artificial muscle system"; Chen, Billings and
Luo, "Orthogonal least squares methods and their application to non-linear system identification", 1989.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable
from typing import Annotated, Literal, Self

import numpy as np
from annotated_types import Interval, MaxLen
from pydantic import BeforeValidator, FiniteFloat
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks import fields
from mckibben.blocks.base import Block, Start
from mckibben.blocks.hysteresis.play_operators import start_operators
from mckibben.blocks.kernels import Step, kernel, remember, step
from mckibben.blocks.sample_times import own_sample_time
from mckibben.errors import ModelError

HEAD = 7
OUTPUT_LAGS, INPUT_LAGS, OPERATORS = range(3)
INPUT_CENTRE, INPUT_SCALE, OUTPUT_CENTRE, OUTPUT_SCALE = range(3, HEAD)
"""Places of the coefficients before the thresholds."""

FARTHEST, SPACING, PLACES = 1.5, 0.0025, 1201
"""Grid of scaled outputs on which an equilibrium is searched: the data's range and half of it
beyond either end.
"""

HIGHEST_DEGREE, MOST_TERMS = 20, 10_000

Term = Annotated[tuple[int, ...], MaxLen(HIGHEST_DEGREE)]
Terms = Annotated[tuple[Term, ...], MaxLen(MOST_TERMS), BeforeValidator(fields.rows)]

Lags = Annotated[int, Interval(ge=0, le=50)]

REGRESSORS = (
    r"x_t = (\bar{y}_{t-1}, \ldots, \bar{y}_{t-n},\, \bar{u}_{t-d}, \ldots, "
    r"\bar{u}_{t-d-m+1},\, F_{r_1}[\bar{u}]_t, \ldots)",
    r"\bar{u} = (u - u_1) / u_2,\quad \bar{y} = (y - y_1) / y_2,\quad "
    r"t \text{ counts samples of } T",
)


@kernel
def take_input(u: float, coefficients: Array, state: Array) -> None:
    """Shift a new input into the past ones, and update the play operators."""
    n, m = int(coefficients[OUTPUT_LAGS]), int(coefficients[INPUT_LAGS])
    k = int(coefficients[OPERATORS])
    x = (u - coefficients[INPUT_CENTRE]) / coefficients[INPUT_SCALE]
    remember(x, state[n : n + m])
    for i in range(k):
        r = coefficients[HEAD + i]
        place = n + m + i
        state[place] = min(max(state[place], x - r), x + r)


@kernel
def give_output(y: float, coefficients: Array, state: Array) -> float:
    """Shift a new output into the past ones, and return it in its unit."""
    remember(y, state[: int(coefficients[OUTPUT_LAGS])])
    return coefficients[OUTPUT_CENTRE] + coefficients[OUTPUT_SCALE] * y


def narx_kernels(regression: Callable[[Array, Array], float]) -> tuple[Step, Start]:
    """Return step and start kernel of a model, from its scaled output of the regressors."""

    def narx_step(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
        """Advance the model."""
        take_input(inputs[0], coefficients, state)
        outputs[0] = give_output(regression(coefficients, state), coefficients, state)

    def narx_start(coefficients: Array, state: Array, inputs: Array, virgin: bool) -> None:
        """Start at equilibrium with the first input: a fixed point of the regression.

        Of several such outputs within the data's range, the lowest from which a small change dies away
        for an input that has risen, the middle one for a virgin start; where there is none, the output
        that changes least.
        """
        n, m = int(coefficients[OUTPUT_LAGS]), int(coefficients[INPUT_LAGS])
        k = int(coefficients[OPERATORS])
        x = (inputs[0] - coefficients[INPUT_CENTRE]) / coefficients[INPUT_SCALE]
        state[n : n + m] = x
        start_operators(coefficients[HEAD : HEAD + k], x, x, virgin, state[n + m :])
        found, rests = 0.0, 0
        for _ in range(2 if virgin else 1):
            wanted = rests // 2
            rests, least, before, last = 0, math.inf, 0.0, 0.0
            for place in range(PLACES):
                y = place * SPACING - FARTHEST
                state[:n] = y
                change = regression(coefficients, state) - y
                if rests == 0 and abs(change) < least:
                    found, least = y, abs(change)
                falls, rises = before > 0.0 and change <= 0.0, before < 0.0 and change >= 0.0
                if falls or (virgin and rises):
                    if rests == wanted:
                        found = last - SPACING * before / (change - before)
                    rests += 1
                before, last = change, y
        state[:n] = found

    return step(narx_step), kernel(narx_start)


@kernel
def sum_of_terms(coefficients: Array, state: Array) -> float:
    """Return the scaled output of the regressors in the state.

    After what all NARX kernels start with: highest degree, then for every term its weight and,
    padded with -1, the places in the state of its factors.
    """
    k = HEAD + int(coefficients[OPERATORS])
    degree = int(coefficients[k])
    terms = coefficients[k + 1 :]
    width = degree + 1
    y = 0.0
    for j in range(terms.size // width):
        product = terms[j * width]
        for i in range(1, width):
            place = int(terms[j * width + i])
            if place < 0:
                break
            product *= state[place]
        y += product
    return y


@kernel
def network(coefficients: Array, state: Array) -> float:
    """Return the scaled output of the regressors in the state.

    After what all NARX kernels start with: number of regressors, of units, whether they are
    wavelets, places in the state, bias, linear, then for every unit its weights, shift and output.
    """
    start = HEAD + int(coefficients[OPERATORS])
    n, units = int(coefficients[start]), int(coefficients[start + 1])
    wavelets = coefficients[start + 2] > 0.0
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


@dataclass(frozen=True, kw_only=True, config=fields.STRICT)
class Narx(fields.WithMemory, Block):
    """Fields and states shared by NARX models.

    Parameters
    ----------
    output_lags, input_lags : int
        n and m; not negative.
    delay : int
        d, samples; 0 where the input acts at once.
    thresholds : sequence of float
        Of play operators among the regressors, in scaled input: increasing, not negative; may be empty.
        There is at least one lag or operator.
    input_scale, output_scale : (float, float)
        Centre, and half the range; the latter positive.
    sample_time : float
        Time between samples that it holds for [s]; positive.
    initial : {"first_sample", "virgin"} or sequence of float
        Default memory before the first sample: at rest at the first input, which may have risen
        there; or at rest with the operators at the centre.
    """

    rate_dependent = True
    increasing = ("thresholds",)
    no_inverse = "has no exact inverse: its output need not increase with its input"

    output_lags: Lags
    input_lags: Lags
    delay: Lags = 0
    thresholds: Annotated[fields.NotNegativeVector, "r_i"] = ()
    input_scale: Annotated[fields.Scale, "u_i [{u}]"]
    output_scale: Annotated[fields.Scale, "y_i [{y}]"]
    sample_time: Annotated[fields.Positive, "T [s]"]

    def __post_init__(self) -> None:
        if not self.places:
            raise ModelError(f"{self.kind!r} has no regressors", remedy="give a lag or an operator")

    @property
    def n_states(self) -> int:
        """Past outputs, inputs from now to the last lag, and operators."""
        return self.output_lags + self.past_inputs + len(self.thresholds)

    @property
    def past_inputs(self) -> int:
        """Number of stored inputs: between the current one and the last lag."""
        return self.delay + self.input_lags if self.input_lags else 0

    @property
    def places(self) -> tuple[int, ...]:
        """Indices of the regressors in the state, in the order of f's arguments."""
        n, m = self.output_lags, self.past_inputs
        return (*range(n), *range(n + min(self.delay, m), self.n_states))

    def head(self, sample_time: float | None) -> list[float]:
        """Return the leading coefficients of all NARX kernels."""
        own_sample_time(self.kind, self.sample_time, sample_time)
        counts = [self.output_lags, self.past_inputs, len(self.thresholds)]
        return [*counts, *self.input_scale, *self.output_scale, *self.thresholds]

    @abstractmethod
    def slopes(self, regressors: Array) -> tuple[Array, Array]:
        """Return the derivatives of f by the parameters, and by past outputs.

        Shapes (k, n_parameters) and (k, output_lags), at scaled regressors and in scaled output.
        """

    def state_at(self, first: Array, output: Array) -> Array | None:
        centre, half = self.output_scale
        state = self.initial_state(first, "first_sample", self.sample_time)
        state[: self.output_lags] = (float(output[0]) - centre) / half
        return state


@dataclass(frozen=True, kw_only=True, config=fields.STRICT)
class NarxPolynomial(Narx):
    """Polynomial NARX model: f is a sum of products of regressors.

    Parameters
    ----------
    terms : sequence of sequence of int
        Regressors multiplied in each term, by their number: past outputs first, then inputs, then
        operators; none for the constant. Repeated for powers.
    weights : sequence of float
        One a term.
    **others
        As of `Narx`.
    """

    kind = "narx-polynomial"
    kernel, start_kernel = narx_kernels(sum_of_terms)
    parameters = ("weights",)
    formulas = (r"\bar{y}_t = \sum_i w_i \prod_{j \in P_i} x_{j,t}", *REGRESSORS)

    terms: Terms
    weights: Annotated[fields.Vector, "w_i"]

    def __post_init__(self) -> None:
        super().__post_init__()
        most = len(self.places)
        if len(self.terms) != len(self.weights) or any(
            not 0 <= factor < most for term in self.terms for factor in term
        ):
            raise ModelError(
                f"the terms of {self.kind!r} do not fit",
                remedy=f"give one weight a term, and factors between 0 and {most - 1}",
            )

    def coefficients(self, sample_time: float | None) -> Array:
        degree = max((len(term) for term in self.terms), default=0)
        places = self.places
        padded = [
            [weight, *(places[f] for f in term), *[-1] * (degree - len(term))]
            for term, weight in zip(self.terms, self.weights, strict=True)
        ]
        return np.array([*self.head(sample_time), degree, *np.ravel(padded)], dtype=np.float64)

    def slopes(self, regressors: Array) -> tuple[Array, Array]:
        """Return the products themselves, and the derivative of their sum by past outputs."""
        by_past = np.zeros((len(regressors), self.output_lags))
        for term, weight in zip(self.terms, self.weights, strict=True):
            for k, factor in enumerate(term):
                if factor < self.output_lags:
                    other_factors = term[:k] + term[k + 1 :]
                    by_past[:, factor] += weight * products(regressors, (other_factors,))[:, 0]
        return products(regressors, self.terms), by_past

    @classmethod
    def example(cls) -> Self:
        return cls(
            output_lags=1,
            input_lags=2,
            thresholds=(0.2,),
            input_scale=(2.5, 2.5),
            output_scale=(10.0, 10.0),
            sample_time=0.01,
            terms=((), (0,), (1,), (3,), (0, 1), (1, 1)),
            weights=(0.01, 0.9, 0.05, 0.04, 0.01, -0.01),
        )


def products(regressors: Array, terms: Terms) -> Array:
    """Return the terms at regressors of shape (k, number of regressors), shape (k, number of terms)."""
    columns = np.ones((len(regressors), len(terms)))
    for column, term in enumerate(terms):
        for factor in term:
            columns[:, column] *= regressors[:, factor]
    return columns


@dataclass(frozen=True, kw_only=True, config=fields.STRICT)
class NarxNetwork(Narx):
    """NARX model with a network: f(x) = bias + linear . x + sum_h out_h a(hidden_h . x + shift_h).

    Parameters
    ----------
    bias : float
        Constant of f.
    linear : sequence of float
        One a regressor: past outputs, inputs, operators.
    hidden : sequence of float
        For every unit its weights, one a regressor, then its shift, then its output.
    activation : {"tanh", "wavelet"}
        a(s) of the units; the wavelet is (1 - s^2) exp(-s^2 / 2).
    **others
        As of `Narx`.
    """

    kind = "narx-network"
    kernel, start_kernel = narx_kernels(network)
    parameters = ("bias", "linear", "hidden")
    formulas = (
        r"\bar{y}_t = b + \sum_i l_i x_{i,t} + \sum_h o_h\, a\left(\sum_i w_{hi} x_{i,t} + s_h\right)",
        *REGRESSORS,
    )

    bias: Annotated[FiniteFloat, "b"]
    linear: Annotated[fields.Vector, "l_i"]
    hidden: Annotated[fields.Vector, "w_i"]
    activation: Literal["tanh", "wavelet"] = "tanh"

    def __post_init__(self) -> None:
        super().__post_init__()
        n = len(self.places)
        if len(self.linear) != n or len(self.hidden) % (n + 2) != 0:
            raise ModelError(
                f"the weights of {self.kind!r} do not fit {n} regressors",
                remedy=f"give {n} linear ones, and {n + 2} numbers a unit",
            )

    def coefficients(self, sample_time: float | None) -> Array:
        units = len(self.hidden) // (len(self.linear) + 2)
        shape = [len(self.linear), units, float(self.activation == "wavelet")]
        return np.array([*self.head(sample_time), *shape, *self.places, *self.pack()])

    def symbol_of(self, field: str, index: tuple[int, ...]) -> str:
        """Return the symbol of a number: those of hidden units have the unit first."""
        if field != "hidden":
            return super().symbol_of(field, index)
        n = len(self.linear)
        unit, k = divmod(index[0], n + 2)
        if k < n:
            return f"w_{{{unit + 1},{k + 1}}}"
        return f"{'so'[k - n]}_{{{unit + 1}}}"

    def slopes(self, regressors: Array) -> tuple[Array, Array]:
        """Return the derivatives by bias, linear and hidden weights, and past outputs, for tanh."""
        (k, n), past = regressors.shape, self.output_lags
        units = np.reshape(self.hidden, (-1, n + 2))
        a = np.tanh(regressors @ units[:, :n].T + units[:, n])
        by_sum = (1.0 - a**2) * units[:, n + 1]
        by_hidden = np.empty((k, len(units), n + 2))
        by_hidden[:, :, :n] = by_sum[:, :, np.newaxis] * regressors[:, np.newaxis, :]
        by_hidden[:, :, n], by_hidden[:, :, n + 1] = by_sum, a
        by_parameters = np.column_stack([np.ones(k), regressors, by_hidden.reshape(k, -1)])
        return by_parameters, np.array(self.linear)[:past] + by_sum @ units[:, :past]

    @classmethod
    def example(cls) -> Self:
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
