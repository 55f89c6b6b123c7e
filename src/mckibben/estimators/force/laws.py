"""Identification of static force laws from isometric runs, solved for by least squares."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from annotated_types import Gt

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.fields import Channel, vector
from mckibben.blocks.force.laws import (
    MU_DECAY,
    NEWTONS_PER_BAR,
    ChouHannaford,
    PolynomialForce,
    TonduLopez,
)
from mckibben.blocks.runs import Run
from mckibben.estimators.core.data import TrainingData
from mckibben.estimators.core.separable import SeparableEstimator

Law = Literal["bilinear", "petrovic", "minh", "schindele"]
ORDERS: dict[Law, tuple[int, int]] = {
    "bilinear": (1, 2),
    "petrovic": (2, 2),
    "minh": (3, 3),
    "schindele": (3, 4),
}
"""Orders in length of what multiplies pressure, and of what does not."""


class PolynomialForceEstimator(SeparableEstimator):
    """Force linear in pressure and polynomial in length, by least squares.

    Source of the bilinear-quadratic law: "A Multistate Friction Model for the Compensation of the
    Asymmetric Hysteresis in the Mechanical Response of Pneumatic Artificial Muscles", Eq. (3).

    Parameters
    ----------
    pressure : str
        Channel of the pressure.
    law : {"bilinear", "petrovic", "minh", "schindele"}
        Whose orders in length.
    """

    purpose = "force"
    cannot = "No hysteresis."
    inverse_kind = "exact"
    made_for = ("length", "force")
    input_settings = ("pressure",)
    rises = False

    pressure: str = "pressure"
    nonnegative = False
    law: Law = "bilinear"

    def basis(self, theta: Array, run: Run, data: TrainingData) -> Array:
        return force_columns(self.law, run, data)

    def build(self, theta: Array, linear: Array, offset: float, data: TrainingData) -> Block:
        return force_law(self.law, linear, offset, data, self.channels(data))


def force_columns(law: Law, run: Run, data: TrainingData) -> Array:
    """Return the regressors of a polynomial law over a run, without its constant, shape (n, k).

    Powers of the length from -1 to 1 over its range: with the pressure, then without.
    """
    orders = ORDERS[law]
    x = (run.u - 0.5 * sum(data.input_range)) / (0.5 * data.input_span)
    with_pressure = [run.scheduled[:, 0] * x**i for i in range(orders[0] + 1)]
    return np.column_stack([*with_pressure, *[x**j for j in range(1, orders[1] + 1)]])


def force_law(
    law: Law, linear: Array, offset: float, data: TrainingData, channels: dict[str, Channel]
) -> PolynomialForce:
    """Return the polynomial law of coefficients in the order of `force_columns`, and the constant."""
    n, centre, half = ORDERS[law][0] + 1, 0.5 * sum(data.input_range), 0.5 * data.input_span
    constant = (offset, *vector(linear[n:]))
    return PolynomialForce(vector(linear[:n]), constant, centre, half, **channels)


class ChouHannafordEstimator(SeparableEstimator):
    """Chou and Hannaford's law: thread length, turns and a constant, by least squares.

    Parameters
    ----------
    pressure : str
        Channel of the pressure.
    """

    title = "Force law of Chou and Hannaford"
    purpose = "force"
    can = "Static force of an ideal braid, three numbers."
    cannot = "No end effects, no bladder, no hysteresis."
    inverse_kind = "exact"
    quick = True
    made_for = ("length", "force")
    input_settings = ("pressure",)
    rises = False

    pressure: str = "pressure"

    def basis(self, theta: Array, run: Run, data: TrainingData) -> Array:
        """Return pressure times squared length, relative to its least, and absolute.

        The law crosses zero at b / sqrt(3): weights of at least 0 keep that between no length at all
        and the shortest recorded.
        """
        length, pressure = run.inputs.T
        shortest = data.input_range[0]
        return np.column_stack([pressure * (length**2 - shortest**2), pressure * length**2])

    def lower_bounds(self, matrix: Array, data: TrainingData) -> Array:
        """Return a small lower bound of the first: without it there would be no braid."""
        reach = float(np.ptp(matrix[:, 0])) or 1.0
        return np.array([1e-3 * data.output_span / reach, 0.0])

    def build(self, theta: Array, linear: Array, offset: float, data: TrainingData) -> Block:
        per_bar = float(linear.sum())
        turns = float(np.sqrt(3 * NEWTONS_PER_BAR / (4 * np.pi * per_bar)))
        thread = data.input_range[0] * float(np.sqrt(3 * linear[0] / per_bar))
        return ChouHannaford(thread, turns, offset, **self.channels(data))


class TonduLopezEstimator(SeparableEstimator):
    """Tondu and Lopez's law with Kerscher's corrections: angle and kappa searched, mu solved for.

    Parameters
    ----------
    pressure : str
        Channel of the pressure.
    rest_length : float, optional
        Of the muscle [mm]; default the longest in the data.
    diameter : float
        Of the muscle [mm]; what it is off by goes into mu.
    """

    title = "Force law of Tondu and Lopez"
    purpose = "force"
    can = "Static force of a cylinder with end and pressure corrections."
    cannot = "No hysteresis; bends less than data often do."
    made_for = ("length", "force")
    input_settings = ("pressure",)
    rises = False
    searches_condensed = False

    pressure: str = "pressure"
    nonnegative = False
    rest_length: Annotated[float, Gt(0)] | None = None
    diameter: Annotated[float, Gt(0)] = 10.0

    def bounds(self, data: TrainingData) -> tuple[Array, Array]:
        """Return bounds of [angle, kappa_1, kappa_0]."""
        return np.array([0.2, -2.0, 0.3]), np.array([0.9, 5.0, 3.0])

    def guesses(self, data: TrainingData) -> list[Array]:
        """Return typical angles without corrections."""
        return [np.array([angle, 0.0, 1.0]) for angle in (0.35, 0.45, 0.55)]

    def law(
        self, theta: Array, mu: tuple[float, float], constant: float, data: TrainingData
    ) -> TonduLopez:
        rest_length = self.rest_length or data.input_range[1]
        angle, *kappa = theta.tolist()
        channels = self.channels(data)
        return TonduLopez(rest_length, self.diameter, angle, mu, tuple(kappa), constant, **channels)

    def basis(self, theta: Array, run: Run, data: TrainingData) -> Array:
        """Return the ideal force, with and without the decay of mu."""
        ideal = self.law(theta, (0.0, 1.0), 0.0, data)
        force = ideal.simulate(run.inputs)[:, 0]
        e = 1.0 - run.u / ideal.rest_length
        return np.column_stack([force * np.exp(-MU_DECAY * e), force])

    def build(self, theta: Array, linear: Array, offset: float, data: TrainingData) -> Block:
        return self.law(theta, (float(linear[0]), float(linear[1])), offset, data)


class BilinearForceEstimator(PolynomialForceEstimator):
    """The bilinear-quadratic law."""

    title = "Bilinear force law"
    can = "Static force, linear in pressure, polynomial in length."


class MinhForceEstimator(PolynomialForceEstimator):
    """Minh's law: cubic in length, with coefficients linear in pressure."""

    title = "Force law of Minh"
    law = "minh"


class PetrovicForceEstimator(PolynomialForceEstimator):
    """Petrovic's polynomial: quadratic in length with pressure, and without."""

    title = "Force law of Petrovic"
    quick = True
    law = "petrovic"


class SchindeleForceEstimator(PolynomialForceEstimator):
    """Schindele and Aschemann's polynomials: cubic with pressure, of fourth order without."""

    title = "Force law of Schindele and Aschemann"
    law = "schindele"
