"""The naive twin of every kernel: plain Python loops, straight from the formulas.

A twin takes a block, rows of inputs and the sample time, and returns rows of outputs from the
block's own start. Inverses have none: a law of every block is that its inverse is exact.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np

Rows = list[list[float]]
Twin = Callable[[Any, Rows, float], Rows]


def _column(rows: Rows) -> list[float]:
    return [row[0] for row in rows]


def _rows(values: list[float]) -> Rows:
    return [[value] for value in values]


def _sum(weights: tuple[float, ...], states: list[float]) -> float:
    return sum(w * s for w, s in zip(weights, states, strict=True))


def bisect(function: Callable[[float], float], target: float, low: float, high: float) -> float:
    """Return where an increasing function is the target, or the end of the range nearer to it."""
    if function(low) >= target:
        return low
    if function(high) <= target:
        return high
    for _ in range(200):
        middle = 0.5 * (low + high)
        if middle in (low, high):
            break
        if function(middle) < target:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


# -- memoryless ------------------------------------------------------------------------------


def memoryless(formula: Callable[..., float]) -> Twin:
    """Return the twin of a formula of a block and one sample of its inputs."""
    return lambda block, inputs, sample_time: [[formula(block, *row)] for row in inputs]


def _lines(knots: tuple[float, ...], values: tuple[float, ...], x: float) -> float:
    piece = 0
    while piece < len(knots) - 2 and x >= knots[piece + 1]:
        piece += 1
    x0, x1, y0, y1 = knots[piece], knots[piece + 1], values[piece], values[piece + 1]
    return y0 + (y1 - y0) / (x1 - x0) * (x - x0)


def _piecewise_linear(block: Any, u: float) -> float:
    return _lines(block.knots, block.values, u)


def _power_sum(block: Any, u: float) -> float:
    x = (u - block.centre) / block.scale
    return math.fsum(c * x**power for power, c in enumerate(block.polynomial))


def stepping(model: Callable[[Any, float, float], Any]) -> Twin:
    """Return the twin of a model that goes from input to input, made from its first and the step."""

    def twin(block: Any, inputs: Rows, sample_time: float) -> Rows:
        own = model(block, inputs[0][0], sample_time)
        return _rows([float(own.go(u)) for u in _column(inputs)])

    return twin


# -- play operators --------------------------------------------------------------------------


def _play(state: float, u: float, r: float) -> float:
    if u - r > state:
        return u - r
    if u + r < state:
        return u + r
    return state


class _Play:
    def __init__(self, block: Any, first: float, step: float) -> None:
        self.r, self.state = block.threshold, first - block.threshold

    def go(self, u: float) -> float:
        self.state = _play(self.state, u, self.r)
        return self.state


class _PI:
    def __init__(self, block: Any, first: float, step: float) -> None:
        self.block, self.states = block, [first - r for r in block.thresholds]

    def go(self, u: float) -> float:
        pairs = zip(self.states, self.block.thresholds, strict=True)
        self.states = [_play(s, u, r) for s, r in pairs]
        return float(self.block.offset + _sum(self.block.weights, self.states))


class _RateDependentPI(_PI):
    def __init__(self, block: Any, first: float, step: float) -> None:
        super().__init__(block, first, step)
        self.step, self.previous, self.rate = step, first, 0.0

    def go(self, u: float) -> float:
        played, tau = super().go(u), self.block.rate_time_constant
        keep = math.exp(-self.step / tau) if tau > 0 else 0.0
        self.rate = keep * self.rate + (1 - keep) * (u - self.previous) / self.step
        self.previous = u
        return played + self.rate * _sum(self.block.rate_weights, self.states)


# -- generalised and unparallel play operators -----------------------------------------------


def tanh_envelope(envelope: Any, u: float) -> float:
    e = math.exp(-2 * abs(envelope.slope * u + envelope.shift))
    tangent = math.copysign((1 - e) / (1 + e), envelope.slope * u + envelope.shift)
    return float(tangent + envelope.offset)


def exponential_envelope(envelope: Any, u: float) -> float:
    bent = 1 - math.e ** (envelope.shift - envelope.rate * u)
    return float(envelope.offset + (bent if envelope.rate > 0 else -bent))


ENVELOPES: dict[str, Callable[[Any, float], float]] = {
    "exponential": exponential_envelope,
    "piecewise-linear": _piecewise_linear,
    "tanh": tanh_envelope,
}


def _envelope(envelope: Any, u: float) -> float:
    return ENVELOPES[envelope.kind](envelope, u)


def gpi(block: Any, inputs: Rows, sample_time: float) -> Rows:
    previous = inputs[0][0]
    states = [_envelope(block.rising, previous) - r for r in block.thresholds]
    outputs = []
    for u in _column(inputs):
        for i, r in enumerate(block.thresholds):
            if u > previous:
                states[i] = max(_envelope(block.rising, u) - r, states[i])
            elif u < previous:
                states[i] = min(_envelope(block.falling, u) + r, states[i])
        previous = u
        outputs.append(_sum(block.weights, states))
    return _rows(outputs)


def _unparallel(block: Any, state: float, x: float, r: float) -> float:
    upper: float = block.falling_slope * x + block.falling_threshold * r
    if state > upper:
        state = upper
    return x - r if x - r > state else state


class _EUPI:
    def __init__(self, block: Any, first: float, step: float) -> None:
        self.block = block
        self.states = [first - block.input_range[0] - r for r in block.thresholds]

    def go(self, u: float) -> float:
        block, x = self.block, u - self.block.input_range[0]
        pairs = zip(self.states, block.thresholds, strict=True)
        self.states = [_unparallel(block, s, x, r) for s, r in pairs]
        smooth = sum(a * x ** (power + 1) for power, a in enumerate(block.polynomial))
        return float(block.offset + smooth + _sum(block.weights, self.states))


# -- relays and ramps on a grid --------------------------------------------------------------


def _cells(block: Any) -> list[tuple[int, int, float]]:
    n = len(block.levels) - 1
    pairs = [(i, j) for i in range(n) for j in range(i + 1)]
    return [(i, j, w) for (i, j), w in zip(pairs, block.weights, strict=True)]


def _relay_share(way: list[float], levels: Any, i: int, j: int) -> float:
    """Share of a cell's relays that is up after the input has gone from turning point to turning point.

    Off the diagonal the relays fill a square of rising and falling thresholds: those up lie below a
    staircase, which is kept as a list of corners (highest rising, lowest falling threshold).
    """
    a0, a1, b0, b1 = levels[i], levels[i + 1], levels[j], levels[j + 1]
    if i == j:
        return min(max((way[-1] - a0) / (a1 - a0), 0.0), 1.0)
    # for falling threshold b, relays with rising threshold up to edge(b) are up
    pieces = [(0.0, 1.0, 0.0)]
    for u in way:
        x = min(max((u - a0) / (a1 - a0), 0.0), 1.0)
        y = min(max((u - b0) / (b1 - b0), 0.0), 1.0)
        risen = [(p, q, max(x, e) if u >= a0 else e) for p, q, e in pieces]
        kept = []
        for p, q, e in risen:
            # falling through b puts every relay with a falling threshold above u down
            if q <= y:
                kept.append((p, q, e))
            elif p >= y:
                kept.append((p, q, 0.0))
            else:
                kept += [(p, y, e), (y, q, 0.0)]
        pieces = kept
    return sum((q - p) * e for p, q, e in pieces)


class _Relays:
    def __init__(self, block: Any, first: float, step: float) -> None:
        self.block, self.way = block, [block.levels[0], first]

    def go(self, u: float) -> float:
        way = [*self.way, u]
        if (way[-1] - way[-2]) * (way[-2] - way[-3]) >= 0 and len(way) > 2:
            del way[-2]
        self.way = [self.block.levels[0], *way] if len(way) < 2 else way
        cells = _cells(self.block)
        shares = [w * _relay_share(self.way, self.block.levels, i, j) for i, j, w in cells]
        return float(self.block.offset + 2 * sum(shares))


class _Ramps:
    def __init__(self, block: Any, first: float, step: float) -> None:
        self.block = block
        self.states = [self.ramp(first, i) for i, _, _ in _cells(block)]

    def ramp(self, u: float, k: int) -> float:
        low, high = self.block.levels[k], self.block.levels[k + 1]
        return float(min(max((u - low) / (high - low), 0.0), 1.0))

    def moved(self, u: float) -> list[float]:
        cells = zip(self.states, _cells(self.block), strict=True)
        return [max(self.ramp(u, i), min(self.ramp(u, j), s)) for s, (i, j, _) in cells]

    def output(self, u: float) -> float:
        cells = zip(self.moved(u), _cells(self.block), strict=True)
        return float(self.block.offset + sum(s * w for s, (_, _, w) in cells))

    def go(self, u: float) -> float:
        output = self.output(u)
        self.states = self.moved(u)
        return output


# -- springs that slip, and differential equations in the input ------------------------------


class _Springs:
    def __init__(self, block: Any, first: float, step: float) -> None:
        self.block, self.previous = block, first
        self.states = list(block.breakaways)

    def moved(self, u: float) -> list[float]:
        du, block = u - self.previous, self.block
        if du >= 0:
            return [min(s + du, r) for s, r in zip(self.states, block.breakaways, strict=True)]
        kappa, ratio = block.stiffness_ratio, block.limit_ratio
        pairs = zip(self.states, block.breakaways, strict=True)
        return [max(s + kappa * du, -ratio * r) for s, r in pairs]

    def output(self, u: float) -> float:
        return _power_sum(self.block, u) + _sum(self.block.weights, self.moved(u))

    def go(self, u: float) -> float:
        output = self.output(u)
        self.states, self.previous = self.moved(u), u
        return output


STEPS = 200
"""Runge-Kutta steps from sample to sample in the twins of differential equations."""

STEPPED = {
    "bouc-wen": 1000,
    "generalized-bouc-wen": 1000,
    "multistate-friction": 1000,
}
"""Kinds whose twin steps through corners, and how many samples to compare."""

STEP_ERROR = 1e-5
"""Of those twins, relative to the output's range."""


