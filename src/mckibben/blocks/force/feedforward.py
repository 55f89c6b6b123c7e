"""Pressure for a desired force at a measured length, in closed form.

f = p g(l) + h(l) + s(p) f_h(l, l'), s(p) = 1 + gain (p - reference), is linear in p, so
p = (f - h - f_h (1 - gain reference)) / (g + gain f_h). This is the feedforward compensation of
"A Multistate Friction Model for the Compensation of the Asymmetric Hysteresis in the Mechanical Response
of Pneumatic Artificial Muscles", Section 4.
"""

from __future__ import annotations

from functools import cache
from typing import Annotated, Self

import numpy as np
from pydantic import BeforeValidator, InstanceOf
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks.base import Block, Start
from mckibben.blocks.compose import Parallel, Series
from mckibben.blocks.coupled.load_estimate import ForceCompensator
from mckibben.blocks.fields import STRICT, Initial
from mckibben.blocks.force.laws import ForceLaw, PolynomialForce
from mckibben.blocks.force.multistate_friction import (
    MultistateFriction,
    multistate_friction_start,
    multistate_friction_step,
)
from mckibben.blocks.kernels import Step, kernel, step
from mckibben.blocks.memoryless import Polynomial
from mckibben.blocks.saving import nested
from mckibben.errors import ModelError

LEAST_PULL = 1e-9
"""Smallest force per bar for which a pressure is computed [N/bar]."""

SINGLE = {"LEAST_PULL": 1e-9}


@cache
def law_kernels(law: type[ForceLaw]) -> tuple[Step, Start]:
    """Return step and start kernel of a feedforward for a kind of force law.

    Coefficients are [size of the law's, the law's, the friction's if there is some]; the state is the
    friction's.
    """
    terms = law.terms_kernel

    @step
    def force_feedforward_step(
        coefficients: Array, state: Array, scratch: Array, inputs: Array, outputs: Array
    ) -> None:
        """Compute the pressure for a force at a length; NaN if there is none."""
        n = int(coefficients[0])
        friction = coefficients[1 + n :]
        per_bar, rest = terms(inputs[1], coefficients[1 : 1 + n])
        slid, gain, reference = 0.0, 0.0, 0.0
        if friction.size > 0:
            gain, reference = friction[1], friction[2]
            at, force = scratch[:2], scratch[2:3]
            at[0], at[1] = inputs[1], reference
            multistate_friction_step(friction, state, scratch[3:], at, force)
            slid = force[0]
        pull = per_bar + gain * slid
        missing = inputs[0] - rest - slid * (1.0 - gain * reference)
        outputs[0] = np.nan if abs(pull) < LEAST_PULL else missing / pull

    @kernel
    def force_feedforward_start(
        coefficients: Array, state: Array, scratch: Array, inputs: Array, virgin: bool
    ) -> None:
        """Start the friction at the first length."""
        friction = coefficients[1 + int(coefficients[0]) :]
        multistate_friction_start(friction, state, scratch[3:], inputs[1:], virgin)

    return force_feedforward_step, force_feedforward_start


@dataclass(frozen=True, config=STRICT)
class ForceFeedforward(Block):
    """Pressure from desired force and measured length.

    Parameters
    ----------
    law : ForceLaw
        Static force, linear in pressure.
    friction : MultistateFriction, optional
        What hysteresis adds.
    """

    kind = "force-feedforward"
    ports = ("law.output",), ("law.input",), ("law.pressure",)
    parameters = ("law", "friction")
    typical = (PolynomialForce((50.0, 5.0), (-10.0, 5.0)), MultistateFriction.example())
    formulas = (
        r"p = \frac{f - h(l) - f_h (1 - g_p p_r)}{g(l) + g_p f_h}",
        r"f = p\, g(l) + h(l) + \left(1 + g_p (p - p_r)\right) f_h[l]",
    )

    law: Annotated[InstanceOf[ForceLaw], BeforeValidator(nested)]
    friction: Annotated[InstanceOf[MultistateFriction] | None, BeforeValidator(nested)] = None

    def __post_init__(self) -> None:
        self.law.check_linear()
        if self.friction is not None and self.friction.inputs != self.law.inputs:
            raise ModelError(
                "law and friction differ in their channels",
                remedy="give both the same length and pressure",
            )

    @classmethod
    def of(cls, model: Block) -> Self | None:
        """Return the feedforward of a force model; None for other models.

        Parameters
        ----------
        model : Block
            A `ForceLaw` that is linear in pressure, alone or with friction in `Parallel`.

        Raises
        ------
        ModelError
            If the law is not linear in pressure.
        """
        match model:
            case ForceLaw():
                return cls(model)
            case Parallel(parts=(ForceLaw() as law, MultistateFriction() as friction)):
                return cls(law, friction)
        return None

    @property
    def forward_model(self) -> Block:
        return self.law if self.friction is None else Parallel((self.law, self.friction))

    @property
    def rate_dependent(self) -> bool:  # type: ignore[override]
        return self.friction is not None

    @property
    def kernel(self) -> Step:  # type: ignore[override]
        return law_kernels(type(self.law))[0]

    @property
    def start_kernel(self) -> Start | None:  # type: ignore[override]
        return None if self.friction is None else law_kernels(type(self.law))[1]

    @property
    def n_states(self) -> int:
        return 0 if self.friction is None else self.friction.n_states

    @property
    def n_scratch(self) -> int:
        return 3 + (0 if self.friction is None else self.friction.n_scratch)

    @property
    def start(self) -> Initial:
        return self.law.start if self.friction is None else self.friction.start

    def coefficients(self, sample_time: float | None) -> Array:
        law = self.law.coefficients(sample_time)
        numbers = np.array([law.size, *law])
        if self.friction is None:
            return numbers
        return np.append(numbers, self.friction.coefficients(sample_time))


def compensator(model: Block) -> Block:
    """Return the compensator of a model: of a force, from that and the length, or the inverse.

    Commands of an inverse without limits of its own end where the model was identified.

    Raises
    ------
    ModelError
        If there is none.
    """
    return ForceFeedforward.of(model) or ForceCompensator.of(model) or _limited(model)


def _limited(model: Block) -> Block:
    inverse, ranges = model.inverse(), model.known_inputs[: model.n_driven]
    if len(ranges) > 1 or np.isfinite(inverse.reachable()).all() or not np.isfinite(ranges).all():
        return inverse
    (channel,), (ends,) = inverse.outputs, ranges
    identity = Polynomial((0.0, 1.0), input_range=tuple(ends), input=channel, output=channel)
    return Series((inverse, identity.inverse()))
