"""What of all that a residual may follow it does follow: chosen one by one, the most important first.

The level is shared by all tests of all outputs, so that a right model is said to miss something as
seldom as that, however many inputs and outputs it has.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from mckibben.validation.regression import Regression
from mckibben.validation.results import LEVEL, Finding
from mckibben.validation.suspects import Group

NOTABLE = 0.02
"""Share of the residual's squares from which something is worth a word."""

SINGLE = ("offset", "lag")
"""Groups whose first coefficient says how much."""

LEVELLED = ("curve", "load", "drift", "hysteresis", "output")
"""Groups that have a level of their own, so that an offset beside them says nothing more."""

INDIRECT = ("crossing", "output", "runs")
"""Groups that follow several defects, each a little, so that they are said where no other is certain."""

MUCH = 0.1
"""Share from which such a group is worth a word."""


def asked(
    regression: Regression, groups: Sequence[Group], every: int, squares: float, n: int
) -> tuple[Finding, ...]:
    """Return what is found of every group by itself.

    Parameters
    ----------
    regression : Regression
        Of the residual.
    groups : sequence of Group
    every : int
        Samples to a block.
    squares : float
        The residual's sum of squares, of all samples.
    n : int
        Samples.
    """
    return tuple(_found(regression, group, (), every, squares, n) for group in groups)


def missing(
    regression: Regression,
    groups: Sequence[Group],
    every: int,
    squares: float,
    n: int,
    n_tests: int,
) -> tuple[Finding, ...]:
    """Return what a model misses, one by one: of what is certain, what explains most beside the rest."""
    chosen: list[Finding] = []
    known: tuple[int, ...] = ()
    left = list(groups)
    while left:
        tried = [(_found(regression, g, known, every, squares, n), g) for g in left]
        certain = [
            pair for pair in tried if pair[0].p_value <= LEVEL / n_tests and _notable(pair[0])
        ]
        if not certain:
            break
        best, group = max(certain, key=lambda pair: (pair[0].kind not in INDIRECT, pair[0].share))
        chosen.append(best)
        known = (*known, *group.columns)
        left.remove(group)
    return _one_after_another(regression, chosen, groups, every, squares, n)


def _one_after_another(
    regression: Regression,
    chosen: Sequence[Finding],
    groups: Sequence[Group],
    every: int,
    squares: float,
    n: int,
) -> tuple[Finding, ...]:
    """Return what is missed with shares that add up; an offset goes with what has a level of its own."""
    columns = {(g.kind, g.channel): g.columns for g in groups}
    levelled = any(one.kind in LEVELLED for one in chosen)
    known = columns["offset", ""] if levelled else ()
    whole = regression.explained(known) if levelled else 0.0
    found = []
    for one in chosen:
        own = columns[one.kind, one.channel]
        if levelled and one.kind == "offset":
            continue
        explained = regression.explained(own, known)
        if one.kind in LEVELLED:
            explained, whole = explained + whole, 0.0
        known = (*known, *own)
        squared = every * explained
        share = min(squared / squares, 1.0)
        found.append(replace(one, share=share, size=(squared / n) ** 0.5))
    return tuple(sorted(found, key=lambda one: -one.share))


def _notable(found: Finding) -> bool:
    return found.share >= (MUCH if found.kind in INDIRECT else NOTABLE)


def _found(
    regression: Regression,
    group: Group,
    known: tuple[int, ...],
    every: int,
    squares: float,
    n: int,
) -> Finding:
    beside = tuple(sorted({*known, *group.beside} - {*group.columns}))
    tested = regression.test(group.columns, beside)
    explained = every * regression.explained(group.columns, beside)
    coefficient = None
    if group.delay:
        coefficient = -float(group.delay)
    elif group.kind in SINGLE:
        coefficient = float(regression.coefficients([*beside, *group.columns])[len(beside)])
    return Finding(
        group.kind,
        group.channel,
        tested.p_value,
        min(explained / squares, 1.0) if squares > 0 else 0.0,
        (explained / n) ** 0.5,
        coefficient,
    )
