"""A setting left open is chosen by trying its values."""

from __future__ import annotations

from collections.abc import Sequence

from mckibben.blocks.base import Block
from mckibben.estimators.core.data import TrainingData
from mckibben.estimators.core.single import SingleEstimator
from mckibben.estimators.optimisers.tracker import Tracker


def best_of_settings(
    estimator: SingleEstimator,
    setting: str,
    values: Sequence[float],
    data: TrainingData,
    tracker: Tracker,
) -> tuple[Block, TrainingData]:
    """Return what an estimator finds with the value of a setting that fits best."""
    found = []
    for place, value in enumerate(values):
        own = tracker.part(place / len(values), (place + 1) / len(values))
        settings = estimator.get_params() | {setting: value}
        found.append((*type(estimator)(**settings).identify(data, own), own))
        tracker.saw_all(own)
        if own.interrupted:
            break
    block, chosen, best = min(found, key=lambda item: item[2].best_cost)
    tracker.best_cost, tracker.best = best.best_cost, best.best
    return block, chosen
