"""Choice of a force balance's terms: what data demand, and what they determine.

Terms that act smoothly are all free from the start, and none unless data say otherwise. Phenomena that
act from a place on, or bring a motion of their own, are tried one after another: each begins at several
places, and is in if it lessens the squared errors by so much, and so far beyond their noise, that no
smooth term could have done so. At the end smooth terms that hardly lessen the errors are left out.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from mckibben.arrays import Array, Mask
from mckibben.blocks.coupled.balance_terms import TABLE
from mckibben.estimators.coupled.balance_search import Search
from mckibben.estimators.coupled.balance_structure import Term
from mckibben.numerics.descent import FIRST_DAMPING
from mckibben.numerics.tracker import Tracker

GAIN, EVIDENCE = 0.2, 5.0
"""Smallest share of the squared errors that a phenomenon takes away, and smallest logarithm of the ratio
of likelihoods with it and without.
"""

PEEK, PROMISING, STEPS, MOST_FOLLOWED = 4, 0.04, 12, 2
"""Steps from every start; share of the squared errors taken away in them from which on a phenomenon is
followed; further steps; most phenomena that are followed at once.
"""

LITTLE = 0.0005
"""Share of the squared errors below which a smooth term is left out."""

BEGUN = {
    "dead": (0.1, 0.2, 0.35),
    "contact": (0.2,),
    "slack": (0.1, 0.7),
    "mass": (0.0,),
    "asymmetry": (0.0,),
}
"""Where phenomena begin, as shares of the highest pressure, or of the largest resistance."""

RIVALS = (("dead", "contact"), ("mass",), ("slack",), ("asymmetry",))
"""Phenomena of which one alone may be there."""

EXCLUDED = {"mass": ("slack",), "slack": ("mass",)}
"""Phenomena that cannot be there beside others."""

PHENOMENA = ("obstacle", *BEGUN)
"""All of them."""


class Trial(NamedTuple):
    """A phenomenon that is tried: its terms, the search with them, the unknowns, and their cost."""

    name: str
    terms: Mask
    search: Search
    z: Array
    cost: float = np.inf

    def followed(self, steps: int) -> Trial:
        """Return the trial after a descent."""
        z = self.search.descended(self.z, steps, Tracker())
        return self._replace(z=z, cost=self.search.cost(z))


def chosen(search: Search, z: Array, tried: set[str], tracker: Tracker) -> tuple[Search, Array]:
    """Return the search with the phenomena that data demand, and its unknowns.

    What came later may do what was there before it: that stays only if it is still demanded, and so does
    the air's lag, which takes a block of its own.
    """
    found, hopeless = list[Trial](), set[str]()
    while True:
        peeked, least = list[Trial](), np.sqrt(1.0 - PROMISING) * search.cost(z)
        for starts in _starts(search, z, tried):
            if starts and starts[0].name not in hopeless:
                peeked.append(_best(search, z, starts))
                # those that cost no descent are tried again once others are in
                if starts[0].z is not z and not peeked[-1].cost < least:
                    hopeless.add(starts[0].name)
        promising = sorted((one for one in peeked if one.cost < least), key=lambda one: one.cost)
        if not promising:
            break
        z = search.descended(z, STEPS, tracker)
        followed = [one.followed(STEPS) for one in promising[:MOST_FOLLOWED]]
        best = min(followed, key=lambda one: one.cost)
        if not demanded(search, z, best.search, best.z):
            break
        search, z = best.search.weighed(best.z), best.z
        found.append(best)
    kinds = search.structure.kinds
    doubtful = [(np.isin(kinds, ("filling", "venting")), 0.0), (kinds == "asymmetry", GAIN)]
    doubtful += [(one.terms, GAIN) for one in found]
    for terms, gain in doubtful:
        if (terms & search.active).any():
            fewer = replace(search, active=search.active & ~terms)
            begun = z.copy()
            begun[: terms.size][terms] = search.none(z)[: terms.size][terms]
            without = fewer.descended(begun, STEPS, tracker)
            if not demanded(fewer, without, search, z, gain):
                search, z = fewer, without
    return search, z


def demanded(search: Search, z: Array, more: Search, after: Array, gain: float = GAIN) -> bool:
    """Return whether data demand what a search has more than another.

    That is, whether it takes away more than a share of the squared errors, beyond their noise.
    """
    ratio = (search.cost(z) / more.cost(after)) ** 2
    count = more.independent(after)[2]
    return ratio * (1.0 - gain) > 1.0 and 0.5 * count * np.log(ratio) > EVIDENCE


def _best(search: Search, z: Array, starts: list[Trial]) -> Trial:
    """Return the best start of a phenomenon, after a few steps.

    Of those that begin where the search is, by a linear model; others are followed.
    """
    if starts[0].z is z:
        costs = search.ahead(z, [one.search.active for one in starts])
        starts = [one._replace(cost=cost) for one, cost in zip(starts, costs, strict=True)]
    else:
        starts = [one.followed(PEEK) for one in starts]
    return min(starts, key=lambda one: one.cost)


def _starts(search: Search, z: Array, tried: set[str]) -> Iterator[list[Trial]]:
    """Yield the starts of every phenomenon that may be there and is not."""
    structure = search.structure
    kinds = structure.kinds
    whiches = np.array([term.which for term in structure.terms])
    common = np.array([term.muscle is None for term in structure.terms])
    on = {TABLE[kind].option for kind in kinds[search.active]}

    def trial(name: str, terms: Mask, begun: Array = z) -> Trial:
        return Trial(name, terms, replace(search, active=search.active | terms), begun)

    count = len(structure.obstacles)
    there = whiches[search.active & (kinds == "obstacles")]
    met = {structure.obstacles[which][0] for which in there}
    for side in (1, -1) if "obstacle" in tried else ():
        places = [place for place, (to, _) in enumerate(structure.obstacles) if to == side]
        yield [
            trial(
                f"obstacle {side:+d}",
                ((kinds == "obstacles") & (whiches == place))
                | ((kinds == "places") & (whiches % count == place)),
            )
            for place in places
            if side not in met
        ]
    for names in RIVALS:
        starts = list[Trial]()
        for name in names if not on & {*names, *EXCLUDED.get(names[0], ())} else ():
            slack = name == "slack"
            own = (kinds == ("pushes" if slack else name)) & common
            size = search.problem.most_resisted(structure, z) if slack else structure.bench.highest
            for share in BEGUN[name] if name in tried else ():
                begun = z
                if share:
                    begun = z.copy()
                    begun[: own.size][own] = share * size
                starts.append(trial(name, own, begun))
        yield starts


def pruned(search: Search, z: Array) -> tuple[Search, Array]:
    """Return the search without terms that data do not determine, and its unknowns.

    The least determined is left out first, and others take its part; of polynomials the highest degree.
    """
    terms, places = search.structure.terms, search.free
    none = search.none(z)
    triangle = search.triangle(z)
    size = np.sqrt((triangle[:, :-1] ** 2).sum(axis=0))
    size[size == 0.0] = 1.0  # what has no effect is lost first
    gram = (triangle[:, :-1] / size).T @ (triangle[:, :-1] / size)
    far, keep = (z - none)[places] * size, np.ones(places.size, dtype=bool)
    while True:
        here = np.flatnonzero(keep)
        free = {terms[places[i]] for i in here if places[i] < len(terms)}
        may = [places[i] < len(terms) and _smooth(terms[places[i]], free) for i in here]
        inverse = np.linalg.pinv(gram[np.ix_(here, here)], hermitian=True)
        own = np.diag(inverse)
        lost = np.where(own > 0.0, far[here] ** 2 / np.where(own > 0.0, own, 1.0), 0.0)
        lost[~np.array(may)] = np.inf
        worst = int(np.argmin(lost))
        if not lost[worst] < LITTLE * (triangle[:, -1] @ triangle[:, -1]):
            break
        if own[worst] > 0.0:
            far[here] -= inverse[:, worst] / own[worst] * far[here[worst]]
        keep[here[worst]] = False
    fewer = replace(search, active=np.isin(np.arange(len(terms)), places[keep]))
    without = fewer.without(z)
    triangle[:, -1] += triangle[:, :-1] @ (without - z)[places]
    return fewer, fewer.solved(triangle[:, np.append(keep, True)], without, FIRST_DAMPING)


def _smooth(term: Term, free: set[Term]) -> bool:
    """Return whether a term may be left out, of those that are free."""
    kind, option = TABLE[term.kind], TABLE[term.kind].option
    if kind.name in ("elasticity", "areas", "springs"):
        first = term.which == 0 and term.muscle is None
        return not first and Term(term.kind, term.which + 1, term.muscle) not in free
    if term.muscle is not None or kind.name == "friction":
        return True
    return bool(option) and option not in PHENOMENA
