"""Recurrent fuzzy network in a NARMAX loop, from past outputs, driven and scheduling inputs.

Memberships remember: what a set answered one sample ago shifts its centre,

    O_ij(t) = exp(-[x_i(t) - m_ij + theta_ij O_ij(t - T)]^2 / (2 sigma_ij^2)),

with one rule for every combination of sets, normalised firing and linear consequents. The inputs x are
the last n_a outputs, the driven input now and n_b samples back, and every scheduling input now and n_c
samples back; the output is fed back, so the network always runs free.

The paper's fourth layer multiplies the firing by sum_i p_ki x_i alone; here a consequent has a constant
too, 0 where it is to be the paper's. The paper's "3N" rules are read as 3^N, one for every combination
of sets, and its N as the number of x that its NARMAX equation lists.

Source: "High-Precision Displacement and Force Hybrid Modeling of Pneumatic Artificial Muscle Using 3D
PI-NARMAX Model", Section 3.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar

import numpy as np
from annotated_types import Interval
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks.base import SEVERAL, Block
from mckibben.blocks.fields import STRICT, Channel, Channels, Positive, PositiveRows, Rows, Vector
from mckibben.blocks.kernels import kernel, remember, step
from mckibben.blocks.parameters import same_as
from mckibben.blocks.sample_times import own_sample_time
from mckibben.errors import ModelError

LEAST_FIRING = 1e-290
"""Smallest total firing strength; below it no rule is active."""

SINGLE = {"LEAST_FIRING": 1e-36}


@step
def recurrent_fuzzy_network_step(
    coefficients: Array, state: Array, scratch: Array, inputs: Array, outputs: Array
) -> None:
    """Advance the network, free-running.

    Coefficients are [n_a, n_b, n_c, sets, constants, centres, widths, feedbacks (each inputs by sets),
    consequents (rule by rule, each a coefficient for every x, then a constant if there is one)]; the
    state is [past outputs, past driven inputs, past scheduling inputs (one after another), memberships].
    """
    n_a, n_b, n_c = int(coefficients[0]), int(coefficients[1]), int(coefficients[2])
    sets, constant, n_scheduled = int(coefficients[3]), int(coefficients[4]), inputs.size - 1
    n = n_a + 1 + n_b + n_scheduled * (1 + n_c)
    centres = coefficients[5 : 5 + n * sets]
    widths = coefficients[5 + n * sets : 5 + 2 * n * sets]
    feedbacks = coefficients[5 + 2 * n * sets : 5 + 3 * n * sets]
    consequents = coefficients[5 + 3 * n * sets :]
    x = scratch
    n_past = n_a + n_b + n_scheduled * n_c
    n_rules = 1
    for _ in range(n):
        n_rules *= sets
    for k in range(n_a):
        x[k] = state[k]
    x[n_a] = inputs[0]
    for k in range(n_b):
        x[n_a + 1 + k] = state[n_a + k]
    for s in range(n_scheduled):
        at = n_a + 1 + n_b + s * (1 + n_c)
        x[at] = inputs[1 + s]
        for k in range(n_c):
            x[at + 1 + k] = state[n_a + n_b + s * n_c + k]
    memberships = state[n_past:]
    for place in range(n * sets):
        z = x[place // sets] - centres[place] + feedbacks[place] * memberships[place]
        z /= widths[place]
        memberships[place] = np.exp(-0.5 * z * z)
    total, y = 0.0, 0.0
    for rule in range(n_rules):
        firing, rest = 1.0, rule
        for i in range(n - 1, -1, -1):
            firing *= memberships[i * sets + rest % sets]
            rest //= sets
        at = rule * (n + constant)
        answer = consequents[at + n] if constant else 0.0
        for i in range(n):
            answer += consequents[at + i] * x[i]
        total += firing
        y += firing * answer
    y = y / total if total > LEAST_FIRING else (state[0] if n_a > 0 else 0.0)
    outputs[0] = y
    remember(y, state[:n_a])
    remember(inputs[0], state[n_a : n_a + n_b])
    for s in range(n_scheduled):
        at = n_a + n_b + s * n_c
        remember(inputs[1 + s], state[at : at + n_c])


@kernel
def recurrent_start(coefficients: Array, state: Array, inputs: Array, virgin: bool) -> None:
    """Start with constant past inputs, and outputs equal to the driven input."""
    n_a, n_b, n_c = int(coefficients[0]), int(coefficients[1]), int(coefficients[2])
    state[:] = 0.0
    state[: n_a + n_b] = inputs[0]
    for s in range(inputs.size - 1):
        at = n_a + n_b + s * n_c
        state[at : at + n_c] = inputs[1 + s]


Lag = Annotated[int, Interval(ge=0, le=10)]


@dataclass(frozen=True, config=STRICT)
class RecurrentFuzzyNetwork(Block):
    """Recurrent Takagi-Sugeno network in a NARMAX loop.

    Parameters
    ----------
    centres, widths, feedbacks : sequence of sequence of float
        m, sigma (positive) and theta of the sets of every x; as many sets for each.
    consequents : sequence of float
        Rule after rule (the last x's set running fastest): a coefficient for every x, then the constant
        if there is one.
    own_time : float
        Sample time that the network holds for [s], positive.
    output_lags, input_lags, scheduling_lags : int
        n_a (at least 1), n_b and n_c.
    driven, scheduled, given : sequence of Channel
        One driven input, those that schedule, one output.
    constants : bool
        Whether consequents have a constant term.
    """

    kind = "recurrent-fuzzy-network"
    added: ClassVar[Mapping[str, int]] = {"constants": 2}
    sample_time = same_as("own_time")
    n_scratch = same_as("n_regressors")
    ports = SEVERAL
    kernel = recurrent_fuzzy_network_step
    start_kernel = recurrent_start
    rate_dependent = True
    of_local_rules = True
    typical = (
        ((0.0, 40.0), (0.0, 40.0), (0.0, 150.0)),
        ((30.0, 30.0), (30.0, 30.0), (100.0, 100.0)),
        ((0.5, -0.5), (0.3, 0.2), (2.0, -1.0)),
        tuple(
            number
            for rule in range(8)
            for number in (0.6 + 0.02 * (rule & 1), 0.3 - 0.02 * (rule >> 2), -0.01, 0.5)
        ),
        0.01,
        (Channel("displacement_free", "mm"),),
        (Channel("force", "N"),),
        (Channel("displacement", "mm"),),
    )
    no_inverse = "has no inverse: within one sample its input hardly changes its output"
    instead = "invert balance, or close a loop"
    parameters = ("centres", "widths", "feedbacks", "consequents")
    formulas = (
        r"y_t = \frac{\sum_r \omega_r\, (\sum_i P_{ri} x_{i,t} + c_r)}{\sum_r \omega_r},\quad "
        r"\omega_r = \prod_i O_{ij,t},\quad j \text{: the set of } x_i \text{ in rule } r",
        r"O_{ij,t} = \exp\left(-\frac{(x_{i,t} - m_{ij} + \theta_{ij} O_{ij,t-1})^2}{2 "
        r"\sigma_{ij}^2}\right)",
        r"x_t = (y_{t-1}, \ldots,\; u_t, \ldots,\; s_t, \ldots),\quad t \text{ counts samples of } T",
    )

    centres: Annotated[Rows, "m_{ij}"]
    widths: Annotated[PositiveRows, r"\sigma_{ij}"]
    feedbacks: Annotated[Rows, r"\theta_{ij}"]
    consequents: Annotated[Vector, "P_{ri}"]
    own_time: Annotated[Positive, "T [s]"]
    driven: Annotated[Channels, "u"]
    scheduled: Annotated[Channels, "s_i"]
    given: Annotated[Channels, "y"]
    output_lags: Annotated[int, Interval(ge=1, le=10)] = 1
    input_lags: Lag = 0
    scheduling_lags: Lag = 0
    constants: bool = True

    def equations(self) -> tuple[str, ...]:
        """Return the equations, with the constants of consequents if there are any."""
        first, *rest = self.formulas
        return (first if self.constants else first.replace(" + c_r", ""), *rest)

    def symbol_of(self, field: str, index: tuple[int, ...]) -> str:
        """Return the symbol of a number: consequents have rule and input."""
        if field != "consequents":
            return super().symbol_of(field, index)
        rule, k = divmod(index[0], self.n_regressors + self.constants)
        constant = k == self.n_regressors
        return f"c_{{{rule + 1}}}" if constant else f"P_{{{rule + 1},{k + 1}}}"

    def __post_init__(self) -> None:
        self.check_channels()
        if len(self.driven) != 1 or len(self.given) != 1:
            raise ModelError(
                f"{self.kind!r} has {len(self.driven)} driven inputs and {len(self.given)} outputs",
                remedy="give one of each",
            )
        sets = {len(row) for rows in (self.centres, self.widths, self.feedbacks) for row in rows}
        rows = {len(self.centres), len(self.widths), len(self.feedbacks)}
        if rows != {self.n_regressors} or len(sets) != 1 or sets == {0}:
            raise ModelError(
                f"{self.kind!r} needs centres, widths and feedbacks of {self.n_regressors} "
                "inputs, as many sets for each",
                remedy="give them",
            )
        n_consequents = self.n_sets**self.n_regressors * (self.n_regressors + self.constants)
        if len(self.consequents) != n_consequents:
            raise ModelError(
                f"{self.kind!r} of this structure has {n_consequents} consequents, got "
                f"{len(self.consequents)}",
                remedy=f"give {n_consequents}",
            )

    @property
    def n_sets(self) -> int:
        """Number of sets per regressor."""
        return len(self.centres[0])

    @property
    def n_regressors(self) -> int:
        """Number N of regressors."""
        scheduled = len(self.scheduled) * (1 + self.scheduling_lags)
        return self.output_lags + 1 + self.input_lags + scheduled

    @property
    def n_states(self) -> int:
        """States: past outputs and inputs, and the last memberships."""
        past = self.n_regressors - 1 - len(self.scheduled)
        return past + self.n_regressors * self.n_sets

    def state_at(self, first: Array, output: Array) -> Array:
        state = self.initial_state(first, sample_time=self.sample_time)
        state[: self.output_lags] = output[0]
        return state

    def coefficients(self, sample_time: float | None) -> Array:
        """Return lags, sets, whether there are constants, and `pack`."""
        own_sample_time(self.kind, self.own_time, sample_time)
        lags = [self.output_lags, self.input_lags, self.scheduling_lags]
        return np.concatenate([lags, [self.n_sets, self.constants], self.pack()])

    @property
    def _regressor_units(self) -> list[str]:
        """Return the unit of every regressor: past outputs, driven input, scheduling inputs."""
        units = [self.outputs[0].unit] * self.output_lags
        units += [self.inputs[0].unit] * (1 + self.input_lags)
        for channel in self.scheduled:
            units += [channel.unit] * (1 + self.scheduling_lags)
        return units

    def unit_of(self, field: str, index: tuple[int, ...]) -> str | None:
        if field in ("centres", "widths", "feedbacks"):
            return self._regressor_units[index[0]]
        if field != "consequents":
            return super().unit_of(field, index)
        per = [*self._regressor_units, *[""] * self.constants]
        return f"{self.outputs[0].unit or '1'}/{per[index[-1] % len(per)] or '1'}"
