"""What is left of a difference that is none: 1e-17 here, -3e-16 on another processor."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from tests.golden.case import Tree

ROUNDING = 1e-9
"""Share of the largest number in the same list, or of 1, below which a number is 0."""


def rounded(tree: Tree) -> Tree:
    """Return a tree whose numbers that are rounding alone are 0; arrays are left as they are.

    Numbers in a mapping are of different units, so that each is compared with 1 alone.
    """
    if isinstance(tree, Mapping):
        return {key: rounded(value) for key, value in tree.items()}
    if isinstance(tree, np.ndarray | str) or not isinstance(tree, Sequence):
        return _number(tree, 1.0)
    return rounded_list(tree)


def rounded_list(values: Sequence[Tree]) -> list[Tree]:
    """Return a list whose numbers that are rounding, beside the others in it, are 0."""
    sizes = [abs(one) for one in values if isinstance(one, float) and math.isfinite(one)]
    scale = max([1.0, *sizes])
    return [_number(one, scale) if isinstance(one, float) else rounded(one) for one in values]


def _number(value: Tree, scale: float) -> Tree:
    return 0.0 if isinstance(value, float) and abs(value) < ROUNDING * scale else value
