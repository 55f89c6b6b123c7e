"""What an envelope is."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from typing import Any, ClassVar, Protocol, Self, cast

import numpy as np
from numpy.typing import ArrayLike

from mckibben.arrays import Array
from mckibben.blocks.kernels import inlined, kernel
from mckibben.blocks.parameters import Parametrised
from mckibben.blocks.saving import part_from_dict


class EnvelopeKernel(Protocol):
    """A function of one number, ``kernel(argument, coefficients)``, compiled.

    Attributes
    ----------
    batch : callable
        ``batch(coefficients, arguments, values)``, which fills ``values``, shape (n,).
    """

    batch: Callable[[Array, Array, Array], None]

    def __call__(self, argument: float, coefficients: Array) -> float:
        """Return the value."""


def envelope_kernel(function: Callable[[float, Array], float]) -> EnvelopeKernel:
    """Compile a function of one number, and the loop over many."""
    one: Any = inlined(function)  # so that what calls it is compiled alike, whatever was before

    def batch(coefficients: Array, arguments: Array, values: Array) -> None:
        for t in range(arguments.size):
            values[t] = one(arguments[t], coefficients)

    batch.__qualname__ = f"{function.__module__}.{function.__qualname__}"  # by which it is cached
    one.batch = kernel(batch)
    return cast("EnvelopeKernel", one)


class Envelope(Parametrised):
    """A strictly increasing function of the input, with its inverse."""

    number: ClassVar[int]
    """What C tells it by."""

    increasing: ClassVar[tuple[str, ...]] = ()
    """Fields of numbers in increasing order, which single precision must not make one."""

    value: ClassVar[EnvelopeKernel]
    inverse: ClassVar[EnvelopeKernel]

    def coefficients(self) -> Array:
        """Return the numbers that the kernels read; by default the parameters."""
        return self.pack()

    @abstractmethod
    def shifted(self, offset: float) -> Self:
        """Return this envelope raised by a constant."""

    @classmethod
    @abstractmethod
    def examples(cls) -> tuple[Self, Self]:
        """Return a pair for rising and falling input over 0 to 5 bar, the second never lower."""

    def __call__(self, inputs: ArrayLike) -> Array:
        """Return the envelope at the inputs, any shape."""
        return self._evaluate(type(self).value, inputs)

    def solve(self, values: ArrayLike) -> Array:
        """Return the inputs at which the envelope has these values, any shape; NaN beyond its range."""
        return self._evaluate(type(self).inverse, values)

    def _evaluate(self, function: EnvelopeKernel, arguments: ArrayLike) -> Array:
        given = np.asarray(arguments, dtype=np.float64)
        flat = np.ascontiguousarray(given.reshape(-1))
        values = np.empty_like(flat)
        function.batch(self.coefficients(), flat, values)
        return values.reshape(given.shape)


def nested_envelope(content: Any) -> Any:
    """Turn the dict of an envelope inside a block into that envelope."""
    return part_from_dict(content, "envelopes") if isinstance(content, dict) else content
