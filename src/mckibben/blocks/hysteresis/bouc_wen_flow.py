"""The closed-form flow that Bouc-Wen models share: z along a straight stretch of the input.

With v = z in the direction of motion and tau > 0 the way travelled, in units of the model's rate,
dv/dtau = 1 - psi |v|^n, where psi is one number while the element unloads (v < 0) and another while
it loads (v > 0). For n = 1 the solutions are exponentials; for n = 2 they are tanh where psi > 0
and tan where psi < 0, by their addition formulas. No step size enters, so stretches add up exactly.
"""

from __future__ import annotations

import math

from mckibben.blocks.kernels import kernel


@kernel
def flow(v: float, tau: float, unloading: float, loading: float, n: int) -> float:
    """Return v after the way ``tau``; psi is ``unloading`` while v < 0, then ``loading``.

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