def _runge_kutta(
    slope: Callable[[float, float], float], y: float, u: float, end: float, steps: int = STEPS
) -> float:
    h = (end - u) / steps
    for _ in range(steps):
        k1 = slope(u, y)
        k2 = slope(u + h / 2, y + h / 2 * k1)
        k3 = slope(u + h / 2, y + h / 2 * k2)
        k4 = slope(u + h, y + h * k3)
        u, y = u + h, y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return y


Rates = Callable[[list[float], float], list[float]]
"""Derivatives of a state by time, under an input."""


def _step(rates: Rates, x: list[float], start: float, end: float, h: float) -> list[float]:
    """Return a state after a step of Runge and Kutta under an input that goes from start to end."""

    def moved(share: float, k: list[float]) -> list[float]:
        return [a + share * h * b for a, b in zip(x, k, strict=True)]

    k1 = rates(x, start)
    k2 = rates(moved(0.5, k1), (start + end) / 2)
    k3 = rates(moved(0.5, k2), (start + end) / 2)
    k4 = rates(moved(1.0, k3), end)
    return moved(
        1.0, [(a + 2 * b + 2 * c + d) / 6 for a, b, c, d in zip(k1, k2, k3, k4, strict=True)]
    )


def _states(
    rates: Rates, x: list[float], given: list[float], block: Any, h: float
) -> Iterator[list[float]]:
    """Give the state at every sample, from substeps of h, under inputs joined as a block says."""
    n = block.substeps
    for before, now in itertools.pairwise([given[0], *given]):
        rise = 0.0 if block.hold == "zero" else now - before
        for s in range(n):
            x = _step(rates, x, before + rise * s / n, before + rise * (s + 1) / n, h)
        yield x


def _sign(x: float) -> float:
    return math.copysign(1.0, x)


