"""Preisach model on a grid of thresholds in Everett form, with its closed-form inverse.

A relay switches up where the input rises through a and down where it falls through b <= a; the
output is the weighted sum over all relays. The plane of (a, b) is cut into cells by the levels;
each cell off the diagonal carries its weight evenly, each on the diagonal as relays without a dead
zone (a = b), which is the reversible part of the model. Instead of relays, the turning points of
the input that are not wiped out are remembered, and the output follows from E(a, b), the weight of
all relays within b and a: after a minimum b, rising to u gives y_b + 2 E(u, b). Between levels E is
bilinear.

Sources: Preisach 1935; Mayergoyz, "Mathematical Models of Hysteresis", 1991 (Everett form,
wiping-out, congruency).

Along a branch the output is linear in the input from one level to the next, so the inverse is in
closed form; it wants positive weights on the diagonal and none negative.
"""

from __future__ import annotations

from typing import ClassVar, Self

import numpy as np
from pydantic import FiniteFloat
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks.core.block import Kernel
from mckibben.blocks.core.exportable import Cost
from mckibben.blocks.core.fields import (
    DISPLACEMENT,
    PRESSURE,
    STRICT,
    ChannelField,
    Initial,
    StoredInitial,
    Vector,
)
from mckibben.blocks.core.kernels import kernel
from mckibben.blocks.core.notation import Notation
from mckibben.blocks.core.refusals import explicit_state
from mckibben.blocks.preisach_type.grid import TriangularGrid
from mckibben.errors import ModelError

DEPTH = 64
"""Turning points remembered. More are nested only in loops within loops 32 deep; the smallest two
are then forgotten."""


@kernel
def _place(u: float, levels: Array) -> tuple[int, float]:
    """Return the interval of the levels that an input lies in, and where in it, 0 to 1."""
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
    """Return the weight of all relays within b and a; ``table`` holds it at the levels, row by row."""
    n = levels.size
    i, x = _place(a, levels)
    j, y = _place(b, levels)
    if i == j:
        return table[(i + 1) * n + i] * (x - y)
    low = table[i * n + j] * (1.0 - y) + table[i * n + j + 1] * y
    high = table[(i + 1) * n + j] * (1.0 - y) + table[(i + 1) * n + j + 1] * y
    return low * (1.0 - x) + high * x


@kernel
def _solve(target: float, other: float, rising: bool, levels: Array, table: Array) -> float:
    """Return the input for which E between it and the turning point ``other`` is ``target``."""
    n = levels.size
    j, _ = _place(other, levels)
    near, near_e = other, 0.0
    for step in range(n):
        k = j + 1 + step if rising else j - step
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


# The state is [depth, direction, lowest level's output, turning points, outputs at them]; the first
# turning point is the lowest level, from which everything has risen.


@kernel
def _output(u: float, state: Array, levels: Array, table: Array) -> float:
    """Return the output at ``u``, within the last two turning points."""
    top = int(state[0]) - 1
    corner, y = state[2 + top], state[2 + DEPTH + top]
    if u == corner:
        return y
    if state[1] > 0.0:
        return y + 2.0 * everett(u, corner, levels, table)
    return y - 2.0 * everett(corner, u, levels, table)


@kernel
def _move(u: float, state: Array, levels: Array, table: Array, last: float, y: float) -> float:
    """Move from input ``last`` and output ``y`` to ``u``, and return the output there."""
    if u == last:
        return y
    going = 1.0 if u > last else -1.0
    if going != state[1]:
        depth = int(state[0])
        if depth == DEPTH:
            depth -= 2
        state[2 + depth], state[2 + DEPTH + depth] = last, y
        state[0], state[1] = depth + 1.0, going
    while state[0] >= 3.0:
        before = state[2 + int(state[0]) - 2]
        if (u - before) * going < 0.0:
            break
        state[0] -= 2.0
    return _output(u, state, levels, table)


