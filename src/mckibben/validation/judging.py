"""What of all that a residual may follow it does follow: chosen one by one, the most important first.

The level is shared by all tests of all outputs, so that a right model is said to miss something as
seldom as that, however many inputs and outputs it has.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from mckibben.validation.level import FEWEST, LEVEL
from mckibben.validation.regression import Regression
from mckibben.validation.results import Finding
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

SLOW = ("offset", "drift")
"""Groups that slow noise looks like."""

GAIN = 4.0
"""Squares of a level over those of a shape about it up to which the level is the shape's: of a gain that
is wrong from zero on they are 3, and a little more of an input that dwells where it is high."""

LOOPS = ("hysteresis", "speed", "lag")
"""Groups that make a loop; they look alike where one speed, or one sine, is all that was recorded."""

ALIKE = 0.9
"""Share of what one of them explains that another explains too, from which both are asked for."""

FIRM = 0.05
"""Part of the level that is asked for where there are fewer independent samples than `FEWEST`."""


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
    level = LEVEL / n_tests * (1.0 if regression.independent >= FEWEST else FIRM)
    chosen: list[Finding] = []
    known: tuple[int, ...] = ()
    left = list(groups)
    while left:
        tried = [(_found(regression, g, known, every, squares, n), g) for g in left]
        certain = [pair for pair in tried if pair[0].p_value <= level and _notable(pair[0])]
        if not certain:
            break
        first = max(certain, key=lambda pair: (pair[0].kind not in INDIRECT, pair[0].share))
        best, group = _told_apart(regression, first, certain, known, level)
        chosen.append(best)
        known = (*known, *group.columns)
        left = [g for g in left if g is not group and not _alternative(g, best)]
    return _one_after_another(regression, chosen, groups, level, every, squares, n)


def slow(asked: Sequence[Finding], missing: Sequence[Finding], n_tests: int) -> tuple[Finding, ...]:
    """Return level and trend that explain much without being certain, beside what is missed."""
    named = {one.kind for one in missing}
    return tuple(
        one
        for one in asked
        if one.kind in SLOW
        and one.kind not in named
        and one.share >= MUCH
        and one.p_value > LEVEL / n_tests
    )


def _told_apart(
    regression: Regression,
    first: tuple[Finding, Group],
    certain: Sequence[tuple[Finding, Group]],
    known: tuple[int, ...],
    level: float,
) -> tuple[Finding, Group]:
    """Return of groups that explain the same loop the one that says something beside the other.

    Where both do, or neither, the finding has what it may be as well.
    """
    either: list[str] = []
    best, group = first
    if group.kind not in LOOPS:
        return first
    for other, twin in certain:
        if twin is group or twin.kind not in LOOPS or not _same(twin.channel, group.channel):
            continue
        shared = {*known, *group.beside, *twin.beside} - {*group.columns, *twin.columns}
        beside, beside_twin = (*shared, *twin.columns), (*shared, *group.columns)
        new = regression.explained(group.columns, beside)
        if new > (1 - ALIKE) * regression.explained(group.columns, tuple(shared)):
            continue
        says = regression.test(group.columns, beside).p_value <= level
        twin_says = regression.test(twin.columns, beside_twin).p_value <= level
        if twin_says and not says:
            return other, twin
        if says == twin_says:
            either.append(twin.kind)
    return replace(best, or_kinds=tuple(either)), group


def _alternative(group: Group, found: Finding) -> bool:
    return group.kind in found.or_kinds and _same(group.channel, found.channel)


def _same(channel: str, other: str) -> bool:
    return channel == other or "" in (channel, other)


def _one_after_another(
    regression: Regression,
    chosen: Sequence[Finding],
    groups: Sequence[Group],
    level: float,
    every: int,
    squares: float,
    n: int,
) -> tuple[Finding, ...]:
    """Return what is missed with shares that add up.

    A level goes with a shape that it may belong to; a larger one stands apart.
    """
    columns = {(g.kind, g.channel): g.columns for g in groups}
    shapes = [one for one in chosen if one.kind in LEVELLED]
    known: tuple[int, ...] = ()
    whole = 0.0
    if shapes:
        known = columns["offset", ""]
        whole = regression.explained(known)
        about = sum(regression.explained(columns[s.kind, s.channel], known) for s in shapes)
        others = [one for one in chosen if one.kind != "offset"]
        if whole > GAIN * about:
            alone = _found(regression, groups[0], (), every, squares, n)
            chosen = [alone, *others] if alone.p_value <= level else others
            whole = 0.0
        else:
            chosen = others
    found = []
    for one in chosen:
        own = columns[one.kind, one.channel]
        if one.kind == "offset":
            explained = regression.explained(own)
        else:
            explained = regression.explained(own, known)
        if one.kind in LEVELLED:
            explained, whole = explained + whole, 0.0
        known = tuple(dict.fromkeys((*known, *own)))
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
