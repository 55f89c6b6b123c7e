"""Nonlinear state-space model in continuous time: a linear part and a layer of tanh units.

x' = rate (L_x v + R_x tanh(H v)),
y = offset + scale (L_y v + R_y tanh(H v)),    v = [x, u, 1],

with every input u less its offset, over its scale, and every output y of its own offset and scale. From
sample to sample inputs go in straight lines or stay; the equations are integrated by the classic
Runge-Kutta method in substeps. Nothing is known of what is modelled but the number of its states.

Source: Suykens, De Moor and Vandewalle, "Nonlinear system identification using neural state space
models", 1995; in continuous time, as neural ordinary differential equations.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Annotated, Any, Self

import numpy as np
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks import fields
from mckibben.blocks.base import SEVERAL, Block
from mckibben.blocks.kernels import kernel, step
from mckibben.blocks.sample_times import needs_sample_time
from mckibben.blocks.solving import eliminate
from mckibben.errors import ModelError
from mckibben.recording import Recording
from mckibben.signals.periodic import band_limited

HEAD = 6
SUBSTEP, N_SUBSTEPS, HOLDS, N_STATES, N_OUTPUTS, UNITS = range(HEAD)
"""Places of the coefficients before offsets and scales of inputs, then of outputs, then the weights;
`SUBSTEP` is in units of 1 / rate, and `HOLDS` 1 for zero-order hold.
"""

SETTLING, SETTLING_STEP, LENGTHENED, LONGEST_STEP = 64, 0.1, 1.5, 1e9
"""Number of implicit steps in which an initial equilibrium is reached, the length of the first in units
of 1 / rate, the factor from one to the next, and the longest, which is a step of Newton's method.
"""

FASTEST = 2.5
"""Largest substep, in units of 1 / rate."""


@kernel
def activate(hidden: Array, v: Array, act: Array) -> None:
    """Fill in tanh(H v)."""
    width = v.size
    for j in range(act.size):
        s = 0.0
        for e in range(width):
            s += hidden[j * width + e] * v[e]
        act[j] = math.tanh(s)


@kernel
def weighted(linear: Array, readout: Array, first: int, v: Array, act: Array, found: Array) -> None:
    """Fill in rows of L v + R tanh(H v), from the first on."""
    width, units = v.size, act.size
    for i in range(found.size):
        row, read = (first + i) * width, (first + i) * units
        s = 0.0
        for e in range(width):
            s += linear[row + e] * v[e]
        for j in range(units):
            s += readout[read + j] * act[j]
        found[i] = s


@kernel
def advance(
    linear: Array, hidden: Array, readout: Array, x: Array, given: Array, h: float, work: Array
) -> None:
    """Take a Runge-Kutta step under inputs that go in straight lines.

    Shapes: x (n,); given (2 m,), inputs at the start of the step, and how far they rise in it; work
    (n + m + 1 + units + 2 n,).
    """
    n, m = x.size, given.size // 2
    units = work.size - (3 * n + m + 1)
    v, act = work[: n + m + 1], work[n + m + 1 : n + m + 1 + units]
    k, total = work[n + m + 1 + units : 2 * n + m + 1 + units], work[2 * n + m + 1 + units :]
    v[n + m] = 1.0
    for i in range(n):
        v[i] = x[i]
        total[i] = 0.0
    for j in range(m):
        v[n + j] = given[j]
    for stage in range(4):
        activate(hidden, v, act)
        weighted(linear, readout, 0, v, act, k)
        way = 1.0 if stage >= 2 else 0.5
        weight = 2.0 if stage == 1 or stage == 2 else 1.0
        for i in range(n):
            total[i] += weight * k[i]
            v[i] = x[i] + way * h * k[i]
        for j in range(m):
            v[n + j] = given[j] + way * given[m + j]
    for i in range(n):
        x[i] += h / 6.0 * total[i]


@step
def state_network_step(
    coefficients: Array, state: Array, scratch: Array, inputs: Array, outputs: Array
) -> None:
    """Advance the model; the state is [x, last inputs]."""
    h, count, held = coefficients[SUBSTEP], int(coefficients[N_SUBSTEPS]), coefficients[HOLDS] > 0.0
    n, units, m, p = (
        int(coefficients[N_STATES]),
        int(coefficients[UNITS]),
        inputs.size,
        outputs.size,
    )
    width, scales = n + m + 1, HEAD + 2 * m
    weights = coefficients[scales + 2 * p :]
    linear = weights[: (n + p) * width]
    hidden = weights[(n + p) * width : (n + p + units) * width]
    readout = weights[(n + p + units) * width :]
    x, given, work = state[:n], scratch[: 2 * m], scratch[2 * m : 2 * m + width + units + 2 * n]
    v, act = work[:width], work[width : width + units]
    for j in range(m):
        centre, scale = coefficients[HEAD + j], coefficients[HEAD + m + j]
        last, now = (state[n + j] - centre) / scale, (inputs[j] - centre) / scale
        given[j] = last
        given[m + j] = 0.0 if held else (now - last) / count
        state[n + j] = inputs[j]
    for _ in range(count):
        advance(linear, hidden, readout, x, given, h, work)
        for j in range(m):
            given[j] += given[m + j]
    for i in range(n):
        v[i] = x[i]
    for j in range(m):
        v[n + j] = (inputs[j] - coefficients[HEAD + j]) / coefficients[HEAD + m + j]
    activate(hidden, v, act)
    weighted(linear, readout, n, v, act, outputs)
    for j in range(p):
        outputs[j] = coefficients[scales + j] + coefficients[scales + p + j] * outputs[j]


@kernel
def state_network_start(
    coefficients: Array, state: Array, scratch: Array, inputs: Array, virgin: bool
) -> None:
    """Start in equilibrium with the first inputs, to which steps lead from 0; or with zeros."""
    state[:] = 0.0
    if not virgin:
        n, p, units = (
            int(coefficients[N_STATES]),
            int(coefficients[N_OUTPUTS]),
            int(coefficients[UNITS]),
        )
        m, width = inputs.size, n + inputs.size + 1
        weights = coefficients[HEAD + 2 * m + 2 * p :]
        linear = weights[: (n + p) * width]
        hidden = weights[(n + p) * width : (n + p + units) * width]
        readout = weights[(n + p + units) * width :]
        v, act = scratch[:width], scratch[width : width + units]
        change = scratch[width + units : width + units + n]
        matrix = scratch[width + units + n : width + units + n + n * n].reshape((n, n))
        for i in range(n):
            v[i] = 0.0
        for j in range(m):
            v[n + j] = (inputs[j] - coefficients[HEAD + j]) / coefficients[HEAD + m + j]
            state[n + j] = inputs[j]
        v[n + m] = 1.0
        length = SETTLING_STEP
        for _ in range(SETTLING):
            activate(hidden, v, act)
            weighted(linear, readout, 0, v, act, change)
            for i in range(n):
                for e in range(n):
                    s = linear[i * width + e]
                    for j in range(units):
                        slope = 1.0 - act[j] * act[j]
                        s += readout[i * units + j] * slope * hidden[j * width + e]
                    matrix[i, e] = (1.0 / length if i == e else 0.0) - s
            eliminate(matrix, change)
            for i in range(n):
                v[i] += change[i]
            length = min(LENGTHENED * length, LONGEST_STEP)
        for i in range(n):
            state[i] = v[i]


PERIODS, REPEATS = 100, 1e-9
"""Maximum number of periods simulated, and the relative difference at which two are equal."""

BETWEEN = 2
"""Interpolated samples per substep of a band-limited input."""


def steady_state(block: StateNetwork, recording: Recording) -> Recording:
    """Return the steady-state response to a periodic recording.

    Inputs are taken to be band-limited between samples, as a multisine measured over whole
    periods is; neither holds of `simulate`, which starts somewhere and joins samples as `hold` says.

    Parameters
    ----------
    block : StateNetwork
    recording : Recording
        A whole number of periods of the inputs, with time.

    Returns
    -------
    Recording
        Of the inputs, and the modelled outputs.

    Raises
    ------
    ModelError
        Where no response comes to repeat itself.
    """
    inputs = block._inputs_from(recording)
    step, ratio = needs_sample_time(block.kind, recording.sample_time), BETWEEN * block.substeps
    fine = np.column_stack([np.roll(band_limited(column, ratio), -1) for column in inputs.T])
    finer = replace(block, substeps=1, hold="first")
    state = block.initial_state(inputs[0], "virgin", step)
    outputs = np.empty((len(fine), len(block.outputs)))
    run = finer.bind(step / ratio, state, np.ascontiguousarray(fine), outputs)
    state[block.order :] = inputs[0]
    before = np.full((len(inputs), outputs.shape[1]), np.inf)
    for _ in range(PERIODS):
        run()
        now = np.roll(outputs[ratio - 1 :: ratio], 1, axis=0)
        change, span = np.abs(now - before).max(axis=0), np.ptp(now, axis=0)
        if not np.isfinite(now).all() or (change <= REPEATS * span).all():
            break
        before = now.copy()
    if not (change <= REPEATS * span).all():
        raise ModelError(
            f"the response of {block.kind!r} to {recording.name} is not periodic "
            f"within {PERIODS} periods",
            remedy="use simulate, which starts from rest",
        )
    return block._modelled(recording, now)


@dataclass(frozen=True, kw_only=True, config=fields.STRICT)
class StateNetwork(Block):
    """State-space model of a linear part and tanh units, with n states, m inputs and p outputs.

    Parameters
    ----------
    linear : rows of float, shape (n + p, n + m + 1)
        L: for every state, then for every output, the weights of all states, of the inputs, and a
        constant.
    hidden : rows of float, shape (units, n + m + 1)
        H: the same for every unit.
    readout : rows of float, shape (n + p, units)
        R: for every state, then for every output, the weights of the units.
    rate : float
        Of time [1/s]; positive.
    input_offset, input_scale : sequence of m float
        In the unit of each input; scales positive.
    output_offset, output_scale : sequence of p float
        In the unit of each output; scales positive.
    driven, scheduled, given : sequence of Channel
        Inputs driven, those that schedule (treated alike), and outputs.
    substeps : int
        Runge-Kutta steps from sample to sample.
    hold : {"first", "zero"}
        What inputs do between samples: go on in a straight line, or stay.
    initial : {"first_sample", "virgin"} or sequence of float
        Default memory before the first sample: as after the first inputs have long been held, or states
        and inputs 0.
    """

    kind = "state-network"
    kernel = state_network_step
    start_kernel = state_network_start
    ports = SEVERAL
    rate_dependent = True
    steady_state = steady_state
    parameters = ("linear", "hidden", "readout")
    formulas = (
        r"z_i = \sum_j L_{ij} v_j + \sum_j R_{ij} \tanh\left(\sum_k H_{jk} v_k\right),\quad "
        r"v = \left(x,\, \frac{u_i - u_{0i}}{u_{si}},\, \ldots,\, 1\right)",
        r"\dot{x}_i = \lambda z_i,\quad y_k = y_{0k} + y_{sk} z_{n+k}",
    )

    linear: Annotated[fields.Rows, "L_{ij}"]
    hidden: Annotated[fields.Rows, "H_{ij}"]
    readout: Annotated[fields.Rows, "R_{ij}"]
    rate: Annotated[fields.Positive, r"\lambda [1/s]"]
    input_offset: Annotated[fields.Vector, "u_{0i} [{in0}]"]
    input_scale: Annotated[fields.PositiveVector, "u_{si} [{in0}]"]
    output_offset: Annotated[fields.Vector, "y_{0k} [{out0}]"]
    output_scale: Annotated[fields.PositiveVector, "y_{sk} [{out0}]"]
    driven: Annotated[fields.Channels, "u_i"]
    scheduled: Annotated[fields.Channels, "u_i"] = ()
    given: Annotated[fields.Channels, "y_k"]
    substeps: fields.Substeps = 1
    hold: fields.Hold = "first"
    initial: fields.StoredInitial = "first_sample"

    @staticmethod
    def converted(fields: dict[str, Any]) -> dict[str, Any]:
        """Return fields as of today: one input and one output, which was the first state, before."""
        if "input" not in fields:
            return fields
        scales = ("input_offset", "input_scale", "output_offset", "output_scale")
        width, units = len(fields["linear"][0]), len(fields["hidden"])
        return {
            **{name: value for name, value in fields.items() if name not in ("input", "output")},
            **{name: (fields[name],) for name in scales},
            "linear": (*fields["linear"], (1.0, *(0.0,) * (width - 1))),
            "readout": (*fields["readout"], (0.0,) * units),
            "driven": (fields["input"],),
            "scheduled": (),
            "given": (fields["output"],),
        }

    def __post_init__(self) -> None:
        self.check_channels()
        n, m, p, units = self.order, len(self.inputs), len(self.outputs), len(self.hidden)
        width = n + m + 1
        wide = [len(row) for row in (*self.linear, *self.hidden)]
        read = [len(row) for row in self.readout]
        if n < 1 or not units or {*wide} != {width} or read != [units] * (n + p):
            raise ModelError(
                f"{self.kind!r} has rows of weights of lengths {wide} and {read} for {n} "
                f"states, {m} input(s), {p} output(s) and {units} units",
                remedy=f"give {width} weights a state, an output and a unit, and for every state "
                f"and output {units} weights of units",
            )
        sizes = [len(self.input_offset), len(self.input_scale)]
        sizes += [len(self.output_offset), len(self.output_scale)]
        if sizes != [m, m, p, p]:
            raise ModelError(
                f"{self.kind!r} of {m} input(s) and {p} output(s) has {sizes} offsets and scales",
                remedy="give one of each a channel",
            )

    @property
    def order(self) -> int:
        """Number n of states x."""
        return len(self.linear) - len(self.given)

    @property
    def n_states(self) -> int:
        """States, and the last inputs."""
        return self.order + len(self.inputs)

    @property
    def n_scratch(self) -> int:
        """Inputs and their rise, v, the units, two or a matrix of as many numbers as states."""
        n, m = self.order, len(self.inputs)
        return 2 * m + n + m + 1 + len(self.hidden) + max(2 * n, n + n * n)

    def coefficients(self, sample_time: float | None) -> Array:
        step = self.rate * needs_sample_time(self.kind, sample_time) / self.substeps
        if not step <= FASTEST:
            raise ModelError(
                f"{self.kind!r} of a rate of {self.rate:.3g} 1/s is too fast for "
                f"{self.substeps} substep(s) of {sample_time:g} s together",
                remedy=f"at least {np.ceil(3 * step * self.substeps):.0f} substeps, or a "
                "shorter sample time",
            )
        counts = [self.order, len(self.given), len(self.hidden)]
        head = [step, self.substeps, self.hold == "zero", *counts]
        scales = [self.input_offset, self.input_scale, self.output_offset, self.output_scale]
        return np.concatenate([head, *scales, self.pack()])

    @classmethod
    def example(cls) -> Self:
        linear = ((0.0, 1.0, 0.0, 0.0), (-1.5, -0.4, 1.0, 0.0), (1.0, 0.0, 0.0, 0.0))
        return cls(
            linear=linear,
            hidden=((1.0, 0.1, 0.0, 0.1), (0.2, 1.0, 0.1, -0.2)),
            readout=((0.0, 0.02), (0.6, -0.2), (0.0, 0.0)),
            rate=15.0,
            input_offset=(1.0,),
            input_scale=(3.0,),
            output_offset=(0.5,),
            output_scale=(2.0,),
            driven=(fields.FORCE,),
            given=(fields.DISPLACEMENT,),
            substeps=2,
        )