class _BoucWen:
    def __init__(self, block: Any, first: float, step: float) -> None:
        self.block, self.previous, self.z = block, first, 1.0

    def slope(self, u: float, z: float, going: float) -> float:
        sigma = self.block.sigma
        psi = sigma * _sign(z * going) + 1 - sigma
        return float(self.block.rate * (1 - abs(z) ** self.block.exponent * psi))

    def moved(self, u: float) -> float:
        going = _sign(u - self.previous)
        return _runge_kutta(lambda v, z: self.slope(v, z, going), self.z, self.previous, u)

    def go(self, u: float) -> float:
        self.z, self.previous = self.moved(u), u
        return _power_sum(self.block, u) + float(self.block.weight) * self.z


class _GeneralizedBoucWen(_BoucWen):
    def slope(self, u: float, z: float, going: float) -> float:
        b, x = self.block.shape, _sign(u - self.block.centre)
        s = _sign(z)
        psi = s * going + b[0] * x * going + b[1] * x * s + b[2] * going + b[3] * s + b[4] * x
        return float(self.block.rate * (1 - abs(z) ** self.block.exponent * psi))


class _Duhem:
    def __init__(self, block: Any, first: float, step: float) -> None:
        self.block, self.previous = block, first
        # a rise from far away ends on the curve that rising inputs tend to
        far = first - 40 * block.scale / block.alpha
        self.y = self.polynomial(block.target, far)
        for k in range(40):
            step = (first - far) / 40
            self.y = self.along(far + k * step, far + (k + 1) * step)

    def polynomial(self, coefficients: Any, u: float) -> float:
        x = (u - self.block.centre) / self.block.scale
        return math.fsum(c * x**power for power, c in enumerate(coefficients))

    def along(self, start: float, end: float) -> float:
        block, going = self.block, _sign(end - start)

        def slope(u: float, y: float) -> float:
            pull = block.alpha * going * (self.polynomial(block.target, u) - y)
            return float((pull + self.polynomial(block.slope, u)) / block.scale)

        return _runge_kutta(slope, self.y, start, end)

    def go(self, u: float) -> float:
        self.y, self.previous = self.along(self.previous, u), u
        return self.y


def _oscillator(slope: Callable[[Any, float, float], float]) -> Twin:
    """Return the twin of a mass-spring-damper with an element of a slope, from [block, z, y']."""

    def twin(block: Any, inputs: Rows, sample_time: float) -> Rows:
        def rates(x: list[float], u: float) -> list[float]:
            y, v, z = x
            pull = u - block.damping * v - block.stiffness * y - z
            return [v, 1000.0 * pull / block.mass, v * slope(block, z, v)]

        given = _column(inputs)

        def taken(_: float, z: float) -> float:
            f = slope(block, z, given[0])
            return f / (block.stiffness + f)

        z = _runge_kutta(taken, 0.0, 0.0, given[0], 64)
        rest = [(given[0] - z) / block.stiffness, 0.0, z]
        states = _states(rates, rest, given, block, sample_time / block.substeps)
        return _rows([x[0] + (block.output_offset or 0.0) for x in states])

    return twin


def _bouc_wen_slope(block: Any, z: float, v: float) -> float:
    return float(block.slope - block.gamma * _sign(v) * z - block.delta * abs(z))


def _duhem_slope(block: Any, z: float, v: float) -> float:
    slopes = block.rising if v > 0 else block.falling
    return _lines(block.knots, slopes, min(max(z, block.knots[0]), block.knots[-1]))


# -- dynamic models --------------------------------------------------------------------------


def transfer_function(block: Any, inputs: Rows, sample_time: float) -> Rows:
    b, f = block.numerator, block.denominator
    u = [row[0] - block.input_offset for row in inputs]
    rest = u[0] * sum(b) / (1 + sum(f))
    y: list[float] = []
    for t in range(len(u)):
        past_u = [u[t - k] if t >= k else u[0] for k in range(len(b))]
        past_y = [y[t - k] if t >= k else rest for k in range(1, len(f) + 1)]
        y.append(_sum(b, past_u) - _sum(f, past_y))
    return _rows([value + block.output_offset for value in y])


def process_model(block: Any, inputs: Rows, sample_time: float) -> Rows:
    """Partial fractions of a P2UZ model whose poles are real, each integrated along straight lines."""
    (w,), zeta, k, tz = block.time_constants, block.damping, block.gain, block.zero_time
    root = math.sqrt(zeta * zeta - 1)
    taus = [w * (zeta + root), w * (zeta - root)]
    shares = [(tau - tz) / (tau - other) for tau, other in zip(taus, taus[::-1], strict=True)]
    u = [row[0] - block.input_offset for row in inputs]
    lags, previous = [u[0], u[0]], u[0]
    outputs = []
    for value in u:
        slope = (value - previous) / sample_time
        for i, tau in enumerate(taus):
            ramp = value - tau * slope
            start = previous - tau * slope
            lags[i] = ramp + (lags[i] - start) * math.exp(-sample_time / tau)
        previous = value
        outputs.append(block.output_offset + k * _sum(tuple(shares), lags))
    return _rows(outputs)


def _narx(block: Any, inputs: Rows, function: Callable[[list[float]], float]) -> Rows:
    (uc, us), (yc, ys) = block.input_scale, block.output_scale
    x = [(row[0] - uc) / us for row in inputs]
    start = block.initial_state(inputs[0], sample_time=block.sample_time)
    past = [float(value) for value in start[: block.output_lags]][::-1]
    operators = [x[0] - r for r in block.thresholds]
    outputs = []
    for t, now in enumerate(x):
        operators = [_play(s, now, r) for s, r in zip(operators, block.thresholds, strict=True)]
        lags = [past[-1 - k] for k in range(block.output_lags)]
        given = [x[max(t - block.delay - k, 0)] for k in range(block.input_lags)]
        past.append(function([*lags, *given, *operators]))
        outputs.append(yc + ys * past[-1])
    return _rows(outputs)


def narx_polynomial(block: Any, inputs: Rows, sample_time: float) -> Rows:
    def function(regressors: list[float]) -> float:
        products = [math.prod(regressors[factor] for factor in term) for term in block.terms]
        return _sum(block.weights, products)

    return _narx(block, inputs, function)


def narx_network(block: Any, inputs: Rows, sample_time: float) -> Rows:
    def function(regressors: list[float]) -> float:
        n = len(regressors)
        y = block.bias + _sum(block.linear, regressors)
        for first in range(0, len(block.hidden), n + 2):
            *weights, shift, out = block.hidden[first : first + n + 2]
            y += out * math.tanh(_sum(tuple(weights), regressors) + shift)
        return float(y)

    return _narx(block, inputs, function)


