"""How kernels are compiled, and the two that every play-type inverse shares.

A kernel is a numba function ``kernel(coefficients, state, inputs, outputs)`` on float64 arrays:
one pass over time, the state changed in place, nothing allocated, nothing global. The same compiled
kernel serves ``simulate``, ``stream`` and ``simulate_many``, so these agree to the last bit.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numba

Function = TypeVar("Function", bound=Callable[..., Any])


def kernel(function: Function) -> Function:
    """Compile with exact arithmetic, for everything but weighted sums."""
    return _compile(function, fastmath=False)


def summing_kernel(function: Function) -> Function:
    """Compile with the terms of weighted sums free to be reordered, which lets them vectorise.

    Minima, maxima, NaN and infinity keep their meaning.
    """
    return _compile(function, fastmath={"reassoc", "contract"})


def _compile(function: Function, **options: Any) -> Function:
    compiled: Function = numba.njit(cache=True, nogil=True, error_model="numpy", **options)(
        function
    )
    return compiled
