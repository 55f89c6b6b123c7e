"""How kernels are compiled.

A kernel is a numba function ``kernel(coefficients, state, inputs, outputs)`` on float64 arrays:
one pass over time, the state changed in place, nothing allocated, nothing global. The same compiled
kernel serves ``simulate``, ``stream`` and ``simulate_many``, so these agree to the last bit.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from mckibben.system.compiling import deferred

Function = TypeVar("Function", bound=Callable[..., Any])


def kernel(function: Function) -> Function:
    """Compile with exact arithmetic, for everything but weighted sums."""
    return deferred(function)


def summing_kernel(function: Function) -> Function:
    """Compile with the terms of weighted sums free to be reordered, which lets them vectorise.

    Minima, maxima, NaN and infinity keep their meaning.
    """
    return deferred(function, fastmath={"reassoc", "contract"})


def inlined(function: Function) -> Function:
    """Compile into each kernel that calls it, for functions that take functions."""
    return deferred(function, inline="always")