def fed_back(slopes: Rows, by_past: Rows) -> Rows:
    """Return the derivatives of a free run, from those of f by parameters and by past outputs."""
    found: Rows = []
    for own, shares in zip(slopes, by_past, strict=True):
        past = found[::-1][: len(shares)]
        pairs = list(zip(shares, past, strict=False))
        found.append([s + sum(share * row[j] for share, row in pairs) for j, s in enumerate(own)])
    return found


class _Creep:
    def __init__(self, block: Any, first: float, step: float) -> None:
        # an inverse begins at rest too, where every element has come to the input
        self.block, self.elements = block, [first] * len(block.compliances)
        self.decays = [math.exp(-step / tau) for tau in block.time_constants]

    def go(self, u: float) -> float:
        self.elements = [u + (x - u) * a for x, a in zip(self.elements, self.decays, strict=True)]
        return u + _sum(self.block.compliances, self.elements)


def _air_moved(block: Any, sample_time: float, x: float, u: float) -> float:
    lowest = -math.inf if block.ambient is None else block.ambient
    highest = math.inf if block.supply is None else block.supply

    def goal(way: float) -> float:
        aimed = block.gain * (u - block.offset - 0.5 * way * block.hysteresis)
        return min(max(aimed, lowest), highest)

    def towards(aim: float, tau: float) -> float:
        return aim + (x - aim) * (math.exp(-sample_time / tau) if tau > 0 else 0.0)

    if goal(1.0) > x:
        return towards(goal(1.0), block.filling_time)
    if goal(-1.0) < x:
        return towards(goal(-1.0), block.venting_time)
    return x


def _air_at_rest(block: Any, u: float) -> float:
    aimed = block.gain * (u - block.offset)
    return min(max(aimed, block.ambient), block.supply)


def air(block: Any, inputs: Rows, sample_time: float) -> Rows:
    x = _air_at_rest(block, inputs[0][0])
    pressures = [x] * round(block.dead_time / sample_time)
    for u in _column(inputs):
        x = _air_moved(block, sample_time, x, u)
        pressures.append(x)
    return _rows(pressures[: len(inputs)])


# -- maps, and forces ------------------------------------------------------------------------


def _acting(u: float, c: float) -> float:
    return math.copysign(abs(u) - 0.95 * c * (1 - math.e ** (-abs(u) / c)), u)


def _braid_pressure(block: Any, displacement: float) -> float:
    e = (displacement - block.offset) / block.rest_length
    angle = block.braid_angle
    geometry = 3 * (1 - e) ** 2 / math.tan(angle) ** 2 - 1 / math.sin(angle) ** 2
    area = math.pi * block.diameter**2 / 4 * 0.1
    force = block.load + block.stiffness * e + block.hardening * e**3
    return float(force / (area * geometry))


def braid_equilibrium(block: Any, inputs: Rows, sample_time: float) -> Rows:
    low, high = (float(end[0]) for end in block.reachable())
    pressures = _column(inputs)
    return _rows([bisect(lambda x: _braid_pressure(block, x), p, low, high) for p in pressures])


def _polynomial_force(block: Any, length: float, p: float) -> float:
    x = (length - block.centre) / block.scale
    pull = math.fsum(g * x**power for power, g in enumerate(block.per_bar))
    return p * pull + math.fsum(h * x**power for power, h in enumerate(block.elastic))


def _chou_hannaford(block: Any, length: float, p: float) -> float:
    area = (3 * length**2 - block.thread_length**2) / (4 * math.pi * block.turns**2)
    return float(0.1 * p * area + block.constant)


def _tondu_lopez(block: Any, length: float, p: float) -> float:
    area = math.pi * (block.diameter / 2) ** 2 * 0.1
    tangent, sine = math.tan(block.braid_angle), math.sin(block.braid_angle)
    e = 1 - length / block.rest_length
    mu = block.mu[0] * math.exp(-40 * e) + block.mu[1]
    kappa = block.kappa[0] * math.exp(-p) + block.kappa[1]
    pull = 3 / tangent**2 * (1 - kappa * e) ** 2 - 1 / sine**2
    return float(mu * area * p * pull + block.constant)


def _deflection_rate(numbers: tuple[float, ...], _: float, x: float) -> float:
    k, sigma, limit, v = numbers
    return (min(max(k * x + sigma * v, -limit), limit) - k * x) / sigma


def multistate_friction(block: Any, inputs: Rows, sample_time: float) -> Rows:
    """Runge-Kutta steps, so small that the stiffest element is followed."""
    table = block.table().tolist()
    states = [row[2] / row[0] if row[2] else 0.0 for row in table]
    previous = inputs[0][0]
    outputs = []
    for length, _ in inputs:
        v = (length - previous) / sample_time
        previous = length
        force = 0.0
        for i, row in enumerate(table):
            k, sigma, limit = row[:3] if v >= 0 else row[3:]
            if limit == 0:
                went = states[i] + v * sample_time
                states[i] = min(went, 0.0) if v >= 0 else max(went, 0.0)
                force += k * states[i]
                continue
            rate = partial(_deflection_rate, (k, sigma, limit, v))
            states[i] = _runge_kutta(rate, states[i], 0.0, sample_time)
            force += min(max(k * states[i] + sigma * v, -limit), limit)
        outputs.append(force)
    return _rows(outputs)


def _power(values: Any, x: float) -> float:
    a, b, c, d = values
    return float(a * x**3 + b * x**2 + c * x + d)


def activation_pressure(block: Any, inputs: Rows, sample_time: float) -> Rows:
    outputs = []
    previous = inputs[0][0]
    for e, force in inputs:
        at = [_power(block.contractions[4 * j : 4 * j + 4], force) for j in range(4)]
        heights = [_power(block.pressures[4 * j : 4 * j + 4], force) for j in range(4)]
        # Newton's divided differences of the cubic through the four points
        table = list(heights)
        for order in range(1, 4):
            for j in range(3, order - 1, -1):
                table[j] = (table[j] - table[j - 1]) / (at[j] - at[j - order])
        y = table[3]
        for j in (2, 1, 0):
            y = y * (e - at[j]) + table[j]
        gamma = block.gamma[0] * block.frequency + block.gamma[1]
        rate = (e - previous) / sample_time
        outputs.append(y + gamma * _power(block.phi, force) * rate)
        previous = e
    return _rows(outputs)


