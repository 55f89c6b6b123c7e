"""The pressure that gives a wished-for force at a measured length, in closed form.

f = p g(l) + h(l) + s(p) f_h(l, l'), s(p) = 1 + gain (p - reference), is linear in p, so
p = (f - h - f_h (1 - gain reference)) / (g + gain f_h). This is the feedforward compensation of
"A Multistate Friction Model for the Compensation of the Asymmetric Hysteresis in the Mechanical Response
of Pneumatic Artificial Muscles", Section 4.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Self

import numpy as np
from pydantic import BeforeValidator, InstanceOf
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks.compose import Parallel
from mckibben.blocks.core.block import Block, Run
from mckibben.blocks.core.fields import STRICT, Channel, Initial
from mckibben.blocks.core.notation import Notation
from mckibben.blocks.core.saving import nested
from mckibben.blocks.force.law import ForceLaw
from mckibben.blocks.force.multistate_friction import MultistateFriction
from mckibben.blocks.force.polynomial_force import PolynomialForce
from mckibben.errors import ModelError

LEAST_PULL = 1e-9
"""Force per bar below which no pressure gives a force [N/bar]."""


@dataclass(frozen=True, config=STRICT)
class ForceFeedforward(Block):
    """Pressure by wished-for force and measured length.

    Parameters
    ----------
    law : ForceLaw
        Static force, linear in pressure.
    friction : MultistateFriction, optional
        What hysteresis adds.
    """

    kind: ClassVar[str] = "force-feedforward"
    parameters: ClassVar[tuple[str, ...]] = ("law", "friction")
    notation: ClassVar[Notation] = Notation(
        r"p = \frac{f - h(l) - f_h (1 - g_p p_r)}{g(l) + g_p f_h}",
        r"f = p\, g(l) + h(l) + \left(1 + g_p (p - p_r)\right) f_h[l]",
    )

    law: Annotated[InstanceOf[ForceLaw], BeforeValidator(nested)]
    friction: Annotated[InstanceOf[MultistateFriction] | None, BeforeValidator(nested)] = None

    def __post_init__(self) -> None:
        self.law.terms(np.ones(1))
        if self.friction is not None and self.friction.inputs != self.law.inputs:
            raise ModelError(
                "law and friction differ in their channels. Remedy: give both the same length and "
                "pressure."
            )

    @property
    def undone(self) -> Block:
        """The force, of the law alone or with friction."""
        return self.law if self.friction is None else Parallel((self.law, self.friction))

    @classmethod
    def of(cls, model: Block) -> Self | None:
        """Return the feedforward of a model of force, or None if the model is another.

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
    def rate_dependent(self) -> bool:  # type: ignore[override]
        """Whether there is friction."""
        return self.friction is not None

    @property
    def inputs(self) -> tuple[Channel, ...]:
        """Force wished for, then length."""
        return (self.law.output, self.law.input)

    @property
    def outputs(self) -> tuple[Channel, ...]:
        """Pressure."""
        return (self.law.pressure,)

    @property
    def scheduling(self) -> tuple[str, ...]:
        """Length."""
        return (self.law.input.name,)

    @property
    def n_states(self) -> int:
        """Those of the friction."""
        return 0 if self.friction is None else self.friction.n_states

    @property
    def n_scratch(self) -> int:
        """That of the friction."""
        return 0 if self.friction is None else self.friction.n_scratch

    def initial_state(self, first: Array, initial: Initial | None = None) -> Array:
        """Return the friction's state at the first length."""
        if self.friction is None:
            return np.empty(0)
        return self.friction.initial_state(np.array([first[1], 0.0]), initial)

    def bind(self, sample_time: float | None, state: Array, inputs: Array, outputs: Array) -> Run:
        """Return a function that runs the friction over the lengths and solves for the pressure."""
        n = inputs.shape[0]
        gain, reference = 0.0, 0.0
        lengths, slid = np.zeros((n, 2)), np.zeros((n, 1))
        run_friction: Run | None = None
        if self.friction is not None:
            gain, reference = self.friction.pressure_gain, self.friction.reference_pressure
            lengths[:, 1] = reference
            run_friction = self.friction.bind(sample_time, state, lengths, slid)

        def run() -> None:
            lengths[:, 0] = inputs[:, 1]
            if run_friction is not None:
                run_friction()
            per_bar, rest = self.law.terms(inputs[:, 1])
            pull = per_bar + gain * slid[:, 0]
            missing = inputs[:, 0] - rest - slid[:, 0] * (1.0 - gain * reference)
            small = np.abs(pull) < LEAST_PULL
            outputs[:, 0] = np.where(small, np.nan, missing / np.where(small, 1.0, pull))

        return run

    @property
    def start(self) -> Initial:
        """The friction's."""
        return self.law.start if self.friction is None else self.friction.start

    def c_numbers(self, sample_time: float | None) -> Array:
        """Return [number of the law, size, the law's], then the friction's."""
        law = self.law.coefficients(sample_time)
        own = np.array([self.law.number, law.size, *law])
        if self.friction is None:
            return own
        return np.concatenate([own, self.friction.coefficients(sample_time)])

    @classmethod
    def example(cls) -> Self:
        """Return a feedforward with a law that pulls at all lengths of 0 to 5 mm."""
        return cls(PolynomialForce((50.0, 5.0), (-10.0, 5.0)), MultistateFriction.example())


def compensator(model: Block) -> Block:
    """Return what gives a model's commands for a wished-for output: of a force its feedforward.

    Of any other model that is its inverse.

    Raises
    ------
    ModelError
        If there is none.
    """
    return ForceFeedforward.of(model) or model.inverse()
