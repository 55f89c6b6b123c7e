"""Preisach and Krasnosel'skii-Pokrovskii models on a triangular grid of thresholds, and their inverses.

Preisach, in Everett form: a relay switches up where the input rises through a and down where it
falls through b <= a; the output is the weighted sum over all relays. The plane of (a, b) is cut into
cells by the levels; each cell off the diagonal carries its weight evenly, each on the diagonal as
relays without a dead zone (a = b), the reversible part of the model. Turning points of the input that
are not wiped out are remembered, and the output follows from E(a, b), the weight of all relays within b
and a: after a minimum b, rising to u gives y_b + 2 E(u, b). Between levels E is bilinear. Along a branch
the output is linear in the input from one level to the next, so the inverse is in closed form; it wants
positive weights on the diagonal and none negative.

Sources: Preisach 1935; Mayergoyz, "Mathematical Models of Hysteresis", 1991 (Everett form,
wiping-out, congruency).

Krasnosel'skii-Pokrovskii: y = offset + sum_ij w_ij s_ij, where operator ij is a play operator with
bounded ridges: while the input rises, s is at least the ramp from 0 at level i to 1 at level i + 1;
while it falls, s is at most the ramp from level j to level j + 1, j <= i. On the diagonal both ramps are
one, and the operator is reversible. Its inverse is solved for.

Sources: Krasnosel'skii and Pokrovskii, "Systems with Hysteresis", 1989; as an approximation of the
Preisach model by Banks, Kurdila and Webb, 1997.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any

import numpy as np
from pydantic import FiniteFloat
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks import fields
from mckibben.blocks.inverse import Invertible
from mckibben.blocks.kernels import ROUNDING, SLACK, kernel, step
from mckibben.blocks.parameters import Parametrised, one_per
from mckibben.blocks.solving import solved_kernels, solved_start
from mckibben.errors import ModelError


@dataclass(frozen=True, config=fields.STRICT)
class Triangle(fields.WithMemory, Parametrised):
    """Fields of a model with a cell for each pair of intervals of the input levels.

    Parameters
    ----------
    levels : sequence of float, length L + 1
        Increasing inputs that cut the plane into cells; the output is constant beyond them.
    weights : sequence of float, length L (L + 1) / 2
        Of the cells, for rising thresholds interval by interval, each from the lowest falling
        threshold to the diagonal: w_00, w_10, w_11, w_20, ...
    offset : float
        Output with all cells down.
    """

    increasing = ("levels",)
    parameters = ("weights", "offset")

    levels: Annotated[fields.Knots, "a_i [{u}]"]
    weights: Annotated[fields.Vector, "w_{ij} [{y}]"]
    offset: Annotated[FiniteFloat, "y_0 [{y}]"] = 0.0

    def symbol_of(self, field: str, index: tuple[int, ...]) -> str:
        """Return the symbol of a number: a cell has its rising and its falling threshold."""
        if field != "weights":
            return super().symbol_of(field, index)
        rows, columns = np.tril_indices(len(self.levels) - 1)
        return f"w_{{{rows[index[0]] + 1},{columns[index[0]] + 1}}}"

    def __post_init__(self) -> None:
        n = len(self.levels) - 1
        fields.wide(self.input_range)
        if len(self.weights) != n * (n + 1) // 2:
            raise ModelError(
                f"{self.kind!r} with {n + 1} levels has {len(self.weights)} weights",
                remedy=f"give {n * (n + 1) // 2}",
            )

    @property
    def input_range(self) -> tuple[float, float]:
        return self.levels[0], self.levels[-1]

    def peaks(self) -> Array:
        return np.array(self.levels)

    @staticmethod
    def near_diagonal(most: float) -> tuple[Any, ...]:
        """Return weights of a loop over 0 to 5, concentrated near the diagonal."""
        weights = [most / (1 + i - j) ** 2 for i in range(5) for j in range(i + 1)]
        return fields.vector(np.linspace(0.0, 5.0, 6)), tuple(weights), 1.0


def on_diagonal(weights: Sequence[float]) -> Array:
    """Return the weights of the diagonal cells, shape (L,), which act at reversals."""
    n = int(np.sqrt(2 * len(weights)))
    return np.array(weights)[np.cumsum(np.arange(1, n + 1)) - 1]


DEPTH = 64
"""Number of turning points stored. Only loops nested 32 deep need more; the smallest two are then
forgotten.
"""


@kernel
def cell_at(u: float, levels: Array) -> tuple[int, float]:
    """Return the interval of an input among the levels, and its position there, 0 to 1."""
    low, high = 0, levels.size - 2
    while low < high:
        middle = (low + high + 1) // 2
        if u >= levels[middle]:
            low = middle
        else:
            high = middle - 1
    return low, (u - levels[low]) / (levels[low + 1] - levels[low])


@kernel
def everett(a: float, b: float, levels: Array, table: Array) -> float:
    """Return the total weight of relays between b and a, from a table at the levels."""
    n = levels.size
    i, x = cell_at(a, levels)
    j, y = cell_at(b, levels)
    if i == j:
        return table[(i + 1) * n + i] * (x - y)
    low = table[i * n + j] * (1.0 - y) + table[i * n + j + 1] * y
    high = table[(i + 1) * n + j] * (1.0 - y) + table[(i + 1) * n + j + 1] * y
    return low * (1.0 - x) + high * x


@kernel
def solved_everett(target: float, other: float, rising: bool, levels: Array, table: Array) -> float:
    """Return the input for which E between it and the turning point ``other`` is ``target``."""
    n = levels.size
    j, _ = cell_at(other, levels)
    near, near_e = other, 0.0
    for i in range(n):
        k = j + 1 + i if rising else j - i
        if k < 0 or k >= n:
            break
        far = levels[k]
        if far == near:
            continue
        far_e = everett(far, other, levels, table) if rising else everett(other, far, levels, table)
        if far_e >= target or k == 0 or k == n - 1:
            if far_e == near_e:
                return far
            return near + (far - near) * (target - near_e) / (far_e - near_e)
        near, near_e = far, far_e
    return near


N_TURNS, DIRECTION, CORNERS, OUTPUTS = 0, 1, 2, 2 + DEPTH
LAST, LAST_OUTPUT, CLIPPED = 2 + 2 * DEPTH, 3 + 2 * DEPTH, 4 + 2 * DEPTH
"""Places of the state: number of turning points, direction of travel, turning points, outputs at them,
last input and output, and of the inverse the count of samples clipped. The first turning point is the
lowest level, from which everything has risen.
"""

SWINGS = DEPTH // 2 - 2
"""Number of shrinking swings that lead to a virgin start."""


@kernel
def output_at(u: float, state: Array, levels: Array, table: Array) -> float:
    """Return the output at ``u``, within the last two turning points."""
    top = int(state[N_TURNS]) - 1
    corner, y = state[CORNERS + top], state[OUTPUTS + top]
    if u == corner:
        return y
    if state[DIRECTION] > 0.0:
        return y + 2.0 * everett(u, corner, levels, table)
    return y - 2.0 * everett(corner, u, levels, table)


@kernel
def turn(going: float, state: Array) -> None:
    """Store the last sample as a turning point if the input reverses there."""
    if going != state[DIRECTION]:
        depth = int(state[N_TURNS])
        if depth == DEPTH:
            depth -= 2
        state[CORNERS + depth], state[OUTPUTS + depth] = state[LAST], state[LAST_OUTPUT]
        state[N_TURNS], state[DIRECTION] = depth + 1.0, going


@kernel
def visit(wanted: float, c: Array, state: Array) -> None:
    """Move to an input, clipped to the levels."""
    n = int(c[0])
    levels, table = c[1 : 1 + n], c[1 + n : 1 + n + n * n]
    u = min(max(wanted, levels[0]), levels[n - 1])
    if u == state[LAST]:
        return
    going = 1.0 if u > state[LAST] else -1.0
    turn(going, state)
    while state[N_TURNS] >= 3.0:
        before = state[CORNERS + int(state[N_TURNS]) - 2]
        if (u - before) * going < 0.0:
            break
        state[N_TURNS] -= 2.0  # a loop is closed, and wiped out
    state[LAST], state[LAST_OUTPUT] = u, output_at(u, state, levels, table)


@step
def preisach_step(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
    """Advance the model; coefficients are [number of levels, levels, Everett table, offset]."""
    visit(inputs[0], coefficients, state)
    outputs[0] = state[LAST_OUTPUT]


@step
def preisach_inverse_step(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
    """Advance the inverse in closed form; the last state is the clip count."""
    n = int(coefficients[0])
    levels, table = coefficients[1 : 1 + n], coefficients[1 + n : 1 + n + n * n]
    bottom = state[OUTPUTS]
    size = 2.0 * table[(n - 1) * n]
    target = min(max(inputs[0], bottom), bottom + size)
    if abs(target - inputs[0]) > SLACK * size:
        state[CLIPPED] += 1.0
    if abs(target - state[LAST_OUTPUT]) > ROUNDING * size:
        going = 1.0 if target > state[LAST_OUTPUT] else -1.0
        turn(going, state)
        while state[N_TURNS] >= 3.0:
            before = state[OUTPUTS + int(state[N_TURNS]) - 2]
            if (target - before) * going < 0.0:
                break
            state[N_TURNS] -= 2.0
        top = int(state[N_TURNS]) - 1
        half = 0.5 * abs(target - state[OUTPUTS + top])
        u = solved_everett(half, state[CORNERS + top], going > 0.0, levels, table)
        state[LAST] = min(max(u, levels[0]), levels[n - 1])
        state[LAST_OUTPUT] = target
    outputs[0] = state[LAST]


@kernel
def preisach_start(coefficients: Array, state: Array, inputs: Array, virgin: bool) -> None:
    """Start as if the input had risen from the lowest level, or swung with falling amplitude."""
    n = int(coefficients[0])
    low, high, offset = coefficients[1], coefficients[n], coefficients[1 + n + n * n]
    state[:] = 0.0
    state[N_TURNS], state[DIRECTION] = 1.0, 1.0
    state[CORNERS], state[OUTPUTS] = low, offset
    state[LAST], state[LAST_OUTPUT] = low, offset
    if virgin:
        middle = min(max(inputs[0], low), high)
        for k in range(SWINGS):
            share = 1.0 - k * (1.0 / (SWINGS - 1))
            visit(middle + share * (high - middle), coefficients, state)
            visit(middle + share * (low - middle), coefficients, state)
    visit(inputs[0], coefficients, state)


@kernel
def first_output(u: float, memory: tuple[Array, Array]) -> float:
    """Return the first output after a start."""
    _, state = memory
    return state[LAST_OUTPUT]


@dataclass(frozen=True, config=fields.STRICT)
class Preisach(Triangle, Invertible):
    """Preisach model on a triangular grid.

    Parameters
    ----------
    weights : sequence of float, length L (L + 1) / 2
        Half the outputs that the relays of cells give when they switch, ordered as in `Triangle`.
    initial : {"first_sample", "virgin"} or sequence of float
        Default memory before the first sample: the input has risen from the lowest level, or the
        input has swung ever less, from the whole range to the first sample.
    **others
        As of `Triangle`.
    """

    kind = "preisach"
    typical = Triangle.near_diagonal(2.0)
    kernel = preisach_step
    start_kernel = preisach_start
    inverse_kernel = preisach_inverse_step
    inverse_start_kernel = solved_start(first_output, preisach_start, 1)
    n_states = CLIPPED
    formulas = (
        r"y = y_0 + \sum_{j \le i} w_{ij} \left(1 + R_{ij}[u]\right)",
        r"R_{ij}[u] = +1 \text{ once } u \text{ rose from } a_i \text{ to } a_{i+1},\; "
        r"-1 \text{ once it fell from } a_{j+1} \text{ to } a_j",
    )

    def table(self) -> Array:
        """Return E at pairs of levels, shape (L + 1, L + 1), zero above the diagonal."""
        n = len(self.levels) - 1
        cells = np.zeros((n, n))
        cells[np.tril_indices(n)] = self.weights
        values = np.zeros((n + 1, n + 1))
        # all cells with rising thresholds up to level i and falling ones from level j on
        values[1:, :n] = np.cumsum(np.cumsum(cells[:, ::-1], axis=1)[:, ::-1], axis=0)
        return np.tril(values, -1)

    def initial_state(
        self, first: Array, initial: fields.Initial | None = None, sample_time: float | None = None
    ) -> Array:
        """Return the initial state; raise an error for an invalid depth or direction."""
        state = super().initial_state(first, initial, sample_time)
        depth, direction = state[N_TURNS], state[DIRECTION]
        if depth not in range(1, DEPTH + 1) or direction not in (1.0, -1.0):
            raise ModelError(
                f"the memory of {self.kind!r} has depth {depth:g} and direction {direction:g}",
                parameter="initial",
                remedy=f"give a depth of 1 to {DEPTH}, a direction of 1 or -1, or 'first_sample'",
            )
        return state

    def coefficients(self, sample_time: float | None) -> Array:
        """Return [number of levels, levels, Everett table, offset]."""
        return np.array([len(self.levels), *self.levels, *self.table().ravel(), self.offset])

    def check_invertible(self) -> None:
        if min(self.weights) < 0 or on_diagonal(self.weights).min() <= 0:
            raise ModelError(
                "'preisach' has no inverse: its weights must not be negative, and "
                "positive on the diagonal",
                remedy="identify it with `settings[nonnegative]=true`",
            )


N_INTERVALS, OFFSET, LEVELS = range(3)
"""Places of the coefficients of a Krasnosel'skii-Pokrovskii model; from the last on levels, weights."""