def activation_memory(block: Any, inputs: Rows, sample_time: float) -> Rows:
    outputs = []
    previous = inputs[0][0]
    states = [previous - r for r in block.thresholds]
    k = len(states)
    behind = [(previous - block.input_scale[0]) / block.input_scale[1]] * len(block.time_constants)
    for e, force in inputs:
        x = (e - block.input_scale[0]) / block.input_scale[1]
        f = (force - block.force_scale[0]) / block.force_scale[1]
        states = [_play(s, e, r) for s, r in zip(states, block.thresholds, strict=True)]
        powers = [
            x**i * f**j for i in range(block.degree + 1) for j in range(block.force_degree + 1)
        ]
        stops = [e - s for s in states]
        friction = _sum(block.friction[:k], stops) + f * _sum(block.friction[k:], stops)
        rate = (e - previous) / sample_time
        viscous = (block.viscosity[0] + block.viscosity[1] * f) * rate
        decays = [math.exp(-sample_time / tau) for tau in block.time_constants]
        behind = [x + (b - x) * a for b, a in zip(behind, decays, strict=True)]
        m = len(behind)
        left = [b - x for b in behind]
        relaxed = _sum(block.relaxation[:m], left) + f * _sum(block.relaxation[m:], left)
        outputs.append(_sum(block.surface, powers) + friction + viscous + relaxed)
        previous = e
    return _rows(outputs)


# -- several muscles -------------------------------------------------------------------------


def coupling(block: Any, inputs: Rows, sample_time: float) -> Rows:
    n, m = len(block.driven), len(block.given)
    return [
        [math.fsum(block.gains[i][j] * row[i] for i in range(n)) for j in range(m)]
        for row in inputs
    ]


def fuzzy_network(block: Any, inputs: Rows, sample_time: float) -> Rows:
    """Every rule fires by its own product, and is divided by the sum over all rules."""
    out = []
    width = len(block.centres) + block.constants
    n_out = len(block.given)
    for row in inputs:
        answers, total = [0.0] * n_out, 0.0
        sets = [range(len(centres)) for centres in block.centres]
        for number, rule in enumerate(itertools.product(*sets)):
            firing = 1.0
            for i, s in enumerate(rule):
                z = (row[i] - block.centres[i][s]) / block.widths[i][s]
                firing *= math.exp(-z * z / 2)
            total += firing
            for j in range(n_out):
                at = (number * n_out + j) * width
                values = [*row, 1.0] if block.constants else row
                own = block.consequents[at : at + width]
                answers[j] += firing * sum(a * b for a, b in zip(own, values, strict=True))
        out.append([answer / total for answer in answers])
    return out


def coupled_memory(block: Any, inputs: Rows, sample_time: float) -> Rows:
    n = len(block.inputs)
    lagged = [list(inputs[0]) for _ in block.lags]
    plays = [
        [
            [min(max(0.0, x - r), x + r) for r in radii]
            for x, radii in zip(row, block.thresholds, strict=True)
        ]
        for row in lagged
    ]
    out = []
    for row in inputs:
        for own, felt, tau in zip(lagged, plays, block.lags, strict=True):
            keep = math.exp(-sample_time / tau) if tau else 0.0
            for i in range(n):
                own[i] = keep * own[i] + (1 - keep) * row[i]
                felt[i] = [
                    min(max(s, own[i] - r), own[i] + r)
                    for s, r in zip(felt[i], block.thresholds[i], strict=True)
                ]
        terms = [1.0, *(x for own in lagged for x in own)]
        terms += [s for felt in plays for own in felt for s in own]
        for power in range(2, block.degree + 1):
            for chosen in itertools.combinations_with_replacement(range(n), power):
                terms.append(math.prod(lagged[0][i] for i in chosen))
        if block.crossed:
            terms += [x * other for x in lagged[0] for other in terms[1 + n : 1 + block.n_states]]
        out.append([math.fsum(a * b for a, b in zip(w, terms, strict=True)) for w in block.readout])
    return out


def recurrent_fuzzy_network(block: Any, inputs: Rows, sample_time: float) -> Rows:
    """Queues of past values, a dictionary of memberships, and rules one by one."""
    first = inputs[0]
    ys = [first[0]] * block.output_lags
    us = [first[0]] * block.input_lags
    loads = [[value] * block.scheduling_lags for value in first[1:]]
    n, sets = block.n_regressors, block.n_sets
    last = {(i, s): 0.0 for i in range(n) for s in range(sets)}
    out = []
    for row in inputs:
        x = [*ys, row[0], *us]
        for now, past in zip(row[1:], loads, strict=True):
            x += [now, *past]
        for (i, s), before in list(last.items()):
            z = x[i] - block.centres[i][s] + block.feedbacks[i][s] * before
            last[i, s] = math.exp(-z * z / (2 * block.widths[i][s] ** 2))
        top = bottom = 0.0
        for number, rule in enumerate(itertools.product(range(sets), repeat=n)):
            firing = math.prod(last[i, s] for i, s in enumerate(rule))
            own = block.consequents[number * (n + 1) : (number + 1) * (n + 1)]
            bottom += firing
            top += firing * sum(a * b for a, b in zip(own, [*x, 1.0], strict=True))
        ys = [top / bottom, *ys][: block.output_lags]
        us = [row[0], *us][: block.input_lags]
        loads = [
            [now, *past][: block.scheduling_lags] for now, past in zip(row[1:], loads, strict=True)
        ]
        out.append([top / bottom])
    return out


