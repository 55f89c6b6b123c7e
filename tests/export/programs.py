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

DOWN, LAST, MANY = -1, -1, 3_000_000_000


@kernel
def moved(a: Array) -> float:
    a[0] += 0.3
    return a[0]


@kernel
def moved_and_told(a: Array) -> tuple[float, int]:
    a[0] += 0.3
    return a[0], int(a[1])


@kernel
def counts_down_by_name(a: Array) -> float:
    y = 0.0
    for i in range(2, -1, DOWN):
        y = 10.0 * y + a[i]
    return y + a[LAST]


@kernel
def shifts_up(a: Array) -> float:
    a[1:] = a[:-1]
    return a[2]


@kernel
def shifts_down(a: Array) -> float:
    rest = a[1:]
    a[:-1] = rest
    return a[0]


@kernel
def stands_alone(a: Array) -> float:
    y, n = moved_and_told(a)
    x = -moved(a)
    if not moved(a):
        y = 0.0
    a[n] = moved(a)
    return x + y


@kernel
def has_derivatives_and_else(a: Array) -> float:
    if DERIVED and a[0] > 0.0:
        a[0] = 0.0
    elif a[0] > 0.0:
        a[0] = 5.0
    if DERIVED or a[1] > 0.0:
        a[1] = 7.0
    return a[0]


@kernel
def assigns_what_it_reads(a: Array) -> float:
    n = 0
    part = a[1:]
    a[1], y = 5.0, part[n]
    a[0], a[2] = a[2], a[n]
    return y


@kernel
def shortens(n: int, a: Array) -> float:
    part = a[:n]
    n = 1
    return 10.0 * part.size + n


@kernel
def keeps_sizes(a: Array) -> float:
    part = a[: int(a[1])]
    a[1] = 0.0
    return part.size + shortens(3, a)


@kernel
def is_full_of_names(a: Array) -> float:
    """Names that C has */ /* already??/"""
    NULL, M_PI, INFINITY, mck_real, DOWN_ = 1.0, 2.0, 3.0, 4.0, 5.0
    k_1, div, div_, a_size, result_2 = 6.0, 7.0, 8.0, 9.0, 10.0  # a comment */ ends /* here
    a[:] = NULL
    rint, isnan, hypot = M_PI + INFINITY, mck_real + DOWN_, k_1 + div * div_ + a_size * DOWN
    return rint + isnan * hypot + result_2 * a.size


@kernel
def leaves_in_many_ways(a: Array) -> float:
    k = 0
    while True:
        if a[k] > 1.0:
            y = a[k]
            break
        if k == 2:
            return -1.0
        k += 1
    if y > 2.0:
        y, z = 2.0, 1.0
    else:
        z = math.floor(y)
    for _ in range(int(y)):
        z += 1.0
    return z


@kernel
def compares_in_a_chain(a: Array) -> float:
    return 1.0 if 0.5 < moved(a) < 1.0 else 0.0


@kernel
def assigns_twice(a: Array) -> float:
    x = y = moved(a)
    return x + y


@kernel
def subtracts_what_moved(a: Array) -> float:
    return moved(a) - 10.0 * a[0]


@kernel
def adds_what_moved(a: Array) -> float:
    a[0] += moved(a)
    return a[0]


@kernel
def puts_where_it_moved(a: Array) -> float:
    a[int(a[0])] = moved(a)
    return a[0]


@kernel
def tells_an_array(a: Array) -> float:
    x, a[2] = moved_and_told(a)
    return x


@kernel
def chooses_a_count(a: Array) -> float:
    n = int(a[1])
    return 1.0 * (n or 7)


@kernel
def returns_a_floor(a: Array) -> int:
    return math.floor(a[1])


@kernel
def indexes_by_a_floor(a: Array) -> float:
    n = math.floor(a[1])
    return a[n]


@kernel  # noqa: RET503
def ends_without_a_result(a: Array) -> float:  # type: ignore[return]
    while a[0] < 1.0:
        if a[0] > 0.0:
            return a[0]


@kernel
def assigns_in_one_branch(a: Array) -> float:
    if a[0] > 0.0:
        y = 1.0
    return y


@kernel
def names_a_part_in_a_loop(a: Array) -> float:
    for k in range(int(a[1])):
        part = a[k:]
    return part[0]


@kernel
def multiplies_by_a_million(a: Array) -> float:
    return 1.0 * int(a[2]) * 1_000_000


@kernel
def counts_beyond_c(a: Array) -> float:
    return a[0] * MANY


@kernel
def counts_beyond_single(a: Array) -> float:
    return a[0] + 16_777_217


@kernel
def halves_a_count(n: int) -> float:
    n = n / 2  # type: ignore[assignment]
    return n + 1.0


@kernel
def stays(a: Array) -> float:
    for i in range(0, 3, 0):
        a[i] = 1.0
    return a[0]


@kernel
def sizes_a_count(a: Array) -> float:
    n = int(a[1])
    n += 1
    return abs(-n) + abs(-3 * n)


@kernel
def counts_from_the_end(a: Array) -> float:
    m = a.reshape((1, a.size))
    return m[-1, -1] + 10.0 * m[0, LAST] + 100.0 * m[-1][0]


@kernel
def counts_from_a_number(a: Array) -> float:
    n = int(a[1])
    return a[-n]


EDGES: dict[Any, int | None] = {
    counts_down_by_name: None,
    shifts_up: 1,
    shifts_down: 2,
    stands_alone: None,
    has_derivatives_and_else: None,
    assigns_what_it_reads: None,
    keeps_sizes: None,
    is_full_of_names: None,
    leaves_in_many_ways: None,
    compares_in_a_chain: 1,
    assigns_twice: 1,
    subtracts_what_moved: 1,
    adds_what_moved: 1,
    puts_where_it_moved: 1,
    tells_an_array: 1,
    chooses_a_count: 2,
    returns_a_floor: 1,
    indexes_by_a_floor: 2,
    ends_without_a_result: 0,
    assigns_in_one_branch: 3,
    names_a_part_in_a_loop: 3,
    multiplies_by_a_million: 1,
    counts_beyond_c: 1,
    counts_beyond_single: 1,
    halves_a_count: 1,
    stays: 1,
    sizes_a_count: None,
    counts_from_the_end: None,
    counts_from_a_number: 2,
}
"""Kernels where Python and C part easily: None where C has Python's numbers, else the line refused."""
