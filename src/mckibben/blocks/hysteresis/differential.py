"""Loops with one memory z that moves with the input: their kernels, and the flow of Bouc-Wen models.

A model gives two compiled functions: ``moved(u, coefficients, state)``, its memory after the input has
gone on to u, and ``output(u, z, coefficients)``. Its state is [z, previous input].
"""

from __future__ import annotations

import math
from collections.abc import Callable

from mckibben.arrays import Array
from mckibben.blocks.base import Start
from mckibben.blocks.kernels import Step, kernel, step
from mckibben.blocks.solving import solved_inverse


def loop_kernels(
    moved: Callable[..., float], output: Callable[..., float], start: Start
) -> tuple[Step, Step, Start]:
    """Return the step of a model, and the step and the start of its inverse."""
    place = f"{moved.__module__}.{moved.__qualname__}"

    @kernel
    def advance(u: float, c: Array, state: Array) -> None:
        state[0] = moved(u, c, state)
        state[1] = u

    def trial(u: float, memory: tuple[Array, Array]) -> float:
        c, state = memory
        return output(u, moved(u, c, state), c)

    def loop_step(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
        """Move the memory with the input; the state is [memory, previous input]."""
        advance(inputs[0], coefficients, state)
        outputs[0] = output(inputs[0], state[0], coefficients)

    trial.__qualname__, loop_step.__qualname__ = f"{place}.trial", f"{place}.step"
    return step(loop_step), *solved_inverse(kernel(trial), advance, start)


@kernel
def bouc_wen_start(coefficients: Array, state: Array, inputs: Array, virgin: bool) -> None:
    """Start with z = 1, as after a long rise, or z = 0."""
    state[0] = 0.0 if virgin else 1.0
    state[1] = inputs[0]


@kernel
def flow(v: float, tau: float, unloading: float, loading: float, n: int) -> float:
    """Return z in the direction of motion, v, after a straight stretch ``tau`` of the input.

    With tau > 0 in units of the model's rate, dv/dtau = 1 - psi |v|^n; psi is ``unloading`` while v < 0,
    then ``loading``. For n = 1 the solutions are exponentials; for n = 2 they are tanh where psi > 0 and
    tan where psi < 0, by their addition formulas. No step size enters, so stretches add up exactly.
    Wants loading > 0 and unloading < 1 / |v|^n, so that v returns to zero and then stays bounded.
    """
    if v < 0.0:
        needed = _way_to_zero(-v, unloading, n)
        if tau <= needed:
            return min(-_shrunk(-v, tau, unloading, n), 0.0)
        v, tau = 0.0, tau - needed
    if n == 1:
        limit = 1.0 / loading
        return limit - (limit - v) * math.exp(-loading * tau)
    q = math.sqrt(loading)
    t = math.tanh(q * tau)
    return (v + t / q) / (1.0 + v * q * t)


@kernel
def _way_to_zero(w: float, psi: float, n: int) -> float:
    """Return the way after which w = |v| has shrunk to zero."""
    if psi == 0.0:
        return w
    if n == 1:
        return -math.log1p(-psi * w) / psi
    q = math.sqrt(abs(psi))
    return math.atan(q * w) / q if psi < 0.0 else math.atanh(q * w) / q


@kernel
def _shrunk(w: float, tau: float, psi: float, n: int) -> float:
    """Return what is left of w = |v| after the way ``tau``."""
    if psi == 0.0:
        return w - tau
    if n == 1:
        grown = math.expm1(psi * tau)
        return w + grown * (w - 1.0 / psi)
    q = math.sqrt(abs(psi))
    if psi < 0.0:
        t = math.tan(q * tau)
        return (w - t / q) / (1.0 + w * q * t)
    t = math.tanh(q * tau)
    return (w - t / q) / (1.0 - w * q * t)
