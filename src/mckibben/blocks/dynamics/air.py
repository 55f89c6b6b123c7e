"""Valve and air: from a valve's or regulator's command to the pressure.

The command u (a voltage, or a pressure asked for) is a goal for the pressure x, while filling and while
venting another, between which the valve stays closed:

    filling  T_f x' = g_f - x   where  g_f = clip(K (u - u_0 - h/2)) > x,
    venting  T_v x' = g_v - x   where  g_v = clip(K (u - u_0 + h/2)) < x,

clipped to the pressures of surroundings and supply. What is measured is x, late by a dead time. Within a
sample the command is held, so x goes one way only and x <- x + (1 - exp(-T / T_f)) (g_f - x) is exact at
any sample time. As of `Creep`, the output of a sample is that at its end; where command and pressure are
read at one instant, the sample for which the command was held is part of the dead time.

The inverse is in closed form and does not compensate the dead time: the response is delayed by it,
unless the reference is given ahead (`mckibben.control.previewed`).
"""

from __future__ import annotations

import math
import warnings
from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Le
from pydantic import Field, FiniteFloat
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks import fields
from mckibben.blocks.inverse import Invertible
from mckibben.blocks.kernels import ROUNDING, SLACK, kernel, remember, step
from mckibben.blocks.sample_times import needs_sample_time
from mckibben.errors import ModelError, ModelWarning

LONGEST_LAG = 1e6
"""Largest time constant [s]."""

APPROACHED = 0.05
"""Share of the range at either end that is approached only asymptotically and not counted as
reachable.
"""

WHOLE_WITHIN = 1e-6
"""Share of a sample by which a dead time may differ from a whole number of samples."""


GAIN, FILLS_FROM, VENTS_FROM, FILLED, VENTED, LOWEST, HIGHEST, LATE = range(8)
"""Places of the coefficients: gain, offset while filling, while venting, share of the way that a sample
fills, that it vents, lowest, highest pressure, dead time in samples.
"""


@kernel
def pressure_after(c: Array, x: float, u: float) -> float:
    """Return the pressure after a sample."""
    filling = min(max(c[GAIN] * (u - c[FILLS_FROM]), c[LOWEST]), c[HIGHEST])
    if filling > x:
        return x + c[FILLED] * (filling - x)
    venting = min(max(c[GAIN] * (u - c[VENTS_FROM]), c[LOWEST]), c[HIGHEST])
    if venting < x:
        return x + c[VENTED] * (venting - x)
    return x


@kernel
def middle_of(c: Array) -> float:
    """Return the command for zero pressure, midway between filling and venting."""
    return 0.5 * (c[FILLS_FROM] + c[VENTS_FROM])


@kernel
def resting_pressure(c: Array, u: float, virgin: bool) -> float:
    """Return the steady pressure of a command; for a virgin start, the ambient pressure or 0."""
    if virgin:
        return c[LOWEST] if c[LOWEST] > -math.inf else 0.0
    return min(max(c[GAIN] * (u - middle_of(c)), c[LOWEST]), c[HIGHEST])


