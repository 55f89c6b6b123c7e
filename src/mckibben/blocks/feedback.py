"""Feedback controllers as blocks, saved, streamed and exported like compensators.

u = base + kp e + integral - kd rate,  e = reference - measured,

one loop a muscle: the derivative is of the measurement, through a first-order filter; the integral
stops where the output is at a limit and would be driven further (Åström and Hägglund, "Advanced PID
Control", ch. 3). What runs on the robot is a compensator with such feedback on top.

Kernels are written in the subset of Python of docs/kernels.md; fields are in the order of saved files.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import Annotated, Any, Self

import numpy as np
from annotated_types import Ge
from pydantic import BeforeValidator, FiniteFloat, InstanceOf
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks.base import SEVERAL, Block, Board
from mckibben.blocks.compose import Composition
from mckibben.blocks.fields import STRICT, Channel, Channels, Vector
from mckibben.blocks.kernels import accumulate, kernel, step
from mckibben.blocks.parameters import one_per, same_as
from mckibben.blocks.sample_times import needs_sample_time
from mckibben.blocks.saving import nested
from mckibben.errors import ModelError
from mckibben.recording import COMMAND, MEASURED

BASE = "_base"
"""Suffix of the name of the command that feedback is added to."""


@step
def pid_step(
    coefficients: Array, state: Array, scratch: Array, inputs: Array, outputs: Array
) -> None:
    """Advance the loops; the state is [integrals, rates, last measurements, last references].

    Coefficients are [sample time, share of the filter, lowest, highest, whether there is a base,
    whether references are delayed by a step, kp, ki, kd]; inputs are references, measurements, bases.
    """
    n = outputs.size
    step, filter_share = coefficients[0], coefficients[1]
    lowest, highest = coefficients[2], coefficients[3]
    has_base, reference_delayed = coefficients[4] > 0.0, coefficients[5] > 0.0
    kp, ki, kd = coefficients[6 : 6 + n], coefficients[6 + n : 6 + 2 * n], coefficients[6 + 2 * n :]
    for k in range(n):
        reference, measured = inputs[k], inputs[n + k]
        error = (state[3 * n + k] if reference_delayed else reference) - measured
        state[n + k] += filter_share * ((measured - state[2 * n + k]) / step - state[n + k])
        state[2 * n + k], state[3 * n + k] = measured, reference

        base = inputs[2 * n + k] if has_base else 0.0
        output = base + kp[k] * error + state[k] - kd[k] * state[n + k]
        direction = ki[k] * error
        winding_up = (output > highest and direction > 0.0) or (output < lowest and direction < 0.0)
        if not winding_up:
            state[k] = accumulate(state[k], ki[k] * step * error, scratch, k)
        outputs[k] = min(max(output, lowest), highest)


@kernel
def pid_start(
    coefficients: Array, state: Array, scratch: Array, inputs: Array, virgin: bool
) -> None:
    """Start with zero integrals and rates, at the first measurements."""
    n = state.size // 4
    state[: 2 * n] = 0.0
    for k in range(n):
        state[2 * n + k] = inputs[n + k]
        state[3 * n + k] = inputs[n + k]
    scratch[:] = 0.0


@dataclass(frozen=True, config=STRICT)
class PIDFeedback(Block):
    """Independent PID loops of n muscles.

    Parameters
    ----------
    kp, ki, kd : sequence of n floats
        Gains [bar/mm], [bar/(mm s)], [bar s/mm].
    limits : (float, float)
        Of the output [bar], lowest first.
    filter_time : float
        Of the derivative [s]; not negative.
    driven : sequence of n Channel
        References.
    scheduled : sequence of n or 2 n Channel
        Measurements, then, if any, what feedback is added to.
    given : sequence of n Channel
        Outputs.
    late : bool
        Whether the measurement answers the reference of the step before, as behind a compensator.
    """

    kind = "pid"
    n_states = one_per("driven", times=4)  # integrals, rates, last measurements and references
    n_scratch = one_per("driven")  # what single precision loses of the integrals
    ports = SEVERAL
    kernel = pid_step
    start_kernel = pid_start
    rate_dependent = True
    no_inverse = "has no inverse"
    instead = "invert the model of the muscle"
    parameters = ("kp", "ki", "kd")
    same_length = (*parameters, "driven", "given")
    formulas = (
        r"p_i = p_{b,i} + k_{p,i} e_i + k_{i,i} \int e_i\, dt - k_{d,i} \dot{y}_i,\quad "
        "e_i = r_i - y_i",
        r"p_{\min} \le p_i \le p_{\max},\quad \dot{y}_i \text{ is filtered with the time constant } T",
    )

    kp: Annotated[Vector, "k_{p,i} [bar/mm]"]
    ki: Annotated[Vector, "k_{i,i} [bar/mm s]"]
    kd: Annotated[Vector, "k_{d,i} [bar s/mm]"]
    limits: Annotated[tuple[FiniteFloat, FiniteFloat], "p_i [bar]"]
    filter_time: Annotated[FiniteFloat, Ge(0), "T [s]"]
    driven: Annotated[Channels, "r_i"]
    scheduled: Annotated[Channels, "y_i"]
    given: Annotated[Channels, "p_i"]
    late: bool = False

    def symbol_of(self, field: str, index: tuple[int, ...]) -> str:
        """Return the symbol of a number, or of a limit."""
        if field == "limits":
            return (r"p_{\min}", r"p_{\max}")[index[0]]
        return super().symbol_of(field, index)

    def letter_of(self, field: str, k: int) -> str:
        """Return the letter of a channel: what feedback is added to is behind the measurements."""
        added = field == "scheduled" and k >= len(self.driven)
        return "p_{b,i}" if added else super().letter_of(field, k)

    def __post_init__(self) -> None:
        self.check_channels()
        n = len(self.driven)
        if len(self.scheduled) not in (n, 2 * n):
            raise ModelError(
                f"{self.kind!r} of {n} references has {len(self.scheduled)} measurements and bases",
                remedy=f"give {n} of each",
            )
        if not self.limits[0] < self.limits[1]:
            raise ModelError(
                f"limits of {self.kind!r} are {self.limits}", remedy="give lowest, then highest"
            )

    def coefficients(self, sample_time: float | None) -> Array:
        step = needs_sample_time(self.kind, sample_time)
        share = step / (self.filter_time + step)
        based = len(self.scheduled) > len(self.driven)
        head = [step, share, *self.limits, float(based), float(self.late)]
        return np.array([*head, *self.kp, *self.ki, *self.kd])

    @classmethod
    def of(
        cls,
        references: Channels,
        outputs: Channels,
        kp: Sequence[float],
        ki: Sequence[float],
        kd: Sequence[float] | None = None,
        *,
        limits: tuple[float, float],
        filter_time: float = 0.1,
    ) -> Self:
        """Return feedback alone, from references and their measurements to outputs.

        Parameters are those of the class; without kd the derivative is left out.
        """
        gains = tuple(kp), tuple(ki), (0.0,) * len(kp) if kd is None else tuple(kd)
        return cls(
            *gains, limits, filter_time, references, _with_suffix(references, MEASURED), outputs
        )

    def behind(self, compensator: Block) -> Self:
        """Return the same feedback added to a compensator's outputs, matched by name and unit.

        Raises
        ------
        ModelError
            If the compensator has other references or outputs.
        """
        references, outputs = compensator.inputs[: compensator.n_driven], compensator.outputs
        pairs = {channel: place for place, channel in enumerate(self.driven)}
        if set(pairs) != set(references) or set(map(_sent, self.given)) != set(map(_sent, outputs)):
            names, output_names = (
                f"{_listed(ins)} to {_listed(outs)}"
                for ins, outs in ((self.driven, self.given), (references, outputs))
            )
            raise ModelError(
                f"feedback goes from {names}, and the compensator from {output_names}",
                remedy="tune it for the compensator's (tune_pid(..., "
                "references=compensator.inputs))",
            )
        order = [pairs[channel] for channel in references]
        by_sent = {_sent(channel): channel for channel in outputs}
        given = tuple(by_sent[_sent(self.given[place])] for place in order)
        kp, ki, kd = (tuple(gains[k] for k in order) for gains in (self.kp, self.ki, self.kd))
        scheduled = (*_with_suffix(references, MEASURED), *_with_suffix(given, BASE))
        made = replace(self, kp=kp, ki=ki, kd=kd, late=True)
        return replace(made, driven=references, scheduled=scheduled, given=given)

    @classmethod
    def example(cls) -> Self:
        from mckibben.blocks.coupled.balance import Balance

        compensator = Balance.example()
        gains = (0.05, 0.04), (0.2, 0.3), (0.002, 0.0)
        ends = compensator.inputs[:2], compensator.outputs
        return cls.of(*ends, *gains, limits=(0.0, 5.0)).behind(compensator)


def _with_suffix(channels: Channels, suffix: str) -> Channels:
    """Return the channels with a suffix added to their names."""
    return tuple(Channel(f"{channel.name}{suffix}", channel.unit) for channel in channels)


def _sent(channel: Channel) -> tuple[str, str]:
    """Return name and unit of a command, whether or not it was recorded as one."""
    return channel.name.removeprefix(COMMAND), channel.unit


def _listed(channels: Channels) -> str:
    return ", ".join(f"{channel.name} [{channel.unit or '-'}]" for channel in channels)


@dataclass(frozen=True, config=STRICT)
class FeedforwardFeedback(Composition):
    """Compensator with feedback correction.

    Inputs are the references, what is measured, and what schedules the compensator.

    Parameters
    ----------
    compensator : Block
        From references, and what schedules it, to pressures.
    feedback : PIDFeedback
        Whose references are the compensator's, and whose bases are its outputs.
    """

    kind = "feedforward-feedback"
    rate_dependent = True
    parameters = ("compensator", "feedback")

    compensator: Annotated[InstanceOf[Block], BeforeValidator(nested)]
    feedback: Annotated[InstanceOf[PIDFeedback], BeforeValidator(nested)]

    path_dependent = same_as("compensator.path_dependent")
    forward_model = same_as("compensator.forward_model")
    samples_ahead = same_as("compensator.samples_ahead")
    outputs = same_as("compensator.outputs")

    def __post_init__(self) -> None:
        made = self.feedback.behind(self.compensator)
        if made.inputs != self.feedback.inputs:
            raise ModelError(
                f"feedback takes {_listed(self.feedback.inputs)}, and behind the "
                f"compensator {_listed(made.inputs)}",
                remedy="make both one with FeedforwardFeedback.of",
            )
        self.check_channels()

    @classmethod
    def of(cls, compensator: Block, feedback: PIDFeedback) -> Self:
        """Return a compensator with feedback added to its outputs."""
        return cls(compensator, feedback.behind(compensator))

    @property
    def parts(self) -> tuple[Block, ...]:  # type: ignore[override]
        return (self.compensator, self.feedback)

    @property
    def measured(self) -> tuple[Channel, ...]:
        """The measured channels."""
        return self.feedback.scheduled[: len(self.feedback.driven)]

    @cached_property
    def inputs(self) -> tuple[Channel, ...]:
        """References, measurements, and further inputs of the compensator."""
        n = len(self.feedback.driven)
        further = (c for c in self.compensator.inputs[n:] if c not in self.measured)
        return (*self.compensator.inputs[:n], *self.measured, *further)

    @cached_property
    def scheduling(self) -> tuple[str, ...]:
        return tuple(channel.name for channel in self.inputs[len(self.feedback.driven) :])

    def wired(self, board: Board, taken: Sequence[Any]) -> list[Any]:
        wires = dict(zip(self.inputs, taken, strict=True))
        bases = self.compensator.wired(board, [wires[c] for c in self.compensator.inputs])
        wires |= dict(zip(_with_suffix(self.outputs, BASE), bases, strict=True))
        results = self.feedback.wired(board, [wires[channel] for channel in self.feedback.inputs])
        return [results[self.feedback.given.index(channel)] for channel in self.outputs]

    def joined(self, parts: Sequence[str]) -> str:
        return f"p = {parts[0]}[r] + {parts[1]}[r, y]"

    @classmethod
    def example(cls) -> Self:
        from mckibben.blocks.coupled.balance import Balance

        return cls(Balance.example(), PIDFeedback.example())