class _Parallel:
    """Muscles in parallel at one place of their history, all as tables of numbers by muscle."""

    def __init__(self, block: Any, scheduled: list[float], sample_time: float) -> None:
        n, m = len(block.given), len(block.driven)
        self.block, self.n, self.m, self.step = block, n, m, sample_time
        self.ways = block.directions or [[float(k == j) for j in range(m)] for k in range(n)]
        self.q, self.u, self.z = [0.0] * m, [0.0] * n, [0.0] * n
        self.stops = [[0.0] * len(block.limits) for _ in range(n)]
        self.behind = [[0.0] * len(block.lags) for _ in range(n)]
        self.moves = [[0.0, 0.0] for _ in range(n)]
        self.way = "rest"
        resting = self.found([0.0] * n, scheduled)
        self.keep(resting, [0.0] * n, scheduled)
        self.tare = resting if block.tare else [0.0] * m
        self.way = "first"

    def shortening(self, k: int, q: list[float]) -> float:
        return math.fsum(w * v for w, v in zip(self.ways[k], q, strict=True))

    def scheduling(self, x: list[float]) -> list[float]:
        return x[: len(x) - len(self.block.loads[0])]

    def outer(self, j: int, q: list[float], x: list[float]) -> float:
        """Return what loads, springs and an obstacle hold a coordinate with."""
        block, m, scheduling = self.block, self.m, self.scheduling(x)
        loads = x[len(scheduling) :]
        force = sum(c * load for c, load in zip(block.loads[j], loads, strict=True))
        for power, x_q in enumerate([1.0] + [v**d for v in scheduling for d in _degrees(block)]):
            row = block.springs[j][power * (1 + m) : (power + 1) * (1 + m)]
            force += x_q * (row[0] + sum(s * v for s, v in zip(row[1:], q, strict=True)))
        if block.obstacles:
            width = 3 + len(scheduling)
            for first in range(0, len(block.obstacles[j]), width):
                side, place, stiff, *by = block.obstacles[j][first : first + width]
                stiffness = stiff + _sum(tuple(by), scheduling)
                force += stiffness * side * max(side * (q[j] - place), 0.0)
        return force

    def area(self, k: int, y: float) -> float:
        terms = self.block.areas[k]
        value = _beyond(
            lambda u: sum(a * u**i for i, a in enumerate(terms)),
            y,
            self.block.hull[k],
            self.block.scale,
        )
        return max(value, 0.01 * terms[0])

    def moved(self, k: int, y: float, p: float, x: list[float]) -> list[float]:
        """Return where a muscle's stops would be."""
        if self.way == "rest":
            return [0.0] * len(self.stops[k])
        block, dz = self.block, y + self.block.walls[k] * p - self.z[k]
        scheduling = self.scheduling(x)
        share = block.friction_growth
        grown = 1.0 - share + share * p / block.highest_pressure
        grown += _sum(block.friction_slopes or (0.0,) * len(scheduling), scheduling)
        return [
            min(max(s + dz, -(block.asymmetry or 1.0) * width), width)
            for s, width in zip(
                self.stops[k], (limit * max(grown, 0.0) for limit in block.limits), strict=True
            )
        ]

    def relaxing(self, k: int, y: float) -> list[float]:
        """Return what a muscle's lags would be behind: on a ramp in time, by a step at once."""
        dy, out = y - self.u[k], []
        for q, tau in zip(self.behind[k], self.block.lags, strict=True):
            keep = math.exp(-self.step / tau)
            ramp = tau / self.step * (1.0 - keep)
            first = 0.0 if self.block.settled else dy
            out.append({"rest": 0.0, "first": first, "time": keep * q + ramp * dy}[self.way])
        return out

    def resisted(self, k: int, u: float, p: float, x: list[float]) -> float:
        """Return what a muscle resists shortening with, were it never slack."""
        block = self.block
        force = _beyond(
            lambda v: sum(e * v**i for i, e in enumerate(block.elasticity[k], start=2)),
            u,
            block.hull[k],
            block.scale,
        )
        force += block.bladders[k] * u if block.bladders else 0.0
        force += _sum(block.friction[k], self.moved(k, u, p, x))
        force += _sum(block.relaxation[k], self.relaxing(k, u))
        if self.way == "time":
            low, high = block.hull[k]
            flow = self.area(k, min(max(self.u[k], low), high)) / block.areas[k][0]
            line = block.lines[k] if block.lines else 0.0
            moved, (last, before) = u - self.u[k], self.moves[k]
            speed = (1.5 * moved - 0.5 * last) / self.step
            force += (block.damping[k] + line * flow**2) * speed
            heavy = block.mass[k] if block.mass else 0.0
            force += heavy * (2.0 * moved - 3.0 * last + before) / self.step**2
        return force - p * self.area(k, u)

    def push(self, k: int) -> float:
        return self.block.pushes[k] if self.block.pushes else math.inf

    def excess(self, j: int, q: list[float], x: list[float], p: list[float]) -> float:
        """Return how much more muscles pull at a coordinate than they hold."""
        lengths = [self.shortening(k, q) for k in range(self.n)]
        forces = [min(self.resisted(k, lengths[k], p[k], x), self.push(k)) for k in range(self.n)]
        return -self.outer(j, q, x) - _sum(tuple(way[j] for way in self.ways), forces)

    def pressure(self, k: int, q: list[float], x: list[float], force: float) -> float:
        """Return the pressure at which a muscle resists with a force."""
        y = self.shortening(k, q)
        return bisect(lambda p: -self.resisted(k, y, p, x), -force, -1000.0, 1000.0)

    def pressures(self, q: list[float], x: list[float]) -> list[float]:
        low, high = self.block.pressure_range or (-math.inf, math.inf)
        if not self.block.directions:
            wanted = [min(-self.outer(k, q, x), self.push(k)) for k in range(self.n)]
            found = [self.pressure(k, q, x, wanted[k]) for k in range(self.n)]
            return [min(max(p, low), high) for p in found]
        if self.block.drive:
            return self.along_the_drive(q, x, low, high)
        shared = min(max(self.block.preload, low), high)
        p, free = [shared] * self.n, set(range(self.n))
        while True:
            forces = []
            for k in range(self.n):
                way, self.way = self.way, "rest" if k in free else self.way
                p[k] = shared if k in free else p[k]
                resisted = self.resisted(k, self.shortening(k, q), p[k], x)
                forces.append(min(resisted, self.push(k)))
                self.way = way
            pulls = np.array(self.ways).T @ forces
            lacks = np.array([-self.outer(j, q, x) - pulls[j] for j in range(self.m)])
            some = sorted(free)
            more = np.linalg.lstsq(np.array(self.ways)[some].T, lacks, rcond=None)[0]
            ends = {}
            for k, change in zip(some, more.tolist(), strict=True):
                p[k] = self.pressure(k, q, x, forces[k] + change)
                slack = self.pressure(k, q, x, self.push(k)) if self.block.pushes else -math.inf
                ends[k] = min(max(p[k], low, slack), high)
            worst = max(some, key=lambda k: abs(p[k] - ends[k]))
            if abs(p[worst] - ends[worst]) <= 1e-9 or len(free) == self.m:
                return [min(max(value, low), high) for value in p]
            p[worst] = ends[worst]
            free.remove(worst)

    def along_the_drive(
        self, q: list[float], x: list[float], low: float, high: float
    ) -> list[float]:
        """Return the least steps along directions; one that ends a muscle's range is taken out."""
        from scipy.optimize import root

        table, pull = np.array(self.block.drive), np.array(self.ways)
        middle, ways = table[:, 0], table[:, 1:]
        sizes, areas = (
            (ways**2).sum(axis=1),
            [self.area(k, self.shortening(k, q)) for k in range(self.n)],
        )
        p = middle
        for n_free in range(ways.shape[1], -1, -1):
            if n_free >= self.m:
                steps = ways @ ways.T @ (np.array(areas)[:, None] * pull)

                def missed(at: Any, middle: Any = middle, steps: Any = steps) -> list[float]:
                    given = (middle + steps @ at).tolist()
                    return [self.excess(j, q, x, given) for j in range(self.m)]

                p = middle + steps @ root(missed, np.zeros(self.m), tol=1e-14).x
            own = np.where((ways**2).sum(axis=1) > 1e-9 * sizes, (ways**2).sum(axis=1), np.inf)
            ends = np.clip(p, low, high)
            worst = int(np.argmax((p - ends) ** 2 / own))
            if abs(p[worst] - ends[worst]) <= 1e-9 or not own[worst] < np.inf:
                break
            along = ways[worst] / np.sqrt(own[worst])
            shift = ways @ along / np.sqrt(own[worst])
            p = p + shift * (ends[worst] - p[worst])
            middle = middle + shift * (ends[worst] - middle[worst])
            ways = ways - np.outer(ways @ along, along)
        return [min(max(float(value), low), high) for value in p]

    def found(self, p: list[float], x: list[float]) -> list[float]:
        from scipy.optimize import root

        def missed(q: Any) -> list[float]:
            return [self.excess(j, list(q), x, p) for j in range(self.m)]

        return [float(q) for q in root(missed, self.q, tol=1e-14).x]

    def keep(self, q: list[float], p: list[float], x: list[float]) -> None:
        u = [self.shortening(k, q) for k in range(self.n)]
        self.stops = [self.moved(k, u[k], p[k], x) for k in range(self.n)]
        self.behind = [self.relaxing(k, here) for k, here in enumerate(u)]
        if self.way == "time":
            self.moves = [[u[k] - self.u[k], last] for k, (last, _) in enumerate(self.moves)]
        self.z = [
            here + wall * pressure
            for here, wall, pressure in zip(u, self.block.walls, p, strict=True)
        ]
        self.q, self.u, self.way = q, u, "time"


