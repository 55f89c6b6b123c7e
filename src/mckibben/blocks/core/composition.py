"""What all blocks made of blocks share."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterable, Sequence
from typing import Annotated, ClassVar

import numpy as np
from pydantic import BeforeValidator, InstanceOf

from mckibben.arrays import Array
from mckibben.blocks.core.block import Block
from mckibben.blocks.core.fields import Initial
from mckibben.blocks.core.refusals import explicit_state
from mckibben.blocks.core.saving import nested
from mckibben.errors import ModelError

DEEPEST, MOST_BLOCKS = 32, 1000
"""Compositions in compositions, and blocks in all."""


def _parts(value: object) -> object:
    return tuple(nested(part) for part in value) if isinstance(value, tuple | list) else value


Parts = Annotated[tuple[InstanceOf[Block], ...], BeforeValidator(_parts)]


class Composition(Block):
    """What all compositions share: states and parameters are those of the parts, one after another."""

    parameters: ClassVar[tuple[str, ...]] = ("parts",)
    together: ClassVar[Callable[[Iterable[float]], float]] = max  # of dead times side by side

    letter: ClassVar[str] = "P"  # of its parts in equations

    parts: tuple[Block, ...]

    def equations(self) -> tuple[str, ...]:
        """Return how the parts come together: ``y`` of them all, ``u`` going into each."""
        marks = [f"{self.letter}_{{{place + 1}}}" for place in range(len(self.parts))]
        return (self.joined(marks),)

    @abstractmethod
    def joined(self, parts: Sequence[str]) -> str:
        """Return in LaTeX what the parts, of these names, make together."""

    @property
    def rate_dependent(self) -> bool:  # type: ignore[override]
        """Whether any part is."""
        return any(part.rate_dependent for part in self.parts)

    @property
    def of_local_rules(self) -> bool:  # type: ignore[override]
        """Whether any part is."""
        return any(part.of_local_rules for part in self.parts)

    @property
    def depth(self) -> int:
        """How many compositions are in each other, this one included."""
        return 1 + max(getattr(part, "depth", 0) for part in self.parts)

    @property
    def n_blocks(self) -> int:
        """How many blocks it is made of, compositions included."""
        return 1 + sum(getattr(part, "n_blocks", 1) for part in self.parts)

    def check_parts(self) -> None:
        """Refuse no parts at all, and more, or more deeply nested ones, than a model is made of."""
        if not self.parts:
            raise ModelError(f"{self.kind!r} has no parts. Remedy: give at least one block.")
        if self.depth > DEEPEST or self.n_blocks > MOST_BLOCKS:
            raise ModelError(
                f"{self.kind!r} is nested {self.depth} deep and made of {self.n_blocks} blocks. "
                f"Remedy: compose at most {MOST_BLOCKS} blocks, at most {DEEPEST} deep."
            )

    @property
    def n_states(self) -> int:
        """The states of all parts."""
        return sum(part.n_states for part in self.parts)

    @property
    def n_scratch(self) -> int:
        """The scratch of all parts."""
        return sum(part.n_scratch for part in self.parts)

    @property
    def dead_time(self) -> float:  # type: ignore[override]
        """That of the parts together."""
        return type(self).together(part.dead_time for part in self.parts)

    def _states(self, state: Array) -> list[Array]:
        return np.split(state, np.cumsum([part.n_states for part in self.parts])[:-1])

    def report(self, state: Array) -> None:
        """Pass on what the parts have to say."""
        for part, share in zip(self.parts, self._states(state), strict=True):
            part.report(share)

    def n_clipped(self, state: Array) -> int:
        """Return those of all parts."""
        shares = zip(self.parts, self._states(state), strict=True)
        return sum(part.n_clipped(share) for part, share in shares)

    def _shared_initial(self, initial: Initial | None) -> Sequence[Initial | None]:
        """Return every part's own share of an explicit initial state, or the rule for all."""
        if initial is None or isinstance(initial, str):
            return [initial] * len(self.parts)
        return [share.tolist() for share in self._states(explicit_state(self, initial))]
