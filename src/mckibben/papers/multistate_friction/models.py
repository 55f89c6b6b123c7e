"""Force laws, frictions and other models of the hysteresis, each fitted twice."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mckibben import registry
from mckibben.arrays import Array
from mckibben.blocks.force.multistate_friction import SIZES as SIZES_OF
from mckibben.blocks.force.multistate_friction import MultistateFriction
from mckibben.comparison.checkpoints import Checkpoints
from mckibben.estimators.force.multistate import (
    MultistateEstimator,
    Structure,
)
from mckibben.papers.keeping import Fitted, fitted
from mckibben.recording import Recording

LAWS = {
    "force-bilinear": "bilinear-quadratic (the paper's)",
    "force-chou": "Chou and Hannaford",
    "force-tondu": "Tondu and Lopez, with Kerscher's corrections",
    "force-petrovic": "Petrovic",
    "force-minh": "Minh's cubic",
    "force-schindele": "Schindele and Aschemann",
}

PAPERS, OURS, EIGHTEEN = "11 parameters, the paper's", "11 parameters, ours", "18 parameters"

NAMES: Mapping[Structure, str] = {"eleven": PAPERS, "each-way": OURS, "eighteen": EIGHTEEN}
"""Structures of the friction."""


@dataclass(frozen=True)
class Baseline:
    """Another model of hysteresis.

    Parameters
    ----------
    estimator : str
        As registered.
    settings : mapping
        Its size: the paper's, where the paper gives one.
    """

    estimator: str
    settings: Mapping[str, Any]


LINE = {"degree": 1}
"""A straight line as the reversible part: what it has to say where the length was not in the data."""

BASELINES = {
    "modified Maxwell-slip": Baseline("mms", {"n_operators": 38, **LINE}),
    "modified PI": Baseline("mpi", {"n_operators": 33}),
    "PI with weights of either sign": Baseline("pi", {"n_operators": 39, "nonnegative": False}),
    "generalised Bouc-Wen": Baseline("gbw", LINE),
    "Maxwell-slip": Baseline("maxwell-slip", LINE),
    "Bouc-Wen": Baseline("bouc-wen", LINE),
    "Duhem": Baseline("duhem", LINE),
}

IDENTIFIED = "isobaric-4bar"
HYSTERESIS = "force_hysteresis"
ELONGATION = "elongation"
"""Length beyond that at which a run starts at rest [mm]: models that know rest at 0 start there."""


@dataclass(frozen=True)
class Model:
    """A model of the hysteresis.

    Parameters
    ----------
    name : str
    closed : Fitted
        On the closed loop, as the paper fits.
    rested : Fitted
        On the same run from rest on.
    """

    name: str
    closed: Fitted
    rested: Fitted

    def errors(self, recording: Recording) -> Array:
        """Return what it leaves of the force from rest on, shape (n,)."""
        modelled = self.rested.block.simulate(recording)[HYSTERESIS]
        return np.asarray(modelled - recording[HYSTERESIS])


def fit_models(
    kept: Checkpoints, loop: Recording, whole: Recording, seed: int, *, quick: bool
) -> dict[str, Model]:
    """Fit everything twice: on the closed loop, and on the run from rest on."""
    found = {}
    search: dict[str, Any] = {"n_refined": 4} if quick else {}

    def both(name: str, estimator: Any) -> Model:
        closed, rested = (
            fitted(kept, f"{name}, {start}", replace(estimator, initial=start), recording)
            for start, recording in (("first_sample", loop), ("virgin", whole))
        )
        return Model(name, closed, rested)

    for structure, name in NAMES.items():
        friction = MultistateEstimator(
            output=HYSTERESIS, static=None, elements=structure, seed=seed, **search
        )
        found[name] = both(name, friction)
    for name, baseline in BASELINES.items():
        estimator = registry.load("estimators", baseline.estimator)
        given = {"input": ELONGATION, "output": HYSTERESIS, "seed": seed, **baseline.settings}
        found[name] = both(name, estimator(**given))
    return found


def other_ends(
    kept: Checkpoints, name: str, loop: Recording, seed: int, *, quick: bool
) -> list[MultistateFriction]:
    """Return what other searches end in: the cost has several minima that are about as good."""
    structure = next(key for key, told in NAMES.items() if told == name)
    found = []
    for other in range(seed + 1, seed + (2 if quick else 5)):
        estimator = MultistateEstimator(
            output=HYSTERESIS,
            static=None,
            elements=structure,
            initial="first_sample",
            seed=other,
        )
        block = fitted(kept, f"{name}, seed {other}", estimator, loop).block
        assert isinstance(block, MultistateFriction)
        found.append(in_order(block)[0])
    return found


def in_order(friction: MultistateFriction) -> tuple[MultistateFriction, list[int]]:
    """Return the friction with elements of one kind by falling F_c, and where its values were."""
    ends = np.cumsum([SIZES_OF[element] for element in friction.elements])
    own = [
        list(range(end - SIZES_OF[e], end)) for e, end in zip(friction.elements, ends, strict=True)
    ]
    strength = [friction.values[places[-1]] for places in own]
    ranked = sorted(range(len(own)), key=lambda place: -strength[place])
    given = {kind: iter([p for p in ranked if friction.elements[p] == kind]) for kind in SIZES_OF}
    order = [value for kind in friction.elements for value in own[next(given[kind])]]
    values = tuple(friction.values[place] for place in order)
    return replace(friction, values=values), order