@kernel
def ramp(u: float, levels: Array, i: int) -> float:
    """Return the position of an input in an interval of the levels, 0 to 1."""
    return min(max((u - levels[i]) / (levels[i + 1] - levels[i]), 0.0), 1.0)


@kernel
def ridges_advance(u: float, c: Array, state: Array) -> None:
    """Update the operators to an input."""
    n = int(c[N_INTERVALS])
    levels = c[LEVELS : LEVELS + n + 1]
    place = 0
    for i in range(n):
        least = ramp(u, levels, i)
        for j in range(i + 1):
            state[place] = max(least, min(ramp(u, levels, j), state[place]))
            place += 1
    state[place] = u


@kernel
def ridges_output(u: float, memory: tuple[Array, Array]) -> float:
    """Return the output at an input; the state is [operators, previous input]."""
    c, state = memory
    n = int(c[N_INTERVALS])
    levels = c[LEVELS : LEVELS + n + 1]
    y = c[OFFSET]
    place = 0
    for i in range(n):
        least = ramp(u, levels, i)
        for j in range(i + 1):
            y += c[LEVELS + n + 1 + place] * max(least, min(ramp(u, levels, j), state[place]))
            place += 1
    return y


@kernel
def ridges_start(coefficients: Array, state: Array, inputs: Array, virgin: bool) -> None:
    """Start on the rising ridges, or half-way between the ridges."""
    n = int(coefficients[N_INTERVALS])
    levels = coefficients[LEVELS : LEVELS + n + 1]
    place = 0
    for i in range(n):
        least = ramp(inputs[0], levels, i)
        for j in range(i + 1):
            most = ramp(inputs[0], levels, j) if virgin else least
            state[place] = 0.5 * (least + most)
            place += 1
    state[place] = inputs[0]


