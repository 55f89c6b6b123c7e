"""The naive twin of every kernel: plain Python loops, straight from the formulas.

A twin takes a block, rows of inputs and the sample time, and returns rows of outputs from the
block's own start. Twins of inverses know nothing of how kernels invert: they search by bisection,
one sample after another, for the input that makes the forward formula give the reference.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

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
        if function(middle) < target:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


# -- memoryless ------------------------------------------------------------------------------


def affine(block: Any, inputs: Rows, sample_time: float) -> Rows:
    return _rows([block.gain * u + block.offset for u in _column(inputs)])


def negative(block: Any, inputs: Rows, sample_time: float) -> Rows:
    return _rows([-u for u in _column(inputs)])


def _lines(knots: tuple[float, ...], values: tuple[float, ...], x: float) -> float:
    piece = 0
    while piece < len(knots) - 2 and x >= knots[piece + 1]:
        piece += 1
    x0, x1, y0, y1 = knots[piece], knots[piece + 1], values[piece], values[piece + 1]
    return y0 + (y1 - y0) / (x1 - x0) * (x - x0)


def piecewise_linear(block: Any, inputs: Rows, sample_time: float) -> Rows:
    return _rows([_lines(block.knots, block.values, u) for u in _column(inputs)])


def _power_sum(block: Any, u: float) -> float:
    x = (u - block.centre) / block.scale
    return math.fsum(c * x**power for power, c in enumerate(block.polynomial))


def polynomial(block: Any, inputs: Rows, sample_time: float) -> Rows:
    return _rows([_power_sum(block, u) for u in _column(inputs)])


def polynomial_inverse(block: Any, inputs: Rows, sample_time: float) -> Rows:
    forward = block.forward
    low, high = forward.input_range
    return _rows([bisect(lambda u: _power_sum(forward, u), y, low, high) for y in _column(inputs)])


# -- play operators --------------------------------------------------------------------------


def _play(state: float, u: float, r: float) -> float:
    if u - r > state:
        return u - r
    if u + r < state:
        return u + r
    return state


def play(block: Any, inputs: Rows, sample_time: float) -> Rows:
    state = inputs[0][0] - block.threshold
    outputs = []
    for u in _column(inputs):
        state = _play(state, u, block.threshold)
        outputs.append(state)
    return _rows(outputs)


def pi(block: Any, inputs: Rows, sample_time: float) -> Rows:
    states = [inputs[0][0] - r for r in block.thresholds]
    outputs = []
    for u in _column(inputs):
        states = [_play(s, u, r) for s, r in zip(states, block.thresholds, strict=True)]
        outputs.append(block.offset + _sum(block.weights, states))
    return _rows(outputs)


def pi_inverse(block: Any, inputs: Rows, sample_time: float) -> Rows:
    forward = block.forward
    thresholds, weights, offset = forward.thresholds, forward.weights, forward.offset
    low, high = forward.input_range

    def risen(u: float) -> list[float]:
        return [u - r for r in thresholds]

    def moved(u: float) -> list[float]:
        return [_play(s, u, r) for s, r in zip(states, thresholds, strict=True)]

    states = risen(bisect(lambda u: offset + _sum(weights, risen(u)), inputs[0][0], low, high))
    outputs = []
    for y in _column(inputs):
        outputs.append(bisect(lambda u: offset + _sum(weights, moved(u)), y, low, high))
        states = moved(outputs[-1])
    return _rows(outputs)


def rate_dependent_pi(block: Any, inputs: Rows, sample_time: float) -> Rows:
    states = [inputs[0][0] - r for r in block.thresholds]
    previous, rate = inputs[0][0], 0.0
    outputs = []
    for u in _column(inputs):
        states, rate = _rated(block, states, rate, previous, u, sample_time)
        outputs.append(_rated_output(block, states, rate))
        previous = u
    return _rows(outputs)


def _rated(
    block: Any, states: list[float], rate: float, previous: float, u: float, sample_time: float
) -> tuple[list[float], float]:
    raw = (u - previous) / sample_time
    tau = block.rate_time_constant
    keep = math.exp(-sample_time / tau) if tau > 0 else 0.0
    moved = [_play(s, u, r) for s, r in zip(states, block.thresholds, strict=True)]
    return moved, keep * rate + (1 - keep) * raw


def _rated_output(block: Any, states: list[float], rate: float) -> float:
    weights = [k * rate + d for k, d in zip(block.rate_weights, block.weights, strict=True)]
    return float(block.offset + _sum(tuple(weights), states))


def rate_dependent_pi_inverse(block: Any, inputs: Rows, sample_time: float) -> Rows:
    forward = block.forward
    low, high = forward.input_range

    def at_rest(u: float) -> float:
        return _rated_output(forward, [u - r for r in forward.thresholds], 0.0)

    def moved(u: float) -> tuple[list[float], float]:
        return _rated(forward, states, rate, previous, u, sample_time)

    previous, rate = bisect(at_rest, inputs[0][0], low, high), 0.0
    states = [previous - r for r in forward.thresholds]
    outputs = []
    for y in _column(inputs):
        outputs.append(bisect(lambda u: _rated_output(forward, *moved(u)), y, low, high))
        states, rate = moved(outputs[-1])
        previous = outputs[-1]
    return _rows(outputs)


# -- generalised and unparallel play operators -----------------------------------------------


def tanh_envelope(envelope: Any, u: float) -> float:
    e = math.exp(-2 * abs(envelope.slope * u + envelope.shift))
    tangent = math.copysign((1 - e) / (1 + e), envelope.slope * u + envelope.shift)
    return float(tangent + envelope.offset)


def exponential_envelope(envelope: Any, u: float) -> float:
    bent = 1 - math.e ** (envelope.shift - envelope.rate * u)
    return float(envelope.offset + (bent if envelope.rate > 0 else -bent))


def piecewise_linear_envelope(envelope: Any, u: float) -> float:
    return _lines(envelope.knots, envelope.values, u)


ENVELOPES: dict[str, Callable[[Any, float], float]] = {
    "exponential": exponential_envelope,
    "piecewise-linear": piecewise_linear_envelope,
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


def gpi_inverse(block: Any, inputs: Rows, sample_time: float) -> Rows:
    forward = block.forward
    thresholds, weights = forward.thresholds, forward.weights
    low, high = forward.input_range

    def risen(u: float) -> list[float]:
        edge = _envelope(forward.rising, u)
        return [max(edge - r, s) for s, r in zip(states, thresholds, strict=True)]

    def fallen(u: float) -> list[float]:
        edge = _envelope(forward.falling, u)
        return [min(edge + r, s) for s, r in zip(states, thresholds, strict=True)]

    previous = inputs[0][0]
    states = [-math.inf] * len(thresholds)
    u = bisect(lambda v: _sum(weights, risen(v)), previous, low, high)
    states = risen(u)
    outputs = []
    for y in _column(inputs):
        if y > previous:
            u = bisect(lambda v: _sum(weights, risen(v)), y, low, high)
            states = risen(u)
        elif y < previous:
            u = bisect(lambda v: _sum(weights, fallen(v)), y, low, high)
            states = fallen(u)
        previous = y
        outputs.append(u)
    return _rows(outputs)


def _unparallel(block: Any, state: float, x: float, r: float) -> float:
    upper: float = block.falling_slope * x + block.falling_threshold * r
    if state > upper:
        state = upper
    return x - r if x - r > state else state


def _unparallel_output(block: Any, states: list[float], x: float) -> float:
    smooth = sum(a * x ** (power + 1) for power, a in enumerate(block.polynomial))
    return float(block.offset + smooth + _sum(block.weights, states))


def eupi(block: Any, inputs: Rows, sample_time: float) -> Rows:
    origin = block.input_range[0]
    states = [inputs[0][0] - origin - r for r in block.thresholds]
    outputs = []
    for u in _column(inputs):
        x = u - origin
        states = [
            _unparallel(block, s, x, r) for s, r in zip(states, block.thresholds, strict=True)
        ]
        outputs.append(_unparallel_output(block, states, x))
    return _rows(outputs)


def eupi_inverse(block: Any, inputs: Rows, sample_time: float) -> Rows:
    forward = block.forward
    low, high = forward.input_range

    def moved(u: float) -> list[float]:
        pairs = zip(states, forward.thresholds, strict=True)
        return [_unparallel(forward, s, u - low, r) for s, r in pairs]

    def output(u: float) -> float:
        return _unparallel_output(forward, moved(u), u - low)

    states = [-math.inf] * len(forward.thresholds)
    states = moved(bisect(output, inputs[0][0], low, high))
    outputs = []
    for y in _column(inputs):
        outputs.append(bisect(output, y, low, high))
        states = moved(outputs[-1])
    return _rows(outputs)


TWINS: dict[str, Twin] = {
    "affine": affine,
    "eupi": eupi,
    "eupi-inverse": eupi_inverse,
    "gpi": gpi,
    "gpi-inverse": gpi_inverse,
    "negative": negative,
    "pi": pi,
    "pi-inverse": pi_inverse,
    "piecewise-linear": piecewise_linear,
    "play": play,
    "polynomial": polynomial,
    "polynomial-inverse": polynomial_inverse,
    "rate-dependent-pi": rate_dependent_pi,
    "rate-dependent-pi-inverse": rate_dependent_pi_inverse,
}
"""Kind of block -> its twin."""
