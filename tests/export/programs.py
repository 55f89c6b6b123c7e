"""Small programs in the kernel language, one for each group of constructs, and some outside of it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.kernels import DERIVED, inlined, kernel, step, summing_step

COUNT, SHARE = 3, 0.25
CLOSED = 1e-12
SINGLE = {"CLOSED": 1e-6}


@kernel
def both(x: float, y: float) -> tuple[float, bool]:
    """Return the larger, and whether it is the first."""
    if x > y:
        return x, True
    return y, False


@kernel
def polynomial(x: float, c: Array) -> float:
    y = 0.0
    for k in range(c.size - 1, -1, -1):
        y = y * x + c[k]
    return y


@inlined
def bisect(f: Any, low: float, high: float, memory: tuple[Array, Array]) -> float:
    """Find a zero between two places."""
    for _ in range(60):
        middle = 0.5 * (low + high)
        if middle in (low, high) or high - low < CLOSED:
            break
        if f(middle, memory) < 0.0:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


@kernel
def cubic(x: float, memory: tuple[Array, Array]) -> float:
    c, shift = memory
    return polynomial(x, c[:2]) + x * x * x - shift[0]


@step
def arithmetic(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
    u, n = inputs[0], int(coefficients[0])
    a = u / 3.0 - (u - 1.0) / -(u * u + 1.0)
    b = 1.0 - -u if u < 0.0 else u**2
    m = n // 2 + n % 2
    outputs[0] = a + b * m - min(u, a, b) + max(1, n) * SHARE + abs(u) / COUNT
    outputs[1] = m if not (0.0 < u <= 1.0 and n != 2) or n in (5, 6) else math.copysign(2.0, u)
    outputs[1] += abs(m - 2 * n)


@step
def functions(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
    u = inputs[0]
    outputs[0] = math.exp(-u * u) + math.tanh(u) + math.sqrt(abs(u)) + math.atan2(u, 2.0)
    outputs[1] = math.floor(u) + np.sqrt(2.0) + math.pi if u < math.inf else 1.0


@step
def loops(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
    # the largest power of two below the input, by hand
    power, steps = 1.0, 0
    while power * 2.0 < abs(inputs[0]):  # at most sixty times
        power *= 2.0
        steps += 1
        if steps >= 60:
            break
    total = 0.0
    for i in range(2, coefficients.size, 2):
        if coefficients[i] < 0.0:
            continue
        total += coefficients[i]
    last = 0.0
    for i in range(coefficients.size):
        if i > 0:
            total -= last
        last = coefficients[i]
    outputs[0], outputs[1] = power, total


@step
def results(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
    larger, first = both(inputs[0], state[0])
    outputs[0], _ = both(coefficients[0], larger)
    state[0], state[1] = state[1], state[0]
    low, high = inputs[0] if first else 0.0, larger if first else 1.0
    outputs[1] = both(low, high)[0] + both(high, low)[0] / 3.0


@step
def arrays(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
    n = state.size // 2
    rows = state[: 2 * n].reshape((2, n))
    rest = coefficients[1:-1]
    for i in range(n):
        rows[0, i] = rows[1, i] + inputs[0] * rest[i]
    row = rows[1]
    for i in range(n):
        row[i] = rows[0, i]
    state[n:][0] = rest[-1]
    outputs[0] = rows[0, n - 1] + polynomial(inputs[0], rest) + rest.size
    outputs[1] = polynomial(0.5, rows[1][1:]) + row.size


@step
def solved(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
    outputs[0] = bisect(cubic, -3.0, 3.0, (coefficients, inputs))
    outputs[1] = bisect(cubic, -9.0, 9.0, (coefficients[1:], inputs))
    if DERIVED:
        outputs[1] = np.nan


@summing_step
def sums(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
    y = 0.0
    for i in range(coefficients.size):
        y += coefficients[i] * inputs[0]
    outputs[0] = y
    outputs[1] = -y


PROGRAMS = (arithmetic, functions, loops, results, arrays, solved, sums)


@kernel
def returns_array(x: Array) -> Array:
    return x


@kernel
def loops_over_items(x: Array) -> float:
    y = 0.0
    for value in x:
        y += value
    return y


@kernel
def uses_a_list(x: float) -> float:
    values = [x, 2.0]
    return values[0]


@kernel
def calls_numpy(x: Array) -> float:
    return np.sum(x)


@kernel
def measures_length(x: Array) -> float:
    return x[len(x) - 1]


@kernel
def takes_the_second_result(x: float) -> float:
    return x + both(x, 1.0)[1]


@kernel
def has_a_tolerance(x: float) -> bool:
    return x < 1e-9


@kernel
def steps_through(x: Array, y: Array) -> None:
    y[0] = x[::2][0]


@kernel
def copies(x: Array, y: Array) -> None:
    y[:] = x


@kernel
def takes_a_default(x: float, y: float = 1.0) -> float:
    return x + y


@kernel
def uses_the_counter(x: Array) -> float:
    for i in range(x.size):
        x[i] = 0.0
    return x[i]


@kernel
def powers(x: float) -> float:
    return x**3.5


@kernel
def raises(x: float) -> float:
    if x < 0.0:
        raise ValueError
    return x


@kernel
def divides_reals(x: float) -> float:
    return x // 2.0


@kernel
def calls_itself(x: float) -> float:
    return calls_itself(x - 1.0) if x > 0.0 else x


@kernel
def chooses_a_number(x: float) -> float:
    return x and 2.0


@kernel
def adds_to_an_array(x: Array, n: int) -> None:
    x[1:] += 1.0
    x += 2.0


@kernel
def is_in_an_array(x: Array) -> bool:
    return x[0] in x


@kernel
def takes_text(name: str) -> float:
    return 1.0


REFUSED = {
    returns_array: 0,
    loops_over_items: 2,
    uses_a_list: 1,
    calls_numpy: 1,
    measures_length: 1,
    takes_the_second_result: 1,
    has_a_tolerance: 1,
    steps_through: 1,
    copies: 1,
    takes_a_default: 0,
    uses_the_counter: 3,
    powers: 1,
    raises: 2,
    divides_reals: 1,
    calls_itself: 0,
    chooses_a_number: 1,
    adds_to_an_array: 1,
    is_in_an_array: 1,
    takes_text: 0,
}
"""Kernels outside the language, and the line behind ``def`` that is."""