@step
def air_step(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
    """Advance the model; the state is [pressure, past pressures, latest first]."""
    late = int(coefficients[LATE])
    state[0] = pressure_after(coefficients, state[0], inputs[0])
    outputs[0] = state[late]
    remember(state[0], state[1 : late + 1])


@kernel
def air_start(coefficients: Array, state: Array, inputs: Array, virgin: bool) -> None:
    """Start at the steady pressure of the first command, or at ambient pressure."""
    state[:] = resting_pressure(coefficients, inputs[0], virgin)


@step
def air_inverse_step(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
    """Advance the inverse; coefficients are [forward ones, lowest, highest command].

    The state is [pressure, samples clipped].
    """
    c = coefficients
    lowest, highest = c[c.size - 2], c[c.size - 1]
    middle = middle_of(c)
    wanted, x = inputs[0], state[0]
    # pressures that differ by less are held, in the middle between filling and venting
    held = ROUNDING * (abs(wanted) + c[GAIN] * abs(middle))
    if wanted > x + held:
        u = min(x + (wanted - x) / c[FILLED], c[HIGHEST]) / c[GAIN] + c[FILLS_FROM]
    elif wanted < x - held:
        u = max(x + (wanted - x) / c[VENTED], c[LOWEST]) / c[GAIN] + c[VENTS_FROM]
    else:
        wanted = x
        u = x / c[GAIN] + middle
    u = min(max(u, lowest), highest)
    reached = pressure_after(c, x, u)
    if abs(reached - wanted) > SLACK * (abs(wanted) + c[GAIN] * abs(u)):
        state[1] += 1.0
        state[0] = reached
    else:
        state[0] = wanted
    outputs[0] = u


@kernel
def air_inverse_start(coefficients: Array, state: Array, inputs: Array, virgin: bool) -> None:
    """Start at the steady pressure of the first command, within its limits."""
    c = coefficients
    u = min(max(inputs[0] / c[GAIN] + middle_of(c), c[c.size - 2]), c[c.size - 1])
    state[0], state[1] = resting_pressure(c, u, virgin), 0.0


@dataclass(frozen=True, config=fields.STRICT)
class Air(fields.WithMemory, Invertible):
    """Valve or regulator with air, from command to measured pressure.

    Parameters
    ----------
    gain : float
        K, pressure per command; positive.
    offset : float
        u_0 [command]: where the goal is 0, in the middle between filling and venting.
    hysteresis : float
        h [command]: by how much the command for a pressure is higher while it rises than while it
        falls; not negative.
    filling_time, venting_time : float
        Time constants T_f and T_v [s]; 0 for none.
    dead_time : float
        Delay of the pressure [s]: up to 254 samples. It is rounded to whole samples, with
        a warning where that changes it.
    ambient, supply : float or None
        Lowest and highest pressure that the valve can aim for; None for no such limit.
    input_range : (float, float), optional
        Lowest and highest command that the inverse may give. Default none.
    initial : {"first_sample", "virgin"} or sequence of float
        Default memory before the first sample: at rest where the first command leads, in the middle
        between filling and venting; or at the ambient pressure, or 0.
    input, output : Channel
        Command, and pressure.
    """

    kind = "air"
    n_inverse_states = 2  # the pressure, and samples clipped
    kernel = air_step
    start_kernel = air_start
    inverse_kernel = air_inverse_step
    inverse_start_kernel = air_inverse_start
    rate_dependent = True
    parameters = (*("gain", "offset", "hysteresis", "filling_time", "venting_time"),)
    typical = (0.6, 0.1, 0.06, 0.03, 0.05, 0.02, 0.0, 6.0, (0.0, 10.0))
    formulas = (
        r"\begin{cases} T_f \dot{x} = g_f - x & \text{filling, } g_f = K (u - u_0 - h/2) "
        r"> x \\ T_v \dot{x} = g_v - x & \text{venting, } g_v = K (u - u_0 + h/2) < x "
        r"\end{cases}",
        r"y(t) = x(t - T_d),\quad p_{\min} \le g_f, g_v \le p_{\max}",
    )

    gain: Annotated[fields.Positive, "K [{y}/{u}]"]
    offset: Annotated[FiniteFloat, "u_0 [{u}]"]
    hysteresis: Annotated[fields.NotNegative, "h [{u}]"]
    filling_time: Annotated[FiniteFloat, Ge(0), Le(LONGEST_LAG), "T_f [s]"]
    venting_time: Annotated[FiniteFloat, Ge(0), Le(LONGEST_LAG), "T_v [s]"]
    dead_time: Annotated[fields.NotNegative, "T_d [s]"] = 0.0
    ambient: Annotated[FiniteFloat | None, r"p_{\min} [{y}]"] = 0.0
    supply: Annotated[FiniteFloat | None, r"p_{\max} [{y}]"] = None
    input_range: fields.InputRange | None = None
    input: fields.ChannelField = Field(default=fields.Channel("voltage", "V"), kw_only=True)
    output: fields.ChannelField = Field(default=fields.PRESSURE, kw_only=True)

    def __post_init__(self) -> None:
        lowest, highest = self.pressures
        if not lowest < highest:
            raise ModelError(
                f"{self.kind!r} has an ambient pressure of {lowest:g} and a supply of "
                f"{highest:g} {self.output.unit}",
                parameter="supply",
                remedy="give a supply above the ambient pressure, or None",
            )

    @property
    def pressures(self) -> tuple[float, float]:
        """Lowest and highest target pressure; infinite without limits."""
        lowest = -math.inf if self.ambient is None else self.ambient
        return lowest, math.inf if self.supply is None else self.supply

    @property
    def offsets(self) -> tuple[float, float]:
        """Commands of zero target pressure while filling, and while venting."""
        return self.offset + 0.5 * self.hysteresis, self.offset - 0.5 * self.hysteresis

    @property
    def n_states(self) -> int:
        """States: the pressure and, with a dead time, past ones."""
        return 1 + (fields.LONGEST_DELAY if self.dead_time > 0 else 0)

    def goal(self, command: float, way: Literal[-1, 1]) -> float:
        """Return the steady pressure of a command when filling, 1, or venting, -1."""
        lowest, highest = self.pressures
        aimed = self.gain * (command - self.offset - 0.5 * way * self.hysteresis)
        return min(max(aimed, lowest), highest)

    def check_time(self, sample_time: float | None) -> None:
        """Warn if the dead time is not a whole number of samples."""
        late = self.coefficients(sample_time)[LATE]
        assert sample_time is not None
        if abs(self.dead_time / sample_time - late) > WHOLE_WITHIN:
            warnings.warn(
                f"the dead time of {self.kind!r}, {self.dead_time:g} s, is no whole number of samples "
                f"of {sample_time:g} s: {late * sample_time:g} s is taken",
                ModelWarning,
                stacklevel=4,
            )

    def coefficients(self, sample_time: float | None) -> Array:
        """Return [gain, offsets, shares per step, pressures, dead time] for a sample time."""
        step = needs_sample_time(self.kind, sample_time)
        late = self.dead_time / step
        if not late <= fields.LONGEST_DELAY + 0.5:
            raise ModelError(
                f"a dead time of {self.dead_time:g} s is {late:.0f} samples",
                remedy=f"a dead time of at most {fields.LONGEST_DELAY} samples, or a longer "
                "sample time",
            )
        times = (self.filling_time, self.venting_time)
        shares = [-math.expm1(-step / time) if time > 0 else 1.0 for time in times]
        return np.array([self.gain, *self.offsets, *shares, *self.pressures, round(late)])

    def inverse_state(self, state: Array) -> Array:
        return np.array([state[0], 0.0])

    def reachable(self) -> tuple[Array, Array]:
        """Return the pressures that are reachable from every state, each of shape (1,).

        With lags the ends of the range are only approached: a twentieth is left out at both. How
        fast references may change there depends on the lags.
        """
        low, high = self.input_limits
        ends = sorted([self.goal(low, -1), self.goal(high, 1)])
        lowest, highest = np.array(ends)
        lags = self.filling_time > 0 or self.venting_time > 0
        margin = APPROACHED * (highest - lowest) if lags and np.isfinite(ends).all() else 0.0
        return np.array([lowest + margin]), np.array([highest - margin])

    def inverse_complaint(self, state: Array) -> str:
        low, high = self.reachable()
        return (
            f"{int(state[-1])} sample(s) of the reference {self.output.name!r} were clipped: they are "
            f"beyond supply or surroundings, or change faster than {self.input.name} within its limits "
            f"makes the air flow. Reachable in time is {low[0]:.6g} to {high[0]:.6g} {self.output.unit}"
        )
