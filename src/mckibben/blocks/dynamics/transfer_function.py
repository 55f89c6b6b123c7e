"""Discrete transfer function, the free-running form of ARX, ARMAX, OE and Box-Jenkins models.

y_t - y_0 = B(q) / F(q) (u_t - u_0),  B = b_0 + b_1 q^-1 + ...,  F = 1 + f_1 q^-1 + ...

Of the models named, B / F is what a free run needs; the noise model C / D describes the
correlation of its errors, and is not simulated. The inverse is F / B. It exists where the
output answers at once (b_0 is not zero) and all zeros of B lie within the unit circle.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import FiniteFloat
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks import fields
from mckibben.blocks.base import Block
from mckibben.blocks.kernels import kernel, step
from mckibben.blocks.sample_times import own_sample_time
from mckibben.errors import ModelError

INPUT_OFFSET, OUTPUT_OFFSET = range(2)
"""Places of the first coefficients: the operating point."""


@step
def filter_step(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
    """Advance the filter in transposed direct form; coefficients are [u_0, y_0, b, f, gain]."""
    n = state.size
    b, f = coefficients[2 : 3 + n], coefficients[3 + n : 4 + 2 * n]
    u = inputs[0] - coefficients[INPUT_OFFSET]
    y = b[0] * u
    if n > 0:
        y += state[0]
    for i in range(n - 1):
        state[i] = state[i + 1] + b[i + 1] * u - f[i + 1] * y
    if n > 0:
        state[n - 1] = b[n] * u - f[n] * y
    outputs[0] = y + coefficients[OUTPUT_OFFSET]


@kernel
def filter_start(coefficients: Array, state: Array, inputs: Array, virgin: bool) -> None:
    """Start the filter at rest: at the first input, or at the operating point."""
    n = state.size
    b, f = coefficients[2 : 3 + n], coefficients[3 + n : 4 + 2 * n]
    u = 0.0 if virgin else inputs[0] - coefficients[INPUT_OFFSET]
    y = coefficients[4 + 2 * n] * u
    coming = 0.0
    for i in range(n, 0, -1):
        coming += b[i] * u - f[i] * y
        state[i - 1] = coming


@dataclass(frozen=True, config=fields.STRICT)
class TransferFunction(fields.WithMemory, Block):
    """Discrete transfer function about an operating point.

    Parameters
    ----------
    numerator : sequence of float
        b_0, b_1, ..., what the input adds at once and samples later; leading zeros are
        delays. At least one.
    denominator : sequence of float
        f_1, f_2, ..., what of past outputs goes on (the leading 1 is left out); may be empty.
    sample_time : float
        Time between samples that it holds for [s]; positive.
    input_offset, output_offset : float
        u_0 and y_0, the operating point.
    initial : {"first_sample", "virgin"} or sequence of float
        Default memory before the first sample: at rest at the first input, or at u_0.
    noise_numerator, noise_denominator : sequence of float
        c_1, c_2, ... and d_1, d_2, ... of the noise model C / D, its leading ones left out.
    noise_deviation : float or None
        Standard deviation of the white noise that drives it; None where it is not known.
    input_range : (float, float), optional
        Lowest and highest input that it was identified for; a compensator of it stays within.
    """

    kind = "transfer-function"
    added: ClassVar[Mapping[str, int]] = {"input_range": 2}
    kernel = filter_step
    start_kernel = filter_start
    rate_dependent = True
    is_linear = True
    filters = True
    parameters = (
        "numerator",
        "denominator",
        "input_offset",
        "output_offset",
    )
    typical = ((0.9, -0.85, 0.018), (-1.2, 0.21), 0.01, 1.0, 2.0)
    formulas = (
        r"y_t - y_0 = \frac{B(q)}{F(q)} (u_t - u_0)",
        r"B(q) = \sum_k b_k q^{-k},\quad F(q) = 1 + \sum_k f_k q^{-k},\quad q^{-1} \text{ delays by } T",
    )

    numerator: Annotated[fields.PolynomialField, "b_k from 0 [{y}/{u}]"]
    denominator: Annotated[fields.Coefficients, "f_k"]
    sample_time: Annotated[fields.Positive, "T [s]"]
    input_offset: Annotated[FiniteFloat, "u_0 [{u}]"] = 0.0
    output_offset: Annotated[FiniteFloat, "y_0 [{y}]"] = 0.0
    noise_numerator: Annotated[fields.Coefficients, "c_k"] = ()
    noise_denominator: Annotated[fields.Coefficients, "d_k"] = ()
    noise_deviation: Annotated[fields.NotNegative | None, r"\sigma_e [{y}]"] = None
    input_range: fields.InputRange | None = None

    def equations(self) -> tuple[str, ...]:
        """Return the equations, with those of the noise if that is modelled."""
        first, second = self.formulas
        if not (self.noise_numerator or self.noise_denominator):
            return self.formulas
        noise = r"C(q) = 1 + \sum_k c_k q^{-k},\quad D(q) = 1 + \sum_k d_k q^{-k}"
        return (rf"{first} + \frac{{C(q)}}{{D(q)}} e_t", second, noise)

    @property
    def n_states(self) -> int:
        return max(len(self.numerator) - 1, len(self.denominator))

    @property
    def poles(self) -> NDArray[np.complex128]:
        """Poles in the z plane."""
        return np.asarray(np.roots([1.0, *self.denominator]), dtype=np.complex128)

    @property
    def is_stable(self) -> bool:
        """Whether all poles lie within the unit circle."""
        return bool(np.all(np.abs(self.poles) < 1))

    @property
    def gain(self) -> float:
        """Output per input at rest; infinite for an integrator."""
        sum_ = 1.0 + float(np.sum(self.denominator))
        return float(np.sum(self.numerator)) / sum_ if sum_ != 0 else float("inf")

    def _padded(self) -> tuple[Array, Array]:
        n = self.n_states
        b = np.pad(np.array(self.numerator), (0, n + 1 - len(self.numerator)))
        f = np.pad(np.array([1.0, *self.denominator]), (0, n - len(self.denominator)))
        return b, f

    def coefficients(self, sample_time: float | None) -> Array:
        """Return [u_0, y_0, b, f, gain], with no gain where that is infinite."""
        own_sample_time(self.kind, self.sample_time, sample_time)
        gain = self.gain if np.isfinite(self.gain) else 0.0
        b, f = self._padded()
        return np.array([self.input_offset, self.output_offset, *b, *f, gain])

    def inverse(self) -> TransferFunction:
        """Return the inverse filter.

        Raises
        ------
        ModelError
            If the output answers late, or a zero lies on or outside the unit circle.
        """
        lead = self.numerator[0]
        if lead == 0:
            raise ModelError(
                f"{self.kind!r} has no inverse: its output is delayed by a sample",
                remedy="identify it with `settings[delay]=0`",
            )
        zeros = np.roots(self.numerator)
        if np.any(np.abs(zeros) >= 1 - 1e-9):
            raise ModelError(
                f"{self.kind!r} has no inverse: a zero at |z| = {np.abs(zeros).max():.3g} "
                "would make it unstable",
                remedy="identify it with fewer coefficients in B, or invert another model",
            )
        b = np.array(self.numerator)
        return TransferFunction(
            tuple((np.array([1.0, *self.denominator]) / lead).tolist()),
            tuple((b[1:] / lead).tolist()),
            self.sample_time,
            self.output_offset,
            self.input_offset,
            initial=self.initial if isinstance(self.initial, str) else "first_sample",
            input=self.output,
            output=self.input,
        )
