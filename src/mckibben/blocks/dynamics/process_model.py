"""Continuous-time process models P1, P1Z, P2, P2Z, P2U, P2UZ and P3 with delay, discretised exactly.

Y(s) / U(s) = K (Tz s + 1) / D(s) exp(-Td s), D(s) = (Tp1 s + 1) (Tp2 s + 1) (Tp3 s + 1), or, for a
pair of poles that may oscillate (U), D(s) = Tw^2 s^2 + 2 zeta Tw s + 1. Names as in MATLAB; the
P2UZ model is Eq. (11) of "Analysis and modeling of a pneumatic artificial muscle system", whose
zeta of 9.1 is above 1: any positive one is allowed.

The input goes in straight lines from sample to sample (first-order hold), or is held (zero-order).
Either way the response is exact, for delays between samples too: the state is carried over each
corner of the delayed input by matrix exponentials.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Annotated

import numpy as np
from pydantic import FiniteFloat
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks import fields
from mckibben.blocks.base import Block
from mckibben.blocks.kernels import kernel, remember, step
from mckibben.blocks.sample_times import needs_sample_time
from mckibben.errors import ModelError


@step
def process_model_step(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
    """Advance the model; the state is [x, past inputs, latest first].

    Coefficients are [n, delay in samples, u_0, y_0, D now, D before, C, three input vectors,
    matrix].
    """
    n, m = int(coefficients[0]), int(coefficients[1])
    u0, y0 = coefficients[2], coefficients[3]
    now, before = coefficients[4], coefficients[5]
    c = coefficients[6:]
    kept = state.size - 2 * n
    remember(inputs[0] - u0, state[n : n + kept])
    first, second, third = state[n + m], state[n + m + 1], state[n + m + 2]
    y = now * first + before * second
    for i in range(n):
        x = c[n + i] * first + c[2 * n + i] * second + c[3 * n + i] * third
        for j in range(n):
            x += c[4 * n + i * n + j] * state[j]
        state[n + kept + i] = x
        y += c[i] * x
    for i in range(n):
        state[i] = state[n + kept + i]
    outputs[0] = y + y0


@kernel
def process_model_start(coefficients: Array, state: Array, inputs: Array, virgin: bool) -> None:
    """Start the lags in equilibrium with the first input, or at the operating point."""
    n = int(coefficients[0])
    u = 0.0 if virgin else inputs[0] - coefficients[2]
    state[:] = 0.0
    state[0] = u
    state[n : state.size - n] = u


@dataclass(frozen=True, config=fields.STRICT)
class ProcessModel(fields.WithMemory, Block):
    """Gain, one to three lags, optional zero and delay, about an operating point.

    Parameters
    ----------
    gain : float
        K, output per input at rest.
    time_constants : sequence of float
        Lags Tp1, Tp2, Tp3 [s], or Tw alone where there is a damping; positive.
    damping : float or None
        zeta, damping of the pair of poles, positive; makes the pair of poles of P2U.
    zero_time : float or None
        Tz, time of the zero [s]; may be negative.
    delay : float
        Td, dead time [s], up to 254 samples; not negative.
    input_offset, output_offset : float
        The operating point.
    hold : {"first", "zero"}
        What the input does between samples: go on in a straight line, or stay.
    initial : {"first_sample", "virgin"} or sequence of float
        Default memory before the first sample: at rest at the first input, or at the operating point.
    """

    kind = "process-model"
    kernel = process_model_step
    start_kernel = process_model_start
    rate_dependent = True
    is_linear = True
    filters = True
    typical = (6.7987, (5.7018,), 9.1096, 156.3105, 0.0, 1.0)

    gain: Annotated[FiniteFloat, "K [{y}/{u}]"]
    time_constants: Annotated[fields.PositiveVector, "T_{p,i} [s]"]
    damping: Annotated[fields.Positive | None, r"\zeta"] = None
    zero_time: Annotated[FiniteFloat | None, "T_z [s]"] = None
    delay: Annotated[fields.NotNegative, "T_d [s]"] = 0.0
    input_offset: Annotated[FiniteFloat, "u_0 [{u}]"] = 0.0
    output_offset: Annotated[FiniteFloat, "y_0 [{y}]"] = 0.0
    hold: fields.Hold = "first"

    def __post_init__(self) -> None:
        n = len(self.time_constants)
        if not 1 <= n <= 3 or (self.damping is not None and n != 1):
            raise ModelError(
                f"{self.kind!r} has the time constants {self.time_constants}",
                remedy="give one to three [s], and one alone with a damping",
            )

    @property
    def parameters(self) -> tuple[str, ...]:  # type: ignore[override]
        """The fields of this structure."""
        optional = [n for n in ("damping", "zero_time") if getattr(self, n) is not None]
        late = ["delay"] if self.delay > 0 else []
        return ("gain", "time_constants", *optional, *late, "input_offset", "output_offset")

    @property
    def order(self) -> int:
        """Number of poles."""
        return 2 if self.damping is not None else len(self.time_constants)

    @property
    def name(self) -> str:
        """MATLAB's name of the structure, P1 to P3 with U and Z; a delay adds D."""
        under = "U" if self.damping is not None else ""
        return f"P{self.order}{'D' * (self.delay > 0)}{under}{'Z' * (self.zero_time is not None)}"

    instead = "invert a hysteresis model (cpi, gpi, mpi), or a transfer-function with delay 0"

    @property
    def no_inverse(self) -> str:  # type: ignore[override]
        return (
            f"({self.name}) has no exact inverse: its output lags its input, so following a reference "
            "would take derivatives of it"
        )

    @property
    def n_states(self) -> int:
        """Number of states: lags, past inputs, and working memory for the lags."""
        return 2 * self.order + (3 if self.delay == 0 else fields.LONGEST_DELAY + 3)

    def denominator(self) -> Array:
        """Return D(s), descending powers."""
        if self.damping is not None:
            (t,) = self.time_constants
            return np.array([t**2, 2 * self.damping * t, 1.0])
        polynomial = np.array([1.0])
        for t in self.time_constants:
            polynomial = np.polymul(polynomial, [t, 1.0])
        return polynomial

    def coefficients(self, sample_time: float | None) -> Array:
        """Return the coefficients of the kernel; raise an error for delays above 254 samples."""
        return _discretised(self, sample_time).copy()

    def equations(self) -> tuple[str, ...]:
        below = r"T_{p,1}^2 s^2 + 2 \zeta T_{p,1} s + 1"
        if self.damping is None:
            below = "".join(f"(T_{{p,{k + 1}}} s + 1)" for k in range(self.order))
        above = "K" if self.zero_time is None else r"K (T_z\,s + 1)"
        late = r"\, e^{-T_d\,s}" if self.delay else ""
        return (rf"\frac{{Y(s) - y_0}}{{U(s) - u_0}} = \frac{{{above}}}{{{below}}}{late}",)


