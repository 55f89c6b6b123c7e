"""What property tests of blocks draw: inputs with minor loops, and models."""

from __future__ import annotations

from typing import Any

import numpy as np
from hypothesis import strategies as st
from numpy.typing import NDArray

from mckibben import EUPI, GPI, PI, RateDependentPI, Series
from mckibben import PiecewiseLinear as Curve
from mckibben.blocks.fields import vector
from mckibben.blocks.hysteresis.envelopes import Envelope, Exponential, PiecewiseLinear, Tanh
from mckibben.blocks.hysteresis.preisach import KrasnoselskiiPokrovskii, Preisach
from mckibben.blocks.laws import through

Array = NDArray[np.float64]

LOW, HIGH = 0.0, 5.0


def numbers(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high, allow_nan=False, allow_subnormal=False)


@st.composite
def paths(draw: st.DrawFn, low: float = LOW, high: float = HIGH, pace: int = 6) -> Array:
    """Draw a path between turning points, shape (n,), with minor loops and holds."""
    turns = draw(st.lists(numbers(low, high), min_size=2, max_size=16))
    samples = draw(
        st.lists(st.integers(1, 2 * pace), min_size=len(turns) - 1, max_size=len(turns) - 1)
    )
    return through(np.array(turns)[:, np.newaxis], np.array(samples))[:, 0]


@st.composite
def thresholds(draw: st.DrawFn, size: int, spread: float) -> tuple[float, ...]:
    """Draw 0 = r_0 < r_1 < ..."""
    steps = draw(st.lists(numbers(0.01, 1.0), min_size=size - 1, max_size=size - 1))
    rising = np.cumsum([0.0, *steps])
    return vector(rising * spread / max(1.0, rising[-1]))


@st.composite
def invertible_weights(draw: st.DrawFn, size: int) -> tuple[float, ...]:
    """Draw weights of which some are negative, with partial sums that are all positive."""
    partial = draw(st.lists(numbers(0.1, 5.0), min_size=size, max_size=size))
    return vector(np.diff([0.0, *partial]))


@st.composite
def pi_models(draw: st.DrawFn) -> PI:
    size = draw(st.integers(1, 8))
    weights, offset = draw(invertible_weights(size)), draw(numbers(-5.0, 5.0))
    return PI(draw(thresholds(size, 3.0)), weights, offset, (LOW, HIGH))


@st.composite
def envelope_pairs(draw: st.DrawFn) -> tuple[Envelope, Envelope]:
    """Draw an unequal pair of one kind, the falling one nowhere below the rising one."""
    gap = draw(numbers(0.0, 0.3))
    kind = draw(st.sampled_from(["tanh", "exponential", "piecewise-linear"]))
    rising: Envelope
    falling: Envelope
    if kind == "tanh":
        slopes, shifts = numbers(0.1, 0.8), numbers(-2.0, 0.5)
        rising, falling = (Tanh(draw(slopes), draw(shifts)) for _ in range(2))
    elif kind == "exponential":
        rates, shifts = numbers(0.05, 0.6), numbers(-0.5, 0.5)
        sign = draw(st.sampled_from([-1.0, 1.0]))
        rising, falling = (Exponential(sign * draw(rates), draw(shifts)) for _ in range(2))
    else:
        knots = (0.0, 1.0, 2.0, 3.5, 5.0)
        steps = st.lists(numbers(0.05, 1.0), min_size=5, max_size=5)
        rising, falling = (PiecewiseLinear(knots, vector(np.cumsum(draw(steps)))) for _ in range(2))
    u = np.linspace(LOW, HIGH, 2001)
    lowest = float((falling(u) - rising(u)).min())
    return rising, falling.shifted(gap + 1e-6 - lowest)


@st.composite
def gpi_models(draw: st.DrawFn) -> GPI:
    rising, falling = draw(envelope_pairs())
    size = draw(st.integers(1, 8))
    r = draw(thresholds(size, float(np.ptp(rising([LOW, HIGH])))))
    return GPI(r, draw(invertible_weights(size)), rising, falling, (LOW, HIGH))


@st.composite
def eupi_models(draw: st.DrawFn) -> EUPI:
    size = draw(st.integers(1, 6))
    weights = draw(st.lists(numbers(0.0, 3.0), min_size=size, max_size=size))
    slope, curve = draw(numbers(0.2, 2.0)), draw(numbers(-0.01, 0.2))
    return EUPI(
        draw(thresholds(size, 3.0)),
        tuple(weights),
        draw(numbers(0.5, 2.0)),
        draw(numbers(0.0, 2.0)),
        (slope, curve, 0.0),
        draw(numbers(-5.0, 5.0)),
        (LOW, HIGH),
    )


@st.composite
def rate_dependent_models(draw: st.DrawFn) -> RateDependentPI:
    size = draw(st.integers(1, 6))
    rate_weights = draw(st.lists(numbers(-0.01, 0.02), min_size=size, max_size=size))
    weights = draw(st.lists(numbers(0.5, 3.0), min_size=size, max_size=size))
    return RateDependentPI(
        draw(thresholds(size, 3.0)),
        tuple(rate_weights),
        tuple(weights),
        draw(numbers(-5.0, 5.0)),
        draw(numbers(0.05, 1.0)),
        (LOW, HIGH),
    )


@st.composite
def modified_models(draw: st.DrawFn) -> Series:
    """Draw a Prandtl-Ishlinskii model and a curve that increases over all that it can give."""
    model = draw(pi_models())
    size = float(np.abs(model.weights).sum()) * (HIGH - LOW + max(model.thresholds))
    low, high = model.offset - size, model.offset + size
    steps = draw(st.lists(numbers(0.1, 2.0), min_size=4, max_size=4))
    values = vector(np.cumsum([0.0, *steps]) * (high - low))
    return Series((model, Curve(vector(np.linspace(low, high, 5)), values)))


@st.composite
def preisach_models(draw: st.DrawFn) -> Preisach | KrasnoselskiiPokrovskii:
    kind: Any = draw(st.sampled_from([Preisach, KrasnoselskiiPokrovskii]))
    weights = draw(st.lists(numbers(0.01, 2.0), min_size=15, max_size=15))
    found: Preisach | KrasnoselskiiPokrovskii = kind(
        vector(np.linspace(LOW, HIGH, 6)), tuple(weights), draw(numbers(-5.0, 5.0))
    )
    return found