@dataclass(frozen=True, config=fields.STRICT)
class KrasnoselskiiPokrovskii(Triangle, Invertible):
    """Krasnosel'skii-Pokrovskii model on a triangular grid.

    Parameters
    ----------
    weights : sequence of float, length L (L + 1) / 2
        Outputs of the operators, ordered as in `Triangle`.
    initial : {"first_sample", "virgin"} or sequence of float
        Default memory before the first sample: the input has risen from the lowest level, or every
        operator is half-way between its ridges.
    **others
        As of `Triangle`.
    """

    kind = "krasnoselskii-pokrovskii"
    typical = Triangle.near_diagonal(4.0)
    solved = True
    inverse_memory = "input"
    start_kernel = ridges_start
    kernel, inverse_kernel, inverse_start_kernel = solved_kernels(
        ridges_output, ridges_advance, ridges_start
    )
    n_states = one_per("weights", 1)  # operators and the previous input
    formulas = (
        r"y = y_0 + \sum_{j \le i} w_{ij} s_{ij}",
        r"s_{ij,t} = \begin{cases} \max(s_{ij,t-1},\, \rho_i(u_t)) & u \text{ rises} \\ "
        r"\min(s_{ij,t-1},\, \rho_j(u_t)) & u \text{ falls} \end{cases}",
        r"\rho_i(u) = \min\left(\max\left(\frac{u - a_i}{a_{i+1} - a_i},\, 0\right),\, "
        r"1\right)",
    )

    def coefficients(self, sample_time: float | None) -> Array:
        """Return [number of intervals, offset, levels, weights]."""
        return np.array([len(self.levels) - 1, self.offset, *self.levels, *self.weights])

    def least_slope(self) -> float:
        """Return the least slope by the input: that of the reversible operators, or less."""
        least = min(self.weights)
        if least < 0:
            return float(least / np.diff(self.levels).min())
        return float(np.min(on_diagonal(self.weights) / np.diff(self.levels)))

    def stored_for_inverse(self, state: Array) -> tuple[float, ...]:
        """Return the last input, within the levels."""
        return (float(np.clip(state[-1], *self.input_range)),)
