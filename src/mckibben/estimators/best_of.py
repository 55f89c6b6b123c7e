"""A setting left open is chosen by trying its values."""

from __future__ import annotations

from collections.abc import Sequence

from mckibben.blocks.base import Block
from mckibben.estimators.base import Estimator
from mckibben.estimators.data import TrainingData
from mckibben.estimators.search import Tracker


def best_of_settings(
    estimator: Estimator,
    setting: str,
    values: Sequence[float],
    data: TrainingData,
    tracker: Tracker,
) -> tuple[Block, TrainingData]:
    """Return what an estimator finds with the value of a setting that fits best."""
    found = []
    for value in values:
        own = Tracker(progress=tracker.progress)
        settings = estimator.get_params() | {setting: value}
        found.append((*type(estimator)(**settings).identify(data, own), own))
        tracker.evaluations += own.evaluations
        if own.interrupted:
            tracker.interrupted = True
            break
    block, chosen, best = min(found, key=lambda item: item[2].best_cost)
    tracker.best_cost, tracker.best = best.best_cost, best.best
    return block, chosen
