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
from mckibben.errors import ModelError
from mckibben.estimators.coupled.balance_search import Search
from mckibben.estimators.coupled.balance_structure import Structure, Term
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

FORMS = {
    name: [kind for kind in TABLE.values() if kind.phenomenon == name]
    for name in dict.fromkeys(kind.phenomenon for kind in TABLE.values())
    if name not in ("", "obstacle")
}
"""Kinds of terms that show a phenomenon, each as a form of it; obstacles have sides and places."""


class Trial(NamedTuple):
    """A phenomenon that is tried: its terms, the search with them, and its cost."""

    name: str
    terms: Mask
    search: Search
    cost: float = np.inf

    def followed(self, steps: int) -> Trial:
        """Return the trial after a descent."""
        search = self.search.descend(steps)
        return self._replace(search=search, cost=search.cost)


def choose(search: Search, options_tried: set[str], tracker: Tracker) -> Search:
    """Return the search with the phenomena that data demand.

    What came later may do what was there before it: that stays only if it is still demanded, and so does
    the air's lag, which takes a block of its own.
    """
    trials, hopeless = list[Trial](), set[str]()
    while True:
        peeked, least = list[Trial](), np.sqrt(1.0 - PROMISING) * search.cost
        for starts in _starts(search, options_tried):
            if starts and starts[0].name not in hopeless:
                peeked.append(_best(search, starts))
                # those that cost no descent are tried again once others are in
                if starts[0].search.z is not search.z and not peeked[-1].cost < least:
                    hopeless.add(starts[0].name)
        promising = sorted((t for t in peeked if t.cost < least), key=lambda t: t.cost)
        if not promising:
            break
        search = search.descend(STEPS, tracker)
        followed = [t.followed(STEPS) for t in promising[:MOST_FOLLOWED]]
        best = min(followed, key=lambda t: t.cost)
        if not is_demanded(search, best.search):
            break
        search = best.search.weighed()
        trials.append(best)
    kinds = search.structure.kinds
    doubtful = [(np.isin(kinds, ("filling", "venting")), 0.0), (kinds == "asymmetry", GAIN)]
    doubtful += [(t.terms, GAIN) for t in trials]
    for terms, gain in doubtful:
        if (terms & search.active).any():
            fewer = search.without(terms).descend(STEPS, tracker)
            if not is_demanded(fewer, search, gain):
                search = fewer
    return search


def is_demanded(search: Search, more: Search, gain: float = GAIN) -> bool:
    """Return whether data demand what a search has more than another.

    That is, whether it takes away more than a share of the squared errors, beyond their noise.
    """
    ratio = (search.cost / more.cost) ** 2
    evidence = 0.5 * more.independent * np.log(ratio)
    return ratio * (1.0 - gain) > 1.0 and evidence > EVIDENCE


def _best(search: Search, starts: list[Trial]) -> Trial:
    """Return the best start of a phenomenon, after a few steps.

    Of those that begin where the search is, by a linear model; others are followed.
    """
    if starts[0].search.z is search.z:
        costs = search.ahead([trial.search.active for trial in starts])
        starts = [trial._replace(cost=cost) for trial, cost in zip(starts, costs, strict=True)]
    else:
        starts = [trial.followed(PEEK) for trial in starts]
    return min(starts, key=lambda trial: trial.cost)


def _starts(search: Search, options_tried: set[str]) -> Iterator[list[Trial]]:
    """Yield the starts of every phenomenon that may be there and is not."""
    structure, z = search.structure, search.z
    kinds = structure.kinds
    whiches = np.array([term.which for term in structure.terms])
    common = np.array([term.muscle is None for term in structure.terms])
    present = {TABLE[kind].phenomenon for kind in kinds[search.active]}

    def trial(name: str, terms: Mask, begun: Array = z) -> Trial:
        return Trial(name, terms, replace(search, active=search.active | terms, z=begun))

    count = len(structure.obstacles)
    numbers = whiches[search.active & (kinds == "obstacles")]
    met = {structure.obstacles[number][0] for number in numbers}
    for side in [side for side in (1, -1) if side not in met and "obstacle" in options_tried]:
        at_place = (
            ((kinds == "obstacles") & (whiches == k))
            | ((kinds == "places") & (whiches % count == k))
            for k, (to, _) in enumerate(structure.obstacles)
            if to == side
        )
        yield [trial(f"obstacle {side:+d}", terms) for terms in at_place]
    for name, forms in FORMS.items():
        if present & {name, *(kind.excludes for kind in forms if kind.excludes)}:
            continue
        starts = list[Trial]()
        for kind in forms:
            terms = (kinds == kind.name) & common
            ends = (0.0, structure.bench.natural(kind.unit))
            if kind.name == "pushes":
                ends = search.problem.resisted(structure, z)
            for share in kind.begins if kind.option in options_tried else ():
                begun = z
                if share:
                    begun = z.copy()
                    begun[: terms.size][terms] = np.interp(share, (0.0, 1.0), ends)
                starts.append(trial(name, terms, begun))
        yield starts


def prune(search: Search) -> Search:
    """Return the search without terms that data do not determine.

    The least determined is left out first, and others take its part; of polynomials the highest degree.
    """
    terms, places = search.structure.terms, search.free
    triangle, _ = search.linearised()
    size = np.sqrt((triangle[:, :-1] ** 2).sum(axis=0))
    size[size == 0.0] = 1.0  # what has no effect is lost first
    gram = (triangle[:, :-1] / size).T @ (triangle[:, :-1] / size)
    far, keep = (search.z - search.none)[places] * size, np.ones(places.size, dtype=bool)
    while True:
        positions = np.flatnonzero(keep)
        free = {terms[places[i]] for i in positions if places[i] < len(terms)}
        may = [
            places[i] < len(terms) and _may_go(search.structure, terms[places[i]], free)
            for i in positions
        ]
        inverse = np.linalg.pinv(gram[np.ix_(positions, positions)], hermitian=True)
        variances = np.diag(inverse)
        lost = np.where(
            variances > 0.0, far[positions] ** 2 / np.where(variances > 0.0, variances, 1.0), 0.0
        )
        lost[~np.array(may)] = np.inf
        worst = int(np.argmin(lost))
        if not lost[worst] < LITTLE * (triangle[:, -1] @ triangle[:, -1]):
            break
        if variances[worst] > 0.0:
            far[positions] -= inverse[:, worst] / variances[worst] * far[positions[worst]]
        keep[positions[worst]] = False
    fewer = search.without(~np.isin(np.arange(len(terms)), places[keep]))
    triangle[:, -1] += triangle[:, :-1] @ (fewer.z - search.z)[places]
    kept_columns = triangle[:, np.append(keep, True)]
    try:
        return replace(fewer, z=fewer.solved(kept_columns, fewer.z, FIRST_DAMPING))
    except ModelError:  # as in a descent, a step that cannot be solved for is not taken
        return fewer


def _may_go(structure: Structure, term: Term, free: set[Term]) -> bool:
    """Return whether a term may be left out, of those that are free."""
    kind = TABLE[term.kind]
    if kind.name in ("elasticity", "areas", "springs"):
        first = term.which == 0 and term.muscle is None
        # springs have powers of one scheduling input after another
        highest = kind.name == "springs" and term.which % structure.degree == 0
        return not first and (highest or term._replace(which=term.which + 1) not in free)
    if term.muscle is not None or kind.name == "friction":
        return True
    return bool(kind.option) and not kind.phenomenon