def _degrees(block: Any) -> range:
    return range(1, block.degree + 1)


def _beyond(
    formula: Callable[[float], float], y: float, hull: tuple[float, float], scale: float
) -> float:
    """Return a polynomial of y / scale, and beyond what is known its tangent there.

    Differences of polynomials of the fourth order and below are exact, of steps of any length.
    """
    inside, h = min(max(y, hull[0]), hull[1]), 1.0
    u = inside / scale
    if y == inside:
        return formula(u)
    near, far = (formula(u + d * h) - formula(u - d * h) for d in (1, 2))
    return formula(u) + (8.0 * near - far) / (12.0 * h) * (y - inside) / scale


def balance(block: Any, inputs: Rows, sample_time: float) -> Rows:
    m, out = len(block.driven), []
    arm = _Parallel(block, inputs[0][m:], sample_time)
    for row in inputs:
        q = [here + tare for here, tare in zip(row[:m], arm.tare, strict=True)]
        out.append(arm.pressures(q, row[m:]))
        there = arm.found(out[-1], row[m:]) if block.pressure_range or block.pushes else q
        arm.keep(there, out[-1], row[m:])
    return out


def balance_inverse(block: Any, inputs: Rows, sample_time: float) -> Rows:
    n, out = len(block.forward.given), []
    arm = _Parallel(block.forward, inputs[0][n:], sample_time)
    for row in inputs:
        q = arm.found(row[:n], row[n:])
        arm.keep(q, row[:n], row[n:])
        out.append([here - tare for here, tare in zip(q, arm.tare, strict=True)])
    return out


def load_estimate(block: Any, inputs: Rows, sample_time: float) -> Rows:
    n, m, shares = (
        len(block.forward.given),
        len(block.forward.driven),
        np.array(block.forward.loads),
    )
    none, first, out = [0.0] * shares.shape[1], inputs[0], []
    arm = _Parallel(block.forward, [*first[m + n :], *none], sample_time)

    def loads(q: list[float], row: list[float]) -> list[float]:
        x = [*row[m + n :], *none]
        left = [arm.excess(j, q, x, row[m : m + n]) for j in range(m)]
        found: list[float] = np.linalg.lstsq(shares, np.array(left), rcond=None)[0].tolist()
        return found

    if not block.forward.tare:
        arm.way = "rest"
        arm = _Parallel(block.forward, [*first[m + n :], *loads(first[:m], first)], sample_time)
    for row in inputs:
        q = [here + tare for here, tare in zip(row[:m], arm.tare, strict=True)]
        out.append(loads(q, row))
        arm.keep(q, row[m : m + n], [*row[m + n :], *none])
    return out


