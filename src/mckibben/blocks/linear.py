"""Linear blocks as state-space systems, for use with other control libraries."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from mckibben.arrays import Array
from mckibben.system.extras import demand

if TYPE_CHECKING:
    from scipy.signal import dlti, lti

    from control import StateSpace, TransferFunction
    from mckibben.blocks.base import Block


@dataclass(frozen=True)
class Polynomials:
    """Numerator and denominator in descending powers: of s, or, with a sample time, of z."""

    numerator: tuple[float, ...]
    denominator: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class LinearSystem:
    """Deviations from an operating point: x+ = A x + B (u - u_0), y - y_0 = C x + D (u - u_0).

    Parameters
    ----------
    a, b, c, d : array, shapes (n, n), (n, k), (m, n) and (m, k)
    sample_time : float or None
        Time between samples [s]; None where there is no state and any will do.
    input_offset, output_offset : array, shapes (k,) and (m,)
        u_0 and y_0.
    polynomials : Polynomials, optional
        The same, where it is known so.
    """

    a: Array
    b: Array
    c: Array
    d: Array
    sample_time: float | None
    input_offset: Array
    output_offset: Array
    polynomials: Polynomials | None = None

    @classmethod
    def gain(cls, gains: ArrayLike, offset: float = 0.0) -> LinearSystem:
        """Return a static gain, y = D u + offset."""
        d = np.atleast_2d(np.asarray(gains, dtype=np.float64))
        m, k = d.shape
        empty = np.zeros((0, 0)), np.zeros((0, k)), np.zeros((m, 0)), d
        return cls(*empty, None, np.zeros(k), np.full(m, offset))

    def then(self, other: LinearSystem) -> LinearSystem:
        """Return the series connection of this system and another."""
        n, m = len(self.a), len(other.a)
        a = np.block([[self.a, np.zeros((n, m))], [other.b @ self.c, other.a]])
        b = np.vstack([self.b, other.b @ self.d])
        c = np.hstack([other.d @ self.c, other.c])
        # how far this one's operating point is from the other's goes through the other at rest
        at_rest = other.rests(self.output_offset)
        step = self.sample_time if other.sample_time is None else other.sample_time
        return LinearSystem(a, b, c, other.d @ self.d, step, self.input_offset, at_rest)

    def beside(self, other: LinearSystem) -> LinearSystem:
        """Return the sum of this system and another with the same inputs."""
        n, m = len(self.a), len(other.a)
        a = np.block([[self.a, np.zeros((n, m))], [np.zeros((m, n)), other.a]])
        b, c = np.vstack([self.b, other.b]), np.hstack([self.c, other.c])
        at_rest = self.output_offset + other.rests(self.input_offset)
        step = self.sample_time if other.sample_time is None else other.sample_time
        return LinearSystem(a, b, c, self.d + other.d, step, self.input_offset, at_rest)

    def among(self, taken: list[int], given: list[int], k: int, m: int) -> LinearSystem:
        """Return the system embedded among k inputs and m outputs."""
        if (taken, given) == ([*range(k)], [*range(m)]):
            return self
        b, c, d = np.zeros((len(self.a), k)), np.zeros((m, len(self.a))), np.zeros((m, k))
        b[:, taken], c[given], d[np.ix_(given, taken)] = self.b, self.c, self.d
        u, y = np.zeros(k), np.zeros(m)
        u[taken], y[given] = self.input_offset, self.output_offset
        return LinearSystem(self.a, b, c, d, self.sample_time, u, y)

    def rests(self, inputs: Array) -> Array:
        """Return the steady outputs for constant inputs, shape (m,)."""
        held = self.d
        if len(self.a):
            held = held + self.c @ np.linalg.solve(np.eye(len(self.a)) - self.a, self.b)
        return np.asarray(self.output_offset + held @ (inputs - self.input_offset))


def as_scipy(block: Block, sample_time: float | None = None) -> dlti | lti:
    """Return a linear model as a system of SciPy, of deviations from its operating point.

    Simulated there, u - u_0 gives y - y_0; noise models stay behind. Without a sample time [s], what
    is continuous in time comes as ``lti``; all else as ``dlti``, which holds the dead time too,
    and what the input does between samples.
    """
    from scipy import signal

    systems: Any = signal
    continuous = block.continuous() if sample_time is None else None
    if continuous is not None:
        return systems.lti(continuous.numerator, continuous.denominator)
    return systems.dlti(*(parts := _discrete(block, sample_time))[:-1], dt=parts[-1])


def as_control(block: Block, sample_time: float | None = None) -> StateSpace | TransferFunction:
    """Return a linear model as a system of python-control, as `as_scipy` does of SciPy."""
    demand("control", "control", "transfer functions of python-control")
    import control

    continuous = block.continuous() if sample_time is None else None
    if continuous is not None:
        return control.tf(continuous.numerator, continuous.denominator)
    parts = _discrete(block, sample_time)
    if len(parts) == 3:
        return control.tf(*parts)
    return control.ss(*parts, remove_useless_states=False)


def _discrete(block: Block, sample_time: float | None) -> tuple[Any, ...]:
    """Return numerator and denominator, or A, B, C and D, then the sample time or True."""
    system = block.linear_system(sample_time)
    step = system.sample_time or sample_time or True
    if system.polynomials is not None:
        return system.polynomials.numerator, system.polynomials.denominator, step
    if len(system.a):
        return system.a, system.b, system.c, system.d, step
    m, k = system.d.shape  # with a state that nothing reads where there would be none
    return np.zeros((1, 1)), np.zeros((1, k)), np.zeros((m, 1)), system.d, step