@lru_cache(maxsize=8)  # once for many runs of one model
def _discretised(model: ProcessModel, sample_time: float | None) -> Array:
    """Return the coefficients of a model."""
    step = needs_sample_time(model.kind, sample_time)
    samples = model.delay / step
    m = int(np.floor(samples + 1e-9))
    if m > fields.LONGEST_DELAY:
        raise ModelError(
            f"a delay of {model.delay:g} s is {m} samples",
            remedy=f"a delay of at most {fields.LONGEST_DELAY} samples, or a longer sample time",
        )
    part = min(max(samples - m, 0.0), 1.0)
    a, b, c, through = _state_space(model)
    early, early_from, early_to = held(a, b, part * step)
    late, late_from, late_to = held(a, b, (1 - part) * step)
    vectors = np.zeros((3, b.size))
    if model.hold == "first":
        # the delayed input at the start of the step, at its corner, and at its end
        start, corner, end = late @ early_from, late @ early_to + late_from, late_to
        vectors[0] = (1 - part) * end
        vectors[1] = part * end + corner + (1 - part) * start
        vectors[2] = part * start
        now, before = (1 - part) * through, part * through
    else:
        # until the corner the input is two samples old, then one
        vectors[1] = late_from + late_to
        vectors[2] = late @ (early_from + early_to)
        now, before = (through, 0.0) if part == 0 else (0.0, through)
    head = [b.size, m, model.input_offset, model.output_offset, now, before]
    return np.concatenate([head, c, vectors.ravel(), (late @ early).ravel()])


def _state_space(model: ProcessModel) -> tuple[Array, Array, Array, float]:
    """Return A, B, C and D of the lags without delay, in controllable form.

    The state is scaled so that it is (u, 0, ..., 0) at rest, which preserves the digits of slow lags.
    """
    d = model.denominator()
    n = d.size - 1
    a = np.diag(np.ones(n - 1), 1)
    a[-1] = -d[:0:-1] / d[0]
    b = np.zeros(n)
    b[-1] = 1.0 / d[0]
    c = np.zeros(n)
    c[0] = model.gain
    through = 0.0
    if model.zero_time is not None and n > 1:
        c[1] = model.gain * model.zero_time
    elif model.zero_time is not None:
        through = model.gain * model.zero_time / d[0]
        c[0] = model.gain - through
    return a, b, c, through


def held(a: Array, b: Array, step: float) -> tuple[Array, Array, Array]:
    """Return the transition of the state over a step, and the weights of the input at its ends.

    For x' = A x + B v with v going in a straight line: x+ = Phi x + G v_start + H v_end.
    """
    from scipy.linalg import expm

    n = b.size
    matrix = np.zeros((n + 2, n + 2))
    matrix[:n, :n], matrix[:n, n], matrix[n, n + 1] = a * step, b * step, 1.0
    exponential = expm(matrix)
    return exponential[:n, :n], exponential[:n, n] - exponential[:n, n + 1], exponential[:n, n + 1]