@kernel
def preisach_kernel(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
    """Run the model; coefficients are [number of levels, levels, Everett table].

    The state is [depth, direction, turning points, outputs at them, last input, last output].
    """
    n = int(coefficients[0])
    levels, table = coefficients[1 : 1 + n], coefficients[1 + n : 1 + n + n * n]
    last, y = state[2 + 2 * DEPTH], state[3 + 2 * DEPTH]
    for t in range(inputs.shape[0]):
        u = min(max(inputs[t, 0], levels[0]), levels[n - 1])
        y = _move(u, state, levels, table, last, y)
        last = u
        outputs[t, 0] = y
    state[2 + 2 * DEPTH], state[3 + 2 * DEPTH] = last, y


@kernel
def preisach_inverse_kernel(
    coefficients: Array, state: Array, inputs: Array, outputs: Array
) -> None:
    """Invert in closed form; coefficients as forward, the state's last number counts samples clipped."""
    n = int(coefficients[0])
    levels, table = coefficients[1 : 1 + n], coefficients[1 + n : 1 + n + n * n]
    last, y = state[2 + 2 * DEPTH], state[3 + 2 * DEPTH]
    bottom = state[2 + DEPTH]
    size = 2.0 * table[(n - 1) * n]
    for t in range(inputs.shape[0]):
        wanted = inputs[t, 0]
        target = min(max(wanted, bottom), bottom + size)
        if abs(target - wanted) > 1e-9 * size:
            state[4 + 2 * DEPTH] += 1.0
        if abs(target - y) > 1e-14 * size:
            going = 1.0 if target > y else -1.0
            depth = int(state[0])
            if going != state[1]:
                if depth == DEPTH:
                    depth -= 2
                state[2 + depth], state[2 + DEPTH + depth] = last, y
                depth += 1
                state[1] = going
            while depth >= 3 and (target - state[2 + DEPTH + depth - 2]) * going >= 0.0:
                depth -= 2
            state[0] = float(depth)
            corner, y_corner = state[2 + depth - 1], state[2 + DEPTH + depth - 1]
            last = _solve(0.5 * abs(target - y_corner), corner, going > 0.0, levels, table)
            last = min(max(last, levels[0]), levels[n - 1])
            y = target
        outputs[t, 0] = last
    state[2 + 2 * DEPTH], state[3 + 2 * DEPTH] = last, y


def checked_memory(state: Array, kind: str) -> Array:
    """Return a memory after checking that its depth and direction can be ones.

    Raises
    ------
    ModelError
        If they cannot: they say where in the memory to go on.
    """
    depth, direction = state[0], state[1]
    if depth not in range(1, DEPTH + 1) or direction not in (1.0, -1.0):
        raise ModelError(
            f"the memory of {kind!r} has depth {depth:g} and direction {direction:g}. Remedy: give a "
            f"depth of 1 to {DEPTH}, a direction of 1 or -1, or 'first_sample'."
        )
    return state


@dataclass(frozen=True, config=STRICT)
class Preisach(TriangularGrid):
    """Preisach model on a triangular grid.

    Parameters
    ----------
    levels : sequence of float, length L + 1
        Increasing inputs that cut the plane into cells; inputs beyond the first and last are
        clipped.
    weights : sequence of float, length L (L + 1) / 2
        Of the cells, for rising thresholds interval by interval, each from the lowest falling
        threshold to the diagonal: w_00, w_10, w_11, w_20, ... Half the output that the cell's
        relays give when they switch.
    offset : float
        Output with all relays down.
    initial : {"first_sample", "virgin"} or sequence of float
        Default memory before the first sample: the input has risen from the lowest level, or the
        input has swung ever less, from the whole range to the first sample.
    input, output : Channel
        Channel driven and channel given.
    """

    kind: ClassVar[str] = "preisach"
    kernel: ClassVar[Kernel] = preisach_kernel
    inverse_kernel: ClassVar[Kernel] = preisach_inverse_kernel
    parameters: ClassVar[tuple[str, ...]] = ("weights", "offset")
    notation: ClassVar[Notation] = Notation(
        r"y = y_0 + \sum_{j \le i} w_{ij} \left(1 + R_{ij}[u]\right)",
        r"R_{ij}[u] = +1 \text{ once } u \text{ rose through cell } i,\; -1 \text{ once "
        "it fell through cell } j",
        levels="a_i [{u}]",
        weights="w_k [{y}]",
        offset="y_0 [{y}]",
    )

    levels: Vector
    weights: Vector
    offset: FiniteFloat = 0.0
    initial: StoredInitial = "first_sample"
    input: ChannelField = PRESSURE
    output: ChannelField = DISPLACEMENT

    @property
    def n_states(self) -> int:
        """Depth and direction, turning points with their outputs, last input and output."""
        return 2 * DEPTH + 4

    def table(self) -> Array:
        """Return E at pairs of levels, shape (L + 1, L + 1), zero above the diagonal."""
        n = len(self.levels) - 1
        cells = np.zeros((n, n))
        cells[np.tril_indices(n)] = self.weights
        found = np.zeros((n + 1, n + 1))
        # all cells with rising thresholds up to level i and falling ones from level j on
        found[1:, :n] = np.cumsum(np.cumsum(cells[:, ::-1], axis=1)[:, ::-1], axis=0)
        return np.tril(found, -1)

    def initial_state(self, first: Array, initial: Initial | None = None) -> Array:
        """Return the memory before the first sample."""
        start = self.initial if initial is None else initial
        low, high = self.input_range
        if start == "first_sample":
            way = [first[0]]
        elif start == "virgin":
            share = np.linspace(1.0, 0.0, DEPTH // 2 - 2)
            middle = float(np.clip(first[0], low, high))
            ends = np.array([high, low])
            way = [middle + part * (end - middle) for part in share for end in ends]
        else:
            return checked_memory(explicit_state(self, start), self.kind)
        state = np.zeros(self.n_states)
        state[0], state[1], state[2], state[2 + DEPTH] = 1.0, 1.0, low, self.offset
        state[2 + 2 * DEPTH], state[3 + 2 * DEPTH] = low, self.offset
        inputs = np.array(way)[:, np.newaxis]
        preisach_kernel(self.coefficients(None), state, inputs, np.empty_like(inputs))
        return state

    def coefficients(self, sample_time: float | None) -> Array:
        """Return [number of levels, levels, Everett table]."""
        del sample_time
        return np.array([len(self.levels), *self.levels, *self.table().ravel()])

    def c_numbers(self, sample_time: float | None) -> Array:
        """Return the coefficients, then the offset."""
        return np.array([*self.coefficients(sample_time), self.offset])

    def cost(self, sample_time: float | None) -> Cost:
        """Return what it costs to find the place of an input in the table."""
        del sample_time
        once = self._look_up()
        return Cost(once, once + 64)

    def inverse_cost(self, sample_time: float | None) -> Cost:
        """Return what it costs to walk along the levels, half of them usually."""
        del sample_time
        once, levels = self._look_up(), len(self.levels)
        return Cost(once * max(1, levels // 2), once * levels + 64)

    def _look_up(self) -> int:
        return 20 + 4 * len(self.levels).bit_length()

    def check_invertible(self) -> None:
        """Demand weights that are not negative, and positive on the diagonal."""
        if min(self.weights) < 0 or self.diagonal.min() <= 0:
            raise ModelError(
                "'preisach' has no inverse: its weights must not be negative, and positive on the "
                "diagonal. Remedy: identify it with nonnegative=true."
            )

    def inverse_numbers(self, own: Array) -> Array:
        """Return those of this model."""
        return own

    @classmethod
    def example(cls) -> Self:
        """Return a loop over 0 to 5 bar with more weight near the diagonal."""
        n = 5
        weights = [2.0 / (1 + i - j) ** 2 for i in range(n) for j in range(i + 1)]
        return cls(tuple(np.linspace(0.0, 5.0, n + 1).tolist()), tuple(weights), 1.0)
