"""The models of the re-run: as published, ours, and what they are measured against.

What predicts is what is inverted: there is one fit of each.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from mckibben import registry
from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.comparison.checkpoints import Checkpoints
from mckibben.papers.keeping import fitted
from mckibben.papers.reproduction import Progress
from mckibben.papers.sdchm.recordings import OUTPUTS, Recordings
from mckibben.recording import Recording

LINEAR = "linear function of the pressures"
RAW = "raw fuzzy network, the paper's"
DAMPED = "raw fuzzy network, damped"
INDIVIDUAL = "individual hysteresis"
PUBLISHED = "SDCHM, the paper's"
OURS = "SDCHM, ours"
MEMORY = "coupled memory"
BALANCE = "balance"
OURS_JOINT = "SDCHM, ours, joint runs too"
BALANCE_JOINT = "balance, joint runs too"

PREDICTING = (LINEAR, RAW, DAMPED, PUBLISHED, OURS, MEMORY, BALANCE)
"""Trained on the paper's patterns alone."""

INVERTED = (OURS, BALANCE)
"""Of these, those of ours with an inverse: the headline is one of them."""

QUICK_SWARM = {"particles": 8, "iterations": 6}
QUICK_SEARCH = {"search_samples": 1000}


@dataclass(frozen=True)
class Models:
    """Models, and how long their fits took [s], by name."""

    blocks: Mapping[str, Block]
    seconds: Mapping[str, float]

    def __getitem__(self, name: str) -> Block:
        """Return a model."""
        return self.blocks[name]

    def __contains__(self, name: str) -> bool:
        """Tell whether there is a model of this name."""
        return name in self.blocks


def fit_models(
    runs: Recordings, quick: bool, seed: int, tell: Progress, kept: Checkpoints
) -> Models:
    """Fit all models; validation patterns stop the search for antecedents of ours."""
    search: dict[str, Any] = QUICK_SEARCH if quick else {}
    swarm: dict[str, Any] = search | QUICK_SWARM if quick else {}
    starts: dict[str, Any] = {"n_starts": 4, "n_refined": 1} if quick else {}
    paper: dict[str, Any] = {"threshold_rule": "paper", "initial": "virgin"}
    ours = search | ({"memory_settings": starts, "n_rounds": 1} if quick else {})
    chosen: dict[str, tuple[str, dict[str, Any]]] = {
        LINEAR: ("tsfnn", {"n_sets": 1, "constants": True, "method": "ls"}),
        RAW: ("tsfnn", {"method": "pso", "ridge": 1e-9} | swarm),
        DAMPED: ("tsfnn", search),
        PUBLISHED: ("sdchm-published", {"memory_settings": paper | starts} | swarm),
        INDIVIDUAL: ("coupled-pi", {"memory_settings": paper | starts}),
        OURS: ("sdchm", ours),
        MEMORY: ("coupled-memory", {}),
        BALANCE: ("balance", {}),
    }
    joint = runs.select("train", stage="joint")
    if joint:
        chosen |= {OURS_JOINT: chosen[OURS], BALANCE_JOINT: chosen[BALANCE]}
    validation = runs.select("validation", stage="network")
    blocks, seconds = {}, {}
    for place, (name, (model, settings)) in enumerate(chosen.items()):
        tell(place / len(chosen), name)
        estimator = registry.load("estimators", model)(seed=seed, **settings)
        train = runs.patterns + (joint if name in (OURS_JOINT, BALANCE_JOINT) else [])
        found = fitted(kept, name, estimator, train, validation=validation)
        blocks[name], seconds[name] = found.block, found.seconds
    return Models(blocks, seconds)


def measured(recordings: list[Recording]) -> Array:
    """Return measured displacements over all recordings, shape (n, 3) [mm]."""
    return np.concatenate([recording.matrix(OUTPUTS) for recording in recordings])