def prompt(block: Any, inputs: Rows, sample_time: float) -> Rows:
    late = max(round(block.late / sample_time) - 1, 0)
    asked = [row[0] for row in inputs]
    return [
        [row[1] + asked[max(t - 1, 0)] - asked[max(t - 1 - late, 0)]]
        for t, row in enumerate(inputs)
    ]


def pid(block: Any, inputs: Rows, sample_time: float) -> Rows:
    n = len(block.driven)
    lowest, highest = block.limits
    integrals, rates = [0.0] * n, [0.0] * n
    last = due = inputs[0][n : 2 * n]
    share, outputs = sample_time / (block.filter_time + sample_time), []
    for row in inputs:
        references, measured, bases = row[:n], row[n : 2 * n], row[2 * n :] or [0.0] * n
        asked = due if block.late else references
        out = []
        for k in range(n):
            error, slope = asked[k] - measured[k], (measured[k] - last[k]) / sample_time
            rates[k] = (1.0 - share) * rates[k] + share * slope
            wanted = bases[k] + block.kp[k] * error + integrals[k] - block.kd[k] * rates[k]
            if not ((wanted > highest and error > 0) or (wanted < lowest and error < 0)):
                integrals[k] += block.ki[k] * error * sample_time
            out.append(max(lowest, min(highest, wanted)))
        last, due = measured, references
        outputs.append(out)
    return outputs


def state_network(block: Any, inputs: Rows, sample_time: float) -> Rows:
    n, h = len(block.linear) - len(block.given), block.rate * sample_time / block.substeps

    def layer(rows: slice, x: list[float], u: list[float]) -> list[float]:
        known = [*x, *u, 1.0]
        units = [math.tanh(_sum(tuple(row), known)) for row in block.hidden]
        pairs = zip(block.linear[rows], block.readout[rows], strict=True)
        return [_sum(own, known) + _sum(read, units) for own, read in pairs]

    def moved(start: list[float], rise: list[float], length: float) -> list[float]:
        def rates(at: list[float], share: float) -> list[float]:
            u = [a + share * b for a, b in zip(start, rise, strict=True)]
            return layer(slice(n), at, u)

        return _step(rates, x, 0.0, 1.0, length)

    scales = list(zip(block.input_offset, block.input_scale, strict=True))
    given = [[(u - a) / b for u, (a, b) in zip(row, scales, strict=True)] for row in inputs]
    x = [0.0] * n
    for _ in range(3000):
        x = moved(given[0], [0.0] * len(scales), 0.1)
    outputs = []
    for before, now in itertools.pairwise([given[0], *given]):
        held = block.hold == "zero"
        rise = [0.0 if held else (b - a) / block.substeps for a, b in zip(before, now, strict=True)]
        for s in range(block.substeps):
            x = moved([a + s * b for a, b in zip(before, rise, strict=True)], rise, h)
        found = zip(
            layer(slice(n, None), x, now), block.output_offset, block.output_scale, strict=True
        )
        outputs.append([a + b * y for y, a, b in found])
    return outputs


def band(block: Any, inputs: Rows, sample_time: float) -> Rows:
    place = math.ceil(block.level * (len(block.scores[0]) - 1) - 1e-9)
    outputs = []
    for before, row in zip([inputs[0], *inputs], inputs, strict=False):
        ends = []
        for g, y in enumerate(row):
            half = block.scores[g][place]
            half += half * block.widening[g] / sample_time * abs(y - before[g])
            ends += [y, y - half, y + half]
        outputs.append(ends)
    return outputs


def banded_pi(block: Any, inputs: Rows, sample_time: float) -> Rows:
    return band(block.band, stepping(_PI)(block.forward, inputs, sample_time), sample_time)


def repetition(block: Any, inputs: Rows, sample_time: float) -> Rows:
    tables = block.corrections
    n = len(tables[0])
    places = [t % n if block.repeats else min(t, n - 1) for t in range(len(inputs))]
    return [
        [u + table[place] for u, table in zip(row, tables, strict=True)]
        for row, place in zip(inputs, places, strict=True)
    ]


TWINS: dict[str, Twin] = {
    "band": band,
    "pi-banded": banded_pi,
    "activation-memory": activation_memory,
    "activation-pressure": activation_pressure,
    "affine": memoryless(lambda block, u: block.gain * u + block.offset),
    "air": air,
    "balance": balance,
    "balance-inverse": balance_inverse,
    "bouc-wen": stepping(_BoucWen),
    "bouc-wen-oscillator": _oscillator(_bouc_wen_slope),
    "braid-equilibrium": braid_equilibrium,
    "chou-hannaford": memoryless(_chou_hannaford),
    "coupled-memory": coupled_memory,
    "coupling": coupling,
    "fuzzy-network": fuzzy_network,
    "creep": stepping(_Creep),
    "duhem": stepping(_Duhem),
    "duhem-oscillator": _oscillator(_duhem_slope),
    "eupi": stepping(_EUPI),
    "exponential": memoryless(lambda block, u: math.exp(u) - block.offset),
    "generalized-bouc-wen": stepping(_GeneralizedBoucWen),
    "gpi": gpi,
    "krasnoselskii-pokrovskii": stepping(_Ramps),
    "load-estimate": load_estimate,
    "contact": memoryless(lambda block, u: _acting(u, block.pressure)),
    "logarithm": memoryless(lambda block, u: math.log(u + block.offset)),
    "maxwell-slip": stepping(_Springs),
    "multistate-friction": multistate_friction,
    "narx-network": narx_network,
    "narx-polynomial": narx_polynomial,
    "negative": memoryless(lambda block, u: -u),
    "pi": stepping(_PI),
    "pid": pid,
    "piecewise-linear": memoryless(_piecewise_linear),
    "play": stepping(_Play),
    "polynomial": memoryless(_power_sum),
    "polynomial-force": memoryless(_polynomial_force),
    "preisach": stepping(_Relays),
    "process-model": process_model,
    "prompt": prompt,
    "rate-dependent-pi": stepping(_RateDependentPI),
    "state-network": state_network,
    "tondu-lopez": memoryless(_tondu_lopez),
    "recurrent-fuzzy-network": recurrent_fuzzy_network,
    "repetition": repetition,
    "transfer-function": transfer_function,
}
"""Kind of block -> its twin."""
