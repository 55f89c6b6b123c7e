"""Linear coupling of muscles, h = G^T v.

Muscles may be more than the coordinates that they move together, or the other way round.

Source: "Modeling and Compensation of Stiffness-Dependent Hysteresis Coupling Behavior for Parallel
Pneumatic Artificial Muscle-Driven Soft Manipulator", Eqs. (8) and (14).
"""

from __future__ import annotations

from typing import Annotated, Self

import numpy as np
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.fields import STRICT, Channel, Channels, Rows, rows
from mckibben.blocks.kernels import step
from mckibben.errors import ModelError

WORST_CONDITION = 1e8
"""Condition number above which a coupling counts as singular."""


@step
def coupling_step(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
    """Multiply by a matrix; coefficients are its rows, one per output."""
    n = inputs.size
    for j in range(outputs.size):
        total = 0.0
        for i in range(n):
            total += coefficients[j * n + i] * inputs[i]
        outputs[j] = total


@dataclass(frozen=True, config=STRICT)
class Coupling(Block):
    """Coupling of n muscles, h_j = sum_i G_ij v_i.

    Parameters
    ----------
    gains : sequence of n sequences of m floats
        G: row i is the contribution of muscle i to every muscle, or to every coordinate; 1 on the
        diagonal where its own is the unit. Finite; of full rank where an inverse is wanted.
    driven, given : sequence of n and of m Channel
        Channels driven and channels given.
    """

    kind = "coupling"
    ports = ("driven",), (), ("given",)
    kernel = coupling_step
    is_linear = True
    parameters = ("gains",)
    formulas = (r"h_j = \sum_i G_{ij} v_i",)

    gains: Annotated[Rows, "G_{ij} [{out1}/{in0}]"]
    driven: Annotated[Channels, "v_i"]
    given: Annotated[Channels, "h_j"]

    def __post_init__(self) -> None:
        widths = [len(row) for row in self.gains]
        n, m = len(self.driven), len(self.given)
        if min(n, m) == 0 or widths != [m] * n:
            raise ModelError(
                f"those of {self.kind!r} have rows of {widths}, and it {n} inputs and {m} outputs",
                parameter="gains",
                remedy="give a row an input, of one number an output",
            )

    @property
    def matrix(self) -> Array:
        """G, shape (n, m)."""
        return np.array(self.gains)

    def coefficients(self, sample_time: float | None) -> Array:
        """Return G^T, row after row."""
        return np.ascontiguousarray(self.matrix.T).ravel()

    @property
    def radius(self) -> float:
        """Spectral radius of I - G^T: the paper's Jacobi iteration, Eq. (28), converges below 1."""
        n, m = self.matrix.shape
        if n != m:
            raise ModelError(
                f"{n} inputs and {m} outputs have no such radius", remedy="use inverse()"
            )
        return float(np.abs(np.linalg.eigvals(np.eye(n) - self.matrix.T)).max())

    def inverse(self) -> Block:
        """Return the decoupling v = G^-T h; for redundant v, the one of least norm.

        Raises
        ------
        ModelError
            If the gains are singular, or nearly.
        """
        condition = float(np.linalg.cond(self.matrix))
        if not condition < WORST_CONDITION:
            raise ModelError(
                "the coupling cannot be inverted: its gains are singular (condition "
                f"{condition:.1e})",
                remedy="identify it from runs in which each muscle is driven alone",
            )
        invert = np.linalg.inv if len(self.driven) == len(self.given) else np.linalg.pinv
        return Coupling(rows(invert(self.matrix)), self.given, self.driven)

    def passes(self, low: Array, high: Array) -> tuple[Array, Array]:
        at_low, at_high = self.matrix.T * low, self.matrix.T * high
        return np.minimum(at_low, at_high).sum(axis=1), np.maximum(at_low, at_high).sum(axis=1)

    @classmethod
    def example(cls) -> Self:
        """Return the paper's Table 3."""
        drives = tuple(Channel(f"displacement_{k}", "mm") for k in (1, 2, 3))
        gains = ((1.0, 0.1124, 0.0356), (0.1521, 1.0, 0.2153), (0.5368, 0.6321, 1.0))
        return cls(gains, drives, drives)
