"""The play (backlash) operator, the unit from which Prandtl-Ishlinskii models are built.

With threshold r and input u: w_t = min(max(w_{t-1}, u_t - r), u_t + r). Its output follows the
input through a dead zone of width 2 r, and remembers where it was left.

Source: "Modeling and Compensation of Stiffness-Dependent Hysteresis Coupling Behavior for Parallel
Pneumatic Artificial Muscle-Driven Soft Manipulator", Eq. (3) with both envelopes the identity.
"""

from __future__ import annotations

from typing import ClassVar, Self

from pydantic import FiniteFloat
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks.base import Block, Kernel, Start
from mckibben.blocks.fields import DISPLACEMENT, PRESSURE, STRICT, ChannelField, StoredInitial
from mckibben.blocks.hysteresis.play_operators import check_thresholds, start_operators
from mckibben.blocks.kernels import kernel, step
from mckibben.blocks.notation import Notation


@step
def play_step(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
    """Run one play operator; coefficients are [r]."""
    r = coefficients[0]
    s = state[0]
    u = inputs[0]
    s = min(max(s, u - r), u + r)
    outputs[0] = s
    state[0] = s


@kernel
def play_start(coefficients: Array, state: Array, inputs: Array, virgin: bool) -> None:
    """Start a play operator."""
    start_operators(coefficients, inputs[0], inputs[0], virgin, state)


@kernel
def play_matrix(u: Array, r: Array, s: Array, operators: Array) -> None:
    """Run play operators side by side: ``operators[t, i]`` is operator i after sample t.

    Shapes: u (n,), r and s (N,), operators (n, N). Changes the states ``s``.
    """
    for t in range(u.size):
        for i in range(r.size):
            s[i] = min(max(s[i], u[t] - r[i]), u[t] + r[i])
            operators[t, i] = s[i]


@dataclass(frozen=True, config=STRICT)
class Play(Block):
    """One play operator.

    Parameters
    ----------
    threshold : float
        Half the dead zone, in the unit of the input; at least 0.
    initial : {"first_sample", "virgin"} or sequence of float
        Default memory before the first sample.
    input, output : Channel
        Channel driven and channel given.
    """

    kind: ClassVar[str] = "play"
    kernel: ClassVar[Kernel] = play_step
    start_kernel: ClassVar[Start] = play_start
    parameters: ClassVar[tuple[str, ...]] = ("threshold",)
    notation: ClassVar[Notation] = Notation(
        r"y = F_r[u],\quad F_r[u]_t = \min(\max(F_r[u]_{t-1},\, u_t - r),\, u_t + r)",
        threshold="r [{u}]",
    )

    threshold: FiniteFloat
    initial: StoredInitial = "first_sample"
    input: ChannelField = PRESSURE
    output: ChannelField = DISPLACEMENT

    def __post_init__(self) -> None:
        check_thresholds(self.kind, (self.threshold,), (1.0,))

    @property
    def n_states(self) -> int:
        """The operator's own output."""
        return 1

    @classmethod
    def example(cls) -> Self:
        """Return a play operator with a dead zone of 1 bar."""
        return cls(0.5)
