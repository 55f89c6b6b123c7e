"""What exporters ask of a block: its C, the numbers that this reads, what a step costs, its wiring."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

from mckibben.arrays import Array
from mckibben.blocks.core.checked import Checked
from mckibben.blocks.core.fields import Initial
from mckibben.errors import ModelError


@dataclass(frozen=True)
class Cost:
    """Arithmetic operations of a step, roughly: usual and at worst."""

    usual: int
    worst: int

    def __add__(self, other: Cost) -> Cost:
        return Cost(self.usual + other.usual, self.worst + other.worst)

    @classmethod
    def of(cls, numbers: Array, n_states: int) -> Cost:
        """Return the cost of one pass: about two operations a number, four a state."""
        operations = 2 * numbers.size + 4 * n_states
        return cls(operations, operations)


class Board(Protocol):
    """Where blocks are laid out as calls in order; signals are named by text."""

    def call(self, block: Exportable, given: Sequence[str]) -> list[str]:
        """Run a block on signals, and return those that it gives."""

    def add(self, terms: Sequence[str]) -> str:
        """Return the sum of signals."""

    def resume(self, state: Sequence[float]) -> None:
        """Start the blocks called last from a state of them all."""


class Exportable(metaclass=Checked):
    """What is written as C: by default one primitive, a file named after the kind."""

    kind: ClassVar[str]
    """Name in the registry and in saved files."""

    increasing: ClassVar[tuple[str, ...]] = ()
    """Fields of numbers in increasing order, which single precision must not make one."""

    filters: ClassVar[bool] = False
    """Whether it is linear with poles of its own, which may be too slow for single precision."""

    @property
    def title(self) -> str:
        """What the block is called among blocks: its kind, and of an inverse, of what."""
        return self.kind

    @property
    def start(self) -> Initial:
        """Memory before the first sample that is used where none is given."""
        return getattr(self, "initial", "first_sample")

    @property
    @abstractmethod
    def n_states(self) -> int:
        """Length of the state vector."""

    @property
    def n_scratch(self) -> int:
        """How many numbers a step computes in beside the state, for code that cannot allocate."""
        return 0

    @property
    def c_kernels(self) -> tuple[Callable[..., Any], ...]:
        """Kernels of a step, and of the start if it has memory, which C is translated from."""
        return ()

    def c_numbers(self, sample_time: float | None) -> Array:
        """Return the numbers that its C reads.

        Raises
        ------
        ModelError
            If there are none.
        """
        raise ModelError(
            f"{self.kind!r} is neither one kernel nor a composition, so it cannot be exported. "
            "Remedy: compose it of blocks."
        )

    @property
    def needs_double(self) -> str:
        """Why single precision will not do, as part of a sentence; empty where it does."""
        return ""

    def cost(self, sample_time: float | None) -> Cost:
        """Return what a step costs."""
        return Cost.of(self.c_numbers(sample_time), self.n_states)

    def kept_apart(self) -> Iterator[tuple[str, tuple[float, ...]]]:
        """Give the name and the numbers of every field that is `increasing`."""
        for name in self.increasing:
            yield name, getattr(self, name)

    def wired(self, board: Board, given: Sequence[str]) -> list[str]:
        """Lay the block out on a board, and return the signals that it gives."""
        return board.call(self, given)
