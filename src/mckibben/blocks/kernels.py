"""Compilation of kernels.

A kernel is a numba function ``kernel(coefficients, state, inputs, outputs)`` on float64 arrays: it
advances one sample, the state changed in place, nothing allocated, nothing global; the loop over samples
is made from it. The same compiled kernel serves ``simulate``, ``stream`` and ``simulate_many``, so these
agree to the last bit.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from inspect import signature
from typing import Any, Protocol, TypeVar, cast

import numpy as np

from mckibben.arrays import Array
from mckibben.system.compiling import deferred

Function = TypeVar("Function", bound=Callable[..., Any])

SUMS = {"reassoc", "contract"}
"""Fast-math flags of the compiler in weighted sums."""


ROUNDING, BRACKET, SLACK = 1e-12, 1e-15, 1e-9
"""Relative tolerances: rounding, width of a closed bracket, and violation of limits."""

NOTHING = 1e-300
"""Weight below which an operator is ignored."""

SINGLE = {"ROUNDING": 1e-6, "BRACKET": 1e-7, "SLACK": 1e-4, "NOTHING": 1e-37}
"""Constants with a different value in single precision. A module with such constants of its own has
its own table.
"""


def kernel(function: Function) -> Function:
    """Compile with exact arithmetic; for everything but weighted sums.

    Here and in what follows arrays are not reference-counted, which would take longer than a short
    kernel; so none is made, and a copy of one is a loop.
    """
    return deferred(function, _nrt=False)


def short_kernel(function: Function) -> Function:
    """Compile a `kernel` inlined into its callers; for very short kernels."""
    return deferred(function, _nrt=False, forceinline=True)


def summing_kernel(function: Function) -> Function:
    """Compile with reassociation in weighted sums, so that they vectorise.

    Minima, maxima, NaN and infinity keep their meaning.
    """
    return deferred(function, fastmath=SUMS)


def inlined(function: Function) -> Function:
    """Compile inlined into every calling kernel, for functions that take functions."""
    return deferred(function, inline="always", _nrt=False)


@kernel
def accumulate(total: float, change: float, lost: Array, place: int) -> float:
    """Return a sum after an increment; in single-precision C, ``lost`` carries the rounding error.

    For sums that go on from sample to sample: a million small changes would drift there.
    """
    return total + change


@kernel
def remember(latest: float, past: Array) -> None:
    """Shift a number into the past ones; the last is dropped."""
    for k in range(past.size - 1, 0, -1):
        past[k] = past[k - 1]
    if past.size > 0:
        past[0] = latest


@kernel
def fill(to: Array, numbers: Array) -> None:
    """Fill an array with the first numbers of another."""
    for i in range(to.size):
        to[i] = numbers[i]


DERIVED = False
"""Whether derivatives are taken: true only in the complex-step versions of
`mckibben.blocks.complex_step`. Code under ``if DERIVED:`` is neither compiled nor translated to C.
"""


@inlined
def improved(evaluate: Any, target: float, u: float, memory: Any) -> float:
    """Return a root of ``evaluate(u, memory) == target``; in complex versions with its derivative.

    A search ends on the root to rounding, but not on its derivative, which is that of the last step.
    """
    return u


class Step(Protocol):
    """A kernel that advances one sample, ``step(coefficients, state, inputs, outputs)``.

    One that computes in scratch has that behind the state.

    Attributes
    ----------
    batch : callable
        The loop made from it, in which ``inputs`` and ``outputs`` have a row for every sample.
    """

    batch: Callable[..., None]

    def __call__(self, coefficients: Array, state: Array, *arrays: Array) -> None:
        """Compute the outputs of a sample in place, each of shape (n,)."""


def step(function: Callable[..., None], **options: Any) -> Step:
    """Compile a kernel that advances one sample, and the loop over samples."""
    options["_nrt"] = False
    one: Any = deferred(function, inline="always", **options)

    def batch(coefficients: Array, state: Array, inputs: Array, outputs: Array) -> None:
        for t in range(inputs.shape[0]):
            one(coefficients, state, inputs[t], outputs[t])

    def batch_in_scratch(
        coefficients: Array, state: Array, scratch: Array, inputs: Array, outputs: Array
    ) -> None:
        for t in range(inputs.shape[0]):
            one(coefficients, state, scratch, inputs[t], outputs[t])

    loop = batch_in_scratch if "scratch" in signature(function).parameters else batch
    one.batch = deferred(loop, **options)
    return cast("Step", one)


def summing_step(function: Callable[..., None]) -> Step:
    """Compile a `step` with the options of a `summing_kernel`."""
    return step(function, fastmath=SUMS)


@cache
def in_scratch(kernel: Callable[..., Any]) -> bool:
    """Return whether a step or start kernel takes a working memory."""
    return "scratch" in signature(kernel).parameters


def scratch_of(kernel: Callable[..., Any], size: int) -> list[Array]:
    """Return the working memory of a kernel as a list of one array, or an empty list."""
    return [np.zeros(size)] if in_scratch(kernel) else []
