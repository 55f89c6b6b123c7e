"""The terms of a balance of forces, and where they are among its coefficients and in its state.

Of muscle k, all in the notation of `mckibben.blocks.coupled.balance_law`,

    R_k = E_k(u_k) + sum_m h_km s_km + sum_l kappa_kl q_kl + (d_k + l_k (A_k / A0_k)^2) u_k' + m_k u_k''
          - p_k A_k(u_k)

is what it resists shortening with. Stops s_m follow the stretch z = u + w p of its wall up to r_m (p +
p0) either way; q_l, what a lag is behind, relaxes with its time constant; d damps, and so does the line
behind which pressure is measured, which resists a flow of A u' with l (areas of the last sample, A0 at
rest). Accelerations are Houbolt's differences of four samples: of second order, stable, and without echo
in pressures.

Coefficients: the head, r (m), decays and gains of the lags (L each), then of every muscle: lowest and
highest displacement known, w, b, d, l, its own spring, m, springs (powers of what schedules by 1 + n),
elasticity, area, friction (m), relaxation (L), loads. State: u (n), z (n), stops (n by m), lags (n by
L), with mass the last two moves (n by 2), the tare (n), whether nothing came before, samples amiss.
"""

from __future__ import annotations

from mckibben.arrays import Array
from mckibben.blocks.kernels import kernel

HEAD = 16
"""n, schedules, degree, loads, stops, lags, elastic terms, area's terms, scale, p0, lowest and highest
pressure, samples a second, tare, what is left at the start to relax (1, or 0 if settled), whether there
is mass."""

OWN = 8
"""Coefficients of a muscle before its springs."""

LEAST_AREA = 0.01
"""Smallest area, relative to that at rest: a muscle that is as short as it gets pulls no more."""

AT_REST, FROM_REST, IN_TIME = 0, 1, 2
"""Ways to a sample: without friction and lags; all at once, before anything relaxes or damps; in the
sample time."""


@kernel
def sprung(c: Array, own: int, k: int, y: Array, x: Array, gradient: Array) -> float:
    """Return springs and loads of muscle k, and fill their gradient by y."""
    n, n_x, degree, n_loads = int(c[0]), int(c[1]), int(c[2]), int(c[3])
    place = own + OWN
    force = c[place]
    for j in range(n):
        gradient[j] = c[place + 1 + j]
        force += gradient[j] * y[j]
    for i in range(n_x):
        power = 1.0
        for _ in range(degree):
            power *= x[i]
            place += 1 + n
            force += power * c[place]
            for j in range(n):
                spring = power * c[place + 1 + j]
                force += spring * y[j]
                gradient[j] += spring
    place = own + muscle_width(c) - n_loads
    for i in range(n_loads):
        force += c[place + i] * x[n_x + i]
    return force


@kernel
def elastic(c: Array, own: int, u: float) -> tuple[float, float]:
    """Return a muscle's own spring and elasticity at a shortening, and their slope."""
    place = own + OWN + (1 + int(c[1]) * int(c[2])) * (1 + int(c[0]))
    inside = min(max(u, c[own]), c[own + 1])
    v = inside / c[8]
    power = v
    value, slope = 0.0, 0.0
    for i in range(int(c[6])):
        slope += (i + 2) * c[place + i] * power
        power *= v
        value += c[place + i] * power
    slope /= c[8]
    return value + slope * (u - inside) + c[own + 6] * u, slope + c[own + 6]


@kernel
def muscle_width(c: Array) -> int:
    """Return how many coefficients a muscle has."""
    springs = (1 + int(c[1]) * int(c[2])) * (1 + int(c[0]))
    return OWN + springs + int(c[6]) + int(c[7]) + int(c[4]) + int(c[5]) + int(c[3])


@kernel
def muscles(c: Array) -> int:
    """Return where the coefficients of the first muscle are."""
    return HEAD + int(c[4]) + 2 * int(c[5])


