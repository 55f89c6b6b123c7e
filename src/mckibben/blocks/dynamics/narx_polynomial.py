"""Polynomial NARX model: f is a sum of products of regressors.

Source: Chen, Billings and Luo 1989 (orthogonal least squares); see `mckibben.blocks.dynamics.narx`.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Self

import numpy as np
from annotated_types import MaxLen
from pydantic import BeforeValidator
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks.base import Kernel, Start
from mckibben.blocks.dynamics.narx import HEAD, Narx, give_output, start_resting, take_input
from mckibben.blocks.fields import STRICT, Vector, rows
from mckibben.blocks.kernels import kernel, step
from mckibben.blocks.notation import Notation
from mckibben.errors import ModelError

HIGHEST_DEGREE, MOST_TERMS = 20, 10_000

Term = Annotated[tuple[int, ...], MaxLen(HIGHEST_DEGREE)]
Terms = Annotated[tuple[Term, ...], MaxLen(MOST_TERMS), BeforeValidator(rows)]


@kernel
def sum_of_terms(coefficients: Array, state: Array) -> float:
    """Return the scaled output of the regressors in the state.

    After what all NARX kernels start with: highest degree, then for every term its weight and,
    padded with -1, the places in the state of its factors.
    """
    k = HEAD + int(coefficients[2])
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


@step
def narx_polynomial_step(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
    """Run the model."""
    take_input(inputs[0], coefficients, state)
    outputs[0] = give_output(sum_of_terms(coefficients, state), coefficients, state)


@kernel
def narx_polynomial_start(coefficients: Array, state: Array, inputs: Array, virgin: bool) -> None:
    """Start the model at rest."""
    start_resting(sum_of_terms, coefficients, state, inputs, virgin)


@dataclass(frozen=True, kw_only=True, config=STRICT)
class NarxPolynomial(Narx):
    """Polynomial NARX model.

    Parameters
    ----------
    terms : sequence of sequence of int
        Regressors multiplied in each term, by their number: past outputs first, then inputs, then
        operators; none for the constant. Repeated for powers.
    weights : sequence of float
        One a term.
    **others
        As for `mckibben.blocks.dynamics.narx.Narx`.
    """

    kind: ClassVar[str] = "narx-polynomial"
    kernel: ClassVar[Kernel] = narx_polynomial_step
    start_kernel: ClassVar[Start] = narx_polynomial_start
    parameters: ClassVar[tuple[str, ...]] = ("weights",)
    notation: ClassVar[Notation] = Notation(
        r"\bar{y}_t = \sum_i w_i \prod_{j \in P_i} x_{j,t}",
        r"x_t = (\bar{y}_{t-1}, \ldots, \bar{y}_{t-n},\, \bar{u}_{t-d}, \ldots, "
        r"\bar{u}_{t-d-m+1},\, F_{r_1}[\bar{u}]_t, \ldots)",
        r"\bar{u} = (u - u_1) / u_2,\quad \bar{y} = (y - y_1) / y_2",
        weights="w_i",
        thresholds="r_i",
        input_scale="u_i [{u}]",
        output_scale="y_i [{y}]",
        sample_time="T [s]",
    )

    terms: Terms
    weights: Vector

    def __post_init__(self) -> None:
        self.check_structure()
        most = len(self.places)
        if len(self.terms) != len(self.weights) or any(
            not 0 <= factor < most for term in self.terms for factor in term
        ):
            raise ModelError(
                f"the terms of {self.kind!r} do not fit. Remedy: give one weight a term, and factors "
                f"between 0 and {most - 1}."
            )

    def coefficients(self, sample_time: float | None) -> Array:
        """Return what the kernel reads."""
        degree = max((len(term) for term in self.terms), default=0)
        places = self.places
        rows = [
            [weight, *(places[f] for f in term), *[-1] * (degree - len(term))]
            for term, weight in zip(self.terms, self.weights, strict=True)
        ]
        return np.array([*self.head(sample_time), degree, *np.ravel(rows)], dtype=np.float64)

    def slopes(self, regressors: Array) -> tuple[Array, Array]:
        """Return the products themselves, and the derivative of their sum by past outputs."""
        by_past = np.zeros((len(regressors), self.output_lags))
        for term, weight in zip(self.terms, self.weights, strict=True):
            for place, factor in enumerate(term):
                if factor < self.output_lags:
                    others = term[:place] + term[place + 1 :]
                    by_past[:, factor] += weight * products(regressors, (others,))[:, 0]
        return products(regressors, self.terms), by_past

    @classmethod
    def example(cls) -> Self:
        """Return a first-order model with a quadratic term and a play operator."""
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


def products(regressors: Array, terms: tuple[tuple[int, ...], ...]) -> Array:
    """Return the terms at regressors of shape (k, number of regressors), shape (k, number of terms)."""
    found = np.ones((len(regressors), len(terms)))
    for column, term in enumerate(terms):
        for factor in term:
            found[:, column] *= regressors[:, factor]
    return found
