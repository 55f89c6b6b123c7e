"""Nonlinear state-space model in continuous time: a linear part and a layer of tanh units.

x' = rate (L [x, u, 1] + R tanh(H [x, u, 1])),
output = offset + scale x_1,

with u the input less its offset, over its scale. From sample to sample the input goes in a straight
line or stays; the equations are integrated by the classic Runge-Kutta method in substeps. Nothing is
known of what is modelled but the number of its states.

Source: Suykens, De Moor and Vandewalle, "Nonlinear system identification using neural state space
models", 1995; in continuous time, as neural ordinary differential equations.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Annotated, Self

import numpy as np
from pydantic import FiniteFloat
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks import fields
from mckibben.blocks.base import Block
from mckibben.blocks.kernels import kernel, step
from mckibben.blocks.parameters import one_per
from mckibben.blocks.sample_times import needs_sample_time
from mckibben.errors import ModelError
from mckibben.recording import Recording
from mckibben.signals.periodic import band_limited

HEAD = 9
SUBSTEP, N_SUBSTEPS, HOLDS, N_STATES, UNITS = range(5)
INPUT_CENTRE, INPUT_SCALE, OUTPUT_CENTRE, OUTPUT_SCALE = range(5, HEAD)
"""Places of the coefficients before the weights; `SUBSTEP` is in units of 1 / rate, and `HOLDS` 1 for
zero-order hold.
"""

SETTLING, SETTLING_STEP = 1000, 0.1
"""Number of steps in which an initial equilibrium is reached, and their length in units of 1 /
rate.
"""

FASTEST = 2.5
"""Largest substep, in units of 1 / rate."""


@kernel
def rates(weights: Array, n: int, units: int, x: Array, u: float, found: Array) -> None:
    """Fill in x', in units of the rate; weights are [L, H, R], row by row."""
    width = n + 2
    hidden, readout = n * width, n * width + units * width
    for i in range(n):
        found[i] = weights[i * width + n] * u + weights[i * width + n + 1]
        for j in range(n):
            found[i] += weights[i * width + j] * x[j]
    for h in range(units):
        row = hidden + h * width
        s = weights[row + n] * u + weights[row + n + 1]
        for j in range(n):
            s += weights[row + j] * x[j]
        a = math.tanh(s)
        for i in range(n):
            found[i] += weights[readout + i * units + h] * a


@kernel
def advance(
    weights: Array, n: int, units: int, x: Array, start: float, rise: float, h: float, work: Array
) -> None:
    """Take a Runge-Kutta step; work has room for 3 n numbers."""
    at, k, total = work[:n], work[n : 2 * n], work[2 * n : 3 * n]
    rates(weights, n, units, x, start, k)
    for i in range(n):
        total[i] = k[i]
        at[i] = x[i] + 0.5 * h * k[i]
    rates(weights, n, units, at, start + 0.5 * rise, k)
    for i in range(n):
        total[i] += 2.0 * k[i]
        at[i] = x[i] + 0.5 * h * k[i]
    rates(weights, n, units, at, start + 0.5 * rise, k)
    for i in range(n):
        total[i] += 2.0 * k[i]
        at[i] = x[i] + h * k[i]
    rates(weights, n, units, at, start + rise, k)
    for i in range(n):
        x[i] += h / 6.0 * (total[i] + k[i])


@step
def state_network_step(
    coefficients: Array, state: Array, scratch: Array, inputs: Array, outputs: Array
) -> None:
    """Advance the model; the state is [x, last input]."""
    h, count, held = coefficients[SUBSTEP], int(coefficients[N_SUBSTEPS]), coefficients[HOLDS] > 0.0
    n, units = int(coefficients[N_STATES]), int(coefficients[UNITS])
    weights = coefficients[HEAD:]
    last = (state[n] - coefficients[INPUT_CENTRE]) / coefficients[INPUT_SCALE]
    now = (inputs[0] - coefficients[INPUT_CENTRE]) / coefficients[INPUT_SCALE]
    rise = 0.0 if held else (now - last) / count
    for s in range(count):
        advance(weights, n, units, state, last + s * rise, rise, h, scratch)
    state[n] = inputs[0]
    outputs[0] = coefficients[OUTPUT_CENTRE] + coefficients[OUTPUT_SCALE] * state[0]


@kernel
def state_network_start(
    coefficients: Array, state: Array, scratch: Array, inputs: Array, virgin: bool
) -> None:
    """Start in equilibrium with the first input, or with zeros."""
    state[:] = 0.0
    if not virgin:
        n, units = int(coefficients[N_STATES]), int(coefficients[UNITS])
        u = (inputs[0] - coefficients[INPUT_CENTRE]) / coefficients[INPUT_SCALE]
        for _ in range(SETTLING):
            advance(coefficients[HEAD:], n, units, state, u, 0.0, SETTLING_STEP, scratch)
        state[n] = inputs[0]


PERIODS, REPEATS = 100, 1e-9
"""Maximum number of periods simulated, and the relative difference at which two are equal."""

BETWEEN = 2
"""Interpolated samples per substep of a band-limited input."""