@kernel
def area(c: Array, own: int, y: float) -> tuple[float, float]:
    """Return a muscle's effective area at y, and its slope; beyond what is known it goes on straight."""
    place = own + muscle_width(c) - int(c[3]) - int(c[5]) - int(c[4]) - int(c[7])
    inside = min(max(y, c[own]), c[own + 1])
    u = inside / c[8]
    value, slope = 0.0, 0.0
    for i in range(int(c[7]) - 1, -1, -1):
        slope = slope * u + value
        value = value * u + c[place + i]
    slope /= c[8]
    value += slope * (y - inside)
    least = LEAST_AREA * c[place]
    return (value, slope) if value > least else (least, 0.0)


@kernel
def rubbed(
    c: Array, own: int, k: int, state: Array, way: int, y: float, p: float
) -> tuple[float, float, float]:
    """Return the friction of muscle k at a displacement and a pressure, and its slopes by both."""
    n, m = int(c[0]), int(c[4])
    if way == AT_REST:
        return 0.0, 0.0, 0.0
    place = own + muscle_width(c) - int(c[3]) - int(c[5]) - m
    wall, grown = c[own + 2], max(p + c[9], 0.0)
    moved = y + wall * p - state[n + k]
    force, by_y, by_p = 0.0, 0.0, 0.0
    for i in range(m):
        h, limit = c[place + i], c[HEAD + i] * grown
        s = state[2 * n + k * m + i] + moved
        held = min(max(s, -limit), limit)
        force += h * held
        by_y += h if s == held else 0.0
        by_p += h * (wall if s == held else c[HEAD + i] if s > 0.0 else -c[HEAD + i])
    return force, by_y, by_p


@kernel
def flowing(c: Array, own: int, before: float) -> float:
    """Return a muscle's area, over that at rest, where it moves on from somewhere."""
    rest = c[own + muscle_width(c) - int(c[3]) - int(c[5]) - int(c[4]) - int(c[7])]
    return area(c, own, min(max(before, c[own]), c[own + 1]))[0] / rest


@kernel
def damped(c: Array, own: int, before: float) -> float:
    """Return the damping of a muscle that moves on from somewhere, over the sample time."""
    flow = flowing(c, own, before)
    return (c[own + 4] + c[own + 5] * flow * flow) * c[12]


@kernel
def accelerated(c: Array, k: int, state: Array, moved: float) -> float:
    """Return the acceleration of muscle k by how it moves, and did."""
    n = int(c[0])
    place = 2 * n + n * (int(c[4]) + int(c[5])) + 2 * k
    return c[12] * c[12] * (2.0 * moved - 3.0 * state[place] + state[place + 1])


@kernel
def lagging(c: Array, own: int, k: int, state: Array, way: int, y: float) -> tuple[float, float]:
    """Return relaxation, damping and inertia of muscle k at a displacement, and their slope by it."""
    if way == AT_REST:
        return 0.0, 0.0
    n, m, n_l = int(c[0]), int(c[4]), int(c[5])
    place = own + muscle_width(c) - int(c[3]) - n_l
    moved = y - state[k]
    slope = damped(c, own, state[k]) if way == IN_TIME else 0.0
    force = slope * moved
    if way == IN_TIME and c[15] != 0.0:
        force += c[own + 7] * accelerated(c, k, state, moved)
        slope += 2.0 * c[own + 7] * c[12] * c[12]
    for i in range(n_l):
        gain = c[HEAD + m + n_l + i] if way == IN_TIME else c[14]
        q = c[HEAD + m + i] * state[2 * n + n * m + k * n_l + i] + gain * moved
        force += c[place + i] * q
        slope += c[place + i] * gain
    return force, slope


@kernel
def resisted(
    c: Array, own: int, k: int, state: Array, way: int, u: float, p: float
) -> tuple[float, float, float]:
    """Return what muscle k resists with at a shortening and a pressure, its slope, and its size."""
    stretched, stiff = elastic(c, own, u)
    friction, by_u, _ = rubbed(c, own, k, state, way, u, p)
    behind, by_moving = lagging(c, own, k, state, way, u)
    a, a_slope = area(c, own, u)
    size = abs(stretched) + abs(friction) + abs(behind) + abs(p * a)
    return (
        stretched + friction + behind - p * a,
        stiff + by_u + by_moving - p * a_slope,
        size,
    )
