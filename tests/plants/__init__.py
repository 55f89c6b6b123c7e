"""Virtual plants from textbook physics, written apart from the models that are tried on them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.recording import Recording


@dataclass(frozen=True)
class Plant:
    """One virtual plant: what was recorded of it, how it answers, and what is truly so."""

    name: str
    title: str
    sources: str
    train: tuple[Recording, ...]
    test: dict[str, tuple[Recording, ...]]
    respond: Callable[[Array, Array], Array]
    facts: dict[str, float | bool | tuple[float, ...]]