def steady_state(block: StateNetwork, recording: Recording) -> Recording:
    """Return the steady-state response to a periodic recording.

    The input is taken to be band-limited between samples, as a multisine measured over whole
    periods is; neither holds of `simulate`, which starts somewhere and joins samples as `hold` says.

    Parameters
    ----------
    block : StateNetwork
    recording : Recording
        A whole number of periods of the input, with time.

    Returns
    -------
    Recording
        Of the input, and the modelled output.

    Raises
    ------
    ModelError
        Where no response comes to repeat itself.
    """
    given = block._inputs_from(recording)
    step, ratio = needs_sample_time(block.kind, recording.sample_time), BETWEEN * block.substeps
    fine = np.ascontiguousarray(np.roll(band_limited(given[:, 0], ratio), -1)[:, np.newaxis])
    finer = replace(block, substeps=1, hold="first")
    state, found = block.initial_state(given[0], "virgin", step), np.empty_like(fine)
    run = finer.bind(step / ratio, state, fine, found)
    state[-1] = given[0, 0]
    before = np.full(len(given), np.inf)
    for _ in range(PERIODS):
        run()
        now = np.roll(found[ratio - 1 :: ratio, 0], 1)
        change = np.abs(now - before).max()
        if not np.isfinite(now).all() or change <= REPEATS * np.ptp(now):
            break
        before = now.copy()
    if not change <= REPEATS * np.ptp(now):
        raise ModelError(
            f"the response of {block.kind!r} to {recording.name} is not periodic "
            f"within {PERIODS} periods",
            remedy="use simulate, which starts from rest",
        )
    return block._modelled(recording, now[:, np.newaxis])


@dataclass(frozen=True, kw_only=True, config=fields.STRICT)
class StateNetwork(fields.WithMemory, Block):
    """State-space model of a linear part and tanh units.

    Parameters
    ----------
    linear : rows of float, shape (n, n + 2)
        L: for every state the weights of all, of the input, and a constant.
    hidden : rows of float, shape (units, n + 2)
        H: the same for every unit.
    readout : rows of float, shape (n, units)
        R: for every state the weights of the units.
    rate : float
        Of time [1/s]; positive.
    input_offset, input_scale, output_offset, output_scale : float
        Scales positive.
    substeps : int
        Runge-Kutta steps from sample to sample.
    hold : {"first", "zero"}
        What the input does between samples: go on in a straight line, or stay.
    initial : {"first_sample", "virgin"} or sequence of float
        Default memory before the first sample: as after the first input has long been held, or states
        and input 0.
    """

    kind = "state-network"
    kernel = state_network_step
    start_kernel = state_network_start
    rate_dependent = True
    steady_state = steady_state
    parameters = ("linear", "hidden", "readout")
    n_states = one_per("linear", 1)  # states, and the last input
    n_scratch = one_per("linear", times=3)  # a state, its rates, and their sum
    formulas = (
        r"\dot{x} = \lambda \left(L v + R \tanh(H v)\right),\quad v = \left(x,\, \frac{u "
        r"- u_0}{u_s},\, 1\right)",
        "y = y_0 + y_s x_1",
    )

    linear: Annotated[fields.Rows, "L_{ij}"]
    hidden: Annotated[fields.Rows, "H_{ij}"]
    readout: Annotated[fields.Rows, "R_{ij}"]
    rate: Annotated[fields.Positive, r"\lambda [1/s]"]
    input_offset: Annotated[FiniteFloat, "u_0 [{u}]"] = 0.0
    input_scale: Annotated[fields.Positive, "u_s [{u}]"] = 1.0
    output_offset: Annotated[FiniteFloat, "y_0 [{y}]"] = 0.0
    output_scale: Annotated[fields.Positive, "y_s [{y}]"] = 1.0
    substeps: fields.Substeps = 1
    hold: fields.Hold = "first"
    input: fields.ChannelField = fields.FORCE

    def __post_init__(self) -> None:
        n, units = len(self.linear), len(self.hidden)
        wide = [len(row) for row in (*self.linear, *self.hidden)]
        read = [len(row) for row in self.readout]
        if not n or not units or {*wide} != {n + 2} or read != [units] * n:
            raise ModelError(
                f"{self.kind!r} has rows of weights of lengths {wide} and {read} for {n} "
                f"states and {units} units",
                remedy=f"give {n + 2} weights a state, {n + 2} a unit, and for every state "
                f"{units} weights of units",
            )

    def coefficients(self, sample_time: float | None) -> Array:
        step = self.rate * needs_sample_time(self.kind, sample_time) / self.substeps
        if not step <= FASTEST:
            raise ModelError(
                f"{self.kind!r} of a rate of {self.rate:.3g} 1/s is too fast for "
                f"{self.substeps} substep(s) of {sample_time:g} s together",
                remedy=f"at least {np.ceil(3 * step * self.substeps):.0f} substeps, or a "
                "shorter sample time",
            )
        head = [step, self.substeps, self.hold == "zero", len(self.linear), len(self.hidden)]
        scales = [self.input_offset, self.input_scale, self.output_offset, self.output_scale]
        return np.array([*head, *scales, *self.pack()])

    @classmethod
    def example(cls) -> Self:
        linear = ((0.0, 1.0, 0.0, 0.0), (-1.5, -0.4, 1.0, 0.0))
        return cls(
            linear=linear,
            hidden=((1.0, 0.1, 0.0, 0.1), (0.2, 1.0, 0.1, -0.2)),
            readout=((0.0, 0.02), (0.6, -0.2)),
            rate=15.0,
            input_offset=1.0,
            input_scale=3.0,
            output_offset=0.5,
            output_scale=2.0,
            substeps=2,
        )
