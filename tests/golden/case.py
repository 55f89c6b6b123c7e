"""A golden case: one call, the tree of values it returns, and how far each may move."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from pathlib import Path
from shutil import which

import numpy as np

from tests.recordings import MEASURED

Leaf = None | bool | int | float | str | np.ndarray
Tree = Leaf | Mapping[str, "Tree"] | Sequence["Tree"]

EXACT = 0.0
"""Equal to the bit, on a machine of the kind on which the case was stored."""

DATA = Path(__file__).parent / "data"


@dataclass(frozen=True)
class Case:
    """One call whose answer is stored.

    Parameters
    ----------
    name : str
        ``room/case``, the place of its data below ``data/``.
    call : str
        The call or the command, for a reader of the stored data.
    run : callable
        Takes an empty folder to work in, returns the tree of values.
    tolerances : dict
        Pattern of leaves' paths (as of `fnmatch`, whose ``*`` crosses ``/``) -> relative tolerance; the
        first that matches counts, ``{"*": EXACT}`` where none is named. It is relative to the stored
        value, in an array to its largest magnitude. `None` compares the kind of a leaf alone.
    needs, tools : sequence of str
        Folders of shared recordings, and programs of `tests.tools`, without which the case is skipped.
    slow : bool
        Left out where neither its name nor ``--slow`` asks for it.
    one_machine : bool
        Compared on machines of the kind on which it was stored alone: two answers are as good, and the
        last bits choose.
    """

    name: str
    call: str
    run: Callable[[Path], Tree]
    tolerances: Mapping[str, float | None] = field(default_factory=lambda: {"*": EXACT})
    needs: Sequence[str] = ()
    tools: Sequence[str] = ()
    slow: bool = False
    one_machine: bool = False

    @property
    def possible(self) -> bool:
        """Whether all that it needs is here."""
        there = all((MEASURED / folder).is_dir() for folder in self.needs)
        return there and all(which(tool) for tool in self.tools)

    def tolerance(self, leaf: str) -> float | None:
        """Return how far a leaf may move, relative to its stored value."""
        for pattern, tolerance in self.tolerances.items():
            if fnmatchcase(leaf, pattern):
                return tolerance
        return EXACT


def flat(tree: Tree, path: str = "") -> dict[str, Leaf]:
    """Return the leaves of a tree by their paths, ``a/b/0``; empty branches are leaves, too."""
    if isinstance(tree, Mapping):
        parts: list[tuple[str, Tree]] = [(str(key), value) for key, value in tree.items()]
        empty = "{}"
    elif isinstance(tree, Sequence) and not isinstance(tree, str):
        parts, empty = [(str(i), value) for i, value in enumerate(tree)], "[]"
    else:
        if isinstance(tree, np.ndarray):
            return {path: np.asarray(tree)}
        return {path: tree.item() if isinstance(tree, np.generic) else tree}
    if not parts:
        return {path: empty}
    leaves: dict[str, Leaf] = {}
    for key, value in parts:
        own = flat(value, f"{path}/{key}" if path else key)
        if twice := leaves.keys() & own.keys():
            raise ValueError(f"two values are called {', '.join(twice)}")
        leaves |= own
    return leaves
